"""What statistics must come to where the oracle's errors went in, and how far chance alone takes them from that.

At age k > 0 an oracle's error is Gaussian of mean m = bias + k drift and covariance S, independent of every other one;
its tracks end at each step with probability h. So every statistic has a known value, and for the counts that were
measured a known standard error.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from tracknoise.trackers.oracle import Oracle

_AXES = {"u": (0, 0), "v": (1, 1), "uv": (0, 1)}


@dataclass(frozen=True, slots=True)
class Known:
    """A statistic that is known before it is measured.

    Attributes
    ----------
    value
        What it must come to.
    standard_error
        Of what is measured, as an estimate of that.
    """

    value: float
    standard_error: float


def curve_point(oracle: Oracle, *, statistic: str, coordinate: str, age: int, n: int) -> Known:
    """A point of a curve, with the definitions of `tracknoise.statistics.curves`.

    With a, b the means of the two coordinates and A, B, C their variances and covariance, Phi has the variance of a
    product of two Gaussians, n / (n - 1)^2 (A B + C^2 + a^2 B + b^2 A + 2 a b C), and eta is the mean of a folded one.

    Parameters
    ----------
    oracle
        Its errors' size; variances must be positive.
    statistic
        nu (px), eta (px), Phi (px^2) or central (px^2).
    coordinate
        u or v, of second moments also uv.
    age
        At least 1, in frames of the nominal sequence.
    n
        How many features were measured, at least 2.
    """
    first, second = _AXES[coordinate]
    a, b = (oracle.bias_px[axis] + age * oracle.drift_px_per_frame[axis] for axis in (first, second))
    covariance = oracle.covariance_px2
    A, B, C = covariance[first][first], covariance[second][second], covariance[first][second]
    if statistic == "nu":
        return Known(a, math.sqrt(A / n))
    if statistic == "eta":
        folded = _folded_mean(a, A)
        return Known(folded, math.sqrt((A + a * a - folded * folded) / n))
    if statistic == "central":
        return Known(C, math.sqrt((A * B + C * C) / (n - 1)))
    variance = A * B + C * C + a * a * B + b * b * A + 2 * a * b * C
    return Known((C + a * b) * n / (n - 1), math.sqrt(variance * n) / (n - 1))


def share(probability: float, n: int) -> Known:
    """The share of `n` features that an event of this probability befalls."""
    return Known(probability, math.sqrt(probability * (1 - probability) / n))


def survival(oracle: Oracle, at_risk: Iterable[int]) -> Known:
    """Kaplan-Meier survival beyond L frames of the tracker, where no track ends in another way than the oracle's own.

    Its standard error is Greenwood's.

    Parameters
    ----------
    oracle
        Its rates.
    at_risk
        Count of tracks at risk at lifetimes 1, 2, ..., L.
    """
    hazard, counts = hazard_rate(oracle), list(at_risk)
    value = (1 - hazard) ** len(counts)
    return Known(value, value * math.sqrt(sum(hazard / (1 - hazard) / n for n in counts)))


def mean_lifetime(oracle: Oracle, *, frames: int, n_scenes: int) -> Known:
    """Mean lifetime, in frames that the tracker saw, where no track ends in another way and all that end are replaced.

    With N features alive in each of F frames, F N observations belong to N tracks and as many more as end in the F - 1
    steps, a binomial number.
    """
    hazard = hazard_rate(oracle)
    value = frames / (1 + (frames - 1) * hazard)
    spread = math.sqrt((frames - 1) * hazard * (1 - hazard) / (oracle.n_features * n_scenes))
    return Known(value, value * value / frames * spread)


def hazard_rate(oracle: Oracle) -> float:
    """Probability that a track ends at a step."""
    return oracle.loss_rate + oracle.outlier_rate


def _folded_mean(mean: float, variance: float) -> float:
    """E|x| of a Gaussian x."""
    z2 = mean * mean / (2 * variance)
    return math.sqrt(2 * variance / math.pi) * math.exp(-z2) + mean * math.erf(mean / math.sqrt(2 * variance))
