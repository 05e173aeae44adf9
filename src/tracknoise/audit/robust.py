"""Scales of residuals, and weights by which outliers count little."""

import numpy as np
from numpy.typing import NDArray

FREEDOM = 4.0
"""Degrees of freedom of Student's distribution, for residuals in two coordinates."""
_RAYLEIGH_MEDIAN = 1.1774100225154747
_LEAST_PX = 1e-3


def scales(group: NDArray[np.intp], residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Robust standard deviation per coordinate of residuals (n, 2) of the same group, (n,), px.

    It is that of a round Gaussian with the same median length, and at least a thousandth of a pixel.

    Parameters
    ----------
    group : (n,)
        Number of the tracker and age, see `tracknoise.audit.samples.AuditSamples.group`.
    residual : (n, 2)
        px; NaN is left out.
    """
    length = np.hypot(residual[:, 0], residual[:, 1])
    _, place = np.unique(group, return_inverse=True)
    order = np.lexsort((length, place))  # NaN last
    known = np.bincount(place, np.isfinite(length)).astype(np.intp)
    first = np.cumsum(np.bincount(place)) - np.bincount(place)
    low, high = first + np.maximum(known - 1, 0) // 2, first + known // 2
    median = 0.5 * (length[order][low] + length[order][np.minimum(high, len(length) - 1)])
    scale: NDArray[np.float64] = np.maximum(np.nan_to_num(median / _RAYLEIGH_MEDIAN), _LEAST_PX)[place]
    return scale


def squared(residual: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared lengths of residuals (n, 2) in units of their scales (n,)."""
    found: NDArray[np.float64] = np.sum(residual * residual, axis=1) / (scale * scale)
    return found


def weights(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights of Student's distribution for squared distances (n,); 0 where one is unknown."""
    found: NDArray[np.float64] = np.nan_to_num((FREEDOM + 2.0) / (FREEDOM + distance))
    return found
