"""How errors behave in time: white, a random walk, a drift, or saturating, by condition.

The second moment about zero is fitted over the ages by (growth) and, where that fails, by (saturating). The changes of
errors from one frame that the tracker saw to the next are correlated by (autocorrelation) of
`tracknoise.statistics.changes`. A verdict agrees with the curve, with the autocorrelations at lags 1 to
`LAGS`, and with the curves of long-lived tracks (`tracknoise.analysis.growth_verdict`).

Errors are zero at birth (or in the key frame) by construction. What is measured at age k is n_k - n_0, where n_0 is the
error of the detected position. If n_0 is independent of the later n_k and has the same variance s^2, the second moment
is 2 s^2 from the first age on. `white_px` is the root of the constant, here sqrt(2) s. It is s if the first position
has no error, as with the template of a tracker, or with the oracle.

The moments at all ages come from the same tracks. Each age is weighted by how much its second moment varies when scenes
are resampled. A twentieth of the moment is added to this spread, so that no single age dominates.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import FOURTH_SUMS, additive, units_of, with_fourth
from tracknoise.analysis.curve_intervals import CHANGE_SUMS, correlated
from tracknoise.analysis.growth_models import (
    OWN,
    TERM_UNITS,
    TERMS,
    Ages,
    Agreement,
    GrowthFit,
    SaturatingFit,
    SceneCurves,
    UnitSums,
    growth_ratio,
    polynomial,
    range_tried,
    saturating,
    scene_curves,
)
from tracknoise.analysis.growth_verdict import Changes, Growth, Loss, behaves, grows, loss
from tracknoise.analysis.scene_spread import OF_SCENES
from tracknoise.analysis.truth_shares import NO_KEY_FRAMES, anchored
from tracknoise.inference.bootstrap import Draws, draws_by_dataset, leave_one_out
from tracknoise.inference.conventions import KIND_OF_INTERVAL, LEVEL, IntervalKind
from tracknoise.inference.coverage import are_heavy
from tracknoise.inference.estimates import Estimate, EstimateArray
from tracknoise.inference.intervals import Method, Statistics, pooled_by
from tracknoise.inference.units import NO_GROUPS, JoinedScenes, Resampled, SceneGroups, Units
from tracknoise.statistics.definitions import LAGS, POOLED, REFERENCE_AGE
from tracknoise.statistics.grouping import (
    Tables,
    TablesByCondition,
    by_condition,
    group_rows,
    in_chunks,
    reduce_each,
    scenes_by_dataset,
)
from tracknoise.tables.defaults import MARGIN, MIN_FEATURES
from tracknoise.tables.enumerations import Aspect, Behaviour, Verdict, Weighting
from tracknoise.tables.findings_schema import BEHAVIOUR, INTERVAL_KIND, RESAMPLED
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import ALL_ROWS, OF_CONDITION, Constants, Rows, RunTable, Value, bounds_of, same
from tracknoise.tables.schema import (
    ASPECT_BLOCKS,
    ASPECTS,
    BLOCKS,
    INCREMENTS,
    MOMENTS,
    ORIGIN,
    SEQUENCE,
    TRIMMING,
    VERDICT,
    check,
)
from tracknoise.tables.schema import POOLED as CONDITIONS
from tracknoise.words import only

_GROWTH = (
    *("white_px", "walk_px_per_sqrt_frame", "drift_px_per_frame"),
    *("saturating_white_px", "saturating_px", "saturating_frames"),
    *("white_px_geometric", "walk_px_per_sqrt_frame_geometric", "drift_px_per_frame_geometric"),
    *("autocorrelation", *(f"autocorrelation_{lag}" for lag in range(2, LAGS + 1))),
    "growth_ratio",
)


def _growth() -> Rows:
    made = same("level", "resampled") | {"interval": "kind"}
    values = [Value("growth", "growth", carried={"n": "n_ages", **same("n_scenes", "verdict", "why"), **made})]
    ends = {"low": "growth_ratio_low", "high": "growth_ratio_high", "at_low": "growth_from", "at_high": "growth_to"}
    of_ratio = {**ends, "verdict": "grows", **same("level", "resampled", "coverage")}
    values.append(Value("growth_ratio", "growth_ratio", carried=of_ratio, always=True))

    def bounded(quantity: str, column: str, labels: Constants, *, kind: str = "kind") -> Value:
        bounds = bounds_of(column) | same("resampled") | {"interval": kind}
        return Value(quantity, column, labels, carried=bounds, always=column == "autocorrelation")

    for quantity, column in (
        ("white", "white_px"),
        ("random_walk", "walk_px_per_sqrt_frame"),
        ("drift", "drift_px_per_frame"),
    ):
        values.append(bounded(quantity, column, {"weighting": Weighting.features}))
        values.append(bounded(quantity, f"{column}_geometric", {"weighting": Weighting.geometric}))
    for quantity in ("saturating_white", "saturating"):
        values.append(bounded(quantity, f"{quantity}_px", {"weighting": Weighting.features}))
    values.append(bounded("saturating_frames", "saturating_frames", {"weighting": Weighting.features}))
    for lag in range(1, LAGS + 1):
        column = "autocorrelation" if lag == 1 else f"autocorrelation_{lag}"
        values.append(bounded("autocorrelation", column, {"axis": "lag", "at": lag}, kind="autocorrelation_kind"))
    keys = {**OF_CONDITION, **same("trimming", "coordinate")}
    return Rows("growth", keys, values)


TIME_STRUCTURE = RunTable(
    "time_structure",
    {
        **CONDITIONS,
        "trimming": TRIMMING,
        "coordinate": pl.String,
        "n_ages": pl.Int32,
        "n_scenes": pl.Int32,
        **{f"{name}{bound}": pl.Float64 for name in _GROWTH for bound in ("", "_low", "_high")},
        "kind": INTERVAL_KIND,
        "autocorrelation_kind": INTERVAL_KIND,
        "level": pl.Float64,
        "resampled": RESAMPLED,
        "coverage": pl.Float64,
        "growth_from": pl.Int64,
        "growth_to": pl.Int64,
        "grows": VERDICT,
        "verdict": BEHAVIOUR,
        "why": pl.String,
    },
    _growth(),
    title="error growth",
    verdicts=ALL_ROWS,
    quantities={
        "growth": Quantity("1", "Verdict on how the second moment grows with age: by its established parts."),
        "growth_ratio": Quantity(
            "1", "RMS at age 10 over that at the first age, of the tracks that live to age 10; scenes count alike."
        ),
        "white": Quantity("px", "Part of the error that is the same at every age."),
        "random_walk": Quantity("px per sqrt(frame)", "Part whose variance grows linearly with age."),
        "drift": Quantity("px per frame", "Part that grows linearly with age."),
        "saturating_white": Quantity("px", "Constant part of the saturating model."),
        "saturating": Quantity("px", "Size to which the saturating part grows."),
        "saturating_frames": Quantity("frames", "Time constant of the saturating part."),
    },
)
"""How errors grow with age: the second moment about zero fitted as white^2 + walk^2 k + drift^2 k^2.

