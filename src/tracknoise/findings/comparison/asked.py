"""One question of a comparison: paired values, and the tests of both directions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.comparison.bias_change import bias_change
from tracknoise.findings.comparison.change import FALLS, GROWS, Change, change_of
from tracknoise.findings.comparison.estimands import OfStatistic, Unit
from tracknoise.findings.comparison.paired_values import PairedValues
from tracknoise.findings.comparison.result import Compared
from tracknoise.findings.factors.asking import ask
from tracknoise.findings.sampling.groups import MIN_WITHIN
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.findings.wording import count
from tracknoise.tables.enumerations import ComparedAges, Resampled

_FEW = f"at least {MIN_SCENES} are needed"


@dataclass(frozen=True, slots=True)
class Asked(OfStatistic):
    """A statistic of a condition in two runs.

    Attributes
    ----------
    of
        What is compared.
    statistic
        A key of `ESTIMANDS`.
    values
        Paired by scene.
    scenes
        Names of the scenes.
    group : (scenes,)
        Number of the group of each scene.
    axis
        What the places of the values are.
    """

    of: Compared
    statistic: str
    values: PairedValues
    scenes: Sequence[str]
    group: NDArray[np.intp]
    axis: str | None = None

    @property
    def worse(self) -> int:
        """Direction of a change for the worse."""
        return FALLS if self.estimand.larger_is_better else GROWS

    @property
    def n_scenes(self) -> int:
        """Number of scenes that were measured in both runs."""
        return int(self.values.both.sum())

    def tested(self, margin: float, *, level: float, ages: ComparedAges) -> "Tested":
        """Test both directions against a margin, of logarithms for ratios and otherwise in the unit."""
        question = ask(self.values.both[:, None], self.group, margin=margin, level=level)
        if question is None:
            return Tested(None, None, self._too_few())
        if self.values.total is None:
            found = change_of(self.values.change, question, ages)
        else:
            found = bias_change(self.values.change, self.values.total, question, ages)
        return Tested(found, question.resampled, self._gap(found))

    def in_unit(self, change: float) -> float:
        """A change in the unit of the estimand."""
        with np.errstate(over="ignore"):
            return float(np.exp(change)) if self.estimand.unit == Unit.ratio else change

    def _too_few(self) -> str:
        if self.n_scenes < MIN_SCENES:
            return f"the runs share only {count(self.n_scenes, 'scene')}; {_FEW}"
        part = self.group[self.values.both]
        n_groups = len(np.unique(part))
        if n_groups < MIN_SCENES and len(part) - n_groups < MIN_WITHIN:
            return f"the scenes form only {count(n_groups, 'group')}; {_FEW}, or {MIN_WITHIN} more scenes than groups"
        return "errors have no scale that a margin could be a share of"

    def _gap(self, found: Change | None) -> str | None:
        if found is None:
            with_data = int((~np.isnan(self.values.change)).any(axis=1).sum())
            return f"{count(with_data, 'scene')} with enough data in both runs; {_FEW}"
        if (self.values.unlike & found.compared).any():
            return "a value of 0 in one of the runs, which has no ratio"
        return None


@dataclass(frozen=True, slots=True)
class Tested:
    """Outcome of the tests.

    Attributes
    ----------
    found
        Tests and effect; None without enough data.
    resampled
        What intervals are about.
    gap
        Why nothing can be shown to be within the margin, if so.
    """

    found: Change | None
    resampled: Resampled | None
    gap: str | None
