"""Whether depth is along the optical axis or along the ray, from how it changes from image to image."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.pose import transform
from tracknoise.inspection.evidence import Evidence
from tracknoise.inspection.hypotheses import AS_GIVEN, AS_RAY_DEPTH, Hypothesis
from tracknoise.inspection.jackknife import jackknife
from tracknoise.inspection.pairs import Pair
from tracknoise.inspection.residuals import relative_pose

_MOST_RELATIVE = 0.05
"""Depths that differ more from their prediction are of another surface."""
_SURE_SD, _TOLERANCE = 5.0, 0.4


@dataclass(frozen=True, slots=True)
class DepthKind:
    """Fit of the kind of depth.

    Attributes
    ----------
    slope
        0 if depth is along the optical axis, 1 if it is along the ray.
    sd
        Its standard deviation, by a jackknife over stretches of the recording.
    """

    slope: float
    sd: float

    @property
    def is_ray(self) -> bool:
        """Whether depth is clearly along the ray."""
        return abs(self.slope - 1.0) < _TOLERANCE and self.slope > _SURE_SD * self.sd


def depth_kind(evidence: Evidence) -> DepthKind | None:
    """Fit the kind of depth; None without depths, where it is known, or where both kinds would look the same."""
    if not evidence.has_depth or evidence.z_depth_from is not None:
        return None
    sums = [found for pair in evidence.pairs if (found := _sums(evidence, pair)) is not None]
    table = np.array(sums).reshape(-1, 2)
    if len(table) < 2 or table[:, 1].sum() <= 0.0:
        return None
    slope, sd = jackknife(table, lambda rows: float(rows[:, 0].sum() / rows[:, 1].sum()))
    return DepthKind(slope, sd)


def _sums(evidence: Evidence, pair: Pair) -> tuple[float, float] | None:
    """Sums of products of one pair for the regression of differences on what rays would make them."""
    relative = relative_pose(evidence.poses, pair)
    known = np.isfinite(pair.depth_first_m) & np.isfinite(pair.depth_second_m)
    if not known.any() or not np.isfinite(relative).all():
        return None
    given = _differences(evidence, pair, relative, known, AS_GIVEN)
    rays = _differences(evidence, pair, relative, known, AS_RAY_DEPTH)
    same = (np.abs(given) < _MOST_RELATIVE) & (np.abs(rays) < _MOST_RELATIVE)
    made = (given - rays)[same]
    return float(given[same] @ made), float(made @ made)


def _differences(
    evidence: Evidence,
    pair: Pair,
    relative: NDArray[np.float64],
    known: NDArray[np.bool_],
    assumed: Hypothesis,
) -> NDArray[np.float64]:
    """(n,) float64: logarithm of predicted over measured depth in the second image."""
    first, second = (evidence.camera.bearings(uv[known]) for uv in (pair.uv_first, pair.uv_second))
    points = first * assumed.depths(first, pair.depth_first_m[known])[:, None]
    predicted = transform(relative, points)[:, 2]
    with np.errstate(all="ignore"):
        return np.log(np.maximum(predicted, 0.0) / assumed.depths(second, pair.depth_second_m[known]))
