"""How large an error of the truth would have to be to be named with a probability of 90 %.

It is named if its test is significant, its interval excludes zero, and its correction explains enough of held-out
clusters. For the last, errors of a size are put into residuals without them, so far as the other columns of the fit do
not absorb them: x_j = D V_j / V_jj for the design D and the inverse V of the information (audit.visible). The
least size at which their correction explains enough is found by trial. A quantile of Student's distribution is added,
because estimates scatter about the size.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.audit.assessment import ALPHA, Assessment, is_enough
from tracknoise.audit.held_out import Gain, gain, losses
from tracknoise.audit.parameters import NUMBERS, Parameter
from tracknoise.audit.resampled_fit import LEVEL, ResampledFit
from tracknoise.audit.robust import scales

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
    return 1.0 if NUMBERS[parameter].is_kind else NUMBERS[parameter].furthest


def _tested(found: ResampledFit, places: NDArray[np.intp], alpha: float) -> NDArray[np.float64]:
    """Size of each number at which Hotelling's test of all at level alpha is passed with the probability `POWER`."""
    k, n, moves = len(places), found.moves.effective(places), found.moves
    if n <= k:
        return np.full(k, np.inf)
    limit = np.sqrt(special.fdtri(k, n - k, 1.0 - alpha) * k * (n - 1) / (n - k))
    return np.asarray((limit + special.stdtrit(moves.freedom[places], POWER)) * moves.standard_errors[places])


def _by_interval(one: Assessment) -> NDArray[np.float64]:
    """Size of each number at which its interval excludes zero with the probability `POWER`."""
    moves = one.resampled.moves
    reach = special.stdtrit(moves.freedom, 0.5 + 0.5 * LEVEL) + special.stdtrit(moves.freedom, POWER)
    return np.asarray(reach * moves.standard_errors)[one.places]


def _explaining(one: Assessment) -> NDArray[np.float64]:
    """Least size of an error of each number whose correction explains enough, whatever its sign."""
    inverse = np.linalg.inv(one.fitted.equations.information)[:, one.places]
    fields = np.nan_to_num(one.fitted.design) @ (inverse / np.diagonal(inverse[one.places]))
    without = _without_errors(one)
    return np.array([_least(one, without, field) for field in np.moveaxis(fields, 2, 0)])


def _least(one: Assessment, without: NDArray[np.float64], field: NDArray[np.float64]) -> float:
    """Least size of an error, of which one of size 1 changes residuals by a field (n, 2)."""
    high = _largest(one.parameter)
    low = _START * high
    if not _explains(one, without, high * field):
        return np.inf
    for _ in range(_TRIALS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if _explains(one, without, middle * field) else (middle, high)
    return high


def _without_errors(one: Assessment) -> NDArray[np.float64]:
    """Held-out residuals of the basis, (n, 2), px, without what the correction explains of them."""
    basis = one.basis.resampled.like(one.tested)
    return np.asarray(basis.residual + one.fitted.residual - one.basis.fitted.residual)


def _explains(one: Assessment, without: NDArray[np.float64], errors: NDArray[np.float64]) -> bool:
    """Whether the correction of errors (n, 2), px, of either sign would explain enough."""
    return all(is_enough(_gain(one, without + sign * errors)) for sign in (-1.0, 1.0))


def _gain(one: Assessment, wrong: NDArray[np.float64]) -> Gain:
    """What the correction would explain of residuals (n, 2), px."""
    samples = one.tested.samples
    scale = scales(samples.group, wrong)
    return gain(one.tested.losses(scale), losses(samples, wrong, scale), level=LEVEL)
