"""Whether covariances that trackers predict for their own observations are right, and whether they are of use.

- right: NEES is certainly as near to 1 as `ALIKE` allows, whatever share of the squared errors the truth explains.
- of use: with one factor, they describe errors of other scenes better than one sigma for all.

Of n errors of a scene, with sums of squares E, px^2, and D, of the Mahalanobis distance, the gain is
g = log sigma^2 - log s - mean log |C| / 2 + (E / sigma^2 - D / s) / (2 n) (gain). sigma^2 = E / (2 n) and
s = D / (2 n) are those of the other scenes; of all other groups, where scenes are not independent. Mean errors are
taken as zero.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimates_by_point, units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, Statistics, column_means, pooled
from tracknoise.inference.units import Units, by_number
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Tables, by_condition
from tracknoise.tables.enumerations import Verdict
from tracknoise.tables.findings_schema import OWN_COVARIANCES
from tracknoise.tables.schema import COVARIANCE_SUMS
from tracknoise.tables.trust import explained_share

ALIKE = 1.1
"""Errors that are certainly not this many times as large, or as small, as predicted agree with a covariance."""
LEAST_GAIN = 0.01
"""A gain that is certainly below this is of no use, nat per error."""

_COVERAGE = ("inside_50", "inside_90", "inside_95", "inside_99")
_COLUMNS = ("n", *_COVERAGE, "squares", "log_det", "px2", "impossible")
_POINT = ("trimming", "axis", "at")
_SORTED = [*POOLED, "covariance", "trimming", "quantity", "axis", "at"]


def are_right(low: float | None, high: float | None, of_truth: float | None = 0.0) -> Verdict:
    """Whether covariances are right, by the bounds of NEES; undecided without any.

    `of_truth`: largest share of the squared errors that are those of the truth; None where it is not bounded.
    """
    if low is None or high is None:
        return Verdict.undecided
    least = 0.0 if of_truth is None else low * (1.0 - of_truth)
    if least > ALIKE**-2 and high < ALIKE**2:
        return Verdict.yes
    return Verdict.no if least > 1.0 or high < 1.0 else Verdict.undecided


def are_of_use(low: float | None, high: float | None) -> Verdict:
    """Whether covariances tell which errors are large, by the bounds of the gain; undecided without any."""
    if low is None or high is None:
        return Verdict.undecided
    if high < LEAST_GAIN:  # also what is above 0 by rounding alone, where all covariances are equal
        return Verdict.no
    return Verdict.yes if low > 0.0 else Verdict.undecided


def own_covariances(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Coverage, NEES (by age too), gain and the share that is not positive definite, of every predicted covariance.

    `sums`: tables of all scenes, schema `COVARIANCE_SUMS`. Returns: schema `OWN_COVARIANCES`, sorted. Raises as
    `condition_table`.
    """
    conditions = by_condition(sums, COVARIANCE_SUMS, "sums of covariances")
    return condition_table(conditions, OWN_COVARIANCES, _rows, sampling).sort(_SORTED)


def allowing_for_truth(rows: pl.DataFrame, trust: pl.DataFrame) -> pl.DataFrame:
    """The same table, where covariances are too small only if errors of the truth cannot make them look so.

    `rows`: schema `OWN_COVARIANCES`. `trust`: schema `TRUST`.
    """
    judged = rows.filter(pl.col("at").is_null(), quantity="nees")
    shares = {tracker: explained_share(trust, tracker) for tracker in judged["tracker"].unique()}
    verdicts = [are_right(low, high, shares[of]) for low, high, of in judged.select("low", "high", "tracker").rows()]
    kind = OWN_COVARIANCES["verdict"]
    others = rows.join(judged, on=_SORTED, how="anti", nulls_equal=True)
    return pl.concat([others, judged.with_columns(pl.Series("verdict", map(str, verdicts), dtype=kind))]).sort(_SORTED)


