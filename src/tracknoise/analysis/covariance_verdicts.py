"""Whether covariances that trackers predict for their own observations are right in size, shape and order.

- size: NEES is certainly as near to 1 as `ALIKE` allows, whatever share of the squared errors the truth explains.
- shape: whitened errors are certainly as large along as across, and in axes turned by 45 degrees, in the image, along
  the axes of the covariances, and along the motion. Circles are right only if errors look Gaussian, too: those of
  ellipses whose axes change have heavier tails, and nothing else tells them from circles.
- ranking: errors whose predicted variance is above the geometric mean of their scene are larger than the others.

Beside these, covariances are of use if with one factor they describe errors of other scenes better than one sigma.

Of n errors of a scene, with sums of squares E, px^2, and D, of the Mahalanobis distance, the gain is
g = log sigma^2 - log s - mean log |C| / 2 + (E / sigma^2 - D / s) / (2 n) (gain). sigma^2 = E / (2 n) and
s = D / (2 n) are those of the other scenes; of all other groups, where scenes are not independent. Mean errors are
taken as zero.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

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
from tracknoise.tables.findings_schema import INTERVAL_COLUMNS
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import ESTIMATED_OF_N, OF_CONDITION, Constants, Rows, RunTable, by_quantity, same
from tracknoise.tables.schema import COVARIANCE_FRAMES, COVARIANCE_SUMS, TRIMMING, VERDICT
from tracknoise.tables.schema import POOLED as CONDITIONS
from tracknoise.tables.trust import AssessedTruth


def _own_covariances() -> Rows:
    names: dict[str, tuple[str, Constants]] = {
        **{f"coverage_{level}": ("covariance_coverage", {"of": f"{level} %"}) for level in (50, 90, 95, 99)},
        "nees": ("covariance_nees", {}),
        "shape": ("covariance_shape", {"of": "worst"}),
        **{
            f"shape_{frame}_{name}": ("covariance_shape", {"of": f"{frame}, {name}"})
            for frame in COVARIANCE_FRAMES
            for name in ("along", "turned")
        },
        "elongation": ("covariance_elongation", {}),
        "fourth": ("covariance_fourth_moment", {}),
        "ranking": ("covariance_ranking", {}),
        "gain": ("covariance_gain", {}),
        "impossible": ("impossible_covariances", {}),
    }
    values = by_quantity(names, ESTIMATED_OF_N | same("verdict"), of=None)
    keys = {**OF_CONDITION, **same("trimming", "axis", "at"), "part": "covariance"}
    return Rows("own covariances", keys, values)


OWN_COVARIANCES = RunTable(
    "own_covariances",
    {
        **CONDITIONS,
        "covariance": pl.String,
        "trimming": TRIMMING,
        "quantity": pl.String,
        "axis": pl.String,
        "at": pl.Int64,
        "n": pl.Int64,
        "value": pl.Float64,
        "verdict": VERDICT,
        **INTERVAL_COLUMNS,
    },
    _own_covariances(),
    title="whether trackers' own covariances are right",
    quantities={
        "covariance_coverage": Quantity(
            "share", "Share of the errors inside the region of a level that the tracker's own covariances claim."
        ),
        "covariance_nees": Quantity(
            "1",
            "Mean of the squared Mahalanobis distance over 2. Of all ages together, the factor by which the tracker's "
            "own covariances would have to be multiplied; the verdict says whether they are right in size.",
        ),
        "covariance_shape": Quantity(
            "1",
            "Size of errors whitened by the tracker's own covariances, along one axis over that across it, in axes of "
            "the image, of the covariances, or of the motion, and in axes turned by 45 degrees. The worst has the "
            "verdict.",
        ),
        "covariance_elongation": Quantity(
            "1", "Mean difference of the eigenvalues of the tracker's own covariances over their sum: 0 for circles."
        ),
        "covariance_fourth_moment": Quantity(
            "1", "Fourth moment of the Mahalanobis distance over that of Gaussian errors with the same second moment."
        ),
        "covariance_ranking": Quantity(
            "1",
            "Mean length of errors that the tracker's own covariances predict to be large, over that of the others. "
            "The verdict says whether they tell which errors are large.",
        ),
        "covariance_gain": Quantity(
            "nat",
            "Gain of the tracker's own covariances, times one factor, over one sigma for all, per error. Both are "
            "fitted to other scenes. The verdict says whether they describe errors better.",
        ),
        "impossible_covariances": Quantity(
            "share", "Share of the tracker's own covariances that are not positive definite."
        ),
    },
)
"""Whether covariances that a tracker predicts are right: see `tracknoise.analysis.covariance_verdicts`.

