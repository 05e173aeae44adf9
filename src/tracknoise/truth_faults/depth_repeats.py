"""How well depth maps agree with each other: random errors of depths, measured without any tracker.

A point that the depth map of one frame places in space has a predicted depth in a later frame. With the depth Z' that
the map of this frame has there, and the predicted depth Z, errors of both maps are in

    r = log(Z / Z')                                                                           (depth.repeats)

The median of r of two frames is left out: an error of their poses moves all points alike. Points that are hidden in the
later frame, and those beside an edge, are outliers. In cells of like depth, the standard deviation of one map is the
robust one of r over sqrt(2).

Errors that both maps share, as those of a fused model, are not in it. Errors of rotations on slanted surfaces are.
"""

from collections.abc import Sequence as ListOf

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.depth import sample
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.sequence import Sequence, camera_at
from tracknoise.text import significant
from tracknoise.truth_faults.audit_fit import MEDIAN_TO_CORE
from tracknoise.truth_faults.audit_samples import DEPTH_CELLS, DepthRepeats
from tracknoise.truth_faults.check_report import Item, Severity, Values
from tracknoise.truth_faults.depth_checks import depth_differences
from tracknoise.truth_faults.image_evidence import AS_GIVEN, Evidence, relative_pose
from tracknoise.words import SPACE

Array = NDArray[np.float64]

_APART = 5
"""Frames between two maps, so that errors which last a few frames are seen."""
_MOST_PAIRS, _MOST_POINTS = 8, 400
_LEAST_IN_CELL, _LEAST_IN_PAIR = 30, 15
_MOST_RELATIVE = 0.3
"""Depths that differ more from their prediction are of another surface."""


def depth_repeats(sequence: Sequence, frame: NDArray[np.intp], uv: Array, depth_m: Array) -> DepthRepeats:
    """Compare the depths of points with later maps.

    Parameters
    ----------
    sequence
        With depth maps.
    frame : (n,)
        In which each point has its depth.
    uv : (n, 2)
        Its position there, px.
    depth_m : (n,)
        Its depth there, metres.
    """
    poses = sequence.world_from_camera
    later = np.minimum(frame + _APART, len(poses) - 1)
    usable = (later > frame) & np.isfinite(poses[frame]).all(axis=(1, 2)) & np.isfinite(poses[later]).all(axis=(1, 2))
    frames, births = np.unique(frame[usable], return_counts=True)
    frames = frames[births >= _LEAST_IN_PAIR]
    chosen = frames[np.unique(np.linspace(0, len(frames) - 1, min(len(frames), _MOST_PAIRS)).astype(int))]
    differences = []
    for index in chosen.tolist():
        points = np.flatnonzero(frame == index)
        thinned = points[:: max(1, len(points) // _MOST_POINTS)]
        differences.append(_differences(sequence, index, int(later[thinned[0]]), uv[thinned], depth_m[thinned]))
    return _joined(differences)


def _differences(sequence: Sequence, index: int, later: int, uv: Array, depth_m: Array) -> tuple[Array, Array]:
    """Depths of points (n,) of a frame, and (depth.repeats) to a later one without their median."""
    depth = sequence.depth(later)
    if depth is None:
        return np.empty(0), np.empty(0)
    first, second = camera_at(sequence, index), camera_at(sequence, later)
    relative = invert(sequence.world_from_camera[later]) @ sequence.world_from_camera[index]
    moved = transform(relative, first.unproject(uv, depth_m))
    seen = second.project(moved)
    inside = np.flatnonzero((moved[:, 2] > 0.0) & np.isfinite(seen).all(axis=1))
    read = sample(depth, seen[inside], second)
    with np.errstate(divide="ignore", invalid="ignore"):
        difference = np.log(moved[inside, 2] / read.depth_m)
    usable = read.valid & ~read.edge
    return _of_one_surface(depth_m[inside[usable]], difference[usable])


def repeats_of_pairs(evidence: Evidence) -> DepthRepeats:
    """The same from points that were followed from one image to another, farther than to the next where there are."""
    differences = []
    for pair in evidence.flow.wide or evidence.flow.steps:
        has_depths = np.isfinite(pair.depth_first_m) & np.isfinite(pair.depth_second_m)
        relative = relative_pose(evidence.poses, pair)
        if has_depths.sum() >= _LEAST_IN_PAIR and np.isfinite(relative).all():
            difference = depth_differences(evidence, pair, relative, has_depths, AS_GIVEN)
            differences.append(_of_one_surface(pair.depth_first_m[has_depths], difference))
    return _joined(differences)


def repeatability(evidence: Evidence) -> Item | None:
    """The topic depth repeatability: by how much depths of two frames differ; None where too few points have both."""
    repeats = repeats_of_pairs(evidence)
    if not len(repeats.depth_m):
        return None
    near_m, far_m = (float(value) for value in repeats.depth_m[[0, -1]])
    near, far = (float(value) for value in repeats.relative[[0, -1]])
    texts = [f"{significant(100.0 * near, 2)}{SPACE}% at {significant(near_m, 2)} m"]
    if len(repeats.depth_m) > 1:
        texts.append(f"{significant(100.0 * far, 2)}{SPACE}% at {significant(far_m, 2)} m")
    text = f"Differences of depth maps show a standard deviation of single depths of {' and '.join(texts)}."
    values: Values = {"near_m": near_m, "near_relative": near, "far_m": far_m, "far_relative": far}
    return Item("depth repeatability", Severity.ok, text, values)


def _of_one_surface(depth_m: Array, difference: Array) -> tuple[Array, Array]:
    """Depths of points, and their differences without the median, of those that are seen in both frames."""
    same = np.abs(difference) < _MOST_RELATIVE
    if same.sum() < _LEAST_IN_PAIR:
        return np.empty(0), np.empty(0)
    return depth_m[same], difference[same] - np.median(difference[same])


def _joined(pairs: ListOf[tuple[Array, Array]]) -> DepthRepeats:
    """Robust standard deviations of one map in cells of like depth and number, of all pairs of maps."""
    depth_m, difference = (np.concatenate([np.empty(0), *(pair[side] for pair in pairs)]) for side in (0, 1))
    cells = min(DEPTH_CELLS, len(depth_m) // _LEAST_IN_CELL)
    parts = np.array_split(np.argsort(depth_m, kind="stable"), cells) if cells else []
    return DepthRepeats(
        np.array([np.median(depth_m[part]) for part in parts]),
        np.array([MEDIAN_TO_CORE * np.median(np.abs(difference[part])) / np.sqrt(2.0) for part in parts]),
    )
