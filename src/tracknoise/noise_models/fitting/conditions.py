"""Conditions at run time: whether white noise and walk depend on what a front end knows while it runs.

For each covariate, a factor is fitted to changes of errors (`tracknoise.noise_models.fitting.factor_cells`). What it
gains over a constant factor is measured on scenes that were left out, those of a group together. Of the covariates
whose gain exceeds `LEAST_GAIN` nat per change, with an interval that does not reach 0, the best one is kept.

A second covariate is kept by the same rule, if it gains as much beyond the first one. Both factors are then fitted
together, to sums by the classes of both covariates.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.groups import NO_GROUPS, SceneGroups
from tracknoise.findings.sampling.jackknife import student_interval
from tracknoise.noise_models.fitting.factor_cells import Cells, Knots
from tracknoise.noise_models.fitting.independent import LEAST_GROUPS, group_numbers
from tracknoise.noise_models.model import Factor, Interval
from tracknoise.statistics.noise.covariates import PER_OCTAVE

if TYPE_CHECKING:
    from tracknoise.noise_models.fitting.components import FittedComponents

Array = NDArray[np.float64]

LEAST_GAIN = 0.01
"""Nat per change."""
_FOLDS = 10


def conditions_of(
    covariates: pl.DataFrame,
    pairs: pl.DataFrame,
    fitted: "FittedComponents",
    *,
    groups: SceneGroups = NO_GROUPS,
    level: float,
) -> tuple[Factor, ...]:
    """The factors that are worth keeping: none, one or two.

    Parameters
    ----------
    covariates
        Schema `NOISE_COVARIATES`, of one tracker and speed.
    pairs
        Schema `NOISE_PAIRS`, of the same; without rows where they are not known.
    fitted
        The components.
    groups
        Of scenes that are not independent of each other.
    level
        Of the intervals of gains.
    """
    first = _best(candidates(covariates, fitted, groups=groups, level=level))
    if first is None:
        return ()
    added = {both[1].of: both for both in second_candidates(pairs, first, fitted, groups=groups, level=level)}
    second = _best([both[1] for both in added.values()])
    return (first,) if second is None else added[second.of]


def candidates(
    covariates: pl.DataFrame, fitted: "FittedComponents", *, groups: SceneGroups = NO_GROUPS, level: float
) -> list[Factor]:
    """The factor by each covariate that varies, with what it gains; see `conditions_of` for the parameters."""
    found = []
    for (name,), part in _parts(covariates, ["covariate"], fitted, groups):
        cells = Cells.of(part, [("before", "now")], PER_OCTAVE, _sizes(fitted))
        knots = cells.knots([str(name)])
        if len(knots[0].places) > 1:
            gain = _gain(cells, knots, [knots[0].constant], level)
            found.append(_factor(knots[0], cells.fitted(knots), gain))
    return found


def second_candidates(
    pairs: pl.DataFrame, first: Factor, fitted: "FittedComponents", *, groups: SceneGroups = NO_GROUPS, level: float
) -> list[tuple[Factor, Factor]]:
    """Both factors, fitted together, for each other covariate, with what it gains beyond the first one.

    Parameters
    ----------
    pairs, fitted, groups, level
        As in `conditions_of`.
    first
        The factor that is kept.
    """
    found = []
    with_first = pairs.filter((pl.col("first") == first.of) | (pl.col("second") == first.of))
    for names, part in _parts(with_first, ["first", "second"], fitted, groups):
        cells = Cells.of(part, [("first_before", "first_now"), ("second_before", "second_now")], 1, _sizes(fitted))
        knots = cells.knots([str(name) for name in names])
        own, other = (0, 1) if names[0] == first.of else (1, 0)
        if len(knots[own].places) > 1 and len(knots[other].places) > 1:
            alone = [one if place == own else one.constant for place, one in enumerate(knots)]
            gain = _gain(cells, knots, alone, level)
            logs = np.split(cells.fitted(knots), [len(knots[0].places)])
            found.append((_factor(knots[own], logs[own], first.gain), _factor(knots[other], logs[other], gain)))
    return found


def _parts(
    table: pl.DataFrame, names: list[str], fitted: "FittedComponents", groups: SceneGroups
) -> list[tuple[tuple[object, ...], pl.DataFrame]]:
    """Rows by covariate, with the number of the group of their scene; none where too little is known."""
    white, walk, _ = _sizes(fitted)
    numbered = table.with_columns(group=pl.Series(group_numbers(table, groups)))
    if numbered["group"].n_unique() < LEAST_GROUPS or not white + walk > 0.0:
        return []
    return sorted(numbered.partition_by(names, as_dict=True).items())


def _sizes(fitted: "FittedComponents") -> tuple[float, float, float]:
    white, walk, drift = (fitted.components[name].sigma.value ** 2 for name in ("white", "walk", "drift"))
    return white, walk, drift


def _factor(knots: Knots, logs: Array, gain: Interval) -> Factor:
    return Factor(of=knots.of, log_knots=tuple(knots.places.tolist()), log_factor=tuple(logs.tolist()), gain=gain)


def _best(found: Sequence[Factor]) -> Factor | None:
    kept = [one for one in found if one.gain.value > LEAST_GAIN and one.gain.low is not None and one.gain.low > 0.0]
    return max(kept, key=lambda one: one.gain.value, default=None)


def _gain(cells: Cells, knots: Sequence[Knots], simpler: Sequence[Knots], level: float) -> Interval:
    """What factors gain over simpler ones on scenes that were left out, nat per change."""
    count = cells.n_groups
    gain, n = np.zeros(count), np.zeros(count)
    for fold in range(min(_FOLDS, count)):
        left = cells.group % min(_FOLDS, count) == fold
        rest = cells.chosen(~left)
        with_all, with_fewer = rest.fitted(knots), rest.fitted(simpler)
        for group in np.unique(cells.group[left]):
            own = cells.chosen(cells.group == group)
            gain[group] = own.cost(simpler, with_fewer) - own.cost(knots, with_all)
            n[group] = own.count.sum()
    value = gain.sum() / n.sum()
    without = (gain.sum() - gain) / (n.sum() - n)
    low, high = student_interval(value, without, level=level, sizes=n)
    return Interval(value=float(value), low=_known(low), high=_known(high))


def _known(bound: Array) -> float | None:
    return None if np.isnan(bound) else float(bound)
