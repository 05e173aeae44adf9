"""Expected values of statistics of an oracle's errors, and their standard errors.

At age k > 0 an oracle's error is Gaussian with mean m = bias + k drift and covariance S. Errors are independent. Tracks
end at each step with probability h. So every statistic has a known expected value. For the measured counts it also has
a known standard error.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from tracknoise.trackers.oracle import Oracle

_AXES = {"u": (0, 0), "v": (1, 1), "uv": (0, 1)}


@dataclass(frozen=True, slots=True)
class Known:
    """Expected value of a statistic.

    Attributes
    ----------
    value
        The expected value.
    standard_error
        Standard error of the measured statistic.
    """

    value: float
    standard_error: float


def curve_point(oracle: Oracle, *, statistic: str, coordinate: str, age: int, n: int) -> Known:
    """A point of a curve, with the definitions of `tracknoise.statistics.curves`.

    Let a, b be the means of the two coordinates and A, B, C their variances and covariance. Phi has the variance of a
    product of two Gaussians, (A B + C^2 + a^2 B + b^2 A + 2 a b C) / n. eta is the mean of a folded Gaussian.

    Parameters
    ----------
    oracle
        Defines the errors; variances must be positive.
    statistic
        nu (px), eta (px), Phi (px^2) or central (px^2).
    coordinate
        u or v; for second moments also uv.
    age
        At least 1, in frames of the nominal sequence.
    n
        Number of features that were measured, at least 2.
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
    return Known(C + a * b, math.sqrt(variance / n))


def share(probability: float, n: int) -> Known:
    """Share of `n` features to which an event of this probability happens."""
    return Known(probability, math.sqrt(probability * (1 - probability) / n))


def survival(oracle: Oracle, at_risk: Iterable[int]) -> Known:
    """Kaplan-Meier survival beyond L frames that the tracker saw, if only the oracle ends tracks.

    The standard error is Greenwood's.

    Parameters
    ----------
    oracle
        Defines the rates.
    at_risk
        Number of tracks at risk at lifetimes 1, 2, ..., L.
    """
    hazard, counts = hazard_rate(oracle), list(at_risk)
    value = (1 - hazard) ** len(counts)
    return Known(value, value * math.sqrt(sum(hazard / (1 - hazard) / n for n in counts)))


def mean_lifetime(oracle: Oracle, *, frames: int, n_scenes: int) -> Known:
    """Mean lifetime, in frames that the tracker saw, if only the oracle ends tracks and each ended track is replaced.

    With N features alive in each of F frames, there are F N observations. They belong to N tracks plus the tracks that
    replaced those that ended in the F - 1 steps. That number is binomial.
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
