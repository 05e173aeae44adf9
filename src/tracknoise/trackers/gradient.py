"""The gradients of the image around a feature: the axis along which a tracker is best constrained, and how well."""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.tracker import Frame

WINDOW_PX = 15
"""Side of the window around a feature in which gradients are used, px."""
LEAST_COHERENCE = 0.1
"""Below this coherence, gradients are about equally strong in all directions, and none dominates."""
_HALF_PX = WINDOW_PX // 2
_MARGIN_PX = _HALF_PX + 1  # a derivative needs its neighbours too
_SCALE = 8  # sum of the weights of Sobel's derivative

Derivatives = tuple[NDArray[np.int16], NDArray[np.int16]]


def dominant_gradient(frame: Frame, uv: NDArray[np.float64]) -> NDArray[np.float32]:
    """Orientation of the dominant gradient at positions in an image.

    It is that of the eigenvector of the larger eigenvalue l1 of the structure tensor, the sum of g g^T over the window
    around the nearest pixel, where g are the image's derivatives (Sobel). One dominates where the coherence
    (l1 - l2) / (l1 + l2) is at least `LEAST_COHERENCE`: 1 on an edge, 0 where all directions are equal. The
    gradient is an axis and has no sign.

    Parameters
    ----------
    frame
        The image. Its derivatives are computed at most once, and only where there are positions.
    uv
        (n, 2) float64, px.

    Returns
    -------
    (n,) float32
        Radians from u towards v, in (-pi/2, pi/2]. NaN where no gradient dominates, and where the window, with a
        pixel more around it for the derivatives, does not lie in the image.
    """
    return _where_inside(frame, uv, _orientation).astype(np.float32)


def min_eigenvalue(frame: Frame, uv: NDArray[np.float64]) -> NDArray[np.float32]:
    """Smaller eigenvalue of the mean structure tensor at positions in an image: how strong its texture is there.

    Shapes: uv (n, 2) px; returns (n,). (Gray values / px)^2. NaN where the window of `dominant_gradient` does not lie
    in the image.
    """
    return _where_inside(frame, uv, _smaller_eigenvalue).astype(np.float32)


def shift_covariance(
    frame: Frame, uv: NDArray[np.float64], residual: NDArray[np.float32], *, window_px: int
) -> NDArray[np.float32]:
    """Covariance that least squares promise for the shift of a patch: s^2 (sum of g g^T over its pixels)^-1.

    The sum is that of the window of `dominant_gradient`, scaled to the pixels of the patch. s is the standard deviation
    of Gaussian differences of gray values, sqrt(pi / 2) times their mean absolute value.

    `frame`, `uv`: the image, and positions (n, 2) in it, px; `residual`: (n,) mean absolute differences of the patches,
    gray values; `window_px`: side of the patches, px. Returns (n, 3) float32: uu, uv and vv, px^2; NaN where gradients
    have one direction only, and where the window is not in the image.
    """
    uu, cross, vv = (
        _where_inside(frame, uv, lambda *tensor: np.stack(tensor, axis=1), columns=3).T
        / (_SCALE * WINDOW_PX / window_px) ** 2
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = 0.5 * np.pi * residual.astype(np.float64) ** 2 / (uu * vv - cross * cross)
        covariance = np.stack([vv, -cross, uu], axis=1) * factor[:, None]
    return np.where(np.isfinite(covariance), covariance, np.nan).astype(np.float32)


def _where_inside(
    frame: Frame, uv: NDArray[np.float64], of_tensor: Callable[..., NDArray[np.float64]], *, columns: int = 1
) -> NDArray[np.float64]:
    """A function of the structure tensor at positions, (n,) or (n, columns); NaN where the window leaves the image."""
    values = np.full((len(uv), columns) if columns > 1 else len(uv), np.nan)
    least, most = _MARGIN_PX - 0.5, np.array(frame.size) - _MARGIN_PX - 0.5
    inside = np.all((uv >= least) & (uv < most), axis=1)
    if inside.any():
        column, row = np.floor(uv[inside] + 0.5).astype(np.intp).T
        values[inside] = of_tensor(*_tensor(frame.memo("derivatives", _derivatives), column, row))
    return values


def _derivatives(image: NDArray[np.uint8]) -> Derivatives:
    """Along u and v, `_SCALE` times as large as they are: whole numbers, so that sums of them are exact."""
    du, dv = cv2.spatialGradient(image)
    return np.asarray(du, dtype=np.int16), np.asarray(dv, dtype=np.int16)


def _tensor(
    derivatives: Derivatives, column: NDArray[np.intp], row: NDArray[np.intp]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Sums over the windows of the products uu, uv and vv of the derivatives."""
    side = np.arange(-_HALF_PX, _HALF_PX + 1)
    rows, columns = (row[:, None] + side)[:, :, None], (column[:, None] + side)[:, None, :]
    u, v = (derivative[rows, columns].astype(np.int32) for derivative in derivatives)
    uu, uv, vv = ((a * b).sum(axis=(1, 2), dtype=np.int64) for a, b in ((u, u), (u, v), (v, v)))
    return uu, uv, vv


def _orientation(uu: NDArray[np.int64], uv: NDArray[np.int64], vv: NDArray[np.int64]) -> NDArray[np.float64]:
    """Half the angle of (uu - vv, 2 uv), whose length is l1 - l2; l1 + l2 is uu + vv."""
    coherent = (np.hypot(uu - vv, 2 * uv) >= LEAST_COHERENCE * (uu + vv)) & (uu + vv > 0)
    return np.where(coherent, np.arctan2(2 * uv, uu - vv) / 2, np.nan)


def _smaller_eigenvalue(uu: NDArray[np.int64], uv: NDArray[np.int64], vv: NDArray[np.int64]) -> NDArray[np.float64]:
    """Of the tensor's mean over the window, in the unit of derivatives."""
    return np.asarray((uu + vv - np.hypot(uu - vv, 2 * uv)) / (2 * (_SCALE * WINDOW_PX) ** 2))