covariance is the name in the columns ``quality_<name>_uu`` of the observations. axis and at are null for all ages
together. n counts errors. The verdict says of `nees` whether the covariances are right in size, of `shape` whether in
shape, of `ranking` whether they tell which errors are large, and of `gain` whether they are better than one sigma.
"""

ALIKE = 1.1
"""Errors that are certainly not this many times as large, or as small, as predicted agree with a covariance."""
LEAST_GAIN = 0.01
"""A gain that is certainly below this is of no use, nat per error."""

_COVERAGE = ("inside_50", "inside_90", "inside_95", "inside_99")
_COLUMNS = tuple(name for name, kind in COVARIANCE_SUMS.items() if kind == pl.Float64)
SHAPES = tuple(f"shape_{frame}_{name}" for frame in COVARIANCE_FRAMES for name in ("along", "turned"))
"""Ratios of the size of whitened errors along two axes, in the axes of a frame, and in axes turned by 45 degrees."""
_ROUND, _ELLIPSES = 0.02, 0.1
"""Mean elongation up to which covariances have no axes of their own, and from which they are ellipses."""
_PEAKED = 1.05
"""Mean fourth power of the distance over that of a Gaussian: ellipses of 1.4 to 1 have as much with changing axes."""
_SAME = 1e-9
"""Below 1, the largest share of the second moment along one axis."""
_POINT = ("trimming", "axis", "at")
_SORTED = [*POOLED, "covariance", "trimming", "quantity", "axis", "at"]


def are_right(low: float | None, high: float | None, of_truth: float | None = 0.0) -> Verdict:
    """Whether covariances are right in size, by the bounds of NEES; undecided without any.

    `of_truth`: largest share of the squared errors that are those of the truth; None where it is not bounded.
    """
    if low is None or high is None:
        return Verdict.undecided
    least = 0.0 if of_truth is None else low * (1.0 - of_truth)
    if least > ALIKE**-2 and high < ALIKE**2:
        return Verdict.yes
    return Verdict.no if least > 1.0 or high < 1.0 else Verdict.undecided


def have_right_shape(
    ratios: Sequence[tuple[float | None, float | None]], *, are_known: bool, of_truth: float | None = 0.0
) -> Verdict:
    """Whether covariances have the right shape, by bounds of the ratios of `SHAPES`.

    `are_known`: whether axes of the errors that no frame shows are excluded; `of_truth`: as that of `are_right`.
    """
    if not ratios or any(low is None or high is None for low, high in ratios):
        return Verdict.undecided
    # share of the second moment by which one axis exceeds the other; errors of the truth may add or take their own
    lows, highs = (np.tanh(np.log(np.array(bounds, dtype=np.float64))) for bounds in zip(*ratios, strict=True))
    least, allowed = 1.0 if of_truth is None else of_truth, np.tanh(np.log(ALIKE**2))
    if (lows - least > -allowed).all() and (highs + least < allowed).all():
        return Verdict.yes if are_known else Verdict.undecided
    return Verdict.no if (lows > least).any() or (highs < -least).any() else Verdict.undecided


def rank_errors(value: float, low: float | None, high: float | None, of_truth: float | None = 0.0) -> Verdict:
    """Whether covariances tell which errors are large, by the ratio of errors predicted as large to the others.

    Without bounds, a ratio of 1 is that of covariances that are all of one size. `of_truth`: as that of `are_right`.
    """
    if low is None or high is None:
        return Verdict.no if value == 1.0 else Verdict.undecided
    most = 1.0 if of_truth is None else 1.0 + (ALIKE - 1.0) * (1.0 - of_truth)
    if high < most:
        return Verdict.no
    return Verdict.yes if low > 1.0 else Verdict.undecided


def are_of_use(low: float | None, high: float | None) -> Verdict:
    """Whether covariances describe errors better than one sigma, by the bounds of the gain; undecided without any."""
    if low is None or high is None:
        return Verdict.undecided
    if high < LEAST_GAIN:  # also what is above 0 by rounding alone, where all covariances are equal
        return Verdict.no
    return Verdict.yes if low > 0.0 else Verdict.undecided


def own_covariances(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Coverage, NEES (by age too), shape, ranking, gain and impossible ones, of every predicted covariance.

    `sums`: tables of all scenes, schema `COVARIANCE_SUMS`. Returns: schema `OWN_COVARIANCES`, sorted. Raises as
    `condition_table`.
    """
    conditions = by_condition(sums, COVARIANCE_SUMS, "sums of covariances")
    return condition_table(conditions, OWN_COVARIANCES, _rows, sampling).sort(_SORTED)


