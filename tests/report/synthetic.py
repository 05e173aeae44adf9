"""A run folder of made-up measurements whose distributions are known: no images, no trackers."""

import json
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from tests.report.made_up_findings import made_up

from tracknoise.analysis.places_found import image_cells, speed_errors, surrounding_errors
from tracknoise.analysis.ratio_intervals import ratio_intervals
from tracknoise.sequences.images import encode_webp
from tracknoise.statistics.changes import change_curves
from tracknoise.statistics.curves import aspect_curves, curves
from tracknoise.statistics.histograms import merge_errors
from tracknoise.statistics.lifetimes import lifetimes_of_ends
from tracknoise.statistics.places import image_map
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.statistics.samples import extreme_tracks
from tracknoise.statistics.scales import cores
from tracknoise.statistics.summarise import STATISTICS, summarise_sequence
from tracknoise.statistics.summary import summary
from tracknoise.statistics.track_counts import merge_counts, outlier_ratios
from tracknoise.statistics.truth_errors import truth_floor
from tracknoise.statistics.yardstick import ReferenceCondition, effects
from tracknoise.tables.defaults import PATCH_PX
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.result_rows import with_ids
from tracknoise.tables.schema import (
    FRAME_COUNTS,
    OBSERVATIONS,
    ORIGIN,
    PATCHES,
    POSES,
    SEQUENCE,
    TRACKS,
    TrackEnd,
    empty,
)
from tracknoise.tables.store import OBSERVED, SEQUENCE_TABLES, RunFolder
from tracknoise.topics.catalogue import RUN_TABLES, by_table
from tracknoise.topics.headline import ReportedConditions
from tracknoise.topics.headlines import headline_table

WIDTH, HEIGHT = 160, 120
_UNREAD = (
    "blocks",
    "scale_blocks",
    "aspect_blocks",
    "samples",
    "between_trackers",
    "rigid",
    "pose_growth",
    "cameras",
    "audit_samples",
    "window_noise",
    "window_blocks",
)
"""Tables that the report does not need, because findings are made up here."""
SMALL: dict[str, object] = {
    "scenes": ("fixating", "forward"),
    "speeds": (1, 2),
    "n_frames": 20,
    "born": 20,
    "min_features": 40,
}
"""Settings of a world that is quick to draw."""
_ONE: dict[str, object] = {"scenes": ("only",), "trackers": ("lucas-kanade",), "speeds": (1,), "born": 40}
DEGENERATE: dict[str, dict[str, object]] = {
    "one of everything": _ONE,
    "no feature found": {"born": 0},
    "no age has enough features": {**_ONE, "min_features": 10**6},
    "only age 0 has enough features": {**_ONE, "loss": 1.0, "min_features": 10},
    "a perfect tracker": {**_ONE, "sigma_px": 0.0, "bias_px": 0.0, "hidden": 0.0, "speeds": (1, 2)},
    "no depth": {**_ONE, "depth": False},
    "one tracker finds nothing": {**_ONE, "trackers": ("lucas-kanade", "blind"), "featureless": ("blind",)},
    "everything censored": {**_ONE, "loss": 1e-12},
    "nothing trimmed": {**_ONE, "percentile": None},
    "no image": {**_ONE, "snapshot": False},
    "statistics alone are kept": {**_ONE, "keep": "statistics"},
    "two lightings": {**_ONE, "lightings": ("led-1", "led-2")},
    "all that is projected": {**_ONE, "population": "projected", "hidden": 0.3},
    "a scan, and enough features in its key frame alone": {**_ONE, "key_frame": 8, "loss": 1.0, "min_features": 10},
    "a scan, and no feature of known error": {**_ONE, "key_frame": 8, "truth": "scan", "depth": False},
    "a light stage": {**_ONE, "key_frame": 8, "lightings": ("diffuse", "LR0", "LR1", "BF0"), "truth": "scan"},
    "turned, and played backward": {**_ONE, "views": ((0, "forward"), (90, "forward"), (0, "backward"))},
    "many conditions": {
        **_ONE,
        "n_frames": 6,
        "born": 4,
        "min_features": 2,
        "lightings": tuple(f"LR{i}" for i in range(41)),
        "alike": True,
    },
    "odd names": {"trackers": ('<b>"&\\_%', "$%_<b>"), "scenes": ("a/b c", "<i>"), "speeds": (1,), "n_frames": 8},
}
"""Worlds at the edge of what a report can be about, by what is odd about them."""


