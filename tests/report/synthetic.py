"""A run folder of made-up measurements whose distributions are known: no images, no trackers."""

import json
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from tracknoise.statistics.counts import counts, merge_counts
from tracknoise.statistics.curves import curves
from tracknoise.statistics.histogram import error_histogram
from tracknoise.statistics.lifetimes import lifetimes
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.outliers import outlier_ratios
from tracknoise.statistics.summary import summary
from tracknoise.statistics.trimming import trim
from tracknoise.tables.schema import FRAMES, OBSERVATIONS, ORIGIN, TRACKS, TrackEnd
from tracknoise.tables.store import Manifest, RunFolder, SequenceEntry

WIDTH, HEIGHT = 160, 120
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
    "two lightings": {**_ONE, "lightings": ("led-1", "led-2")},
    "all that is projected": {**_ONE, "population": "projected", "hidden": 0.3},
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
    n_frames: int = 30
    born: int = 12
    sigma_px: float = 0.15
    bias_px: float = 0.02
    loss: float = 0.08
    hidden: float = 0.02
    percentile: float | None = 90.0
    min_features: int = 100
    population: str = "visible"
    depth: bool = True
    snapshot: bool = True
    depthless: Sequence[str] = ()
    """Scenes and trackers whose features have no depth."""
    featureless: Sequence[str] = ()
    """Trackers that find no feature."""
    dataset: str = "simulated"
    truth: str = "raycast"


def write_run(path: Path, world: World, *, seed: int = 0) -> RunFolder:
    """Write a complete run folder, statistics included."""
    run = RunFolder(path)
    manifest = Manifest("hash", {"tracknoise": "0.1.0", "python": "3.11"}, {"system": "Linux", "cores": "2"}, seed)
    run.create(_toml(world), manifest)
    rng = np.random.default_rng(seed)
    for scene in world.scenes:
        for lighting in world.lightings:
            entry = _entry(scene, lighting, world)
            run.write_sequence(entry.key, _sequence(rng, scene, lighting, world), _png(world))
            manifest.sequences[entry.key] = entry
    run.write_manifest(manifest)
    _write_statistics(run, world)
    return run


def _toml(world: World) -> str:
    names = [json.dumps(name) for name in world.trackers]
    trackers = [f"[[trackers]]\nname = {name}\nkind = {name}\n[trackers.options]\nwindow = 15" for name in names]
    return "\n".join(
        [
            'name = "made up"',
            f"speeds = {list(world.speeds)}",
            "seed = 0",
            f'[dataset]\nreader = "simulated"\nlightings = {list(world.lightings)}\n[dataset.options]\nframes = 30',
            *trackers,
            f'[truth]\npopulation = "{world.population}"',
            f"[statistics]\ntrim_percentile = {world.percentile or 100.0}\nmin_features = {world.min_features}",
        ]
    )


def _entry(scene: str, lighting: str, world: World) -> SequenceEntry:
    notes = ("poses were projected to the nearest rotation, by up to 0.002",) if scene == "forward" else ()
    return SequenceEntry(
        world.dataset, scene, lighting, 0, world.n_frames, WIDTH, HEIGHT, world.truth, world.n_frames // 2, 3.2, notes
    )


def _sequence(rng: np.random.Generator, scene: str, lighting: str, world: World) -> dict[str, pl.DataFrame]:
    parts = [
        _condition(rng, scene, lighting, tracker, speed, world) for tracker in world.trackers for speed in world.speeds
    ]
    observations, tracks, frames = (pl.concat(tables) for tables in zip(*parts, strict=True))
    trimmed = trim(observations, tracks, percentile=world.percentile, population=world.population)
    return {
        "observations": trimmed.observations,
        "tracks": trimmed.tracks,
        "frames": frames,
        "moments": scene_moments(trimmed.observations),
        "trims": trimmed.trims,
        "counts": counts(trimmed.observations, trimmed.tracks),
    }


def _condition(
    rng: np.random.Generator, scene: str, lighting: str, tracker: str, speed: int, world: World
) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    """Features born in every frame, lost by chance, with errors that walk and drift."""
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
    error = walk + world.bias_px * worse * (step * speed)[:, None] * [1.0, -0.5]
    uv = rng.uniform([0, 0], [WIDTH, HEIGHT], (first.size, 2))[track] + step[:, None] * [0.8 * speed, 0.3]
    status = np.where(rng.random(step.size) < world.hidden, "occluded", "valid") if depth else "no_depth"
    origin = [world.dataset, scene, lighting, 0, tracker, speed]
    observations = pl.DataFrame(
        {
            "track": track, "frame": (first[track] + step) * speed, "age": step * speed,
            "u_px": uv[:, 0], "v_px": uv[:, 1],
            "u_true_px": uv[:, 0] - error[:, 0], "v_true_px": uv[:, 1] - error[:, 1],
            "truth": np.broadcast_to(status, step.size), "du_px": error[:, 0], "dv_px": error[:, 1],
        }
    ).with_columns(kept=pl.lit(value=True))  # fmt: skip
    if not depth:
        observations = observations.with_columns(
            pl.lit(None).alias(c) for c in ("u_true_px", "v_true_px", "du_px", "dv_px")
        )
    end = np.where(first + life == seen, TrackEnd.sequence_end.name, TrackEnd.lost.name)
    tracks = pl.DataFrame({"track": np.arange(first.size), "first_frame": first * speed, "lifetime": life, "end": end})
    tracks = tracks.with_columns(
        response=pl.lit(9.0), depth_m=pl.lit(3.0), max_error_px=pl.lit(None), kept=pl.lit(value=True)
    )
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
    made = ((observations, OBSERVATIONS), (tracks, TRACKS), (frames, FRAMES))
    observations, tracks, frames = (_labelled(table, origin).cast(dict(kinds)).select(*kinds) for table, kinds in made)
    return observations, tracks, frames


def _labelled(table: pl.DataFrame, origin: Sequence[object]) -> pl.DataFrame:
    return table.with_columns(pl.lit(value).alias(name) for name, value in zip(ORIGIN, origin, strict=True))


def _write_statistics(run: RunFolder, world: World) -> None:
    made = {
        "curves": curves(pl.concat(run.sequence_tables("moments")), min_features=world.min_features),
        "lifetimes": lifetimes(run.sequence_tables("tracks")),
        "outliers": outlier_ratios(run.sequence_tables("frames")),
        "trims": pl.concat(run.sequence_tables("trims")),
        "errors": error_histogram(run.sequence_tables("tracks")),
        "counts": merge_counts(run.sequence_tables("counts")),
    }
    made["summary"] = summary(made["curves"], made["lifetimes"], made["outliers"], population=world.population)
    for name, table in made.items():
        run.write_statistics(name, table)


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