def allowing_for_truth(rows: pl.DataFrame, trust: pl.DataFrame) -> pl.DataFrame:
    """The same table, where covariances are wrong only if errors of the truth cannot make them look so.

    `rows`: schema `OWN_COVARIANCES`. `trust`: schema `TRUST`.
    """
    key = [*POOLED, "covariance", "trimming"]
    judged = [
        _with_verdicts(part, AssessedTruth(trust).explained_share(part["tracker"][0]))
        for part in rows.partition_by(key, maintain_order=True)
    ]
    return pl.concat([rows.clear(), *judged]).sort(_SORTED)


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
    narrow = replace(method, level=1.0 - (1.0 - method.level) / len(SHAPES))
    rows = [
        _estimates(units, names, _shares_and_nees, draws, method),
        _estimates(units, dict.fromkeys(SHAPES, "log"), _shape_ratios, draws, narrow),
        _estimates(_peaks(units), {"fourth": "log"}, column_means, draws, method),
        _estimates(units, {"elongation": "linear"}, _elongation, draws, method),
        _estimates(units, {"ranking": "log"}, _ranking, draws, method),
        _estimates(_every(units), {"impossible": "logit"}, column_means, draws, method),
    ]
    if (gains := _gains(units)) is not None:
        rows.append(_estimates(gains, {"gain": "linear"}, column_means, draws, method))
    nothing = {"axis": pl.lit(None, dtype=pl.String), "at": pl.lit(None, dtype=pl.Int64)}
    return pl.concat(rows).with_columns(**nothing)


