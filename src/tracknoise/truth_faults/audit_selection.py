"""Which faults of the truth are named: significance, agreement of trackers, and how large a fault would have to be.

A fault of the truth is the same for all trackers, a tracker's own bias is not. Faults are named by forward selection,
in the order of what their corrections explain on held-out clusters.

Tests leave out scenes where at least `LEAST_EFFECTIVE` of them determine the parameter by (audit.effective). Otherwise
they leave out blocks of tracks within scenes: a clock offset, for example, shows only where the camera changes its
speed, and a test over scenes finds nothing if two of eight do. Intervals are from scenes in any case, with the few
degrees of freedom that there are. A parameter is significant only if they exclude zero, too.

The size that is computed is that at which an error of the truth would be named with a probability of 90 %. It is named
if its test is significant, its interval excludes zero, and its correction explains enough of held-out clusters. For the
last, errors of a size are put into residuals without them, so far as the other columns of the fit do not absorb them:
x_j = D V_j / V_jj for the design D and the inverse V of the information (audit.visible). The least size at which their
correction explains enough is found by trial. A quantile of Student's distribution is added, because estimates scatter
about the size.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.multiple_tests import holm
from tracknoise.inference.robust_fits import condition_number, jackknife, scales
from tracknoise.tables.truth_audit import AuditVerdict
from tracknoise.truth_faults.audit_fit import Gain, ResampledFit, design_of, fit, gain, losses
from tracknoise.truth_faults.audit_samples import AuditSamples
from tracknoise.truth_faults.corrected_positions import Predicted, has_k1, predict
from tracknoise.truth_faults.fault_parameters import COUNT, FAULTS, Fit, Parameter

_LEAST_COUNT, _LEAST_CLUSTERS = 50, 2
"""Fewest observations of a tracker, and fewest clusters with any of them: one alone says nothing of its own error."""
_LEAST_SHARE, _MOST_SHARE = 0.5, 2.0
"""A tracker contradicts if it surely sees less than half, or more than double, of what all see together."""


@dataclass(frozen=True, slots=True)
class Shares:
    """How much of the common correction each tracker sees by itself: 1 where it sees the same.

    Attributes
    ----------
    tracker
        Its place.
    value, low, high
        The share and its interval, adjusted for the number of trackers.
    """

    tracker: int
    value: float
    low: float
    high: float

    @property
    def contradicts(self) -> bool:
        """Whether this tracker surely sees another correction."""
        return self.high < _LEAST_SHARE or self.low > _MOST_SHARE


def shares(fitted: Fit, places: NDArray[np.intp]) -> list[Shares]:
    """Compare the corrections that single trackers see with the common one.

    Each tracker's own fit is one step of Newton's method from the common one. Its share is the projection on the common
    correction, in units of the information about it. Returns: of the trackers that have enough observations, in several
    clusters, if there are several such trackers. `places`: columns of the correction in question.
    """
    count = fitted.equations.count
    several = np.count_nonzero(count, axis=1) >= _LEAST_CLUSTERS
    enough = np.flatnonzero(several & (count.sum(axis=1) >= _LEAST_COUNT))
    if len(enough) < 2:
        return []
    common = fitted.estimate[places]
    metric = np.linalg.pinv(np.linalg.inv(fitted.equations.information)[np.ix_(places, places)], hermitian=True)
    onto = metric @ common / max(float(common @ metric @ common), 1e-300)
    return [_share(fitted, places, onto, int(tracker), 1.0 - (1.0 - LEVEL) / len(enough)) for tracker in enough]


def _share(fitted: Fit, places: NDArray[np.intp], onto: NDArray[np.float64], tracker: int, level: float) -> Shares:
    moves = jackknife(fitted.equations, [tracker])
    value = 1.0 + float(onto @ moves.step[places])
    spread = float(np.sqrt(onto @ moves.covariance[np.ix_(places, places)] @ onto))
    half = float(special.stdtrit(moves.freedom[places].min(), 0.5 + 0.5 * level)) * spread
    return Shares(tracker, value, value - half, value + half)


ALPHA = 1.0 - LEVEL
"""Level of the tests, after Holm's adjustment for all parameters."""
MARGIN = 0.02
"""Least share that a fault must explain on held-out clusters to be named."""
LEAST_EFFECTIVE = 5.0
"""Fewest effective scenes that tests leave out as such."""
_NEAR_KIND = 0.4
"""A number that is 0 or 1 in truth is 1 if it is this near to it; others stand in for another fault."""