white_px, walk_px_per_sqrt_frame and drift_px_per_frame are of all errors together, so that every feature counts alike.
Those with `_geometric` are geometric means over scenes: the sizes in a scene of typical scale. saturating_white_px,
saturating_px and saturating_frames are white, size and tau of white^2 + size^2 (1 - exp(-k / tau)), and null where the
polynomial agrees with the data. autocorrelation is that of the changes at one step of the tracker, about zero;
autocorrelation_2 to autocorrelation_5 are those at 2 to 5 steps. coordinate is u or v. white_px is the root of the
constant term: sqrt(2) times the noise of a single position, if the first position is as noisy as the others.

growth_ratio is the RMS at age growth_to over that at growth_from, of the tracks that live to age 10 where these are
known, with scenes counted alike. coverage is the share of intervals of geometric means that contain the true value
where single errors have a heavy tail, and null elsewhere. `grows` says whether growth_ratio is above 1 + margin, and
`verdict` how errors grow: by the established part that grows, white if there is none and errors do not grow.
"""

Array = NDArray[np.float64]
_Fit = Callable[[Array], Array]
Sizes = Mapping[str, Estimate]
"""By term: white, saturating_white and saturating (px), walk, drift (`TERM_UNITS`), and time_constant (frames)."""

COVERED_IF_HEAVY = 0.90
"""Share of 95 % intervals of geometric sizes that hold the truth if the scales of tracks lead to errors of Student's
distribution with 3 degrees of freedom (`python -m benchmarks.validity.planted_coverage --worlds "tracks t3"`).
"""
MIN_AGES = 4
"""Fewest ages of a fit."""
GROWTH_SUMS = ("n", "uu", "vv")
"""What a fit needs of each age: the count, and the sums of squared errors."""
_MIN_UNITS = 4
_ROUNDING = 1e-9


def fit_ages(units: Units, *, min_features: int) -> NDArray[np.bool_]:
    """Which points are fitted: up to the first that rests on too few errors, or too few units.

    `units`: columns `GROWTH_SUMS`.
    """
    n = units.sums[..., 0]
    enough = (n.sum(axis=0) >= min_features) & (np.count_nonzero(n, axis=0) >= min(_MIN_UNITS, len(n)))
    return np.logical_and.accumulate(enough)


def pooled_sizes(units: Units, weights: Array, ages: NDArray[np.bool_], method: Method) -> tuple[Sizes, Sizes]:
    """Sizes of (growth) of u and of v, of all errors together.

    Shapes: weights (draws, units), ages (points,). `units`: columns `GROWTH_SUMS`.
    """

    def fits(since: Array, weight: Array) -> _Fit:
        fit = GrowthFit.at(since, weight)
        return lambda second: np.concatenate([fit.free(second), fit.bounded(second), fit.alone(second)])

    u, v = _pooled(units, weights, ages, method, fits)
    return _of_terms(u), _of_terms(v)


def pooled_saturating(units: Units, weights: Array, ages: NDArray[np.bool_], method: Method) -> tuple[Sizes, Sizes]:
    """Sizes and time constant of (saturating) of u and of v, of all errors together."""
    tried = range_tried(units.points["since"].to_numpy().astype(np.float64)[ages])

    def named(estimates: list[Estimate]) -> Sizes:
        white, size, constant = estimates
        return {
            "saturating_white": _root(white, white, unit="px"),
            "saturating": _root(size, size, unit="px"),
            "time_constant": _between(replace(constant, unit="frames"), *tried),
        }

    def fits(since: Array, weight: Array) -> _Fit:
        return SaturatingFit.at(since, weight).fit

    u, v = _pooled(units, weights, ages, method, fits)
    return named(u), named(v)


def mean_drift(moments: pl.DataFrame) -> tuple[float, float]:
    """Mean error of u and of v per frame, px: what fits the mean errors of all ages, as a line through zero.

    `moments`: columns since, n, u and v; at least one row.
    """
    since, n, u, v = (moments[name].to_numpy().astype(np.float64) for name in ("since", "n", "u", "v"))
    total = (n * since**2).sum()
    return float((since * u).sum() / total), float((since * v).sum() / total)


def _pooled(
    units: Units, weights: Array, ages: NDArray[np.bool_], method: Method, fits: Callable[[Array, Array], _Fit]
) -> tuple[list[Estimate], list[Estimate]]:
    """What the fits at some ages with some weights find of u and of v, with intervals."""
    part = replace(units, sums=units.sums[:, ages], points=units.points[np.flatnonzero(ages)])
    since = part.points["since"].to_numpy().astype(np.float64)
    second, weight = _observed(part)
    both = [fits(since, of_axis) for of_axis in weight]

    def statistics(sums: Array) -> Array:
        """Of u, then of v, (statistics, 1, ...); ages without data in a draw are taken as observed."""
        drawn = _second(sums)
        whole = second.reshape(*second.shape, *[1] * (drawn.ndim - 2))
        filled = np.where(np.isnan(drawn), whole, drawn)
        return np.concatenate([fit(of_axis) for fit, of_axis in zip(both, filled, strict=True)])[:, None]

    bounds = _of_differing_scenes(part, weights, statistics, method)
    estimates = [bounds.at(row) for row in range(len(bounds.value))]
    return estimates[: len(estimates) // 2], estimates[len(estimates) // 2 :]


def _of_differing_scenes(units: Units, weights: Array, statistics: Statistics, method: Method) -> EstimateArray:
    """Bounds of coefficients. Those that are above 0 contain the bounds of a mean over scenes that differ by factors.

    Resampling a few scenes does not show how far the largest of all scenes lie above the others; the logarithms of
    their own coefficients do (`tracknoise.inference.jackknife`).
    """
    differing = method.kind == IntervalKind.bca and units.resampled != Resampled.blocks
    methods = [method, Method(IntervalKind.student, method.level)] if differing else [method]
    sizes = units.sums[..., 0].sum(axis=1)[None]
    bounds, *others = pooled_by(methods, units, weights, statistics, scales="log", sizes=sizes)
    if not others:
        return bounds
    skewed = others[0]
    positive = (bounds.low > 0) & ~np.isnan(skewed.low + skewed.high)
    return replace(
        bounds,
        low=np.where(positive, np.minimum(bounds.low, skewed.low), bounds.low),
        high=np.where(positive, np.maximum(bounds.high, skewed.high), bounds.high),
    )


def _observed(units: Units) -> tuple[Array, Array]:
    """Second moments of u and v at each age, and their weights, (2, ages) each."""
    whole = _second(units.sums.sum(axis=0).T)
    without = _second(np.moveaxis(leave_one_out(units.sums), 0, -1).swapaxes(0, 1))
    influence = np.nan_to_num(without - whole[..., None])
    variance = (influence**2).sum(axis=-1) if units.resampled else np.zeros_like(whole)  # of the jackknife
    least = 1e-6 * whole.max(axis=1, keepdims=True)  # a second moment of zero must not decide alone
    return whole, 1 / (variance + (OWN * whole) ** 2 + least**2)


def _second(sums: Array) -> Array:
    """(Phi) of u and of v from `GROWTH_SUMS`, (2, ages, ...), NaN where undefined."""
    n, uu, vv = sums
    return np.stack([uu, vv]) / np.where(n > 0, n, np.nan)


def _of_terms(estimates: list[Estimate]) -> Sizes:
    """Sizes from free and bounded coefficients, and from those of terms that would explain everything alone."""
    free, bounded, alone = (estimates[first : first + len(TERMS)] for first in range(0, 3 * len(TERMS), len(TERMS)))
    return {
        term: _at_most(_root(one, other, unit=unit), _length(whole.high))
        for term, one, other, whole, unit in zip(TERMS, bounded, free, alone, TERM_UNITS, strict=True)
    }


def _at_most(size: Estimate, most: float | None) -> Estimate:
    """The same with an upper bound that is not above that of all errors.

    A coefficient of one scene can be near 0 where another term takes its part, so that the logarithms of coefficients
    differ more than scenes do.
    """
    if size.value is None or size.high is None or most is None:
        return size
    return replace(size, high=max(min(size.high, most), size.value))


def _root(bounded: Estimate, free: Estimate, *, unit: str) -> Estimate:
    """Root of a coefficient of the bounded fit, with bounds that contain those of either fit.

    Where the true coefficient is 0, the bounded fit shifts the other terms, and its draws do not show that.
    """
    low = None if bounded.low is None or free.low is None else min(bounded.low, free.low)
    high = None if bounded.high is None or free.high is None else max(bounded.high, free.high)
    return replace(bounded, value=_length(bounded.value), low=_length(low), high=_length(high), unit=unit)


def _between(estimate: Estimate, least: float, most: float) -> Estimate:
    """The same without bounds that are not between two limits."""
    low = estimate.low if estimate.above(least * (1 + _ROUNDING)) else None
    high = estimate.high if estimate.below(most * (1 - _ROUNDING)) else None
    return replace(estimate, low=low, high=high)


def _length(square: float | None) -> float | None:
    return None if square is None else float(max(square, 0.0) ** 0.5)


_LIVED = ["at_least", "since"]


@dataclass(frozen=True, slots=True)
class GrowthUnits:
    """Sums of the same units: of errors, of changes, and of long-lived tracks.

    Attributes
    ----------
    errors
        Points by `since`; columns `GROWTH_SUMS`.
    changes : (units, lags, columns)
        Columns `CHANGE_SUMS`; 0 where there are none.
    lived : (units, ages, columns)
        Columns `GROWTH_SUMS`, by the age that tracks live to.
    fourth : (units, ages, 2)
        Sums of the fourth powers of u and v, where units are scenes.
    """

    errors: Units
    changes: Array
    lived: Mapping[int, Array]
    fourth: Array | None = None

    def of(self, coordinate: int) -> UnitSums:
        """Sums of one coordinate, u or v."""
        lagged, squares = (
            self.changes[..., CHANGE_SUMS.index(f"{name}_{'uv'[coordinate] * 2}")] for name in ("lagged", "squares")
        )
        sums = self.errors.sums
        n_units = len(sums) // max(len(self.errors.scenes), 1)
        scene = np.repeat(np.arange(len(self.errors.scenes)), n_units)
        return UnitSums(sums[..., 0], sums[..., 1 + coordinate], lagged, squares, scene)

    def lived_of(self, coordinate: int) -> dict[int, tuple[Array, Array]]:
        """Number of errors and sum of their squares of one coordinate, (units, ages), by the age tracks live to."""
        return {age: (sums[..., 0], sums[..., 1 + coordinate]) for age, sums in self.lived.items()}


def growth_units(
    scenes: pl.DataFrame,
    blocks: pl.DataFrame | None,
    changes: pl.DataFrame | None,
    lived: pl.DataFrame | None,
    lived_blocks: pl.DataFrame | None,
    groups: SceneGroups,
) -> GrowthUnits:
    """Sums of errors by unit, with those of changes and of long-lived tracks of the same units.

    `scenes, blocks`: of errors, by scene and by block: columns dataset, scene (and block), since and `GROWTH_SUMS`.
    `changes`: columns dataset, scene, block, lag and `CHANGE_SUMS`.
    """
    errors = units_of(scenes, blocks, points=["since"], columns=GROWTH_SUMS, groups=groups).across_groups()
    by_block = errors.resampled == Resampled.blocks
    of_changes = np.zeros((len(errors.sums), LAGS, len(CHANGE_SUMS)))
    if changes is not None:
        own = changes if by_block else None
        units = units_of(changes, own, points=["lag"], columns=CHANGE_SUMS, groups=groups)
        of_changes[:, units.points["lag"].to_numpy().astype(np.intp) - 1] = _aligned(units, errors)
    if lived is None or (by_block and lived_blocks is None):
        return GrowthUnits(errors, of_changes, {})
    units = units_of(lived, lived_blocks if by_block else None, points=_LIVED, columns=GROWTH_SUMS, groups=groups)
    fourth = None if by_block else units_of(scenes, points=["since"], columns=FOURTH_SUMS).sums
    return GrowthUnits(errors, of_changes, _by_age(units, errors), fourth)


def _aligned(units: Units, like: Units) -> Array:
    """Sums of units in the order of others; 0 for a scene that is missing."""
    each = len(units.sums) // max(len(units.scenes), 1)
    by_scene = units.sums.reshape(len(units.scenes), each, *units.sums.shape[1:])
    placed = np.zeros((len(like.scenes), *by_scene.shape[1:]))
    shared = [place for place, scene in enumerate(units.scenes) if scene in like.scenes]
    placed[[like.scenes.index(units.scenes[place]) for place in shared]] = by_scene[shared]
    return placed.reshape(-1, *units.sums.shape[1:])


def _by_age(units: Units, errors: Units) -> dict[int, Array]:
    """Sums of long-lived tracks at the ages of all errors, by the age that tracks live to."""
    aligned = _aligned(units, errors)
    ages = errors.points["since"].to_numpy()
    by_age: dict[int, Array] = {}
    for key, part in units.points.with_row_index("place").partition_by("at_least", as_dict=True).items():
        there = part.filter(pl.col("since").is_in(ages.tolist()))
        sums = np.zeros((len(aligned), len(ages), len(GROWTH_SUMS)))
        sums[:, np.searchsorted(ages, there["since"].to_numpy())] = aligned[:, there["place"].to_numpy()]
        by_age[int(key[0])] = sums
    return by_age


_DRAWS = 400
"""Draws of the fit of (saturating), which takes longer than that of the polynomial."""


def growth_fits(units: GrowthUnits, ages: Ages, weights: NDArray[np.float64], method: Method) -> tuple[Growth, Growth]:
    """Fit the growth of u and of v. Shapes: weights (draws, units)."""
    sizes = pooled_sizes(units.errors, weights, ages.fitted, method)
    curves = [scene_curves(units.of(axis)) for axis in (0, 1)]
    polynomials = [_known(units, *polynomial(curve, ages, method.level)) for curve in curves]
    refused = [agreement.refused for agreement, _ in polynomials]
    limits = pooled_saturating(units.errors, weights[:_DRAWS], ages.fitted, method) if any(refused) else ({}, {})
    u, v = (
        Growth(
            _ratio(units, ages, axis, curves[axis], method.level),
            {**sizes[axis], **(limits[axis] if refused[axis] else {})},
            polynomials[axis][1],
            polynomials[axis][0],
            saturating(curves[axis], ages) if refused[axis] else None,
            _loss(units, ages, axis),
            float(ages.since[ages.fitted].max()),
        )
        for axis in (0, 1)
    )
    return u, v


def _known(units: GrowthUnits, agreement: Agreement, sizes: Sizes) -> tuple[Agreement, Sizes]:
    """The same without bounds, and not refused, where nothing can be resampled."""
    if units.errors.resampled is not None:
        return agreement, sizes
    return replace(agreement, p=1.0), {term: Estimate(size.value) for term, size in sizes.items()}


def rise_ages(ages: Ages) -> tuple[float, float]:
    """The ages that (growth ratio) compares: the first, and the last that is fitted and not above the reference age."""
    since = ages.since[ages.fitted]
    return float(since[0]), float(since[since <= REFERENCE_AGE].max(initial=since[0]))


def _ratio(units: GrowthUnits, ages: Ages, axis: int, curves: SceneCurves, level: float) -> Estimate | None:
    """(growth ratio) of the tracks that live to the reference age, or of all where these are not known."""
    first, last = rise_ages(ages)
    if first == last:
        return None
    places = np.searchsorted(ages.since, [first, last])
    sums = units.of(axis)
    n, squares = units.lived_of(axis).get(REFERENCE_AGE, (sums.n, sums.squares))
    ratio = growth_ratio(n[:, places], squares[:, places], curves.own, level)
    return ratio if units.errors.resampled is not None else Estimate(ratio.value)


def _loss(units: GrowthUnits, ages: Ages, axis: int) -> Loss | None:
    if units.errors.resampled is None:
        return None
    sums, fourth = units.of(axis), None if units.fourth is None else units.fourth[..., axis]
    return loss(sums.n, sums.squares, ages.since, units.lived_of(axis), fourth)


_KEY = [*POOLED, "trimming"]
_PAIRS = [*ORIGIN, "block", "trimming", "lag"]
_OF_SCENE = [name for name in _PAIRS if name != "block"]
_COLUMNS = {
    "white": "white_px",
    "walk": "walk_px_per_sqrt_frame",
    "drift": "drift_px_per_frame",
    "saturating_white": "saturating_white_px",
    "saturating": "saturating_px",
    "time_constant": "saturating_frames",
}
_EVERY = pl.lit(value=True)
LONG_LIVED = pl.col("aspect") == Aspect.long_lived
"""Rows of `ASPECTS` that time structure needs."""


def time_structure(
    moments: Tables,
    increments: pl.DataFrame | Iterable[pl.DataFrame],
    *,
    blocks: Tables = (),
    aspects: Tables = (),
    aspect_blocks: Tables = (),
    groups: SceneGroups = NO_GROUPS,
    key_frames: Mapping[str, int] = NO_KEY_FRAMES,
    min_features: int = MIN_FEATURES,
    margin: float = MARGIN,
    kind: str = KIND_OF_INTERVAL,
    level: float = LEVEL,
    n_draws: int = 1000,
    seed: int = 0,
) -> pl.DataFrame:
    """How visible errors grow, by condition, trimming and coordinate, with intervals and a verdict.

    Parameters
    ----------
    moments, increments
        Of all scenes, `MOMENTS` and `INCREMENTS`.
    blocks
        Schema `BLOCKS`: what to resample in conditions of too few scenes. They have no bounds without, and no verdict.
    aspects
        Schema `ASPECTS`: the long-lived tracks, in the conditions that have them. Without them it is not checked
        whether the loss of tracks shapes the curve.
    aspect_blocks
        Schema `ASPECT_BLOCKS`: the same by block, for conditions of too few scenes.
    groups
        Groups of scenes that are not independent of each other (`tracknoise.inference.units.JoinedScenes`).
    key_frames
        Where a scan makes errors zero in one frame: that frame, by direction. Time is then the distance from it.
    min_features
        Ages are fitted up to the first at which all scenes together have fewer features than this.
    margin
        Growth of the RMS by less than this share counts as none.
    kind, level, n_draws, seed
        As in `tracknoise.analysis.curve_intervals.interval_table`. For what is fitted, `bca` takes the place of
        `student` (`Method.by_bootstrap`); columns `kind` and `autocorrelation_kind` say which was made. Geometric means
        over scenes always have Student's interval from the jackknife.

    Returns
    -------
    polars.DataFrame
        Schema `TIME_STRUCTURE`, sorted: a row for each condition and trimming that has visible errors, and coordinate.
        Where fewer than `MIN_AGES` ages can be fitted there are no numbers, and the verdict is undecided.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    errors = by_condition(moments, MOMENTS, "moments")
    scenes = scenes_by_dataset(errors.items())
    joined = JoinedScenes.of(scenes, groups)
    by_scene = _sums({key: with_fourth(part) for key, part in errors.items()}, key_frames, joined)
    by_block = _sums(by_condition(blocks, BLOCKS, "blocks"), key_frames, joined)
    chunks = in_chunks(increments, INCREMENTS, "increments")
    changes = reduce_each(chunks, INCREMENTS, "increments", _of_lags).partition_by(_KEY, as_dict=True)
    changes = {key: joined.rename(part, key[0]) for key, part in changes.items()}
    lived = _sums(by_condition(aspects, ASPECTS, "aspects", _long_lived), key_frames, joined, LONG_LIVED)
    lived_blocks = _sums(
        by_condition(aspect_blocks, ASPECT_BLOCKS, "blocks of aspects", _long_lived), key_frames, joined, LONG_LIVED
    )
    drawn = draws_by_dataset(joined.scenes(scenes), n_draws=n_draws, seed=seed, groups=joined.others)
    every: list[dict[str, Any]] = []
    for key, part in by_scene.items():
        sums = _Sums.of(part, *(table.get(key) for table in (changes, by_block, lived, lived_blocks)))
        rows = _rows(sums, drawn[key[0]], Method(kind, level), min_features, margin, key[_KEY.index("speed")])
        labels = {**dict(zip(_KEY, key, strict=True)), "level": level}
        names = part["scene"].unique().sort().to_list()
        of_groups = [{**row, "resampled": joined.resampled(row["resampled"], key[0], names)} for row in rows]
        every += [{**labels, **row} for row in of_groups]
    table = (
        pl.DataFrame(every, schema=dict(TIME_STRUCTURE))
        .with_columns_seq(pl.selectors.float().fill_nan(None))
        .sort(*_KEY, "coordinate")
    )
    return check(table, TIME_STRUCTURE, "time structure")


