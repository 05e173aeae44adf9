"""How much a match supports a model when the noise has any scale up to a largest one (MAGSAC++)."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma, gammainc, gammaincc

Floats = NDArray[np.float64]

_QUANTILE = 3.64
"""An error is shorter than so many standard deviations with 99 %, in the four dimensions of a match."""


def marginal_support(squared: Floats) -> Floats:
    """Support of matches for models: from 1 without an error to 0 at the threshold, and beyond.

    One less the loss of MAGSAC++ in units of its largest value. The loss is the integral of r w(r), where the weight w
    is the density of an error r in four dimensions, averaged over all standard deviations up to threshold / 3.64, each
    cut off at 3.64 of its own.

    Parameters
    ----------
    squared
        (b, n) float64: squared errors in units of the squared threshold.

    Returns
    -------
    (b, n) float64

    References
    ----------
    D. Barath, J. Noskova, M. Ivashechkin, J. Matas, MAGSAC++, a Fast, Reliable and Accurate Robust Estimator, CVPR
    2020.
    """
    found: Floats = np.interp(np.sqrt(squared), _ERRORS, _SUPPORT, right=0.0)
    return found


def _loss(errors: Floats) -> Floats:
    """The loss (n,) of errors in units of the threshold, but for a constant factor."""
    most = _QUANTILE**2 / 2
    scaled = errors**2 * most
    tail = gamma(1.5) * (gammaincc(1.5, scaled) - gammaincc(1.5, most))
    return np.asarray(gamma(2.5) * gammainc(2.5, scaled) + scaled * tail, dtype=np.float64)


_ERRORS = np.linspace(0, 1, 1001)
_SUPPORT = 1 - _loss(_ERRORS) / _loss(_ERRORS[-1:])