@dataclass(frozen=True)
class World:
    """What to make up."""

    scenes: Sequence[str] = ("fixating", "forward", "sideways", "arvr")
    trackers: Sequence[str] = ("lucas-kanade", "correspondence")
    speeds: Sequence[int] = (1, 2, 4)
    lightings: Sequence[str] = ("default",)
    views: Sequence[tuple[int, str]] = ((0, "forward"),)
    """Rotation and direction."""
    n_frames: int = 30
    born: int = 12
    sigma_px: float = 0.15
    bias_px: float = 0.02
    loss: float = 0.08
    hidden: float = 0.02
    percentile: float | None = 90.0
    trim_among: str = "all"
    trimming: str = "trimmed"
    min_features: int = 100
    population: str = "visible"
    depth: bool = True
    snapshot: bool = True
    keep: str = "observations"
    depthless: Sequence[str] = ()
    """Scenes and trackers whose features have no depth."""
    featureless: Sequence[str] = ()
    """Trackers that find no feature."""
    dataset: str = "simulated"
    truth: str = "raycast"
    key_frame: int | None = None
    """Where truth is a scan."""
    depth_m: float = 3.0
    floor_px: float | None = None
    """Truth floor: error of the relative poses of successive frames, a random walk; None where nothing is known."""
    paper: str | None = None
    """Which experiment of the paper it repeats."""
    patches: bool = False
    """Whether the run has patches of tracks, grey ones."""
    alike: bool = False
    """Whether all lightings of a view have the errors of the first, which are quicker to copy than to sum up."""
    told: bool = False
    """Whether findings are put into sentences: a third of what it takes to write a run."""


def write_run(path: Path, world: World, *, seed: int = 0) -> RunFolder:
    """Write a complete run folder, statistics included."""
    run = RunFolder(path)
    manifest = Manifest("hash", {"tracknoise": "0.1.0", "python": "3.11"}, {"system": "Linux", "cores": "2"}, seed)
    run.create(_toml(world), manifest)
    rng = np.random.default_rng(seed)
    first: dict[tuple[Any, ...], dict[str, pl.DataFrame]] = {}
    for scene, lighting, (rotation, direction) in product(world.scenes, world.lightings, world.views):
        origin = [world.dataset, scene, lighting, rotation, direction, ""]
        entry = _entry(origin, world)
        view = (scene, rotation, direction)
        if world.alike and view in first:
            tables = {name: _lit(table, lighting) for name, table in first[view].items()}
        else:
            tables = first[view] = _sequence(rng, origin, world)
        kept = [name for name in tables if name not in OBSERVED or world.keep == "observations"]
        hashes = run.write_sequence(entry.key, {name: tables[name] for name in kept}, _png(world))
        manifest.sequences[entry.key] = replace(entry, sha256=hashes)
    run.write_manifest(manifest)
    _write_statistics(run, world)
    if world.told:
        tell(run, world)
    return run


def _lit(table: pl.DataFrame, lighting: str) -> pl.DataFrame:
    """The same under another lighting."""
    return table.with_columns(pl.lit(lighting).alias("lighting")) if "lighting" in table.columns else table


def _toml(world: World) -> str:
    names = [json.dumps(name, ensure_ascii=False) for name in world.trackers]
    trackers = [f"[[trackers]]\nname = {name}\nkind = {name}\n[trackers.options]\nwindow = 15" for name in names]
    return "\n".join(
        [
            'name = "made up"',
            f"speeds = {list(world.speeds)}",
            f'seed = 0\nkeep = "{world.keep}"',
            f'paper = "{world.paper}"' if world.paper else "",
            f'[dataset]\nreader = "simulated"\nlightings = {list(world.lightings)}\n[dataset.options]\nframes = 30',
            *trackers,
            f'[truth]\npopulation = "{world.population}"',
            f"[statistics]\ntrim_percentile = {world.percentile or 100.0}\nmin_features = {world.min_features}",
            f'[findings]\ntrimming = "{world.trimming}"',
        ]
    )


