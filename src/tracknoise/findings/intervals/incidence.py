"""Competing risks: the share of tracks that have ended by each cause, with bounds.

The estimate is that of Aalen and Johansen (1978). A track that ends at lifetime L by one cause can no longer end by
another. Kaplan-Meier curves of single causes ignore this, and add up to more than all tracks. Which tracks are at risk
is stated in `tracknoise.statistics.tracks.survival`.

Source: O. Aalen, S. Johansen, Scandinavian Journal of Statistics 5 (1978).
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.intervals.condition_table import USUAL, Sampling, condition_table, estimated
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of
from tracknoise.statistics.conditions import Tables, by_condition
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.tracks.survival import kaplan_meier
from tracknoise.tables.findings_schema import INCIDENCE
from tracknoise.tables.schema import BY_CAUSE, CAUSES, ENDS, check, empty

_COLUMNS = ["n_censored", *BY_CAUSE]


def incidence_table(ends: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Cumulative incidence of every cause of ending, in every condition, with intervals.

    Parameters
    ----------
    ends
        Tables of all scenes, schema `ENDS`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `INCIDENCE`, sorted. Conditions whose tracker does not report causes have no row. Bounds are on the logit
        scale. They are null where the incidence is 0 or 1, and in conditions of too few units.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(ends, ENDS, "ends")
    table = condition_table(conditions, INCIDENCE, _rows, sampling)
    table = table.with_columns_seq(pl.col("incidence", "low", "high").fill_nan(None))
    return check(table.sort(*POOLED, "cause", "lifetime"), INCIDENCE, "incidence")


def cumulative_incidence(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of tracks that have ended by each cause up to each lifetime (Aalen and Johansen).

    Parameters
    ----------
    sums : (1 + causes, lifetimes, ...)
        Tracks that were censored, and that ended by each cause, at each lifetime, ascending.

    Returns
    -------
    (causes, lifetimes, ...) float64
        Constant where no track is at risk. Together with the Kaplan-Meier survival it adds up to 1.
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
    found = pooled(units, draws.weights(units), cumulative_incidence, method, scales=scales, sizes=sizes)
    labels = pl.DataFrame({"cause": CAUSES}).join(units.points, how="cross")
    return estimated(labels, found, units, INCIDENCE, value="incidence")