@dataclass(frozen=True, slots=True)
class _Sums:
    """Sums of a condition and trimming: of errors by scene and block, of changes, and of long-lived tracks.

    Ages are distances from where errors are zero. `mean_px_per_frame` is of u and of v.
    """

    scenes: pl.DataFrame
    blocks: pl.DataFrame | None
    changes: pl.DataFrame | None
    lived: pl.DataFrame | None
    lived_blocks: pl.DataFrame | None
    mean_px_per_frame: tuple[float, float]

    @classmethod
    def of(cls, scenes: pl.DataFrame, changes: pl.DataFrame | None, *others: pl.DataFrame | None) -> "_Sums":
        """Of tables by the side of the key frame that errors are on."""
        blocks, lived, lived_blocks = map(_apart, others)
        apart = scenes.with_columns_seq(pl.col("since").abs())
        return cls(apart, blocks, changes, lived, lived_blocks, mean_drift(scenes))


def _sums(
    moments: TablesByCondition, key_frames: Mapping[str, int], joined: JoinedScenes, chosen: pl.Expr = _EVERY
) -> dict[tuple[Any, ...], pl.DataFrame]:
    """Sums of each condition and trimming; what is added up in one place is of one scene, and in its order."""
    return {
        (*key, *trimming): sums
        for key, part in moments.items()
        for trimming, sums in additive(anchored(_joined(part.filter(chosen), joined, key[0]), key_frames))
        .partition_by("trimming", as_dict=True)
        .items()
    }