def _entry(origin: Sequence[Any], world: World) -> SequenceEntry:
    notes = ("poses were projected to the nearest rotation, by up to 0.002",) if origin[1] == "forward" else ()
    size = (WIDTH, HEIGHT) if origin[3] % 180 == 0 else (HEIGHT, WIDTH)
    middle = world.n_frames // 2
    return SequenceEntry(
        SequenceId(*origin), world.n_frames, *size, world.truth, middle, 3.2, notes, key_frame=world.key_frame
    )  # fmt: skip


def _sequence(rng: np.random.Generator, origin: Sequence[Any], world: World) -> dict[str, pl.DataFrame]:
    parts = [_condition(rng, [*origin, tracker, speed], world) for tracker in world.trackers for speed in world.speeds]
    observations, tracks, frames = (pl.concat(tables) for tables in zip(*parts, strict=True))
    tables = summarise_sequence(
        observations,
        tracks,
        frames,
        key_frame=world.key_frame,
        population=world.population,
        trim_percentile=world.percentile,
        trim_among=world.trim_among,
        statistics=[name for name in STATISTICS if name not in _UNREAD],
    )
    tables["floors"] = _floors(tables["moments"], world)
    seen = prepare_sequence(tables["observations"], tables["tracks"], key_frame=world.key_frame)
    cells = image_map(replace(seen, slowest=min(world.speeds)), width=WIDTH, height=HEIGHT)
    unread = {name: empty(SEQUENCE_TABLES[name]) for name in (*_UNREAD, "pose_differences")}
    shown = {"patches": _patches(observations, world)} if world.patches else {}
    return {**tables, "poses": _poses(origin, world), "image_map": cells, **unread, **shown}


def _patches(observations: pl.DataFrame, world: World) -> pl.DataFrame:
    """Patches without a picture of the tracks that a run would show."""
    rows = []
    for n_each, chosen in extreme_tracks(
        observations, speed=min(world.speeds), population=world.population, key_frame=world.key_frame
    ):
        sheet = encode_webp(np.full((chosen.height * PATCH_PX, 2 * PATCH_PX), 90, np.uint8), quality=50)
        strip = encode_webp(np.full((PATCH_PX, 3 * PATCH_PX), 90, np.uint8), quality=50)
        lists = {name: chosen[name].to_list() for name in ("track", "frame", "anchor_frame", "du_px", "dv_px")}
        labels = chosen.select(*ORIGIN, "at").row(0, named=True)
        rows.append({**labels, "n_each": n_each, **lists, "sheet": sheet, "strip": strip})
    return pl.DataFrame(rows, schema=dict(PATCHES))


def _floors(moments: pl.DataFrame, world: World) -> pl.DataFrame:
    """Errors of poses that all features of a frame share, and that grow from frame to frame."""
    if world.floor_px is None:
        return empty(SEQUENCE_TABLES["floors"])
    seen = moments.filter(population="visible", trimming="untrimmed")
    since = (pl.col("at").cast(pl.Int64) - (world.key_frame or 0)).abs().cast(pl.Float64)
    total = pl.col("n") * since * world.floor_px**2
    values = {"sum_uu": total, "sum_uv": 0.0 * total, "sum_vv": 4.0 * total}
    values |= {"own_uu": total * pl.col("n") / 4.0, "own_vv": total * pl.col("n"), "shared_u": 0.0 * total}
    values |= {"shared_v": 0.0 * total, "source": pl.lit("poses")}
    return seen.with_columns(**values).select(
        pl.col(name).cast(kind) for name, kind in SEQUENCE_TABLES["floors"].items()
    )


