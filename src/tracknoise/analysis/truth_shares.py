"""What errors of the truth can explain: its floor, its audit, two truths, differences between trackers, and fits.

`AUDIT_CURVES` has errors by age as measured, and with all faults corrected, in units that took no part in the fit. A
mean error, or the growth of a second moment, is covered by the audit if the corrections take off at least half of it:
the claim that it is the tracker's then rests on what is stated wrongly. (audit.cover)

A mean error is covered by the truth floor if it lies within two standard deviations of what the errors of the truth add
to the mean. The growth of a second moment is covered if it is at most twice the growth of the floor: the errors of the
poses of a few stretches scatter about their expected size, and that size is itself known roughly only.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import hypot, sqrt
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimates_by_point, units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, column_means, pooled
from tracknoise.statistics.definitions import LENGTHS, POOLED, UNITS, since_zero
from tracknoise.statistics.grouping import Tables, by_condition, tables_of
from tracknoise.statistics.moments import ABOUT_ZERO
from tracknoise.tables.enumerations import Population
from tracknoise.tables.findings_schema import ESTIMATE_COLUMNS, INTERVAL_COLUMNS
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import (
    ALL_ROWS,
    ESTIMATED_OF_N,
    OF_CONDITION,
    OF_VIEW,
    Rows,
    RunTable,
    Value,
    one_number,
    same,
)
from tracknoise.tables.schema import (
    BETWEEN_TRACKERS,
    FITTED_MEASURE,
    FITTED_NOISE,
    ORIGIN,
    POSE_DIFFERENCES,
    TRIMMING,
    TRUTH_DIFFERENCES,
    TRUTH_QUANTITY,
    VIEW,
    check,
)
from tracknoise.tables.schema import POOLED as CONDITIONS
from tracknoise.tables.truth_audit import EVERYTHING, MEASURED


def _second_truth() -> Rows:
    values = [
        Value(f"truth_difference_{statistic}", "value", {}, {"statistic": statistic}, ESTIMATED_OF_N)
        for statistic in ("mean", "second")
    ]
    keys = {**OF_CONDITION, **same("trimming", "coordinate"), "part": "quantity", "at": "age"}
    return Rows("second truth", keys, values)


TWO_TRUTHS = RunTable(
    "two_truths",
    {
        **CONDITIONS,
        "quantity": TRUTH_QUANTITY,
        "trimming": TRIMMING,
        "age": pl.UInt32,
        "statistic": pl.String,
        "coordinate": pl.String,
        "n": pl.Int64,
        **ESTIMATE_COLUMNS,
    },
    _second_truth(),
    title="disagreement of two truths",
    quantities={
        "truth_difference_mean": Quantity("px", "Mean of positions by two truths, and of errors by each."),
        "truth_difference_second": Quantity("px^2", "Second moment of the same."),
    },
    without_truth=True,
)
"""How far the true positions by two truths are apart, by age, and the errors of trackers by each of them.

The statistics are `mean` (px; u, v) and `second`, the second moment about zero (px^2; u, v, uv). All quantities have
the same observations: those visible by the first truth whose true position the second knows too. The disagreement is
zero at age 0. Its second moment is the sum of the second moments of the errors of both truths if these are independent.
The table has no rows unless the experiment has a second truth.
"""

POSE_DISAGREEMENT = RunTable(
    "pose_disagreement",
    {
        "dataset": pl.String,
        **VIEW,
        "lag": pl.UInt32,
        "quantity": pl.String,
        "unit": pl.String,
        "n": pl.Int64,
        **ESTIMATE_COLUMNS,
    },
    one_number(
        "pose disagreement",
        "pose_disagreement",
        "value",
        {"dataset": "dataset", **OF_VIEW, "at": "lag", "of": "quantity"},
        ESTIMATED_OF_N | {"unit": "unit"},
    ),
    title="disagreement of the poses of two truths",
    quantities={
        "pose_disagreement": Quantity(None, "RMS difference per axis between the relative poses of two truths.")
    },
    without_truth=True,
)
"""Root mean square difference per axis between the relative poses of two truths, by lag in frames.

