"""Bounds of lifetimes, survival and outlier ratio of one condition.

The lifetime that a share of the tracks exceeds is where the survival curve reaches that share. Its bounds are where the
bounds of the survival curve reach it (Brookmeyer and Crowley 1982). Lifetimes are whole frames: a value or a bound
between two frames is rounded up. Such intervals are too coarse to contain the true value as often as their level says.
The table therefore has interpolated lifetimes too, where the line between the survival of successive frames reaches the
share (the median of a life table).
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.estimate import EstimateArray
from tracknoise.findings.intervals.between_scenes import between_scenes
from tracknoise.findings.sampling.bounds import LabelledEstimates, Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.groups import NO_GROUPS, SceneGroups
from tracknoise.findings.sampling.units import Units, units_of
from tracknoise.statistics.blocks import block_of

QUANTILES: Mapping[str, float] = {
    "lower_quartile_lifetime": 0.75,
    "median_lifetime": 0.5,
    "upper_quartile_lifetime": 0.25,
}
"""Lifetimes by the share of the tracks that live longer."""
INTERPOLATED = "interpolated_"
"""What the name of such a lifetime begins with where it is interpolated between whole frames."""
SCALAR_UNITS: Mapping[str, str] = {
    "mean_lifetime": "frames",
    **{prefix + name: "frames" for prefix in ("", INTERPOLATED) for name in QUANTILES},
    "survival": "share",
    "outlier_ratio": "share",
}
"""Statistics of this file and their units."""

_ROUNDED = 1e-12  # the product that is exactly a half on paper may be rounded up


def lifetime_bounds(
    ends: pl.DataFrame, draws: Draws, method: Method, groups: SceneGroups = NO_GROUPS
) -> Iterator[LabelledEstimates]:
    """Mean lifetime, survival beyond each lifetime, and the lifetimes that certain shares of the tracks exceed.

    Parameters
    ----------
    ends
        Columns of `ENDS`, rows of one condition.
    draws
        Of all scenes of the dataset.
    method
        How to make intervals.
    groups
        Groups of scenes that are not independent of each other.
    """
    whole = ends.select("dataset", "scene", "block", "lifetime", "n_ended", "n_censored")
    units = units_of(whole, whole, points=["lifetime"], columns=["n_ended", "n_censored"], groups=groups)
    weights, lifetimes = draws.weights(units), units.points["lifetime"].to_numpy().astype(np.float64)
    tracks = units.sums.sum(axis=(1, 2))

    def mean_of(sums: NDArray[np.float64]) -> NDArray[np.float64]:
        return _mean(sums, lifetimes)

    mean = pooled(units, weights, mean_of, method, scales=["log"], sizes=tracks[None])
    between = between_scenes(units, mean_of, ["log"], mean)
    yield LabelledEstimates(_labels("mean_lifetime"), mean, units, between)
    sizes = np.broadcast_to(tracks, (len(lifetimes), len(tracks)))
    curve = pooled(units, weights, survival, method, scales=["logit"], sizes=sizes)
    yield LabelledEstimates(_labels("survival", lifetimes), _where_at_risk(curve, units), units)
    for name, share in QUANTILES.items():
        for prefix, reached in (("", first_reached), (INTERPOLATED, interpolated)):
            yield LabelledEstimates(_labels(prefix + name), _quantile(curve, lifetimes, share, reached), units)


def outlier_bounds(
    frames: pl.DataFrame, draws: Draws, method: Method, groups: SceneGroups = NO_GROUPS
) -> Iterator[LabelledEstimates]:
    """Pooled outlier ratio: outliers over the features that were offered.

    Parameters
    ----------
    frames
        Columns of `FRAME_COUNTS`, rows of one condition.
    draws, method, groups
        As in `lifetime_bounds`.
    """
    order, size = pl.int_range(pl.len()).over("scene"), pl.len().over("scene")
    blocks = frames.sort("scene", "frame").with_columns(block=block_of(order, size))
    units = units_of(blocks, blocks, points=[], columns=["offered", "outliers"], groups=groups)
    ratio = pooled(units, draws.weights(units), _ratio, method, scales=["logit"])
    yield LabelledEstimates(_labels("outlier_ratio"), ratio, units, between_scenes(units, _smoothed, ["logit"], ratio))


def survival(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Kaplan-Meier survival, as `tracknoise.statistics.lifetimes` has it; constant where no track is at risk.

    Parameters
    ----------
    sums : (2, lifetimes, ...)
        Tracks that ended, and that were censored, at each lifetime.

    Returns
    -------
    (1, lifetimes, ...) float64
    """
    ended, censored = sums
    at_risk = np.cumsum((ended + censored)[::-1], axis=0)[::-1] - censored
    stays = 1 - ended / np.where(at_risk > 0, at_risk, 1.0)
    return np.asarray(np.cumprod(stays, axis=0))[None]


def first_reached(curve: NDArray[np.float64], lifetimes: NDArray[np.float64], share: float) -> float:
    """Shortest lifetime at which a survival curve (lifetimes,) is down to a share; NaN if it never is."""
    places = np.flatnonzero(curve <= share + _ROUNDED)
    return float(lifetimes[places[0]]) if len(places) else np.nan


def interpolated(curve: NDArray[np.float64], lifetimes: NDArray[np.float64], share: float) -> float:
    """Where the line between a survival curve at whole frames is down to a share; NaN if it never is.

    Parameters
    ----------
    curve : (lifetimes,)
        Survival beyond each lifetime, or a bound of it; it is 1 before the first, and stays where it was at whole
        frames that are not among the lifetimes. Places before the one where it is down, and which have none, as
        bounds of a survival of 1, count as 1.
    lifetimes : (lifetimes,)
        Whole frames, ascending.
    share
        Between 0 and 1.
    """
    places = np.flatnonzero(curve <= share + _ROUNDED)
    if not len(places):
        return np.nan
    place = places[0]
    before = curve[place - 1] if place else 1.0
    height = (1.0 if np.isnan(before) else before) - curve[place]
    return float(lifetimes[place] - max(share - curve[place], 0.0) / height)


def _labels(statistic: str, at: NDArray[np.float64] | None = None) -> pl.DataFrame:
    """One row, or one row per lifetime along the axis lifetime."""
    if at is None:
        return pl.DataFrame({"statistic": statistic, "axis": None, "at": None})
    return pl.DataFrame({"statistic": statistic, "axis": "lifetime", "at": at})


def _mean(sums: NDArray[np.float64], lifetimes: NDArray[np.float64]) -> NDArray[np.float64]:
    found = sums.sum(axis=0)
    count = found.sum(axis=0)
    frames = np.tensordot(lifetimes, found, axes=1)
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


def _quantile(
    curve: EstimateArray,
    lifetimes: NDArray[np.float64],
    share: float,
    reached: Callable[[NDArray[np.float64], NDArray[np.float64], float], float],
) -> EstimateArray:
    """Where a survival curve and its bounds reach a share."""
    value, low, high = (
        np.array([[reached(values[0], lifetimes, share)]]) for values in (curve.value, curve.low, curve.high)
    )
    n_units, n_scenes = curve.n_units[:, :1], curve.n_scenes[:, :1]
    return replace(curve, value=value, low=low, high=high, n_units=n_units, n_scenes=n_scenes)
