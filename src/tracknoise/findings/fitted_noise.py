"""Noise of tracks with triangulated truth, (noise.triangulated) and (noise.epipolar), with intervals."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import N_DRAWS, Draws, draws_by_dataset
from tracknoise.findings.sampling.groups import NO_GROUPS, SceneGroups
from tracknoise.findings.sampling.units import units_of
from tracknoise.statistics.conditions import Tables, by_condition, scenes_by_dataset
from tracknoise.statistics.definitions import LENGTHS, POOLED
from tracknoise.tables.defaults import KIND_OF_INTERVAL, LEVEL
from tracknoise.tables.enumerations import IntervalKind
from tracknoise.tables.findings_schema import TRIANGULATED_NOISE
from tracknoise.tables.schema import FITTED_NOISE, check, empty

_SUMS = ["n", "squares_u", "freedom_u", "squares_v", "freedom_v", "squares", "freedom"]
_COORDINATES = ("u", "v", "both")
_POINT = ["measure", "trimming", "length_low"]


def fitted_noise_table(
    sums: Tables,
    *,
    groups: SceneGroups = NO_GROUPS,
    kind: str = KIND_OF_INTERVAL,
    level: float = LEVEL,
    n_draws: int = N_DRAWS,
    seed: int = 0,
) -> pl.DataFrame:
    """Standard deviation of the noise of one coordinate, by length of the track and for all lengths together.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `FITTED_NOISE`.
    groups
        Groups of scenes that are not independent of each other.
    kind, level, n_draws, seed
        As in `tracknoise.findings.intervals.table.interval_table`.

    Returns
    -------
    polars.DataFrame
        Schema `TRIANGULATED_NOISE`, sorted. Without rows unless true positions are triangulated.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(sums, FITTED_NOISE, "fitted noise")
    scenes = scenes_by_dataset(conditions.items())
    drawn = draws_by_dataset(scenes, n_draws=0 if kind == IntervalKind.student else n_draws, seed=seed, groups=groups)
    parts = [
        _rows(part, drawn[key[0]], Method(kind, level), groups).with_columns(
            pl.lit(value, dtype=TRIANGULATED_NOISE[name]).alias(name) for name, value in zip(POOLED, key, strict=True)
        )
        for key, part in conditions.items()
        if part.height
    ]
    typed = [part.select(pl.col(name).cast(dtype) for name, dtype in TRIANGULATED_NOISE.items()) for part in parts]
    table = pl.concat([empty(TRIANGULATED_NOISE), *typed])
    order = [*POOLED, "measure", "trimming", "length_low", "coordinate"]
    return check(table.sort(order), TRIANGULATED_NOISE, "triangulated noise")


def _rows(sums: pl.DataFrame, draws: Draws, method: Method, groups: SceneGroups) -> pl.DataFrame:
    """One row per measure, trimming, class of lengths and coordinate of a condition."""
    together = sums.with_columns(length_low=pl.lit(0, dtype=pl.UInt32))  # sorts before all classes
    both = pl.concat([together, sums])
    units = units_of(both, both, points=_POINT, columns=_SUMS, groups=groups)
    sizes = np.stack([units.sums[..., place].T for place in (2, 4, 6)])
    found = pooled(units, draws.weights(units), _deviations, method, scales=["log"] * len(_COORDINATES), sizes=sizes)
    labels = pl.DataFrame({"coordinate": _COORDINATES}).join(units.points, how="cross")
    columns = {"sigma_px": "value", **{name: name for name in ("low", "high", "n_units", "n_scenes")}}
    numbers = pl.DataFrame({name: getattr(found, source).ravel() for name, source in columns.items()})
    n = np.tile(units.sums[..., 0].sum(axis=0), len(_COORDINATES))
    made = {"kind": found.kind, "level": found.level, "resampled": units.resampled}
    table = labels.hstack(numbers).with_columns(
        _lengths(),
        pl.Series("n", n, dtype=pl.Float64),
        *(pl.lit(value, dtype=TRIANGULATED_NOISE[name]).alias(name) for name, value in made.items()),
    )
    return table.with_columns(
        pl.col("sigma_px", "low", "high").fill_nan(None), length_low=pl.col("length_low").replace({0: None})
    ).drop_nulls("sigma_px")


def _lengths() -> pl.Expr:
    highest = {low: high for low, high in LENGTHS if high is not None}
    return pl.col("length_low").replace_strict(highest, default=None, return_dtype=pl.Int64).alias("length_high")


def _deviations(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviations in u, in v and of both, (3, points, ...), NaN where there are no degrees of freedom."""
    squares, freedom = sums[1::2], sums[2::2]
    return np.asarray(np.sqrt(squares / np.where(freedom > 0, freedom, np.nan)))