The quantity is `rotation` (degrees) or `translation` (metres), n the number of pairs of frames. The table has no rows
unless the experiment has a second truth.
"""

TRIANGULATED_NOISE = RunTable(
    "triangulated_noise",
    {
        **CONDITIONS,
        "measure": FITTED_MEASURE,
        "trimming": TRIMMING,
        "length_low": pl.Int64,
        "length_high": pl.Int64,
        "coordinate": pl.String,
        "n": pl.Int64,
        "sigma_px": pl.Float64,
        **INTERVAL_COLUMNS,
    },
    one_number(
        "fitted noise",
        "fitted_noise",
        "sigma_px",
        {
            **OF_CONDITION,
            **same("trimming", "coordinate"),
            "part": "measure",
            "at_low": "length_low",
            "at_high": "length_high",
        },
        ESTIMATED_OF_N,
    ),
    title="noise from triangulated truth",
    verdicts=ALL_ROWS,
    quantities={
        "fitted_noise": Quantity("px", "Noise of one coordinate, corrected for the fit of the true positions.")
    },
)
"""Noise of tracks whose true positions are triangulated: standard deviation of one coordinate of a position, px.

The measure `triangulated` is from errors about the fitted points, with 2 N - 3 degrees of freedom for a track of N
observations. `epipolar` is from distances to the epipolar line of the first observation, which tracks of two
observations have as well; its coordinate is `both`. length_low and length_high bound the number of observations of the
tracks; both are null for all lengths together, and length_high for the longest class. n counts observations. White
noise in every position is measured without bias. Errors along the epipolar line are not seen. The table has no rows for
other kinds of truth.
"""

TRACKER_DIFFERENCES = RunTable(
    "tracker_differences",
    {
        **CONDITIONS,
        "other": pl.String,
        "statistic": pl.String,
        "age": pl.Int64,
        "coordinate": pl.String,
        "unit": pl.String,
        "n": pl.Int64,
        **ESTIMATE_COLUMNS,
        "established": pl.Boolean,
    },
    one_number(
        "tracker differences",
        "tracker_difference",
        "value",
        {**OF_CONDITION, "against": "other", "of": "statistic", "at": "age", "coordinate": "coordinate"},
        ESTIMATED_OF_N | {"unit": "unit", "verdict": "established"},
    ),
    title="differences between trackers",
    quantities={"tracker_difference": Quantity(None, "Difference of the errors of two trackers at the same corners.")},
    without_truth=True,
)
"""Differences of the errors of two trackers at the same corners and in the same frames: `tracker` minus `other`.

