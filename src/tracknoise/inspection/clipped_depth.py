"""The topic clipped depth: whether the largest depth of a recording stands for everything farther away."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tracknoise.inspection.check_report import Item, Severity
from tracknoise.inspection.evidence import Evidence
from tracknoise.inspection.hypotheses import AS_GIVEN, Hypothesis
from tracknoise.inspection.residuals import relative_pose, reprojection_px
from tracknoise.printable import significant

_FACTORS = (1.25, 1.6, 2.5, 1000.0)
_FARTHER = tuple(Hypothesis("farther", "points are farther away", depth_scale=factor) for factor in _FACTORS)
_NEARER = tuple(Hypothesis("nearer", "points are nearer", depth_scale=1.0 / factor) for factor in _FACTORS)
_SAME = 1e-6
"""Depths that differ less, relative to themselves, are the same number: they were interpolated between pixels."""
_LEAST_SHARE, _FEWEST_POINTS, _FEWEST_PAIRS = 0.02, 5, 6
_MOST_GAIN, _LEAST_BETTER = 0.75, 0.75
"""Residuals must fall below this share, in at least this share of the pairs. Judged is by the half of the pairs with
the larger image motion."""
_FLOOR_PX = 0.05


def clipped_depth(evidence: Evidence) -> Item | None:
    """Compare points at the largest depth as if they were farther away, and nearer; None where nothing is wrong.

    Parameters
    ----------
    evidence
        Image motion of a sequence with its poses and depths.

    Returns
    -------
    Item or None
        A caveat if at least 2 % of the points have the largest depth to the digit, and the image motion fits clearly
        better with each of these points at some greater depth than at any smaller one. Right depths have no such
        preference. Without translation of the camera nothing can be said.
    """
    if not evidence.has_depth:
        return None
    depths = np.concatenate([pair.depth_first_m for pair in evidence.pairs])
    known = depths[np.isfinite(depths)]
    largest_m = float(known.max())
    share = float(_is_largest(known, largest_m).mean())
    if share < _LEAST_SHARE:
        return None
    found = np.array(list(_residuals(evidence, largest_m))).reshape(-1, 4)
    if len(found) < _FEWEST_PAIRS:
        return None
    motion, given, nearer, farther = np.maximum(found[found[:, 0] >= np.median(found[:, 0])], _FLOOR_PX).T
    if np.exp(np.log(farther / nearer).mean()) > _MOST_GAIN or (farther < nearer).mean() < _LEAST_BETTER:
        return None
    before, after = (significant(float(np.median(residuals)), 2) for residuals in (given, farther))
    moved = significant(float(np.median(motion)), 3)
    text = (
        f"{share:.0%} of the points have the largest depth, {significant(largest_m, 4)} m, to the digit. The residual "
        f"of these points falls from {before} to {after} px if they are farther away (image motion {moved} px). "
        "Their depths were probably clipped. Give such pixels no depth."
    )
    return Item("clipped depth", Severity.caveat, text, {"share": share, "largest_m": largest_m})


def _residuals(evidence: Evidence, largest_m: float) -> Iterator[tuple[float, float, float, float]]:
    """Motion of each pair, px, and three median residuals of its points at the largest depth, px.

    They are: at this depth, and with each point at this or that smaller, or this or that greater depth that fits best.
    """
    for pair in evidence.pairs:
        chosen = _is_largest(pair.depth_first_m[np.isfinite(pair.depth_first_m)], largest_m)
        relative = relative_pose(evidence.poses, pair)
        if chosen.sum() >= _FEWEST_POINTS and np.isfinite(relative).all():
            given, nearer, farther = (
                [np.linalg.norm(reprojection_px(pair, relative, evidence.camera, one), axis=1)[chosen] for one in tried]
                for tried in ((AS_GIVEN,), _NEARER, _FARTHER)
            )
            best = (np.min(tried, axis=0) for tried in (given, given + nearer, given + farther))
            at, below, above = (float(np.median(residual)) for residual in best)
            yield pair.motion_px, at, below, above


def _is_largest(depth_m: NDArray[np.float64], largest_m: float) -> NDArray[np.bool_]:
    return np.asarray(depth_m >= largest_m * (1.0 - _SAME), dtype=np.bool_)
