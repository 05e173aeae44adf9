"""How consistent a right model is under a robust loss.

Solvers report the inverse of the Gauss-Newton Hessian, 1 / E[w] for residuals of covariance 1. The estimate has the
variance E[psi^2] / E[psi']^2. For blocks of two residuals of norm r, with weights w(r) and psi = w r,

    NEES / dof = E[w] E[w^2 r^2] / 2 / E[w + r w' / 2]^2    (loss.nees)

This is not 1. A right model that is judged without it looks wrong.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from tracknoise.proof.loss import Loss

_NORMS = np.concatenate([np.linspace(0.0, 40.0, 80_001), np.geomspace(40.0, 1e5, 20_001)[1:]])


def expected_nees(loss: Loss, *, nu: float = np.inf, scale: float = 1.0) -> float:
    """(loss.nees) of observations.

    Parameters
    ----------
    loss
        Of whitened observations.
    nu
        Degrees of freedom of Student's distribution of the errors; infinite for a Gaussian.
    scale
        Standard deviation of a Gaussian, or square root of the scale of a Student, in units of the assumed one.
    """
    density = _density(_NORMS / scale, nu) / scale
    weight = loss.weights(np.stack([_NORMS, np.zeros_like(_NORMS)], axis=1))[:, 0]
    slope = np.gradient(weight, _NORMS)
    claimed = _mean(weight, density)
    spread = _mean(weight**2 * _NORMS**2, density) / 2.0
    return claimed * spread / _mean(weight + _NORMS * slope / 2.0, density) ** 2


def _density(norms: NDArray[np.float64], nu: float) -> NDArray[np.float64]:
    """Of the norm of two coordinates of scale 1."""
    if np.isfinite(nu):
        return np.asarray(norms * stats.f.pdf(norms**2 / 2.0, 2, nu))
    return np.asarray(stats.rayleigh.pdf(norms))


def _mean(values: NDArray[np.float64], density: NDArray[np.float64]) -> float:
    return float(np.trapezoid(values * density, _NORMS))