statistic is `mean` (px) or `central`, the covariance of the differences (px^2): u and v are variances. An error of the
truth cancels in the difference. established states whether a mean differs from 0 at the level of the row, with
Bonferroni's correction for all ages and both coordinates of the two trackers; it is null for covariances.
"""

NO_KEY_FRAMES: Mapping[str, int] = {}


def anchored(table: pl.DataFrame, key_frames: Mapping[str, int]) -> pl.DataFrame:
    """Rows of visible errors that are not zero by construction, with their distance from where errors are.

    Returns: the same columns, and `since` (Int64), not 0: an age, or frames after the key frame, negative before it.
    `table`: moments by age or frame: columns direction, population, axis, at and n, besides any others.
    """
    return table.with_columns_seq(since=since_zero(key_frames)).filter(
        pl.col("n") > 0, pl.col("since") != 0, population=Population.visible
    )


_MOST_LEFT = 0.5
_LEAST_ERRORS = 30


@dataclass(frozen=True, slots=True)
class AuditCover:
    """An error, and what corrections of the truth leave of it.

    Attributes
    ----------
    age
        Largest audited age up to that in question.
    error_px, left_px
        Size of the error as measured and corrected, px; of a growth its root.
    is_covered
        Whether at most half of the mean, or of the growth of the second moment, is left.
    """

    age: int
    error_px: float
    left_px: float
    is_covered: bool


def audited_mean(curves: pl.DataFrame, tracker: str, at: int) -> AuditCover | None:
    """Length of the mean error of a tracker at an age, with and without corrections: (audit.cover).

    Parameters
    ----------
    curves
        Table `AUDIT_CURVES`.
    tracker
        Its name.
    at
        Age, or distance from the key frame, frames.

    Returns
    -------
    AuditCover or None
        None where no fault was found, or the tracker took no part in the audit.
    """
    rows = _both(curves, tracker, at)
    if not rows:
        return None
    error_px, left_px = (hypot(rows[-1][f"mean_u_px{end}"], rows[-1][f"mean_v_px{end}"]) for end in ("", "_left"))
    return AuditCover(rows[-1]["age"], error_px, left_px, is_covered=left_px <= _MOST_LEFT * error_px)


def audited_growth(curves: pl.DataFrame, tracker: str, coordinate: str, at: int) -> AuditCover | None:
    """Root of the growth of a second moment from the first audited age to another: see `audited_mean`.

    Parameters
    ----------
    curves, tracker, at
        As for `audited_mean`.
    coordinate
        u or v.
    """
    rows, column = _both(curves, tracker, at), f"second_{coordinate}{coordinate}"
    if len(rows) < 2:
        return None
    grown, left = (rows[-1][f"{column}{end}"] - rows[0][f"{column}{end}"] for end in ("", "_left"))
    error_px, left_px = (sqrt(max(value, 0.0)) for value in (grown, left))
    return AuditCover(rows[-1]["age"], error_px, left_px, is_covered=grown > 0.0 and left <= _MOST_LEFT * grown)


def _both(curves: pl.DataFrame, tracker: str, at: int) -> list[dict[str, Any]]:
    """Rows of the errors as measured, beside those with all faults corrected, by age."""
    enough = curves.filter(pl.col("age") <= at, pl.col("n") >= _LEAST_ERRORS, tracker=tracker)
    measured, left = (enough.filter(correction=name) for name in (MEASURED, EVERYTHING))
    return measured.join(left, on=["dataset", "age"], suffix="_left").sort("age").to_dicts()


SIGMAS = 2.0
_VARIANCES = 2.0


@dataclass(frozen=True, slots=True)
class FloorCover:
    """An error and what the truth can cause.

    Attributes
    ----------
    error_px
        Size of the error, px.
    limit_px
        Largest size that errors of the truth can explain, px.
    """

    error_px: float
    limit_px: float

    @property
    def is_covered(self) -> bool:
        """Whether the error of the truth alone can explain the error."""
        return self.error_px <= self.limit_px


def cover_of_mean(mean_px: float | None, floor_mean_px: float | None) -> FloorCover | None:
    """A mean error beside its floor; None where either is unknown, or the truth is exact.

    Parameters
    ----------
    mean_px
        Mean error of a coordinate, px.
    floor_mean_px
        Standard deviation of what the errors of the truth add to it, px.
    """
    if mean_px is None or not floor_mean_px:
        return None
    return FloorCover(abs(mean_px), SIGMAS * floor_mean_px)


def cover_of_second(second: float | None, floor: float | None) -> FloorCover | None:
    """A second moment, or its growth, beside that of the floor; None where either is unknown, or the truth is exact.

    Parameters
    ----------
    second
        Second moment of a coordinate, or its growth between two ages, px^2.
    floor
        The same of the truth floor, px^2.
    """
    if second is None or floor is None or floor <= 0.0:
        return None
    return FloorCover(sqrt(max(second, 0.0)), sqrt(_VARIANCES * floor))


def covered_by_floor(*covers: FloorCover | None) -> bool:
    """Whether there is an error at all, and errors of the truth alone can explain each."""
    measured = [cover for cover in covers if cover is not None]
    return bool(measured) and len(measured) == len(covers) and all(cover.is_covered for cover in measured)


_TWO_TRUTH_SUMS = ["n", "u", "v", "uu", "vv", "uv"]
_TWO_TRUTH_POINT = ["quantity", "trimming", "age"]
_VALUES = pl.DataFrame({"statistic": ["mean"] * 2 + ["second"] * 3, "coordinate": ["u", "v", "u", "v", "uv"]})
_TWO_TRUTH_SCALES = ("linear", "linear", "log", "log", "linear")
_POSES = pl.DataFrame({"quantity": ["rotation", "translation"], "unit": ["deg", "m"]})
_POSE_KEYS = [*(name for name in POSE_DISAGREEMENT if name in POOLED), "lag", "quantity"]
_ANY_CONDITION = {"tracker": pl.lit(""), "speed": pl.lit(1, dtype=ORIGIN["speed"])}
"""Poses do not depend on trackers and speeds."""


def two_truths_table(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Mean and second moment of the disagreement of true positions, and of the errors by each truth, by age.

    `sums`: tables of all scenes, schema `TRUTH_DIFFERENCES`. Returns: schema `TWO_TRUTHS`, sorted by its columns
    before `n`. Raises as `condition_table`.
    """
    conditions = by_condition(sums, TRUTH_DIFFERENCES, "truth differences")
    order = [*POOLED, *_TWO_TRUTH_POINT, "statistic", "coordinate"]
    return condition_table(conditions, TWO_TRUTHS, _of_positions, sampling).sort(order)