def _joined(moments: pl.DataFrame, joined: JoinedScenes, dataset: str) -> pl.DataFrame:
    """Moments with new names of scenes. Column measured keeps the names of the scenes, which are counted."""
    return joined.rename(moments.with_columns_seq(measured="scene"), dataset)


def lagged(increments: pl.DataFrame, few: pl.DataFrame) -> pl.DataFrame:
    """Rows of `INCREMENTS` of which (autocorrelation) is made: all that time structure needs.

    Parameters
    ----------
    increments
        Of any number of sequences, one after another.
    few
        Conditions of so few scenes that blocks are resampled. In others all blocks are added up, as block 0.
    """
    pairs = increments.filter(pl.col("lag") > 0)
    if few.is_empty():
        return _of_all_blocks(pairs)
    by_block, whole = (pairs.join(few, on=few.columns, how=how, maintain_order="left") for how in ("semi", "anti"))
    return pl.concat([by_block, _of_all_blocks(whole)])


def _of_all_blocks(pairs: pl.DataFrame) -> pl.DataFrame:
    """Sums over the blocks of each scene, as block 0; sequences stay in their order."""
    numbered = pairs.with_columns_seq(sequence=pl.struct(list(SEQUENCE)).rle_id())
    groups = group_rows(numbered, ["sequence", *_OF_SCENE])
    known = {name: pl.col(name) for name in (*_OF_SCENE, *CHANGE_SUMS)} | {"block": pl.lit(0)}
    columns = [known.get(name, pl.lit(None)).cast(kind).alias(name) for name, kind in INCREMENTS.items()]
    return groups.keys.hstack(groups.sums(pairs, CHANGE_SUMS)).select_seq(columns)