def _poses(origin: Sequence[Any], world: World) -> pl.DataFrame:
    """A step of a decimetre along x and a turn of one degree about z in every frame."""
    frame = np.arange(world.n_frames)
    half = np.deg2rad(30 + frame) / 2
    zeros = np.zeros(world.n_frames)
    place = {"x_m": 0.1 * frame, "y_m": zeros, "z_m": zeros}
    turn = {"qx": zeros, "qy": zeros, "qz": np.sin(half), "qw": np.cos(half)}
    labels = {name: [value] * world.n_frames for name, value in zip(SEQUENCE, origin, strict=True)}
    return pl.DataFrame({**labels, "frame": frame, **place, **turn}, schema=dict(POSES))


def _condition(
    rng: np.random.Generator, origin: Sequence[Any], world: World
) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    """Features born in every frame, lost by chance, with errors that walk and drift.

    What drifts to the right in the upright image goes up in one that is turned by 90 degrees, and to the left where
    the sequence is played backward.
    """
    _, scene, _, rotation, direction, _, tracker, speed = origin
    seen = len(range(0, world.n_frames, speed))
    born = 0 if tracker in world.featureless else world.born
    depth = world.depth and not {scene, tracker} & {*world.depthless}
    first = np.repeat(np.arange(seen), born)
    worse = 1.0 + 0.6 * world.trackers.index(tracker)
    life = np.minimum(rng.geometric(min(1.0, world.loss * worse), first.size), seen - first)
    track = np.repeat(np.arange(first.size), life)
    step = np.concatenate([np.arange(n) for n in life]) if first.size else np.empty(0, int)
    size = world.sigma_px * worse * np.where(rng.random(first.size) < 0.06, 12.0, 1.0)[track]
    walk = rng.standard_normal((step.size, 2)) * (size * np.sqrt(step * speed))[:, None]
    drift = np.array([1.0, -0.5]) * (-1.0 if direction == "backward" else 1.0)
    drift = np.array([drift[1], -drift[0]]) if rotation == 90 else drift
    error = walk + world.bias_px * worse * (step * speed)[:, None] * drift
    uv = rng.uniform([0, 0], [WIDTH, HEIGHT], (first.size, 2))[track] + step[:, None] * [0.8 * speed, 0.3]
    status = np.where(rng.random(step.size) < world.hidden, "occluded", "valid") if depth else np.array("no_depth")
    if world.key_frame is not None:
        fixed = ((first[track] + step) * speed == world.key_frame) & depth
        known = np.isin(track, track[fixed])
        start = np.zeros((first.size, 2))
        start[track[fixed]] = error[fixed]
        error -= start[track]
        status = np.where(known, status, "no_depth")
    observations = pl.DataFrame(
        {
            "track": track, "frame": (first[track] + step) * speed, "age": step * speed,
            "u_px": uv[:, 0], "v_px": uv[:, 1],
            "u_true_px": uv[:, 0] - error[:, 0], "v_true_px": uv[:, 1] - error[:, 1],
            "truth": np.broadcast_to(status, step.size), "du_px": error[:, 0], "dv_px": error[:, 1],
        }
    ).with_columns(kept=pl.lit(value=True))  # fmt: skip
    known = pl.when(pl.col("truth") != "no_depth")
    observations = observations.with_columns(known.then(pl.col("u_true_px", "v_true_px", "du_px", "dv_px")))
    end = np.where(first + life == seen, TrackEnd.sequence_end.name, TrackEnd.lost.name)
    tracks = pl.DataFrame({"track": np.arange(first.size), "first_frame": first * speed, "lifetime": life, "end": end})
    every_way = (np.arange(first.size) * 0.4) % np.pi - np.pi / 2
    tracks = tracks.with_columns(
        response=pl.lit(9.0), depth_m=pl.lit(world.depth_m), max_error_px=pl.lit(None), kept=pl.lit(value=True),
        gradient_rad=pl.Series(every_way), incidence_deg=pl.lit(30.0),
        edge_px=pl.Series(np.array([-3.0, 3.0, np.nan])[np.arange(first.size) % 3], nan_to_null=True),
        edge_side=pl.Series(np.array(["far", "near", "none"])[np.arange(first.size) % 3]),
    )  # fmt: skip
    alive = np.bincount(first[track] + step, minlength=seen)
    offered = np.concatenate([[0], alive[:-1]])
    outliers = rng.binomial(offered, 0.05 * worse)
    frames = pl.DataFrame(
        {
            "frame": np.arange(seen) * speed,
            "offered": offered,
            "matched": offered,
            "outliers": outliers,
            "new": born,
            "alive": alive,
        }
    )
    made = ((observations, OBSERVATIONS), (tracks, TRACKS), (frames, FRAME_COUNTS))
    observations, tracks, frames = (_labelled(table, origin).cast(dict(kinds)).select(*kinds) for table, kinds in made)
    return observations, tracks, frames


