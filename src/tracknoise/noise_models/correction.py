"""Correction of the mean error."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tracknoise.exceptions import SettingsError
from tracknoise.noise_models.model import Bias, BiasKind


def corrected(
    bias: Bias, uv: NDArray[np.float64], ages: NDArray[np.float64], flow: ArrayLike | None
) -> NDArray[np.float64]:
    """Positions (n, 2) px without the bias, at ages (n,). First positions stay: biases are about them.

    Raises
    ------
    SettingsError
        If the bias is along the motion, and there is no flow.
    """
    if bias.kind == BiasKind.BY_AGE:
        return uv - by_age(bias, ages)
    if bias.kind == BiasKind.ALONG_MOTION:
        if flow is None:
            raise SettingsError("correction: found no flow, expected it because the bias is along the motion")
        later = np.where(ages[:, None] > 0.0, np.asarray(flow, dtype=np.float64), 0.0)
        return np.asarray(uv - bias.per_motion * later)
    return uv.copy()


def by_age(bias: Bias, ages: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean error at ages (n,), (n, 2) px: between the known ages along a line, beyond them that of the last."""
    mean = np.array(bias.mean_px)
    since = np.array((0, *bias.ages), dtype=np.float64)
    return np.stack([np.interp(ages, since, [0.0, *mean[:, axis]]) for axis in (0, 1)], axis=1)