@dataclass(frozen=True)
class Basis:
    """A fit to which a parameter is added.

    Attributes
    ----------
    resampled
        The fit and its jackknife.
    start
        Its corrections, and what they predict.
    scale : (n,)
        Robust scale of its residuals, px.
    """

    resampled: ResampledFit
    start: Predicted
    scale: NDArray[np.float64]

    @classmethod
    def of(
        cls, samples: AuditSamples, parameters: Sequence[Parameter], start: Predicted, *, with_bias: bool
    ) -> "Basis":
        """Fit what has been named so far."""
        fitted = fit(samples, parameters, start, with_bias=with_bias)
        resampled = ResampledFit.of(samples, fitted)
        predicted = predict(samples, fitted.theta) if parameters else start
        return cls(resampled, predicted, scales(samples.group, resampled.residual))

    @property
    def fitted(self) -> Fit:
        """The fit."""
        return self.resampled.fitted

    def gain_of(self, other: ResampledFit) -> Gain:
        """Share that another fit explains of held-out clusters, those of the other fit, beyond this one."""
        return other.gain_beyond(self.resampled, self.scale)


@dataclass(frozen=True)
class Assessment:
    """A parameter beside those of a basis.

    Attributes
    ----------
    parameter
        What was added.
    resampled, tested
        The fit of all of them, and its jackknife: for intervals, and for tests.
    basis
        What it was added to.
    gain
        Share that the correction explains on held-out clusters beyond the basis.
    p
        Of the test that the correction is zero; 1 where an interval does not exclude zero.
    """

    parameter: Parameter
    resampled: ResampledFit
    tested: ResampledFit
    basis: Basis
    gain: Gain
    p: float

    @property
    def fitted(self) -> Fit:
        """The fit."""
        return self.resampled.fitted

    @property
    def places(self) -> NDArray[np.intp]:
        """Columns of the parameter in the fit."""
        return self.fitted.places_of(self.parameter)

    @property
    def estimate(self) -> NDArray[np.float64]:
        """Numbers of the parameter."""
        return self.fitted.estimate[self.places]

    @property
    def half_widths(self) -> NDArray[np.float64]:
        """Half of their intervals."""
        return self.resampled.half_widths[self.places]

    def gain_beyond(self, other: "Assessment") -> Gain:
        """Share that this correction explains of its held-out clusters beyond another one."""
        return self.tested.gain_beyond(other.resampled, self.basis.scale)

    @property
    def explains(self) -> bool:
        """Whether the correction explains enough to be named."""
        return is_enough(self.gain)

    @property
    def is_small(self) -> bool:
        """Whether the correction explains too little to be named."""
        return self.gain.value < MARGIN

    @property
    def is_possible(self) -> bool:
        """Whether there are faults with this estimate."""
        return not FAULTS[self.parameter].is_kind or bool(abs(self.estimate[0] - 1.0) < _NEAR_KIND)

    @cached_property
    def shares(self) -> list[Shares]:
        """What each tracker sees of the correction."""
        return shares(self.tested.fitted, self.places)

    @property
    def is_agreed(self) -> bool:
        """Whether no tracker contradicts."""
        return not any(share.contradicts for share in self.shares)


