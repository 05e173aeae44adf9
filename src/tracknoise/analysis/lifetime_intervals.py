"""Bounds of lifetimes, survival, outlier ratio, and the shares of tracks that end by each cause.

The lifetime that a share of the tracks exceeds is where the survival curve reaches that share. Its bounds are where the
bounds of the survival curve reach it (Brookmeyer and Crowley 1982). Lifetimes are whole frames, and so are these
quantiles and their bounds. Such intervals contain the true value more often than their level says. A restricted mean
has its interval on the logit scale of its share of the horizon.

The share of tracks that have ended by each cause is that of Aalen and Johansen (1978). A track that ends at lifetime L
by one cause can no longer end by another. Kaplan-Meier curves of single causes ignore this, and add up to more than all
tracks. Which tracks are at risk is stated in `tracknoise.inference.survival`.

Source: O. Aalen, S. Johansen, Scandinavian Journal of Statistics 5 (1978).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimated, units_of
from tracknoise.analysis.scene_spread import between_scenes, own_values, spread_on
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.estimates import EstimateArray
from tracknoise.inference.intervals import BetweenScenes, LabelledEstimates, Method, Statistics, pooled
from tracknoise.inference.survival import area_under, kaplan_meier
from tracknoise.inference.units import Units
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Tables, by_condition
from tracknoise.statistics.lifetimes import RESTRICTED
from tracknoise.statistics.prepared import block_of
from tracknoise.tables.findings_schema import CAUSE, INTERVAL_COLUMNS
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import ESTIMATED, OF_CONDITION, RunTable, one_number
from tracknoise.tables.schema import BY_CAUSE, CAUSES, ENDS, FAILURES, empty
from tracknoise.tables.schema import POOLED as CONDITIONS

INCIDENCE = RunTable(
    "incidence",
    {
        **CONDITIONS,
        "cause": CAUSE,
        "lifetime": pl.Int64,
        "incidence": pl.Float64,
        **INTERVAL_COLUMNS,
    },
    one_number("causes", "incidence", "incidence", {**OF_CONDITION, "part": "cause", "at": "lifetime"}, ESTIMATED),
    quantities={"incidence": Quantity("share", "Share of all tracks that a cause has ended up to this lifetime.")},
    without_truth=True,
)
"""Share of all tracks that have ended by a cause up to and including a lifetime: one row per cause and lifetime.

