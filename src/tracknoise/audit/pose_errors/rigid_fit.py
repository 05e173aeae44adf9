"""Robust least squares for one small pose error per frame.

The equations (rigid) of one pair of frames add up to the 6 x 6 matrix S = sum w J'J and the vector g = sum w J'e. The
normal equations of all frames are a Laplacian with these matrices as weights, whose band is as wide as the distance of
the frames. A weak prior, `PRIOR`, fixes the motion that all frames share, and any that the tracks do not determine.

Weights are those of a Cauchy distribution, whose scale is the median residual at the same number of steps. They come
from all tracks; the two halves are then fitted alone, with the same weights.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from tracknoise.audit.pose_errors.rigid_rows import REACH, RigidRows

PRIOR = 1.0
"""Standard deviation of a pose error before any track is seen: rad, and units of length."""
FEWEST = 30
"""Fewest tracks in a frame that determine its pose error."""
_ROUNDS = 6
_TAIL = 2.4
"""Residual, in units of the scale, at which the weight of an observation is halved."""
_LEAST_SCALE_PX = 0.01
_WIDTH = 6 * (REACH + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Normal:
    """Normal equations, which add up.

    Attributes
    ----------
    band : (6 (`REACH` + 1), 6 frames) float64
        Lower part of the matrix, as `scipy.linalg.solveh_banded` takes it.
    right : (frames, 6) float64
        Right side.
    count : (frames,) int64
        Tracks that were seen in a frame, those that began there only if they were seen in the next one too.
    """

    band: NDArray[np.float64]
    right: NDArray[np.float64]
    count: NDArray[np.int64]

    def __add__(self, other: "Normal") -> "Normal":
        return Normal(self.band + other.band, self.right + other.right, self.count + other.count)

    def solve(self, axes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pose errors eta, (frames, 6); NaN of frames with too few tracks.

        Parameters
        ----------
        axes
            (frames, 6, 6) float64: Ad of each pose.
        """
        band = self.band.copy()
        band[0] += 1.0 / PRIOR**2
        xi = solveh_banded(band, self.right.ravel(), lower=True, check_finite=False).reshape(-1, 6)
        xi[self.count < FEWEST] = np.nan
        return np.asarray(np.einsum("nij,nj->ni", axes, xi))


def normal_equations(rows: RigidRows, weight: NDArray[np.float64], axes: NDArray[np.float64]) -> Normal:
    """Normal equations of weighted rows, (n,), for the pose errors xi in the axes of their cameras.

    Parameters
    ----------
    rows
        All with an equation.
    weight
        Of each equation, 1/px^2.
    axes
        As in `Normal.solve`.
    """
    n_frames = len(axes)
    codes, pair = np.unique(rows.again * n_frames + rows.frame, return_inverse=True)
    start, end = np.divmod(codes, n_frames)
    squares, right = _sums(rows, weight, pair, len(codes))
    band, total = np.zeros((_WIDTH, 6 * n_frames)), np.zeros((n_frames, 6))
    for one, other, sign in ((start, start, 1.0), (end, end, 1.0), (end, start, -1.0)):
        _add_blocks(band, one, other, sign * np.swapaxes(axes[one], 1, 2) @ squares @ axes[other])
    for frame, sign in ((start, 1.0), (end, -1.0)):
        np.add.at(total, frame, sign * np.einsum("nji,nj->ni", axes[frame], right))
    begun = rows.again[np.abs(rows.frame - rows.again) == 1]
    count = np.bincount(begun, minlength=n_frames) + np.bincount(rows.frame, minlength=n_frames)
    return Normal(band, total, count)


def _sums(
    rows: RigidRows, weight: NDArray[np.float64], pair: NDArray[np.intp], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """S and g of each pair of frames, (pairs, 6, 6) and (pairs, 6)."""
    columns = np.ascontiguousarray(np.transpose(rows.jacobian, (2, 1, 0)))  # (6, 2, n)
    weighted = columns * weight
    squares, right = np.empty((count, 6, 6)), np.empty((count, 6))
    for one in range(6):
        right[:, one] = np.bincount(pair, (weighted[one] * rows.again_px.T).sum(axis=0), count)
        for other in range(one + 1):
            products = (weighted[one] * columns[other]).sum(axis=0)
            squares[:, one, other] = squares[:, other, one] = np.bincount(pair, products, count)
    return squares, right


def _add_blocks(
    band: NDArray[np.float64], one: NDArray[np.int64], other: NDArray[np.int64], blocks: NDArray[np.float64]
) -> None:
    """Add blocks (n, 6, 6), with frames (n,) of their rows and columns, to the lower part of a symmetric matrix."""
    late = (one >= other)[:, None, None]
    row, column = 6 * np.maximum(one, other), 6 * np.minimum(one, other)
    placed = np.where(late, blocks, np.swapaxes(blocks, 1, 2))
    for down in range(6):
        for across in range(6):
            below = row + down - column - across
            lower = below >= 0
            np.add.at(band, (below[lower], column[lower] + across), placed[lower, down, across])


def predicted(
    eta: NDArray[np.float64], jacobian: NDArray[np.float64], start: NDArray[np.int64], end: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Errors (n, 2) by (rigid), px; NaN where the pose error of one of the two frames is not known."""
    error: NDArray[np.float64] = np.einsum("nij,nj->ni", jacobian, eta[start] - eta[end])
    return error


def robust_weights(rows: RigidRows, axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weight of each equation, (n,), 1/px^2.

    Parameters
    ----------
    rows
        Of one tracker, all with an equation.
    axes
        As in `Normal.solve`.
    """
    lag = np.abs(rows.frame - rows.again)
    weight = _weights(rows.again_px, lag)
    for _ in range(_ROUNDS):
        eta = normal_equations(rows, weight, axes).solve(axes)
        error_px = np.nan_to_num(predicted(eta, rows.jacobian, rows.again, rows.frame))
        weight = _weights(rows.again_px - error_px, lag)
    return weight


def _weights(residual_px: NDArray[np.float64], lag: NDArray[np.int64]) -> NDArray[np.float64]:
    """Weights of a Cauchy distribution with the scale of each lag."""
    size = np.hypot(*residual_px.T)
    scale = np.full(REACH + 1, _LEAST_SCALE_PX)
    for one in np.unique(lag):
        scale[one] = max(float(np.median(size[lag == one])) / _MEDIAN_SIZE, _LEAST_SCALE_PX)
    return np.asarray(1.0 / (scale[lag] ** 2 + (size / _TAIL) ** 2))


_MEDIAN_SIZE = 1.1774
"""Median length of a vector whose two components are standard Gaussian."""