def is_enough(found: Gain) -> bool:
    """Whether something is surely explained, and enough to name what explains it."""
    return found.value >= MARGIN and found.low > 0.0


def assess(samples: AuditSamples, basis: Basis, parameter: Parameter) -> Assessment:
    """Add a parameter to those of a basis."""
    fitted = fit(samples, (*basis.fitted.parameters, parameter), basis.start, with_bias=basis.fitted.with_bias)
    places = fitted.places_of(parameter)
    resampled = ResampledFit.of(samples, fitted)
    is_by_scenes = resampled.moves.effective(places) >= LEAST_EFFECTIVE
    tested = resampled if is_by_scenes else resampled.by_blocks
    p = tested.moves.p_value(fitted.estimate[places], places)
    if not is_by_scenes and not _excludes_zero(resampled, places):
        p = 1.0
    return Assessment(parameter, resampled, tested, basis, basis.gain_of(tested), p)


def _excludes_zero(resampled: ResampledFit, places: NDArray[np.intp]) -> bool:
    """Whether the interval of one of the numbers does."""
    return bool(np.any(np.abs(resampled.fitted.estimate[places]) > resampled.half_widths[places]))


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
        assessment = self.assessed.get(parameter)
        return assessment is not None and self.is_significant(parameter) and assessment.explains

    def is_significant(self, parameter: Parameter) -> bool:
        """Whether a parameter is not zero, and is possible."""
        return self.p[parameter] <= ALPHA and self.assessed[parameter].is_possible

    @cached_property
    def best(self) -> Assessment | None:
        """What is named: of all that pass and that trackers agree on, the one with the fewest numbers.

        Left out are those that surely explain less than the one that explains most. Of equal numbers, the one that
        explains more is named.
        """
        agreed = [
            assessment for name, assessment in self.assessed.items() if self.passes(name) and assessment.is_agreed
        ]
        most = max(agreed, key=lambda assessment: assessment.gain.value, default=None)
        like_it = [
            assessment
            for assessment in agreed
            if most is assessment or (most and most.gain_beyond(assessment).low <= 0.0)
        ]
        return min(
            like_it, key=lambda assessment: (FAULTS[assessment.parameter].count, -assessment.gain.value), default=None
        )


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
    return tuple(parameter for parameter in Parameter if parameter not in left_out)


def select(samples: AuditSamples) -> Selection:
    """Name faults one after the other, until none is left that passes."""
    start, parameters = predict(samples, np.zeros(COUNT)), available(samples)
    stages = [_stage(samples, Basis.of(samples, (), start, with_bias=True), parameters)]
    while (best := stages[-1].best) is not None and len(stages) <= MOST_NAMED:
        predicted = predict(samples, best.fitted.theta)
        stages.append(_stage(samples, Basis.of(samples, best.fitted.parameters, predicted, with_bias=True), parameters))
    alone = _stage(samples, Basis.of(samples, (), start, with_bias=False), parameters)
    final = _final(samples, stages[-1].basis)
    named = [_named(samples, stage, with_bias=final.fitted.with_bias) for stage in stages[:-1]]
    return Selection(stages[0], alone, stages[-1], named, final)


def _stage(samples: AuditSamples, basis: Basis, parameters: Sequence[Parameter]) -> Stage:
    left = [parameter for parameter in parameters if parameter not in basis.fitted.parameters]
    assessed = {parameter: assess(samples, basis, parameter) for parameter in left}
    adjusted = holm(np.array([assessed[parameter].p for parameter in left])).tolist()
    return Stage(basis, assessed, dict(zip(left, adjusted, strict=True)))


def _named(samples: AuditSamples, stage: Stage, *, with_bias: bool) -> Named:
    """The best of a stage."""
    best = stage.best
    assert best is not None, "only stages that name a fault are asked"
    rivals = _rivals(samples, stage, best, with_bias=with_bias)
    return Named(best, _reported_fit(samples, best, with_bias=with_bias), rivals)


