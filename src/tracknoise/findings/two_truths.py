"""How far two truths of the same images disagree, with intervals."""

from collections.abc import Iterable

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.intervals.condition_table import USUAL, Sampling, condition_table, estimated
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of
from tracknoise.statistics.conditions import Tables, by_condition
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.findings_schema import POSE_DISAGREEMENT, TWO_TRUTHS
from tracknoise.tables.schema import ORIGIN, POSE_DIFFERENCES, TRUTH_DIFFERENCES, check

_SUMS = ["n", "u", "v", "uu", "vv", "uv"]
_POINT = ["quantity", "trimming", "age"]
_VALUES = pl.DataFrame(
    {"statistic": ["mean"] * 2 + ["second"] * 3, "coordinate": ["u", "v", "u", "v", "uv"]},
)
_SCALES = ("linear", "linear", "log", "log", "linear")
_POSES = pl.DataFrame({"quantity": ["rotation", "translation"], "unit": ["deg", "m"]})
_POSE_KEYS = [*(name for name in POSE_DISAGREEMENT if name in POOLED), "lag", "quantity"]
_ANY_CONDITION = {"tracker": pl.lit(""), "speed": pl.lit(1, dtype=ORIGIN["speed"])}
"""Poses do not depend on trackers and speeds."""


def two_truths_table(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Mean and second moment of the disagreement of true positions, and of the errors by each truth, by age.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `TRUTH_DIFFERENCES`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `TWO_TRUTHS`, sorted by its columns before `n`.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(sums, TRUTH_DIFFERENCES, "truth differences")
    table = condition_table(conditions, TWO_TRUTHS, _of_positions, sampling)
    return check(table.sort(*POOLED, *_POINT, "statistic", "coordinate"), TWO_TRUTHS, "two truths")


def pose_disagreement_table(sums: pl.DataFrame | Iterable[pl.DataFrame], sampling: Sampling = USUAL) -> pl.DataFrame:
    """Root mean square difference of the relative poses of two truths, by lag: see `two_truths_table`.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `POSE_DIFFERENCES`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `POSE_DISAGREEMENT`, sorted by its columns before `n`.

    Raises
    ------
    SchemaError, SettingsError
        As `two_truths_table`.
    """
    tables = [sums] if isinstance(sums, pl.DataFrame) else sums
    named = (check(table, POSE_DIFFERENCES, "pose differences").with_columns_seq(**_ANY_CONDITION) for table in tables)
    schema = {**ORIGIN, **{name: kind for name, kind in POSE_DIFFERENCES.items() if name not in ORIGIN}}
    conditions = by_condition((table.select_seq(*schema) for table in named), schema, "pose differences")
    wide = {**TWO_TRUTHS, **POSE_DISAGREEMENT}
    columns = {name: wide[name] for name in (*POOLED, *(name for name in POSE_DISAGREEMENT if name not in POOLED))}
    table = condition_table(conditions, columns, _of_poses, sampling)
    return check(table.select_seq(*POSE_DISAGREEMENT).sort(_POSE_KEYS), POSE_DISAGREEMENT, "pose disagreement")


def _of_positions(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per quantity, trimming, age, statistic and coordinate of a condition."""
    units = units_of(sums, sums, points=_POINT, columns=_SUMS, groups=draws.groups)
    found = pooled(units, draws.weights(units), _moments, method, scales=_SCALES)
    labels = _VALUES.join(units.points, how="cross")
    table = estimated(labels, found, units, TWO_TRUTHS, value="value")
    return _counted(table, units.sums[..., 0], _VALUES.height)


def _of_poses(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per lag and quantity of a condition."""
    columns = ["n", "rotation_rad2", "translation_m2"]
    units = units_of(sums, sums, points=["lag"], columns=columns, groups=draws.groups)
    found = pooled(units, draws.weights(units), _deviations, method, scales=["log"] * _POSES.height)
    labels = _POSES.join(units.points, how="cross")
    table = estimated(labels, found, units, POSE_DISAGREEMENT, value="value")
    return _counted(table, units.sums[..., 0], _POSES.height)


def _counted(table: pl.DataFrame, counts: NDArray[np.float64], times: int) -> pl.DataFrame:
    n = np.tile(counts.sum(axis=0), times)
    return table.with_columns_seq(pl.col("value", "low", "high").fill_nan(None), pl.Series("n", n, dtype=pl.Float64))


def _moments(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means and second moments about zero, (5, points, ...), NaN where there are no observations."""
    return np.asarray(sums[1:] / np.where(sums[:1] > 0, sums[:1], np.nan))


def _deviations(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation in degrees and translation in metres, (2, points, ...), NaN where there are no pairs."""
    deviations = np.sqrt(_moments(sums))
    return np.asarray(np.stack([np.degrees(deviations[0]), deviations[1]]))