def _long_lived(aspects: pl.DataFrame) -> pl.DataFrame:
    return aspects.filter(LONG_LIVED)


def _rows(
    tables: _Sums, draws: Draws, method: Method, min_features: int, margin: float, step: int
) -> Iterator[dict[str, Any]]:
    """Rows of a condition and trimming, by the columns of `TIME_STRUCTURE`."""
    units = growth_units(tables.scenes, tables.blocks, tables.changes, tables.lived, tables.lived_blocks, draws.groups)
    errors, fitted = units.errors, fit_ages(units.errors, min_features=min_features)
    ages = Ages(errors.points["since"].to_numpy().astype(np.float64), fitted, step)
    related = _related(tables.changes, draws, method, resampled=errors.resampled is not None)
    made, n_ages = method.by_bootstrap(), int(np.count_nonzero(fitted))
    n_scenes = tables.scenes["measured"].n_unique()
    labels = {"n_ages": n_ages, "n_scenes": n_scenes, "resampled": errors.resampled, "kind": made.kind,
              "autocorrelation_kind": method.kind}  # fmt: skip
    usable = n_ages >= MIN_AGES and bool((errors.sums[:, fitted, 1:].sum(axis=0) > 0).all())
    fits = growth_fits(units, ages, draws.weights(errors), made) if usable else (None, None)
    for place, (coordinate, fit) in enumerate(zip("uv", fits, strict=True)):
        correlations = {f"autocorrelation{end}": row[place] for end, row in related.items()}
        if fit is None:
            few = f"{only(n_ages, 'age')} with enough errors; at least {MIN_AGES} are needed"
            why = few if n_ages < MIN_AGES else "all errors are zero at some age"
            row = {**_bounds(correlations), "grows": Verdict.undecided, "verdict": Behaviour.undecided, "why": why}
        else:
            changes = Changes(correlations.get("autocorrelation"), tables.mean_px_per_frame[place])
            verdict, why = behaves(fit, changes, margin)
            first, last = rise_ages(ages)
            row = {**_bounds({**correlations, **_named(fit)}), "verdict": verdict, "why": why,
                     "coverage": _covered(tables.scenes, coordinate, last, errors, made.level),
                     "grows": grows(fit.ratio, margin), "growth_from": first, "growth_to": last}  # fmt: skip
        yield {"coordinate": coordinate, **labels, **row}