At every lifetime, the incidences of all causes and the survival of `LIFETIMES` add up to 1. Bounds are null where the
incidence is 0 or 1, or nothing can be resampled.
"""

QUANTILES: Mapping[str, float] = {
    "lower_quartile_lifetime": 0.75,
    "median_lifetime": 0.5,
    "upper_quartile_lifetime": 0.25,
}
"""Lifetimes by the share of the tracks that live longer."""
WHOLE_FRAMES = (*QUANTILES, "median_until_failure")
"""Lifetimes that are whole frames, and so are their bounds."""
SCALAR_UNITS: Mapping[str, str] = {
    "mean_lifetime": "frames",
    **dict.fromkeys(RESTRICTED, "frames"),
    **dict.fromkeys(WHOLE_FRAMES, "frames"),
    "survival": "share",
    "survival_until_failure": "share",
    "outlier_ratio": "share",
}
"""Statistics of this file and their units."""

_LABELS = {"statistic": pl.String, "axis": pl.String, "at": pl.Float64}
_ROUNDED = 1e-12  # the product that is exactly a half on paper may be rounded up


def lifetime_bounds(ends: pl.DataFrame, draws: Draws, method: Method, *, horizon: float) -> Iterator[LabelledEstimates]:
    """Means of lifetimes, survival beyond each lifetime, and the lifetimes that certain shares of the tracks exceed.

    Without those until failure where the tracker does not report causes. `ends`: columns of `ENDS`, rows of one
    condition.
    """
    curves = _CURVES if not ends[f"n_{FAILURES[0]}"].null_count() else {survival: _CURVES[survival]}
    counts = ends.with_columns_seq(n_failed=pl.sum_horizontal(f"n_{cause}" for cause in FAILURES))
    sums = ["n_ended", "n_censored", "n_failed"]
    units = units_of(counts, counts, points=["lifetime"], columns=sums, groups=draws.groups)
    weights, lifetimes = draws.weights(units), units.points["lifetime"].to_numpy().astype(np.float64)
    tracks = units.sums[..., :2].sum(axis=(1, 2))

    def mean_of(sums: NDArray[np.float64]) -> NDArray[np.float64]:
        return _mean(sums, lifetimes)

    mean = pooled(units, weights, mean_of, method, scales=["log"], sizes=tracks[None])
    between = between_scenes(units, mean_of, ["log"], mean)
    yield LabelledEstimates(_labels("mean_lifetime"), mean, units, between)
    sizes = np.broadcast_to(tracks, (len(lifetimes), len(tracks)))
    for survival_of, names in curves.items():
        restricted = partial(_restricted, survival_of, lifetimes, horizon)
        share = pooled(units, weights, restricted, method, scales=["logit"], sizes=tracks[None])
        mean = replace(share, **{name: horizon * getattr(share, name) for name in ("value", "low", "high")})
        between = _in_frames(between_scenes(units, restricted, ["logit"], share), horizon)
        between = replace(between, spread=spread_on(units, restricted, "log", level=share.level))
        yield LabelledEstimates(_labels(names.restricted_mean), mean, units, between)
        curve = pooled(units, weights, survival_of, method, scales=["logit"], sizes=sizes)
        yield LabelledEstimates(_labels(names.curve, lifetimes), _where_at_risk(curve, units), units)
        for name, left in names.quantiles.items():
            yield LabelledEstimates(_labels(name), _quantile(curve, lifetimes, left), units)


def outlier_bounds(frames: pl.DataFrame, draws: Draws, method: Method) -> Iterator[LabelledEstimates]:
    """Pooled outlier ratio: outliers over the features that were offered. None if outliers are not reported.

    `frames`: columns of `FRAME_COUNTS`, rows of one condition.
    """
    if frames["outliers"].null_count():
        return
    order, size = pl.int_range(pl.len()).over("scene"), pl.len().over("scene")
    blocks = frames.sort("scene", "frame").with_columns_seq(block=block_of(order, size))
    units = units_of(blocks, blocks, points=[], columns=["offered", "outliers"], groups=draws.groups)
    ratio = pooled(units, draws.weights(units), _ratio, method, scales=["logit"])
    between = _with_extremes(between_scenes(units, _smoothed, ["logit"], ratio), own_values(units, _ratio))
    yield LabelledEstimates(_labels("outlier_ratio"), ratio, units, between)


def survival(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Kaplan-Meier survival beyond each lifetime; constant where no track is at risk.

    Shapes: sums (2 or more, lifetimes, ...); returns (1, lifetimes, ...).
    """
    return kaplan_meier(sums[0], sums[1], axis=0).beyond[None]


