"""From irradiance to grey levels: noise and rounding."""

import numpy as np
from numpy.typing import NDArray


def expose(irradiance: NDArray[np.float32], noise_sigma: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Image that the sensor delivers.

    Parameters
    ----------
    irradiance
        (height, width) float32, 1 is the sensor's full range.
    noise_sigma
        Standard deviation of the Gaussian sensor noise, grey levels.
    rng
        Random generator of the noise.

    Returns
    -------
    (height, width) uint8
        Rounded, and clipped to 0..255.
    """
    grey = irradiance * np.float32(255.0)
    if noise_sigma > 0.0:
        grey += np.float32(noise_sigma) * rng.standard_normal(grey.shape, dtype=np.float32)
    levels: NDArray[np.uint8] = np.clip(np.rint(grey), 0.0, 255.0).astype(np.uint8)
    return levels