def _covered(scenes: pl.DataFrame, coordinate: str, age: float, errors: Units, level: float) -> float | None:
    """`COVERED_IF_HEAVY` where single errors at an age have a heavy tail, and scenes are resampled; else None."""
    there = scenes.filter(since=age)
    if errors.resampled not in OF_SCENES or level != LEVEL:
        return None
    n, squares, absolute = (
        there[name].to_numpy().astype(np.float64)[None] for name in ("n", coordinate * 2, f"abs_{coordinate}")
    )
    count = np.maximum(n, 1.0)
    return COVERED_IF_HEAVY if are_heavy(squares / count, absolute / count, n, level=level)[0] else None


def _named(fit: Growth) -> dict[str, Estimate]:
    """Sizes by their columns."""
    geometric = {f"{_COLUMNS[term]}_geometric": size for term, size in fit.geometric.items()}
    ratio = {} if fit.ratio is None else {"growth_ratio": fit.ratio}
    return {_COLUMNS[term]: size for term, size in fit.sizes.items()} | geometric | ratio


def _bounds(estimates: Mapping[str, Estimate]) -> dict[str, float | None]:
    """Values and bounds by their columns."""
    return {
        f"{name}{end}": getattr(estimate, which)
        for name, estimate in estimates.items()
        for end, which in (("", "value"), ("_low", "low"), ("_high", "high"))
    }


def _of_lags(increments: pl.DataFrame) -> pl.DataFrame:
    """Rows of `INCREMENTS` and columns that (autocorrelation) is made of."""
    return increments.filter(pl.col("lag") > 0).select_seq(*_PAIRS, *CHANGE_SUMS)


def _related(
    changes: pl.DataFrame | None, draws: Draws, method: Method, *, resampled: bool
) -> dict[str, tuple[Estimate, Estimate]]:
    """(autocorrelation) of u and of v by the end of the name of its column; if `resampled`, of blocks too."""
    if changes is None:
        return {}
    blocks = changes if resampled else None
    units = units_of(changes, blocks, points=["lag"], columns=CHANGE_SUMS, groups=draws.groups).across_groups()
    estimates = correlated(units, draws.weights(units), method)
    ends = ["" if lag == 1 else f"_{lag}" for lag in units.points["lag"]]
    return {end: (estimates.at(0, place), estimates.at(1, place)) for place, end in enumerate(ends)}


def _apart(moments: pl.DataFrame | None) -> pl.DataFrame | None:
    """Moments by how far they are from where errors are zero, before or after."""
    return None if moments is None else moments.with_columns_seq(pl.col("since").abs())