def survival_until_failure(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same until failure: only the tracks in the third row of `sums` ended, the others were censored."""
    return kaplan_meier(sums[0], sums[1], n_events=sums[2], axis=0).beyond[None]


def _restricted(
    survival_of: Statistics, lifetimes: NDArray[np.float64], horizon: float, sums: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Restricted mean as a share of its horizon, which it cannot exceed, (1, 1, ...).

    Without a unit the follow-up can be shorter than the horizon: the curve keeps its last value.
    """
    area = area_under(np.moveaxis(survival_of(sums), 1, -1), lifetimes, horizon)
    return np.where(sums[:2].sum(axis=(0, 1)) > 0, area / horizon, np.nan)[:, None]


def first_reached(curve: NDArray[np.float64], lifetimes: NDArray[np.float64], share: float) -> float:
    """Shortest lifetime at which a survival curve (lifetimes,) is down to a share; NaN if it never is."""
    places = np.flatnonzero(curve <= share + _ROUNDED)
    return float(lifetimes[places[0]]) if len(places) else np.nan


def _labels(statistic: str, at: NDArray[np.float64] | None = None) -> pl.DataFrame:
    """One row, or one row per lifetime along the axis lifetime."""
    axis, places = (None, [None]) if at is None else ("lifetime", at)
    count = len(places)
    return pl.DataFrame({"statistic": [statistic] * count, "axis": [axis] * count, "at": places}, schema=_LABELS)


def _mean(sums: NDArray[np.float64], lifetimes: NDArray[np.float64]) -> NDArray[np.float64]:
    tracks = sums[:2].sum(axis=0)
    count = tracks.sum(axis=0)
    frames = np.tensordot(lifetimes, tracks, axes=1)
    return np.asarray(frames / np.where(count > 0, count, np.nan))[None, None]


def _where_at_risk(curve: EstimateArray, units: Units) -> EstimateArray:
    """The same survival without the longest lifetime, if no track was at risk there: none ended."""
    unknown = np.zeros(curve.value.shape, dtype=np.bool_)
    unknown[:, -1] = units.sums[:, -1, 0].sum() == 0
    value, low, high = (np.where(unknown, np.nan, values) for values in (curve.value, curve.low, curve.high))
    return replace(curve, value=value, low=low, high=high)


def _ratio(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    offered, outliers = sums
    return np.asarray(outliers / np.where(offered > 0, offered, np.nan))[None]


def _smoothed(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same with half an outlier more in a feature more, so that scenes without outliers have a logit."""
    offered, outliers = sums
    return np.asarray((outliers + 0.5) / np.where(offered > 0, offered + 1, np.nan))[None]


def _with_extremes(between: BetweenScenes, own: NDArray[np.float64]) -> BetweenScenes:
    """The same with the shares 0 and 1 within the bounds of the next scene, where any scene has them, (1, 1, scenes).

    Where most scenes have 0, or most have 1, it is not known how much scenes differ.
    """
    n_scenes = (~np.isnan(own)).sum(axis=-1)
    none, every = ((own == end).sum(axis=-1) for end in (0.0, 1.0))
    unknown = 2 * np.maximum(none, every) > n_scenes
    low = np.where((own == 0.0).any(axis=-1) & ~np.isnan(between.next_low), 0.0, between.next_low)
    high = np.where((own == 1.0).any(axis=-1) & ~np.isnan(between.next_high), 1.0, between.next_high)
    spread, low, high = (np.where(unknown, np.nan, values) for values in (between.spread, low, high))
    return replace(between, spread=spread, next_low=low, next_high=high)


def _in_frames(between: BetweenScenes, horizon: float) -> BetweenScenes:
    """Bounds of shares of a horizon as frames."""
    return replace(between, next_low=horizon * between.next_low, next_high=horizon * between.next_high)


def _quantile(curve: EstimateArray, lifetimes: NDArray[np.float64], share: float) -> EstimateArray:
    """Where a survival curve and its bounds reach a share."""
    value, low, high = (
        np.array([[first_reached(values[0], lifetimes, share)]]) for values in (curve.value, curve.low, curve.high)
    )
    n_units, n_scenes = curve.n_units[:, :1], curve.n_scenes[:, :1]
    return replace(curve, value=value, low=low, high=high, n_units=n_units, n_scenes=n_scenes)


@dataclass(frozen=True, slots=True)
class _Names:
    """Names of a survival curve and of the numbers that are read from it."""

    curve: str
    restricted_mean: str
    quantiles: Mapping[str, float]


_CURVES: Mapping[Statistics, _Names] = {
    survival: _Names("survival", "restricted_mean_lifetime", QUANTILES),
    survival_until_failure: _Names(
        "survival_until_failure", "restricted_mean_until_failure", {"median_until_failure": 0.5}
    ),
}
_COLUMNS = ["n_censored", *BY_CAUSE]


def incidence_table(ends: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Cumulative incidence of every cause of ending, in every condition, with intervals.

    `ends`: tables of all scenes, schema `ENDS`. Returns: schema `INCIDENCE`, sorted. Conditions whose tracker does
    not report causes have no row. Bounds are on the logit scale. They are null where the incidence is 0 or 1, and
    in conditions of too few units. Raises as `condition_table`.
    """
    conditions = by_condition(ends, ENDS, "ends")
    return condition_table(conditions, INCIDENCE, _rows, sampling).sort(*POOLED, "cause", "lifetime")


def cumulative_incidence(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of tracks that have ended by each cause up to each lifetime (Aalen and Johansen).

    Shapes: sums (1 + causes, lifetimes, ...); returns (causes, lifetimes, ...). Constant where no track is at risk.
    Together with the Kaplan-Meier survival it adds up to 1.
    """
    censored, ended = sums[0], sums[1:]
    at_risk, beyond = kaplan_meier(ended.sum(axis=0), censored, axis=0)
    before = np.concatenate([np.ones_like(beyond[:1]), beyond[:-1]])
    return np.asarray(np.cumsum(before * ended / np.where(at_risk > 0, at_risk, 1.0), axis=1))


def _rows(ends: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per cause and lifetime of a condition; none if causes are not reported."""
    if ends[_COLUMNS[-1]].null_count():
        return empty(INCIDENCE)
    units = units_of(ends, ends, points=["lifetime"], columns=_COLUMNS, groups=draws.groups)
    tracks = units.sums.sum(axis=(1, 2))
    sizes = np.broadcast_to(tracks, (len(units.points), len(tracks)))
    scales = ["logit"] * len(CAUSES)
    estimates = pooled(units, draws.weights(units), cumulative_incidence, method, scales=scales, sizes=sizes)
    labels = pl.DataFrame({"cause": CAUSES}).join(units.points, how="cross")
    return estimated(labels, estimates, units, INCIDENCE, value="incidence")
