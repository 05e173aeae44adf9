"""Topics about depth: its unit, its limits, and whether it is along the optical axis or the ray."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.depth import EDGE_RELATIVE_SPREAD, DepthMap
from tracknoise.geometry.pose import transform
from tracknoise.inference.jackknife import jackknife
from tracknoise.sequences.depth_samples import MOST_EDGES, edge_share, sampled_depths
from tracknoise.sequences.sequence import Sequence
from tracknoise.text import significant
from tracknoise.truth_faults.check_report import Item, Severity, Values
from tracknoise.truth_faults.image_evidence import (
    AS_GIVEN,
    AS_RAY_DEPTH,
    Evidence,
    Hypothesis,
    Pair,
    relative_pose,
    reprojection_px,
)

NEAREST_M, FARTHEST_M = 0.05, 1000.0
"""A median depth outside of this range is not metres."""
_DEPTH_UNIT_LEAST_SHARE = 0.2


def depths(sequence: Sequence) -> Item:
    """Median depth and share of pixels with depth in some frames."""
    maps = sampled_depths(sequence)
    if not maps:
        if sequence.truths:
            return Item("depth", Severity.ok, f"There are no depth maps; the truth `{sequence.truths[0]}` is possible.")
        return Item("depth", Severity.caveat, "There is no depth: a truth from depth is not possible.")
    share = depth_share(maps)
    values = np.concatenate([depth.depth_m[depth.valid] for depth in maps.values()])
    if not len(values):
        return Item("depth", Severity.fatal, "No pixel has a valid depth.", {"share": 0.0})
    low, median, high = (float(value) for value in np.percentile(values, [5, 50, 95]))
    numbers: Values = {"share": share, "median_m": median, "low_m": low, "high_m": high}
    text = (
        f"The median depth is {significant(median, 3)} m; "
        f"90 % lie between {significant(low, 3)} and {significant(high, 3)} m. "
        f"{share:.0%} of pixels have depth."
    )
    if not NEAREST_M <= median <= FARTHEST_M:
        return Item("depth", Severity.fatal, f"{text} The unit is probably not metres.", numbers)
    is_dense = next(iter(maps.values())).radius_px is None
    if is_dense and share < _DEPTH_UNIT_LEAST_SHARE:
        return Item("depth", Severity.caveat, f"{text} Few features will have a true position.", numbers)
    edges = edge_share(sequence, maps)
    if edges > MOST_EDGES:
        text = (
            f"{text} At {edges:.0%} of these pixels, depths of neighbours differ by more than "
            f"{EDGE_RELATIVE_SPREAD:.0%}: features there count as beside a depth edge, and have no true position. If "
            "noise is the cause, smooth the depths."
        )
        return Item("depth", Severity.caveat, text, {**numbers, "edges": edges})
    return Item("depth", Severity.ok, text, numbers)


def depth_share(maps: Mapping[int, DepthMap]) -> float:
    """Share of pixels with depth, over all maps."""
    return float(np.mean([depth.valid.mean() for depth in maps.values()]))


_FACTORS = (1.25, 1.6, 2.5, 1000.0)
_FARTHER = tuple(Hypothesis("farther", "points are farther away", depth_scale=factor) for factor in _FACTORS)
_NEARER = tuple(Hypothesis("nearer", "points are nearer", depth_scale=1.0 / factor) for factor in _FACTORS)
_SAME = 1e-6
"""Depths that differ less, relative to themselves, are the same number: they were interpolated between pixels."""
_CLIPPED_LEAST_SHARE, _FEWEST_POINTS, _FEWEST_PAIRS = 0.02, 5, 6
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
    finite = depths[np.isfinite(depths)]
    largest_m = float(finite.max())
    share = float(_is_largest(finite, largest_m).mean())
    if share < _CLIPPED_LEAST_SHARE:
        return None
    rows = np.array(list(_residuals(evidence, largest_m))).reshape(-1, 4)
    if len(rows) < _FEWEST_PAIRS:
        return None
    motion, as_given, nearer, farther = np.maximum(rows[rows[:, 0] >= np.median(rows[:, 0])], _FLOOR_PX).T
    if np.exp(np.log(farther / nearer).mean()) > _MOST_GAIN or (farther < nearer).mean() < _LEAST_BETTER:
        return None
    before, after = (significant(float(np.median(residuals)), 2) for residuals in (as_given, farther))
    moved = significant(float(np.median(motion)), 3)
    text = (
        f"{share:.0%} of the points have exactly the largest depth, {significant(largest_m, 4)} m. The residual of "
        f"these points falls from {before} to {after} px if they are farther away (image motion {moved} px). "
        "Their depths were probably clipped. Remove the depth of such pixels."
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
            as_given, nearer, farther = (
                [
                    np.linalg.norm(reprojection_px(pair, relative, evidence.camera, assumed), axis=1)[chosen]
                    for assumed in tried
                ]
                for tried in ((AS_GIVEN,), _NEARER, _FARTHER)
            )
            best = (np.min(tried, axis=0) for tried in (as_given, as_given + nearer, as_given + farther))
            at, below, above = (float(np.median(residual)) for residual in best)
            yield pair.motion_px, at, below, above


def _is_largest(depth_m: NDArray[np.float64], largest_m: float) -> NDArray[np.bool_]:
    return np.asarray(depth_m >= largest_m * (1.0 - _SAME), dtype=np.bool_)


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

    @property
    def is_z(self) -> bool:
        """Whether depth is clearly along the optical axis."""
        return abs(self.slope) < _TOLERANCE and 1.0 - self.slope > _SURE_SD * self.sd


def depth_kind(evidence: Evidence) -> DepthKind | None:
    """Fit the kind of depth; None without depths, where it is known, or where both kinds would look the same."""
    if not evidence.has_depth or evidence.z_depth_from is not None:
        return None
    sums = [pair_sums for pair in evidence.pairs if (pair_sums := _sums(evidence, pair)) is not None]
    table = np.array(sums).reshape(-1, 2)
    table = table[table[:, 1] > 0.0]
    if len(table) < 2:
        return None
    slope, sd = jackknife(table, lambda rows: float(rows[:, 0].sum() / rows[:, 1].sum()))
    return DepthKind(slope, sd)


def _sums(evidence: Evidence, pair: Pair) -> tuple[float, float] | None:
    """Sums of products of one pair for the regression of differences on what rays would make them."""
    relative = relative_pose(evidence.poses, pair)
    has_depths = np.isfinite(pair.depth_first_m) & np.isfinite(pair.depth_second_m)
    if not has_depths.any() or not np.isfinite(relative).all():
        return None
    as_given = depth_differences(evidence, pair, relative, has_depths, AS_GIVEN)
    rays = depth_differences(evidence, pair, relative, has_depths, AS_RAY_DEPTH)
    same = (np.abs(as_given) < _MOST_RELATIVE) & (np.abs(rays) < _MOST_RELATIVE)
    expected = as_given[same] - rays[same]
    return float(as_given[same] @ expected), float(expected @ expected)


def depth_differences(
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
