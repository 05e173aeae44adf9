"""The shape of errors: a verdict from effect sizes, all of them in nats per error.

An effect size is what an estimator loses by assuming Gaussian errors, so one margin applies to all. All are of errors
in units of their own scene (`tracknoise.findings.shape.within`). The verdict is the first of these that is true for the
bounds of the intervals (shape):

1. undecided: there are no intervals.
2. contaminated: the mixture's gain lies above the margin and above Student's gain.
3. heavy-tailed: Student's gain, or the mixture's, lies above the margin. For either verdict at least as many errors
   as a Gaussian has lie beyond d2 = 9.21, both in units of scenes and of all scenes together; otherwise undecided.
4. skewed: b1 / 12 lies above the margin, and b2 below 16; where b2 is larger, a few errors decide third moments.
5. light-tailed: kurtosis b2 lies below 8 (1 - sqrt(2 margin)), 6.87 for 0.01 nat, which is where an elliptical
   distribution is that far from the Gaussian, and fewer errors than expected are beyond d2 = 9.21.
6. Gaussian: both gains and b1 / 12 lie below the margin, and kurtosis above that bound.
7. undecided: some interval contains its limit.
"""

import math
from dataclasses import dataclass

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_as
from tracknoise.findings.wording import DASH, MINUS, SPACE, number
from tracknoise.tables.enumerations import Shape

MARGIN_NATS = 0.01
"""Smaller distances from the Gaussian count as none, nats per error."""
_FEW_DECIDE = 16.0
UNKNOWN = Estimate(None)


@dataclass(frozen=True, slots=True)
class ShapeEvidence:
    """What the verdict is made from.

    Attributes
    ----------
    n_sampled
        Single errors behind gains and tails.
    student, mixture, difference
        Gains, nats per error, and how much the mixture's is above Student's.
    skewness, kurtosis
        Mardia's b1 and b2.
    tail_99
        P(d2 > 9.21) / 0.01; None where there are too few errors.
    nu, share, ratio
        Parameters of the fits; None where there are none.
    pooled_tail_99
        As `tail_99`, but of all scenes together.
    scales
        What the different scales of scenes add to Student's gain, nats per error.
    """

    n_sampled: int
    student: Estimate
    mixture: Estimate
    difference: Estimate
    skewness: Estimate
    kurtosis: Estimate
    tail_99: float | None
    nu: float | None
    share: float | None
    ratio: float | None
    pooled_tail_99: float | None = None
    scales: Estimate = UNKNOWN


def judge(evidence: ShapeEvidence, *, margin: float = MARGIN_NATS) -> tuple[Shape, str]:
    """Verdict by (shape), and the reason in words.

    Parameters
    ----------
    evidence
        Of one condition, trimming and band of ages.
    margin
        Largest distance from the Gaussian that counts as none, nats per error.
    """
    student, mixture, kurtosis = evidence.student, evidence.mixture, evidence.kurtosis
    if None in (student.low, mixture.low, kurtosis.low):
        return Shape.undecided, f"too few errors ({evidence.n_sampled}), scenes or blocks for intervals"
    light = 8 * (1 - math.sqrt(2 * margin))
    if student.above(margin) or mixture.above(margin):
        verdict, why = _heavy(evidence, margin)
        return verdict, why + _of_scales(evidence)
    if evidence.skewness.above(12 * margin) and kurtosis.below(_FEW_DECIDE):
        return Shape.skewed, f"skewness b1 is {_text(evidence.skewness)}, above {12 * margin:g}"
    if kurtosis.below(light) and evidence.tail_99 is not None and evidence.tail_99 < 1:
        return Shape.light_tailed, f"kurtosis is {_text(kurtosis)}, below {number(light)}; that of a Gaussian is 8"
    gains = f"Student's t gains {_text(student)} nat per error over a Gaussian, a mixture {_text(mixture)}"
    small = student.below(margin) and mixture.below(margin)
    if small and evidence.skewness.below(12 * margin) and kurtosis.above(light):
        small_gains = f"{gains}. Both are below {margin:g}. Kurtosis is {_text(kurtosis)}"
        return Shape.gaussian, small_gains + _of_scales(evidence)
    moments = f"Kurtosis is {_text(kurtosis)}, skewness {_text(evidence.skewness)}"
    return Shape.undecided, f"{gains}. {moments}. No interval decides"


def _heavy(evidence: ShapeEvidence, margin: float) -> tuple[Shape, str]:
    """The verdict where tails are heavier than a Gaussian's."""
    tails = [tail for tail in (evidence.tail_99, evidence.pooled_tail_99) if tail is not None]
    if min(tails, default=1.0) < 1:
        few = f"only {number(min(tails))} times as many errors as of a Gaussian lie beyond its 99{SPACE}% ellipse"
        return Shape.undecided, f"Student's t gains {_text(evidence.student)} nat per error over a Gaussian, but {few}"
    mixture = _text(evidence.mixture)
    if evidence.mixture.above(margin) and evidence.difference.above(0.0):
        wider = f"{number(_percent(evidence.share))} % of errors {number(_root(evidence.ratio))} times as wide"
        gains = f"gains {mixture} nat per error over a Gaussian, and {_text(evidence.difference)} more than Student's t"
        return Shape.contaminated, f"a mixture with {wider} {gains}"
    student = f"Student's t with {number(evidence.nu)} degrees of freedom gains {_text(evidence.student)} nat per error"
    return Shape.heavy_tailed, f"{student} over a Gaussian; a mixture gains {mixture}"


def _of_scales(evidence: ShapeEvidence) -> str:
    """What the different scales of scenes add, where they do."""
    added = f"Different scales of scenes add {_text(evidence.scales)} nat to the gain of Student's t"
    return f". {added}" if evidence.scales.above(0.0) else ""


def _text(estimate: Estimate) -> str:
    return format_as(estimate, _thousandths)


def _thousandths(value: float | None) -> str:
    return DASH if value is None else f"{value:z.3f}".replace("-", MINUS)


def _percent(share: float | None) -> float | None:
    return None if share is None else 100 * share


def _root(ratio: float | None) -> float | None:
    return None if ratio is None else math.sqrt(ratio)
