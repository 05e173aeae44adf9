"""How the noise of the oracle depends on conditions that a tracker knows: texture and motion."""

import numpy as np
from numpy.typing import NDArray

USUAL_TEXTURE = 30.0
"""Texture strength at which noise has its stated size, (gray values / px)^2."""
USUAL_MOTION_PX = 1.0
"""Motion at which noise has its stated size, px per frame."""
_WEAKEST_TEXTURE, _LEAST_MOTION_PX = 1.0, 0.1


def texture_factor(strength: NDArray[np.float32], exponent: float) -> NDArray[np.float64]:
    """What noise is multiplied by at texture of some strength.

    Parameters
    ----------
    strength
        (n,) float32: `tracknoise.trackers.gradient.min_eigenvalue`. Below 1 it counts as 1.
    exponent
        The factor is (strength / `USUAL_TEXTURE`) to the power of minus this number.

    Returns
    -------
    (n,) float64
        1 where the strength is NaN.
    """
    return _power(strength.astype(np.float64), _WEAKEST_TEXTURE, USUAL_TEXTURE, -exponent)


def motion_factor(motion_px: NDArray[np.float64], exponent: float) -> NDArray[np.float64]:
    """What noise is multiplied by at some motion.

    Parameters
    ----------
    motion_px
        (n,) float64, px per frame of the nominal sequence. Below 0.1 it counts as 0.1.
    exponent
        The factor is (motion / `USUAL_MOTION_PX`) to the power of this number.

    Returns
    -------
    (n,) float64
        1 where the motion is NaN.
    """
    return _power(motion_px, _LEAST_MOTION_PX, USUAL_MOTION_PX, exponent)


def _power(values: NDArray[np.float64], least: float, usual: float, exponent: float) -> NDArray[np.float64]:
    return np.where(np.isnan(values), 1.0, (np.fmax(values, least) / usual) ** exponent)
