"""Errors of known kind as the tables that a run would make of them, for benchmarks of what is concluded from these."""

from collections.abc import Sequence

import numpy as np
import polars as pl

from tracknoise.statistics.trimming import trim
from tracknoise.tables.schema import OBSERVATIONS, TRACKS, Schema

CONDITION = {
    "dataset": "d",
    "lighting": "nominal",
    "rotation": 0,
    "direction": "forward",
    "camera": "",
    "tracker": "lk",
}


def tables(
    errors: Sequence[np.ndarray], *, speed: int = 1, percentile: float = 90.0
) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Observations and tracks, trimmed, of scenes whose tracks all begin in frame 0.

    `errors` has an array a scene, (tracks, frames seen, 2), px; that of the first frame should be 0.
    """
    observations, tracks = [], []
    for scene, values in enumerate(errors):
        n, ages, _ = values.shape
        labels = {**CONDITION, "scene": f"{scene:03}", "speed": speed, "kept": True}
        age = np.tile(np.arange(ages) * speed, n)
        seen = {"track": np.repeat(np.arange(n), ages), "frame": age, "age": age, "truth": "valid"}
        positions = dict.fromkeys(("u_px", "v_px", "u_true_px", "v_true_px"), 0.0)
        found = {"du_px": values[..., 0].ravel(), "dv_px": values[..., 1].ravel()}
        observations.append(_table(OBSERVATIONS, **labels, **seen, **positions, **found))
        lives = {"track": np.arange(n), "first_frame": 0, "lifetime": ages, "end": "sequence_end"}
        tracks.append(_table(TRACKS, **labels, **lives))
    trimmed = trim(pl.concat(observations), pl.concat(tracks), percentile=percentile)
    return trimmed.observations, trimmed.tracks


def tables_of_tracks(errors: np.ndarray, lives: np.ndarray) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Observations and tracks of one scene whose tracks all begin in frame 0 and are then lost.

    `errors` (observations, 2), px, has those of each track one after the other, `lives` (tracks,) their number.
    """
    age = np.arange(len(errors)) - np.repeat(np.cumsum(lives) - lives, lives)
    labels = {**CONDITION, "scene": "000", "speed": 1, "kept": True}
    seen = {"track": np.repeat(np.arange(len(lives)), lives), "frame": age, "age": age, "truth": "valid"}
    positions = dict.fromkeys(("u_px", "v_px", "u_true_px", "v_true_px"), 0.0)
    found = {"du_px": errors[:, 0], "dv_px": errors[:, 1]}
    lived = {"track": np.arange(len(lives)), "first_frame": 0, "lifetime": lives, "end": "lost"}
    return _table(OBSERVATIONS, **labels, **seen, **positions, **found), _table(TRACKS, **labels, **lived)


def _table(schema: Schema, **columns: object) -> pl.DataFrame:
    """A table of the schema: arrays give the rows, single values fill every row, and what is not given is null."""
    height = len(columns["track"])  # type: ignore[arg-type]
    filled = {name: columns.get(name) for name in schema}
    series = {
        name: pl.Series(values=value).cast(schema[name])
        if isinstance(value, np.ndarray)
        else pl.Series(values=[value] * height, dtype=schema[name])
        for name, value in filled.items()
    }
    return pl.DataFrame(series)