def _shares_and_nees(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of sums (columns, ...) in the order of `_COLUMNS`."""
    means = column_means(sums[: len(_COVERAGE) + 2])
    return np.concatenate([means[: len(_COVERAGE)], 0.5 * means[len(_COVERAGE)][None]])


def _column(sums: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """Sums of a column, of sums (columns, ...) in the order of `_COLUMNS`."""
    return np.asarray(sums[_COLUMNS.index(name)])


def _shape_ratios(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """The ratios of `SHAPES`; NaN where a frame has no axes."""
    ratios = []
    is_round = _elongation(sums)[0] < _ROUND
    for frame in COVARIANCE_FRAMES:
        total = _column(sums, f"{frame}_total")
        positive = np.where((total > 0.0) & ~(is_round & (frame == "own")), total, np.nan)
        for name in ("along", "turned"):
            share = np.clip(_column(sums, f"{frame}_{name}") / positive, -1.0 + _SAME, 1.0 - _SAME)
            ratios.append(np.exp(np.arctanh(share)))
    return np.stack(ratios)


def _elongation(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    n = _column(sums, "n")
    return np.asarray(_column(sums, "elongation") / np.where(n > 0, n, np.nan))[None]


def _ranking(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean length of errors predicted as large, over that of the others; 1 where all covariances have one size."""
    large, small = _column(sums, "n_large"), _column(sums, "n_small")
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = _column(sums, "large_px") / large / (_column(sums, "small_px") / small)
    nothing = (large + small == 0.0) & (_column(sums, "n") > 0)
    return np.where(nothing, 1.0, np.where((large > 0) & (small > 0), ratio, np.nan))[None]


def _peaks(units: Units) -> Units:
    """Counts, and mean fourth powers of the distance over those of a Gaussian with the size of the unit."""
    n, squares, fourth = (units.sums[..., _COLUMNS.index(name)] for name in ("n", "squares", "fourth"))
    peaked = n * np.divide(n * fourth, 2.0 * squares**2, out=np.zeros_like(n), where=squares > 0)
    return replace(units, sums=np.stack([n, peaked], axis=-1))


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
    estimates = pooled(units, draws.weights(units), statistics, method, scales=list(scales.values()))
    return estimates_by_point(estimates, units, OWN_COVARIANCES, statistics=pl.DataFrame({"quantity": list(scales)}))


def _with_verdicts(rows: pl.DataFrame, of_truth: float | None = 0.0) -> pl.DataFrame:
    """Rows of one condition, with the verdicts on those of all ages together."""
    return pl.concat(
        _judged(part, of_truth) for part in rows.drop_nulls("value").partition_by("covariance", "trimming")
    )


def _judged(rows: pl.DataFrame, of_truth: float | None) -> pl.DataFrame:
    every = rows.filter(pl.col("at").is_null(), pl.col("quantity") != "shape")
    found = {row["quantity"]: row for row in every.to_dicts()}
    bounds = {name: (row["low"], row["high"]) for name, row in found.items()}
    verdicts = {}
    if "nees" in found:
        verdicts["nees"] = are_right(*bounds["nees"], of_truth)
    if "gain" in found:
        verdicts["gain"] = are_of_use(*bounds["gain"])
    if "ranking" in found:
        verdicts["ranking"] = rank_errors(found["ranking"]["value"], *bounds["ranking"], of_truth)
    shapes = [name for name in SHAPES if name in found]
    shape = pl.DataFrame(schema=rows.schema)
    if shapes:
        peak = bounds["fourth"][1]
        are_known = found["elongation"]["value"] >= _ELLIPSES or (peak is not None and peak < _PEAKED)
        worst = worst_shape(found)
        verdicts["shape"] = have_right_shape([bounds[name] for name in shapes], are_known=are_known, of_truth=of_truth)
        shape = rows.filter(pl.col("at").is_null(), quantity=worst).with_columns(quantity=pl.lit("shape"))
    others = rows.filter(~(pl.col("at").is_null() & (pl.col("quantity") == "shape")))
    made = pl.concat([others, shape])
    judged = pl.col("quantity").replace_strict({name: str(verdict) for name, verdict in verdicts.items()}, default=None)
    kind = OWN_COVARIANCES["verdict"]
    return made.with_columns(verdict=pl.when(pl.col("at").is_null()).then(judged).cast(kind))


def _deviation(low: float | None, high: float | None) -> float:
    """By how much a ratio certainly differs from 1, as logarithm; negative where it may not."""
    return -np.inf if low is None or high is None else max(np.log(low), -np.log(high))


def worst_shape(rows: Mapping[str, Mapping[str, Any]]) -> str | None:
    """Which of `SHAPES` differs most certainly from 1, of rows by quantity; None where there is none."""
    shapes = [name for name in SHAPES if name in rows]
    return max(shapes, key=lambda name: _deviation(rows[name]["low"], rows[name]["high"]), default=None)