def _rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """Rows of every covariance of a condition."""
    parts = []
    for (name,), part in sums.partition_by("covariance", as_dict=True, maintain_order=True).items():
        of_all, by_age = part.filter(pl.col("at").is_null()), part.filter(pl.col("at").is_not_null())
        made = [_of_all(of_all, draws, method)]
        if by_age.height:
            units = units_of(by_age, by_age, points=_POINT, columns=("n", "squares"), groups=draws.groups)
            made.append(_estimates(units, {"nees": "log"}, lambda part: 0.5 * column_means(part), draws, method))
        named = [table.with_columns(covariance=pl.lit(name, dtype=pl.String)) for table in made]
        parts += [table.cast({key: OWN_COVARIANCES[key] for key in table.columns}) for table in named]
    return _with_verdicts(pl.concat(parts, how="diagonal"))


def _of_all(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    units = units_of(sums, sums, points=["trimming"], columns=_COLUMNS, groups=draws.groups)
    names = {**{name.replace("inside", "coverage"): "logit" for name in _COVERAGE}, "nees": "log"}
    found = [
        _estimates(units, names, _shares_and_nees, draws, method),
        _estimates(_every(units), {"impossible": "logit"}, column_means, draws, method),
    ]
    if (gains := _gains(units)) is not None:
        found.append(_estimates(gains, {"gain": "linear"}, column_means, draws, method))
    nothing = {"axis": pl.lit(None, dtype=pl.String), "at": pl.lit(None, dtype=pl.Int64)}
    return pl.concat(found).with_columns(**nothing)


def _shares_and_nees(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of sums (columns, ...) in the order of `_COLUMNS`."""
    means = column_means(sums)
    return np.concatenate([means[: len(_COVERAGE)], 0.5 * means[len(_COVERAGE)][None]])


def _every(units: Units) -> Units:
    """Counts of all predicted covariances, and of those that are impossible."""
    impossible = units.sums[..., _COLUMNS.index("impossible")]
    return replace(units, sums=np.stack([units.sums[..., 0] + impossible, impossible], axis=-1))


def _gains(units: Units) -> Units | None:
    """Counts and sums of the gains of each unit by (gain); None where there is nothing to fit to."""
    number = units.scene_group[units.scene]
    groups = by_number(number, units.sums)
    others = (groups.sum(axis=0) - groups)[number]
    n, squares, log_det, px2 = (units.sums[..., _COLUMNS.index(name)] for name in ("n", "squares", "log_det", "px2"))
    learned, fits, lengths = (others[..., _COLUMNS.index(name)] for name in ("n", "squares", "px2"))
    with np.errstate(divide="ignore", invalid="ignore"):
        factor, variance = fits / (2.0 * learned), lengths / (2.0 * learned)
        gain = n * np.log(variance / factor) - 0.5 * log_det + 0.5 * (px2 / variance - squares / factor)
    gain = np.where(n > 0, gain, 0.0)
    if not np.isfinite(gain).all():
        return None
    return replace(units, sums=np.stack([n, gain], axis=-1))


def _estimates(
    units: Units, scales: Mapping[str, str], statistics: Statistics, draws: Draws, method: Method
) -> pl.DataFrame:
    """One row per statistic, named by `scales`, and point."""
    found = pooled(units, draws.weights(units), statistics, method, scales=list(scales.values()))
    return estimates_by_point(found, units, OWN_COVARIANCES, statistics=pl.DataFrame({"quantity": list(scales)}))


def _with_verdicts(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows that have a value, with the verdicts on those of all ages together."""
    known = rows.drop_nulls("value")
    decide = {"nees": are_right, "gain": are_of_use}
    bounds: Sequence[tuple[str, int | None, float | None, float | None]] = known.select(
        "quantity", "at", "low", "high"
    ).rows()
    verdicts = [
        str(decide[quantity](low, high)) if at is None and quantity in decide else None
        for quantity, at, low, high in bounds
    ]
    return known.with_columns(pl.Series("verdict", verdicts, dtype=OWN_COVARIANCES["verdict"]))
