"""What shape errors have: a verdict from effect sizes, all of them in nats per error.

Nats are what an estimator loses by taking errors for Gaussian, so that one margin serves all. With the bounds of each
interval, the first of these that holds is the verdict (shape):

1. undecided: nothing to judge by.
2. contaminated: the mixture's gain lies above the margin and above Student's gain.
3. heavy-tailed: Student's gain, or the mixture's, lies above the margin.
4. skewed: b1 / 12 lies above the margin, and b2 below 16; where it is larger, third moments are those of a few errors.
5. light-tailed: kurtosis b2 lies below 8 (1 - sqrt(2 margin)), 6.87 for 0.01 nat, which is where an elliptical
   distribution is that far from the Gaussian, and fewer errors than expected are beyond d2 = 9.21.
6. Gaussian: both gains and b1 / 12 lie below the margin, and kurtosis above that bound.
7. undecided: intervals straddle.
"""

from dataclasses import dataclass

import numpy as np

from tracknoise.findings.wording import MINUS, number

MARGIN_NATS = 0.01
"""Less than this is nothing."""
_FEW_DECIDE = 16.0


@dataclass(frozen=True, slots=True)
class Interval:
    """A value with the bounds of its interval; NaN where there is none."""

    value: float
    low: float
    high: float

    def above(self, bound: float) -> bool:
        """Whether all of it is."""
        return self.low > bound

    def below(self, bound: float) -> bool:
        """Whether all of it is."""
        return self.high < bound

    def __str__(self) -> str:
        value, low, high = (f"{bound:.3f}".replace("-", MINUS) for bound in (self.value, self.low, self.high))
        return f"{value} [{low}, {high}]"


@dataclass(frozen=True, slots=True)
class Evidence:
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
        P(d2 > 9.21) / 0.01; NaN where there are too few errors.
    nu, share, ratio
        Parameters of the fits.
    """

    n_sampled: int
    student: Interval
    mixture: Interval
    difference: Interval
    skewness: Interval
    kurtosis: Interval
    tail_99: float
    nu: float
    share: float
    ratio: float


def judge(evidence: Evidence, *, margin: float = MARGIN_NATS) -> tuple[str, str]:
    """Verdict by (shape), one of `SHAPE`, and why, in words.

    Parameters
    ----------
    evidence
        Of one condition, trimming and band of ages.
    margin
        Largest distance from the Gaussian that is nothing, nats per error.
    """
    if np.isnan([evidence.student.low, evidence.mixture.low, evidence.kurtosis.low]).any():
        return "undecided", f"{evidence.n_sampled} errors, or the units they come from, are too few for intervals"
    light = 8 * (1 - np.sqrt(2 * margin))
    if evidence.student.above(margin) or evidence.mixture.above(margin):
        return _heavy(evidence, margin)
    if evidence.skewness.above(12 * margin) and evidence.kurtosis.below(_FEW_DECIDE):
        return "skewed", f"skewness b1 is {evidence.skewness}, where less than {12 * margin:g} is nothing"
    if evidence.kurtosis.below(light) and evidence.tail_99 < 1:
        return "light-tailed", f"kurtosis is {evidence.kurtosis}, below {number(light)}; that of a Gaussian is 8"
    gains = f"Student's t gains {evidence.student} nat per error over a Gaussian, a mixture {evidence.mixture}"
    small = evidence.student.below(margin) and evidence.mixture.below(margin)
    if small and evidence.skewness.below(12 * margin) and evidence.kurtosis.above(light):
        return "Gaussian", f"{gains}: both below {margin:g}; kurtosis is {evidence.kurtosis}"
    return "undecided", f"{gains}; kurtosis is {evidence.kurtosis}, skewness {evidence.skewness}: intervals straddle"


def _heavy(evidence: Evidence, margin: float) -> tuple[str, str]:
    """The verdict where tails are heavier than a Gaussian's."""
    mixture = (
        f"{number(100 * evidence.share)} % of errors with {number(evidence.ratio**0.5)} times the spread: "
        f"such a mixture gains {evidence.mixture} nat per error over a Gaussian"
    )
    if evidence.mixture.above(margin) and evidence.difference.above(0.0):
        return "contaminated", f"{mixture}, {evidence.difference} more than Student's t"
    student = f"Student's t of {number(evidence.nu)} degrees of freedom gains {evidence.student} nat per error"
    return "heavy-tailed", f"{student} over a Gaussian; a mixture {evidence.mixture}"
