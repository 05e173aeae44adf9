"""Intervals of the changes of errors from one frame that the tracker saw to the next.

Their moments by age are those of errors, with an aspect of their own; (autocorrelation) by lag is that of
`tracknoise.statistics.errors.increments`. Its intervals are made on Fisher's scale, on which a correlation has no
limits.
"""

from collections.abc import Iterator

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.estimate import EstimateArray
from tracknoise.findings.sampling.bounds import LabelledEstimates, Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.groups import NO_GROUPS, SceneGroups
from tracknoise.findings.sampling.units import Units, units_of
from tracknoise.statistics.conditions import TablesByCondition
from tracknoise.tables.enumerations import Aspect, Axis, Population
from tracknoise.tables.schema import ASPECT, AXIS, ORIGIN, POPULATION

AUTOCORRELATION = "autocorrelation"
CHANGE_SUMS = ("n", "lagged_uu", "squares_uu", "lagged_vv", "squares_vv")
"""What (autocorrelation) is made of: the count of pairs of changes, and the sums of their products and squares."""
_MOMENTS = ("mean_u", "mean_v", "m_uu", "m_uv", "m_vv")
_POINT = ["trimming", "lag"]


def moments_of_changes(increments: TablesByCondition) -> TablesByCondition:
    """Rows of lag 0 of `INCREMENTS` as moments of an aspect, but for absolute values, which count as 0."""
    return {key: _as_moments(part) for key, part in increments.items()}


def _as_moments(increments: pl.DataFrame) -> pl.DataFrame:
    return increments.filter(pl.col("lag") == 0).select_seq(
        pl.lit(Aspect.change, dtype=ASPECT).alias("aspect"),
        pl.lit(None, dtype=pl.UInt32).alias("at_least"),
        *ORIGIN,
        pl.lit(Population.visible, dtype=POPULATION).alias("population"),
        "trimming",
        pl.lit(Axis.age, dtype=AXIS).alias("axis"),
        pl.col("age").alias("at"),
        "n",
        *_MOMENTS,
        mean_abs_u=pl.lit(0.0),
        mean_abs_v=pl.lit(0.0),
    )


def correlated_changes(increments: TablesByCondition) -> TablesByCondition:
    """Rows of `INCREMENTS` of which (autocorrelation) is made, of the conditions that have any."""
    pairs = {key: part.filter(pl.col("lag") > 0) for key, part in increments.items()}
    return {key: part for key, part in pairs.items() if not part.is_empty()}


def correlation_bounds(
    increments: pl.DataFrame, draws: Draws, method: Method, groups: SceneGroups = NO_GROUPS
) -> Iterator[LabelledEstimates]:
    """(autocorrelation) at every lag, of u and of v.

    Parameters
    ----------
    increments
        Rows of one condition: what `correlated_changes` made.
    draws
        Of all scenes of the dataset.
    method
        How to make intervals.
    groups
        Groups of scenes that are not independent of each other.
    """
    units = units_of(increments, increments, points=_POINT, columns=CHANGE_SUMS, groups=groups)
    coordinates = pl.DataFrame({"coordinate": ["u", "v"]})
    labels = coordinates.join(units.points.rename({"lag": "at"}), how="cross").with_columns_seq(
        statistic=pl.lit(AUTOCORRELATION),
        axis=pl.lit("lag"),
        aspect=pl.lit(Aspect.change, dtype=ASPECT),
        population=pl.lit(Population.visible),
    )
    yield LabelledEstimates(labels, correlated(units, draws.weights(units), method), units)


def correlated(units: Units, weights: NDArray[np.float64], method: Method) -> EstimateArray:
    """(autocorrelation) of u and of v, with intervals; what a unit weighs in it are the squares of its changes.

    Parameters
    ----------
    units
        Columns `CHANGE_SUMS`.
    weights : (draws, units)
        How often each unit was drawn.
    method
        How to make intervals.
    """
    squares = np.stack([units.sums[..., CHANGE_SUMS.index(name)].T for name in ("squares_uu", "squares_vv")])
    return pooled(units, weights, _autocorrelation, method, scales=["fisher"] * 2, sizes=squares)


def _autocorrelation(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of u and of v, (2, points, ...)."""
    _, lagged_u, squares_u, lagged_v, squares_v = sums
    squares = np.stack([squares_u, squares_v])
    return np.asarray(np.stack([lagged_u, lagged_v]) / np.where(squares > 0, squares, np.nan))