def _rivals(samples: AuditSamples, stage: Stage, best: Assessment, *, with_bias: bool) -> dict[Parameter, float]:
    """Parameters that pass too, explain about as much, and leave nothing for the best, with condition numbers."""
    rivals = {}
    for name, rival in stage.assessed.items():
        if name is not best.parameter and stage.passes(name) and best.gain_beyond(rival).low <= 0.0:
            predicted = predict(samples, rival.fitted.theta)
            basis = Basis.of(samples, rival.fitted.parameters, predicted, with_bias=with_bias)
            beside = assess(samples, basis, best.parameter)
            if beside.is_small:
                rivals[name] = condition_number(beside.fitted.equations)
    return rivals


def _reported_fit(samples: AuditSamples, best: Assessment, *, with_bias: bool) -> ResampledFit:
    """The fit that sentences tell of."""
    if with_bias:
        return best.resampled
    start = predict(samples, best.fitted.theta)
    return ResampledFit.of(samples, fit(samples, best.fitted.parameters, start, with_bias=False))


def _final(samples: AuditSamples, basis: Basis) -> Basis:
    """The named faults with trackers that have no bias, unless biases explain something of held-out clusters."""
    without = Basis.of(samples, basis.fitted.parameters, basis.start, with_bias=False)
    return basis if without.gain_of(basis.resampled).low > 0.0 else without


POWER = 0.9
"""Probability with which an error of the size that is called visible is named."""
_TRIALS, _START = 10, 1e-3


def visible_above(one: Assessment) -> NDArray[np.float64]:
    """Size of an error of each number of a parameter that would have been named, in units of the fit, (k,).

    Infinite where not even the largest error that is tried would have been.
    """
    tested = np.max([_tested(one.tested, one.places, ALPHA / len(Parameter)), _by_interval(one)], axis=0)
    moves = one.tested.moves
    beyond = special.stdtrit(moves.freedom, POWER) * moves.standard_errors
    explaining = _explaining(one) + beyond[one.places]
    size = np.maximum(tested, explaining)
    return np.where(size <= _largest(one.parameter), size, np.inf)


def _largest(parameter: Parameter) -> float:
    """Largest error of a parameter that is tried."""
    return 1.0 if FAULTS[parameter].is_kind else FAULTS[parameter].furthest


def _tested(resampled: ResampledFit, places: NDArray[np.intp], alpha: float) -> NDArray[np.float64]:
    """Size of each number at which Hotelling's test of all at level alpha is passed with the probability `POWER`."""
    k, n, moves = len(places), resampled.moves.effective(places), resampled.moves
    if n <= k:
        return np.full(k, np.inf)
    limit = np.sqrt(special.fdtri(k, n - k, 1.0 - alpha) * k * (n - 1) / (n - k))
    return np.asarray((limit + special.stdtrit(moves.freedom[places], POWER)) * moves.standard_errors[places])


def _by_interval(assessment: Assessment) -> NDArray[np.float64]:
    """Size of each number at which its interval excludes zero with the probability `POWER`."""
    moves = assessment.resampled.moves
    reach = special.stdtrit(moves.freedom, 0.5 + 0.5 * LEVEL) + special.stdtrit(moves.freedom, POWER)
    return np.asarray(reach * moves.standard_errors)[assessment.places]


def _explaining(assessment: Assessment) -> NDArray[np.float64]:
    """Least size of an error of each number whose correction explains enough, whatever its sign."""
    inverse = np.linalg.inv(assessment.fitted.equations.information)[:, assessment.places]
    fields = np.nan_to_num(design_of(assessment.tested.samples, assessment.fitted)) @ (
        inverse / np.diagonal(inverse[assessment.places])
    )
    without = _without_errors(assessment)
    return np.array([_least(assessment, without, field) for field in np.moveaxis(fields, 2, 0)])