def pose_disagreement_table(sums: pl.DataFrame | Iterable[pl.DataFrame], sampling: Sampling = USUAL) -> pl.DataFrame:
    """Root mean square difference of the relative poses of two truths, by lag: see `two_truths_table`.

    `sums`: tables of all scenes, schema `POSE_DIFFERENCES`. Returns: schema `POSE_DISAGREEMENT`, sorted by its
    columns before `n`. Raises as `condition_table`.
    """
    tables = (check(table, POSE_DIFFERENCES, "pose differences") for table in tables_of(sums, "pose differences"))
    named = (table.with_columns_seq(**_ANY_CONDITION) for table in tables)
    schema = {**ORIGIN, **{name: kind for name, kind in POSE_DIFFERENCES.items() if name not in ORIGIN}}
    conditions = by_condition((table.select_seq(*schema) for table in named), schema, "pose differences")
    wide = {**TWO_TRUTHS, **POSE_DISAGREEMENT}
    columns = {name: wide[name] for name in (*POOLED, *(name for name in POSE_DISAGREEMENT if name not in POOLED))}
    table = condition_table(conditions, columns, _of_poses, sampling)
    return table.select_seq(*POSE_DISAGREEMENT).sort(_POSE_KEYS)


def _of_positions(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per quantity, trimming, age, statistic and coordinate of a condition."""
    units = units_of(sums, sums, points=_TWO_TRUTH_POINT, columns=_TWO_TRUTH_SUMS, groups=draws.groups)
    estimates = pooled(units, draws.weights(units), column_means, method, scales=_TWO_TRUTH_SCALES)
    return estimates_by_point(estimates, units, TWO_TRUTHS, statistics=_VALUES)


def _of_poses(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per lag and quantity of a condition."""
    columns = ["n", "rotation_rad2", "translation_m2"]
    units = units_of(sums, sums, points=["lag"], columns=columns, groups=draws.groups)
    estimates = pooled(units, draws.weights(units), _two_truth_deviations, method, scales=["log"] * _POSES.height)
    return estimates_by_point(estimates, units, POSE_DISAGREEMENT, statistics=_POSES)


def _two_truth_deviations(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation in degrees and translation in metres, (2, points, ...), NaN where there are no pairs."""
    deviations = np.sqrt(column_means(sums))
    return np.asarray(np.stack([np.degrees(deviations[0]), deviations[1]]))


_TRACKER_DIFFERENCE_SUMS = ["n", "u", "v", "uu", "uv", "vv"]
_TRACKER_DIFFERENCE_POINT = ["other", "age"]
_ROWS = pl.DataFrame({"statistic": ["mean"] * 2 + ["central"] * 3, "coordinate": ["u", "v", "u", "uv", "v"]})
"""Statistic and coordinate of the rows of each point."""
_TRACKER_DIFFERENCE_SCALES = ("linear", "linear", "log", "linear", "log")


def tracker_differences(moments: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Mean and covariance of the differences of every two trackers, by age.

    `moments`: tables of all scenes, schema `BETWEEN_TRACKERS`. Returns: schema `TRACKER_DIFFERENCES`, sorted.
    Without rows where no two trackers had tracks of the same corner. Raises as `condition_table`.
    """
    conditions = by_condition(moments, BETWEEN_TRACKERS, "between trackers")
    order = [*POOLED, "other", "statistic", "age", "coordinate"]
    return condition_table(conditions, TRACKER_DIFFERENCES, _tracker_difference_rows, sampling).sort(order)


def _tracker_difference_rows(moments: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per other tracker, age, statistic and coordinate of a condition."""
    sums = moments.with_columns_seq(**ABOUT_ZERO)
    units = units_of(
        sums, sums, points=_TRACKER_DIFFERENCE_POINT, columns=_TRACKER_DIFFERENCE_SUMS, groups=draws.groups
    )
    weights = draws.weights(units)
    estimates = pooled(units, weights, _statistics, method, scales=_TRACKER_DIFFERENCE_SCALES)
    rows = estimates_by_point(estimates, units, TRACKER_DIFFERENCES, statistics=_ROWS)
    strict = pooled(units, weights, _statistics, _corrected(method, units.points), scales=_TRACKER_DIFFERENCE_SCALES)
    nonzero = (strict.low > 0.0) | (strict.high < 0.0)
    means = pl.when(pl.col("statistic") == "mean").then(pl.Series(nonzero.ravel()))
    units_of_rows = pl.col("statistic").replace_strict(UNITS)
    return rows.with_columns_seq(unit=units_of_rows, established=means).drop_nulls("value")


def _corrected(method: Method, points: pl.DataFrame) -> Method:
    """Bonferroni's level for both coordinates and all ages of two trackers."""
    n_ages = points["age"].n_unique()
    return Method(method.kind, 1.0 - (1.0 - method.level) / (2.0 * max(n_ages, 1)))


def _statistics(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means and central covariance, (5, points, ...), of the sums of `_SUMS`; NaN where there are none."""
    n, u, v, uu, uv, vv = sums
    count = np.where(n > 0, n, np.nan)
    mean_u, mean_v = u / count, v / count
    pairs = ((uu, mean_u * mean_u), (uv, mean_u * mean_v), (vv, mean_v * mean_v))
    freedom = np.where(n > 1, n - 1, np.nan)
    central = [(product - count * of_means) / freedom for product, of_means in pairs]
    return np.stack([mean_u, mean_v, *central])


_FITTED_NOISE_SUMS = ["n", "squares_u", "freedom_u", "squares_v", "freedom_v", "squares", "freedom"]
_COORDINATES = ("u", "v", "both")
_FITTED_NOISE_POINT = ["measure", "trimming", "length_low"]


def fitted_noise_table(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Standard deviation of the noise of one coordinate, by length of the track and for all lengths together.

    `sums`: tables of all scenes, schema `FITTED_NOISE`. Returns: schema `TRIANGULATED_NOISE`, sorted. Without rows
    unless true positions are triangulated. Raises as `condition_table`.
    """
    conditions = by_condition(sums, FITTED_NOISE, "fitted noise")
    order = [*POOLED, "measure", "trimming", "length_low", "coordinate"]
    return condition_table(conditions, TRIANGULATED_NOISE, _fitted_noise_rows, sampling).sort(order)


def _fitted_noise_rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per measure, trimming, class of lengths and coordinate of a condition."""
    together = sums.with_columns_seq(length_low=pl.lit(0, dtype=pl.UInt32))  # sorts before all classes
    both = pl.concat([together, sums])
    units = units_of(both, both, points=_FITTED_NOISE_POINT, columns=_FITTED_NOISE_SUMS, groups=draws.groups)
    sizes = np.stack([units.sums[..., place].T for place in (2, 4, 6)])
    estimates = pooled(
        units, draws.weights(units), _fitted_noise_deviations, method, scales=["log"] * len(_COORDINATES), sizes=sizes
    )
    statistics = pl.DataFrame({"coordinate": _COORDINATES})
    rows = estimates_by_point(estimates, units, TRIANGULATED_NOISE, value="sigma_px", statistics=statistics)
    highest = {low: high for low, high in LENGTHS if high is not None}
    low = pl.col("length_low")
    high = low.replace_strict(highest, default=None, return_dtype=pl.Int64)
    with_sigma = rows.drop_nulls("sigma_px")
    return with_sigma.with_columns_seq(length_low=low.replace({0: None}), length_high=high)


def _fitted_noise_deviations(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviations in u, in v and of both, (3, points, ...), NaN where there are no degrees of freedom."""
    squares, freedom = sums[1::2], sums[2::2]
    return np.asarray(np.sqrt(squares / np.where(freedom > 0, freedom, np.nan)))
