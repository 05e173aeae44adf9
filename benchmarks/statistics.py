"""How fast observations become moments, and moments of scenes become curves."""

import numpy as np
import polars as pl

from benchmarks.harness import Row, median_ms
from tracknoise.statistics.cells import KEYS, merge
from tracknoise.statistics.curves import curves
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.trimming import trim
from tracknoise.tables.schema import OBSERVATIONS, TRACKS, Schema

TRACKS_PER_CONDITION = 12_000
TRACKERS = ("lucas-kanade", "correspondence")
SPEEDS = (1, 2, 4)
SCENES = 100


def rows() -> list[Row]:
    """Time trimming, moments, pooling and curves on synthetic tables of about two million observations."""
    observations, tracks = _tables(np.random.default_rng(0))
    moments = scene_moments(observations)
    scenes = pl.concat([moments.with_columns(scene=pl.lit(f"scene {index}")) for index in range(SCENES)])
    by = [column for column in KEYS if column != "scene"]
    trim_ms = median_ms(lambda: trim(observations, tracks, percentile=90.0), repeats=5)
    moments_ms = median_ms(lambda: scene_moments(observations), repeats=5)
    merge_ms = median_ms(lambda: merge(scenes, by=by), repeats=5)
    curves_ms = median_ms(lambda: curves(scenes), repeats=5)
    size, pooled = f"{observations.height} observations", f"{scenes.height} rows of {SCENES} scenes"
    return [
        Row("trim", observations.height / trim_ms / 1e3, "million observations/s", size),
        Row("scene_moments", observations.height / moments_ms / 1e3, "million observations/s", size),
        Row("merge", scenes.height / merge_ms / 1e3, "million moments rows/s", pooled),
        Row("curves", curves_ms, "ms", pooled),
    ]


def _tables(rng: np.random.Generator) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Observations and tracks of one scene under every tracker and speed, lifetimes geometric with mean 28."""
    pairs = [_condition(rng, tracker, speed) for tracker in TRACKERS for speed in SPEEDS]
    return pl.concat([pair[0] for pair in pairs]), pl.concat([pair[1] for pair in pairs])


def _condition(rng: np.random.Generator, tracker: str, speed: int) -> tuple[pl.DataFrame, pl.DataFrame]:
    lifetime = rng.geometric(1 / 28, TRACKS_PER_CONDITION)
    track = np.repeat(np.arange(len(lifetime)), lifetime)
    step = np.arange(len(track)) - np.repeat(np.cumsum(lifetime) - lifetime, lifetime)
    errors = {name: rng.normal(size=len(track)) for name in ("du_px", "dv_px")}
    origin = {"dataset": "synthetic", "scene": "scene", "lighting": "nominal", "rotation": 0}
    condition = {**origin, "tracker": tracker, "speed": speed, "kept": True}
    truth = np.where(rng.random(len(track)) < 0.9, "valid", "occluded")
    seen = {"track": track, "frame": step * speed, "age": step * speed, "truth": truth, **errors}
    seen |= dict.fromkeys(("u_px", "v_px", "u_true_px", "v_true_px"), np.zeros(len(track)))
    lived = {"track": np.arange(len(lifetime)), "first_frame": 0, "lifetime": lifetime, "end": "lost"}
    return _typed(seen | condition, OBSERVATIONS), _typed(lived | condition, TRACKS)


def _typed(columns: dict[str, object], schema: Schema) -> pl.DataFrame:
    table = pl.DataFrame(columns)
    missing = [pl.lit(None).alias(name) for name in schema if name not in columns]
    return table.with_columns(missing).select(pl.col(name).cast(kind) for name, kind in schema.items())