def _labelled(table: pl.DataFrame, origin: Sequence[Any]) -> pl.DataFrame:
    return table.with_columns(pl.lit(value).alias(name) for name, value in zip(ORIGIN, origin, strict=True))


def _write_statistics(run: RunFolder, world: World) -> None:
    pooled = curves(pl.concat(run.sequence_tables("moments")), min_features=world.min_features)
    made = {
        "curves": pooled,
        "cores": cores(run.sequence_tables("scales"), pooled),
        "floor": truth_floor(run.sequence_tables("floors")),
        "lifetimes": lifetimes_of_ends(run.sequence_tables("ends")),
        "outliers": outlier_ratios(run.sequence_tables("frames")),
        "trims": pl.concat(run.sequence_tables("trims")),
        "errors": merge_errors(run.sequence_tables("errors")),
        "counts": merge_counts(run.sequence_tables("counts")),
    }
    made["summary"] = summary(
        made["curves"],
        made["lifetimes"],
        made["outliers"],
        cores=made["cores"],
        floor=made["floor"],
        key_frame=world.key_frame or 0,
        population=world.population,
    )
    made["effects"] = effects(
        made["curves"],
        made["lifetimes"],
        made["outliers"],
        reference=ReferenceCondition(
            world.lightings[0],
            speed=world.speeds[0],
            key_frames={} if world.key_frame is None else dict.fromkeys(("forward", "backward"), world.key_frame),
        ),
        population=world.population,
    )
    made["changes"] = change_curves(run.sequence_tables("increments"))
    made["aspect_curves"] = aspect_curves(run.sequence_tables("aspects"), min_features=world.min_features)
    made["surrounding_errors"] = surrounding_errors(run.sequence_tables("surroundings"))
    made["image_cells"] = image_cells(run.sequence_tables("image_map"))
    made["ratios"] = ratio_intervals(run.stored_tables("ratio_sums"))
    made["speed_errors"] = speed_errors(run.sequence_tables("image_speeds"))
    run.write_statistics(by_table(made | made_up(made, population=world.population)))


def tell(run: RunFolder, world: World) -> None:
    """Put the findings of a run into sentences."""
    tables = {table: run.statistics(table) for table in RUN_TABLES.values()}
    cited = {table.name: with_ids(table, found) for table, found in tables.items() if table.rows is not None}
    named = {table.name: found for table, found in tables.items()}
    run.write_statistics({FINDINGS: headline_table({**named, **cited}, _scope(world))})


def _scope(world: World) -> ReportedConditions:
    """What the headlines are about."""
    key_frames = {} if world.key_frame is None else dict.fromkeys(("forward", "backward"), world.key_frame)
    reference = ReferenceCondition(world.lightings[0], speed=min(world.speeds), key_frames=key_frames)
    return ReportedConditions(
        reference,
        world.trackers,
        population=world.population,
        percentile=world.percentile,
        trimming=Trimming(world.trimming),
    )


def _png(world: World) -> bytes:
    """A grey gradient as an 8-bit PNG; nothing where the world has no image."""
    if not world.snapshot:
        return b""
    rows = np.add.outer(np.arange(HEIGHT), np.arange(WIDTH)).astype(np.uint8)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    header = struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 0, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(raw)), (b"IEND", b"")]
    packed = [struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks]
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)
