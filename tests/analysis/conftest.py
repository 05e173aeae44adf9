from collections.abc import Callable, Sequence

import numpy as np
import polars as pl
import pytest

from tracknoise.statistics.trimming import Trimmed, trim
from tracknoise.tables.schema import OBSERVATIONS, TRACKS, Schema

SeeErrors = Callable[..., Trimmed]


@pytest.fixture(scope="session")
def see_errors() -> SeeErrors:
    """Observations and tracks, trimmed, that have given errors."""

    def see(errors: Sequence[np.ndarray], *, speed: int = 1, percentile: float | None = 90.0) -> Trimmed:
        """Of an array a scene, (tracks, frames seen, 2), px; all tracks begin in frame 0."""
        scenes = [_scene(f"{place:02}", values, speed) for place, values in enumerate(errors)]
        observations, tracks = (pl.concat(tables) for tables in zip(*scenes, strict=True))
        return trim(observations, tracks, percentile=percentile)

    return see


def _scene(name: str, errors: np.ndarray, speed: int) -> tuple[pl.DataFrame, pl.DataFrame]:
    n, ages, _ = errors.shape
    where = {"dataset": "d", "scene": name, "lighting": "nominal", "rotation": 0, "direction": "forward", "camera": ""}
    labels = {**where, "tracker": "lk", "speed": speed, "kept": True}
    age = np.tile(np.arange(ages) * speed, n)
    positions = dict.fromkeys(("u_px", "v_px", "u_true_px", "v_true_px"), 0.0)
    seen = {
        "frame": age,
        "age": age,
        "truth": "valid",
        "du_px": errors[..., 0].ravel(),
        "dv_px": errors[..., 1].ravel(),
    }
    observations = {"track": np.repeat(np.arange(n), ages), **seen, **positions, **labels}
    tracks = {"track": np.arange(n), "first_frame": 0, "lifetime": ages, "end": "sequence_end", **labels}
    return _table(OBSERVATIONS, observations), _table(TRACKS, tracks)


def _table(schema: Schema, columns: dict[str, object]) -> pl.DataFrame:
    """A table of the schema: arrays give the rows, single values fill every row, and what is not given is null."""
    arrays = {name: values for name, values in columns.items() if isinstance(values, np.ndarray)}
    others = {name: pl.lit(columns.get(name)) for name in schema if name not in arrays}
    table = pl.DataFrame(arrays).with_columns(**others)
    return table.select(pl.col(name).cast(kind) for name, kind in schema.items())