def _least(assessment: Assessment, without: NDArray[np.float64], field: NDArray[np.float64]) -> float:
    """Least size of an error, of which one of size 1 changes residuals by a field (n, 2)."""
    high = _largest(assessment.parameter)
    low = _START * high
    if not _explains(assessment, without, high * field):
        return np.inf
    for _ in range(_TRIALS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if _explains(assessment, without, middle * field) else (middle, high)
    return high


def _without_errors(assessment: Assessment) -> NDArray[np.float64]:
    """Held-out residuals of the basis, (n, 2), px, without what the correction explains of them."""
    basis = assessment.basis.resampled.like(assessment.tested)
    return np.asarray(basis.residual + assessment.fitted.residual - assessment.basis.fitted.residual)


def _explains(assessment: Assessment, without: NDArray[np.float64], errors: NDArray[np.float64]) -> bool:
    """Whether the correction of errors (n, 2), px, of either sign would explain enough."""
    return all(is_enough(_gain(assessment, without + sign * errors)) for sign in (-1.0, 1.0))


def _gain(assessment: Assessment, wrong: NDArray[np.float64]) -> Gain:
    """What the correction would explain of residuals (n, 2), px."""
    samples = assessment.tested.samples
    scale = scales(samples.group, wrong)
    return gain(assessment.tested.losses(scale), losses(samples, wrong, scale))


@dataclass(frozen=True, slots=True)
class Judged:
    """The verdict on a parameter.

    Attributes
    ----------
    parameter, verdict
        Which, and what.
    rank
        Place among the named faults, from 1; None if it is not one.
    condition
        Condition number of the fit that shows what cannot be distinguished.
    visible_above : (k,) float64
        Size of an error of each component of which 90 % would have been named, in units of the fit; or infinite.
    """

    parameter: Parameter
    verdict: AuditVerdict
    rank: int | None
    condition: float
    visible_above: NDArray[np.float64]


def judge(selection: Selection) -> list[Judged]:
    """Verdicts on all parameters: named faults first, in their order."""
    names = [fault.parameter for fault in selection.named]
    faults = [
        Judged(fault.parameter, AuditVerdict.fault, rank, _condition(fault.assessment), visible_above(fault.assessment))
        for rank, fault in enumerate(selection.named, start=1)
    ]
    return faults + [_judged(selection, name) for name in selection.beside_bias.assessed if name not in names]


def _judged(selection: Selection, name: Parameter) -> Judged:
    beside = selection.last.assessed[name]
    visible = visible_above(beside)
    verdict = _verdict(selection, name, visible)
    if selection.last.is_significant(name):
        visible = np.maximum(visible, np.abs(beside.estimate))
    return Judged(name, verdict, None, _condition(beside), visible)


def _verdict(selection: Selection, name: Parameter, visible: NDArray[np.float64]) -> AuditVerdict:
    """Why a parameter is not a fault, given the errors that would have been seen."""
    first, last = selection.beside_bias, selection.last
    if last.is_significant(name) and not last.assessed[name].is_agreed:
        return AuditVerdict.disagreement
    if last.passes(name):
        return AuditVerdict.fault
    if selection.named and first.passes(name):
        return AuditVerdict.explained
    if not selection.named and selection.alone.passes(name):
        return AuditVerdict.like_bias
    if last.is_significant(name):
        return AuditVerdict.small if last.assessed[name].is_small else AuditVerdict.undetermined
    return AuditVerdict.undetermined if _is_wide(last.assessed[name], visible) else AuditVerdict.none


def _is_wide(assessment: Assessment, visible: NDArray[np.float64]) -> bool:
    """Whether the data would not show a change worth correcting, or no change that is tried."""
    plausible = FAULTS[assessment.parameter].plausible
    return bool(np.any(assessment.half_widths > plausible) or np.any(np.isinf(visible)))


def _condition(assessment: Assessment) -> float:
    return condition_number(assessment.fitted.equations)
