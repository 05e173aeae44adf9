"""Parts of the scene that move: some points fit poses and depths exactly, and the others do not fit at all."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.inspection.evidence import Evidence
from tracknoise.inspection.hypotheses import AS_GIVEN
from tracknoise.inspection.pairs import Pair
from tracknoise.inspection.residuals import relative_pose, reprojection_px

_LEAST_MOTION_PX, _FIT_SHARE = 2.0, 0.15
"""A point that moves at least this far fits if its residual is at most this share of its own motion."""
_LEAST_SHARE, _LEAST_RATIO = 0.25, 10.0
"""Wrong poses or depths leave fewer points that fit, or a gradual transition between those that do and do not."""
_FEWEST_POINTS = 100


@dataclass(frozen=True, slots=True)
class MovingScene:
    """Points in two groups.

    Attributes
    ----------
    share
        Share of points that fit.
    fit_px, other_px
        Median residual of the points that fit, and of the others.
    """

    share: float
    fit_px: float
    other_px: float


def moving_scene(evidence: Evidence) -> MovingScene | None:
    """Both groups of points; None without depth, or where points do not form two groups."""
    if not evidence.has_depth:
        return None
    points = np.concatenate([_points(evidence, pair) for pair in evidence.pairs])
    points = points[points[:, 1] >= _LEAST_MOTION_PX]
    fits: NDArray[np.bool_] = points[:, 0] <= _FIT_SHARE * points[:, 1]
    if len(points) < _FEWEST_POINTS or fits.mean() < _LEAST_SHARE or fits.all():
        return None
    found = MovingScene(float(fits.mean()), float(np.median(points[fits, 0])), float(np.median(points[~fits, 0])))
    return found if _LEAST_RATIO * found.fit_px <= found.other_px < np.inf else None


def _points(evidence: Evidence, pair: Pair) -> NDArray[np.float64]:
    """(m, 2) float64: residual and motion of each point with depth, px; none where a pose is missing."""
    relative = relative_pose(evidence.poses, pair)
    if not np.isfinite(relative).all():
        return np.empty((0, 2))
    residual = np.linalg.norm(reprojection_px(pair, relative, evidence.camera, AS_GIVEN), axis=1)
    motion = np.linalg.norm(pair.uv_second - pair.uv_first, axis=1)[np.isfinite(pair.depth_first_m)]
    return np.column_stack([residual, motion])
