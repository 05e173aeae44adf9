"""Motion of true positions in the image, from one frame that the tracker saw to the next."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.statistics.definitions import LEAST_MOTION_PX
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.steps import followers


@dataclass(frozen=True, slots=True)
class ImageMotion:
    """Visible observations whose true position has moved since the frame before, by `LEAST_MOTION_PX` or more.

    Attributes
    ----------
    rows : (n,) intp
        Rows of the observations.
    direction : (n, 2) float64
        Unit vector of the motion.
    length_px : (n,) float64
        Length of the motion between two frames that the tracker saw.
    """

    rows: NDArray[np.intp]
    direction: NDArray[np.float64]
    length_px: NDArray[np.float64]


def image_motion(sequence: PreparedSequence, chosen: NDArray[np.bool_]) -> ImageMotion:
    """Motion of the true positions of chosen observations, (rows,) bool, whose predecessors are chosen too."""
    seen = sequence.seen
    true_px = sequence.observations.select("u_true_px", "v_true_px").to_numpy()
    rows = sequence.ordered_where(chosen & ~np.isnan(true_px).any(axis=1))
    late = followers(sequence.track_row[rows], seen.frame[rows], seen.speed[rows], 1)
    step = true_px[rows[late]] - true_px[rows[late - 1]]
    length = np.sqrt(step[:, 0] ** 2 + step[:, 1] ** 2)
    directed = (length >= LEAST_MOTION_PX) & seen.visible[rows[late]]
    return ImageMotion(rows[late][directed], step[directed] / length[directed, None], length[directed])


def along_and_across(
    sequence: PreparedSequence, rows: NDArray[np.intp], direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Errors of observations along unit vectors (n, 2) and across them, to the right, (n, 2)."""
    (du, dv), (d_u, d_v) = sequence.seen.error_px[rows].T, direction.T
    return np.column_stack([d_u * du + d_v * dv, d_u * dv - d_v * du])
