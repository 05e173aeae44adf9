"""Laws of growth from relative pose errors that were measured at several lags."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from tracknoise.geometry.accuracy import TOPICS, AccuracyKind, TruthAccuracy


def accuracy_of_growth(
    lag: NDArray[np.float64],
    rotation_deg: NDArray[np.float64],
    translation_m: NDArray[np.float64],
    *,
    source: str,
    kind: AccuracyKind = AccuracyKind.measured,
) -> TruthAccuracy:
    """The law (accuracy.growth) that fits measured relative pose errors best.

    Squares are fitted, with coefficients of at least 0, so that the sum of squared relative deviations is least.

    Parameters
    ----------
    lag
        (n,) float64: frames between the two poses, above 0.
    rotation_deg, translation_m
        (n,) float64: standard deviation per axis of the relative rotation and translation; NaN where unknown.
    source
        Where they are from.
    kind
        How they were found.

    Returns
    -------
    TruthAccuracy
        Without rotation or translation where no lag has one.
    """
    figures: dict[str, Any] = {}
    for topic, errors in (("rotation", rotation_deg), ("translation", translation_m)):
        known = np.isfinite(errors)
        if known.any():
            figures |= dict(zip(TOPICS[topic], _fitted(lag[known], errors[known]), strict=True))
    return TruthAccuracy(**figures, source=source, kind=kind)


def _fitted(lag: NDArray[np.float64], errors: NDArray[np.float64]) -> list[float]:
    """Sizes of the white, walking and drifting part."""
    squares = np.square(errors)
    if not squares.any():
        return [0.0, 0.0, 0.0]
    weight = 1.0 / np.maximum(squares, 1e-6 * squares.max())
    growth = np.column_stack([np.full(len(lag), 2.0), lag, np.square(lag)])
    sizes, _ = nnls(growth * weight[:, None], squares * weight)
    return [float(size) for size in np.sqrt(sizes)]
