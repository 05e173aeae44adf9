"""Which faults are named, and in which order: forward selection by what corrections explain on held-out clusters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.assessment import ALPHA, MARGIN, Assessment, Basis, assess
from tracknoise.audit.fit import Start, fit
from tracknoise.audit.jackknife import condition_number
from tracknoise.audit.optics import has_k1
from tracknoise.audit.parameters import COUNT, Parameter
from tracknoise.audit.resampled_fit import ResampledFit
from tracknoise.audit.samples import AuditSamples
from tracknoise.findings.sampling.multiplicity import holm

MOST_NAMED = 4
"""Most faults that are named; a truth with more needs another look than this."""


@dataclass(frozen=True)
class Stage:
    """Every parameter that is not yet named, beside those that are.

    Attributes
    ----------
    basis
        The faults named before.
    assessed
        Each other parameter beside them.
    p
        P-value of each, adjusted by Holm's method.
    """

    basis: Basis
    assessed: Mapping[Parameter, Assessment]
    p: Mapping[Parameter, float]

    def passes(self, parameter: Parameter) -> bool:
        """Whether a parameter is significant, possible and explains enough, whatever single trackers say."""
        found = self.assessed.get(parameter)
        return found is not None and self.is_significant(parameter) and found.explains

    def is_significant(self, parameter: Parameter) -> bool:
        """Whether a parameter is not zero, and is possible."""
        return self.p[parameter] <= ALPHA and self.assessed[parameter].is_possible

    @property
    def best(self) -> Assessment | None:
        """What is named: of all that pass and that trackers agree on, the one that explains most."""
        agreed = [one for name, one in self.assessed.items() if self.passes(name) and one.is_agreed]
        return max(agreed, key=lambda one: one.gain.value, default=None)


@dataclass(frozen=True)
class Named:
    """A fault that was named.

    Attributes
    ----------
    assessment
        When it was named, beside biases of the trackers.
    resampled
        The fit of it and of those named before it, with biases of the trackers only if these explain anything.
    rivals
        Parameters that explain as much, and beside which it explains nothing, with the condition number of both.
    """

    assessment: Assessment
    resampled: ResampledFit
    rivals: Mapping[Parameter, float]

    @property
    def parameter(self) -> Parameter:
        """Which one."""
        return self.assessment.parameter

    @property
    def estimate(self) -> NDArray[np.float64]:
        """Its numbers."""
        return self.resampled.fitted.estimate[self.resampled.fitted.places_of(self.parameter)]

    @property
    def half_widths(self) -> NDArray[np.float64]:
        """Half of their intervals."""
        return self.resampled.half_widths[self.resampled.fitted.places_of(self.parameter)]


@dataclass(frozen=True)
class Selection:
    """The result of the selection.

    Attributes
    ----------
    beside_bias
        The first stage: every parameter beside biases of the trackers.
    alone
        The same for trackers without bias.
    last
        The last stage: what is left beside the named faults.
    named
        The faults, in the order in which they were named.
    final
        All named faults together, with biases of the trackers if these explain anything beside them.
    """

    beside_bias: Stage
    alone: Stage
    last: Stage
    named: Sequence[Named]
    final: Basis


def available(samples: AuditSamples) -> tuple[Parameter, ...]:
    """Parameters that can be fitted: not k1 where a lens has none, nor the kind of depth where it is known."""
    left_out = set() if has_k1(samples.cameras) else {Parameter.k1}
    if samples.z_depth_from is not None:
        left_out.add(Parameter.ray_depth)
    return tuple(one for one in Parameter if one not in left_out)


def select(samples: AuditSamples) -> Selection:
    """Name faults one after the other, until none is left that passes."""
    start, every = Start.at(samples, np.zeros(COUNT)), available(samples)
    stages = [_stage(samples, Basis.of(samples, (), start, with_bias=True), every)]
    while (best := stages[-1].best) is not None and len(stages) <= MOST_NAMED:
        there = Start.at(samples, best.fitted.theta)
        stages.append(_stage(samples, Basis.of(samples, best.fitted.parameters, there, with_bias=True), every))
    alone = _stage(samples, Basis.of(samples, (), start, with_bias=False), every)
    final = _final(samples, stages[-1].basis)
    named = [_named(samples, stage, with_bias=final.fitted.with_bias) for stage in stages[:-1]]
    return Selection(stages[0], alone, stages[-1], named, final)


def _stage(samples: AuditSamples, basis: Basis, every: Sequence[Parameter]) -> Stage:
    left = [one for one in every if one not in basis.fitted.parameters]
    assessed = {one: assess(samples, basis, one) for one in left}
    adjusted = holm(np.array([assessed[one].p for one in left])).tolist()
    return Stage(basis, assessed, dict(zip(left, adjusted, strict=True)))


def _named(samples: AuditSamples, stage: Stage, *, with_bias: bool) -> Named:
    """The best of a stage."""
    best = stage.best
    assert best is not None, "only stages that name a fault are asked"
    rivals = _rivals(samples, stage, best, with_bias=with_bias)
    return Named(best, _reported_fit(samples, best, with_bias=with_bias), rivals)


def _rivals(samples: AuditSamples, stage: Stage, best: Assessment, *, with_bias: bool) -> dict[Parameter, float]:
    """Parameters that pass too, explain about as much, and leave nothing for the best, with condition numbers."""
    found = {}
    for name, other in stage.assessed.items():
        if name is not best.parameter and stage.passes(name) and best.gain_beyond(other).low <= 0.0:
            there = Start.at(samples, other.fitted.theta)
            basis = Basis.of(samples, other.fitted.parameters, there, with_bias=with_bias)
            beside = assess(samples, basis, best.parameter)
            if beside.gain.value < MARGIN:
                found[name] = condition_number(beside.fitted.equations)
    return found


def _reported_fit(samples: AuditSamples, best: Assessment, *, with_bias: bool) -> ResampledFit:
    """The fit that sentences tell of."""
    if with_bias:
        return best.resampled
    start = Start.at(samples, best.fitted.theta)
    return ResampledFit.of(samples, fit(samples, best.fitted.parameters, start, with_bias=False))


def _final(samples: AuditSamples, basis: Basis) -> Basis:
    """The named faults with trackers that have no bias, unless biases explain something of held-out clusters."""
    without = Basis.of(samples, basis.fitted.parameters, basis.start, with_bias=False)
    return basis if without.gain_of(basis.resampled).low > 0.0 else without
