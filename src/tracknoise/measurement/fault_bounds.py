"""What constant faults, and parts of the image that do not fit, leave of the errors of refined poses.

Poses absorb a part of a constant fault, such as a readout time that is not stated or a wrong focal length, and both
halves of the reference tracks do so alike. What they leave is in all positions, and in the residuals of the tracks, by
which its size theta is found (`PoseAdjustment.faults`). Its bound is

    bound^2 = theta^2 + (2 sigma)^2    (refined.faults)

with the standard error sigma, or half of the difference of both kinds of tracks where this is larger; both after the
prior of a plausible fault, so that what tracks do not tell is bounded by this. It counts where nothing is stated of the
fault, and where tracks contradict it.

Other faults of the geometry, such as parts of the scene that move, are shared by both halves as well. Where a part of
the image does not fit, both kinds of tracks say so. With their mean residuals f and m in the same part and frame,

    misfit^2 = mean of f . m    (refined.misfit)

Noise of single tracks, and what one kind has of its own, cancel. A misfit that is larger than what the bounds of faults
make is in the halves, which are moved apart for it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.accuracy import AccuracyKind, TruthAccuracy
from tracknoise.geometry.pose import invert
from tracknoise.inference.robust_fits import scales, scales_of_groups, squared
from tracknoise.measurement.adjusted_depths import FOCAL, READOUT, AdjustedDepths
from tracknoise.measurement.reference_tracks import KINDS
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import shutter_of
from tracknoise.truth.pose_adjustment import exponential

Array = NDArray[np.float64]

_BOUND, _CONTRADICTS = 2.0, 3.0
"""Standard errors."""
_PLAUSIBLE = {READOUT: 30.0, FOCAL: 0.03}
"""Standard deviations of a readout time in ms, and of a relative focal length, before any track is seen."""
_PARTS = 3
"""Parts of the image along each side."""
_FAR = 3.0
"""Sizes of residuals beyond which tracks are outliers."""


@dataclass(frozen=True, slots=True, eq=False)
class FaultBounds:
    """What constant faults may leave of the errors of refined poses."""

    shares: Mapping[str, float]  # of what a fault moves that poses do not absorb, by its figure
    bounds: TruthAccuracy  # of those that count
    left_px: float  # RMS of what the bounds leave of some observations, both coordinates together
    in_floor_px: float  # by these and by what is stated of other faults

    @classmethod
    def of(cls, depths: AdjustedDepths, stated: TruthAccuracy, rows: NDArray[np.bool_]) -> "FaultBounds":
        """By (refined.faults); `rows`, (n,) bool: observations of which is said what is left."""
        shares, bounds, squares = dict[str, float](), dict[str, float](), np.zeros((2, np.count_nonzero(rows), 2))
        for figure in (READOUT, FOCAL):
            fault, moved = depths.faults[figure], depths.displaced[figure]
            if not np.isfinite(fault.deviation):
                continue
            whole_px, left = rms(moved), fault.left[rows]
            shares[figure] = min(rms(fault.left) / whole_px, 1.0) if whole_px > 0.0 else 1.0
            told, sigma = abs(fault.size), max(fault.deviation, float(np.ptp(fault.of_kinds)) / 2.0)
            part = _PLAUSIBLE[figure] ** 2 / (_PLAUSIBLE[figure] ** 2 + sigma**2)
            told, sigma = part * told, np.sqrt(part) * sigma
            stated_size = stated.figures((figure,)).get(figure)
            if stated_size is None and figure == READOUT and shutter_of(depths.sequence) is not None:
                stated_size = 0.0
            if stated_size is None or told - _CONTRADICTS * sigma > stated_size:
                bounds[figure] = float(np.hypot(told, _BOUND * sigma))
                squares[0] += np.nan_to_num(left * bounds[figure]) ** 2
            squares[1] += np.nan_to_num(left * (bounds.get(figure, stated_size) or 0.0)) ** 2
        figures: dict[str, Any] = dict(bounds)
        accuracy = TruthAccuracy(**figures, source="reference tracks", kind=AccuracyKind.measured)
        return cls(shares, accuracy, *(rms(left_px) for left_px in np.sqrt(squares)))


def size(moved: NDArray[np.floating]) -> float:
    """Robust RMS of both coordinates (n, 2) together, px: that of a round Gaussian with the same median length."""
    has_any = np.isfinite(moved).all(axis=1).any()
    return float(np.sqrt(2.0) * scales_of_groups(np.zeros(len(moved), np.int8), moved)[0]) if has_any else 0.0


_MOST_SIZES = 10.0
"""Larger displacements, of points next to the camera, count as so many robust sizes."""


def rms(moved: NDArray[np.floating], frame: NDArray[np.integer] | None = None) -> float:
    """RMS of both coordinates (n, 2) together, px: as the floor has it.

    With frames (n,), robust sizes are those of the points of a frame: poses of some frames alone may be wrong.
    """
    parts = [moved] if frame is None else _of_frames(moved, frame)
    length = np.concatenate([_limited(part) for part in parts])
    return float(np.sqrt(np.mean(length**2))) if len(length) else 0.0


def _of_frames(moved: NDArray[np.floating], frame: NDArray[np.integer]) -> list[NDArray[np.floating]]:
    """Displacements by frame."""
    order = np.argsort(frame, kind="stable")
    return np.split(moved[order], np.flatnonzero(np.diff(frame[order])) + 1)


def _limited(moved: NDArray[np.floating]) -> NDArray[np.floating]:
    """Lengths of displacements that are known, none above so many robust sizes."""
    length = np.hypot(*moved.T)  # squares of points next to the camera may overflow
    return np.asarray(np.minimum(length[np.isfinite(length)], _MOST_SIZES * size(moved)))


def largest_bounds(one: TruthAccuracy, other: TruthAccuracy) -> TruthAccuracy:
    """The larger bound of each fault by reference tracks."""
    both = [bounds.figures((READOUT, FOCAL)) for bounds in (one, other)]
    largest: dict[str, Any] = {name: max(bounds.get(name, 0.0) for bounds in both) for name in {**both[0], **both[1]}}
    return replace(other, **largest)


def misfit_px2(depths: AdjustedDepths, rows: NDArray[np.bool_]) -> float:
    """(refined.misfit) of some observations, (n,) bool, px^2; its upper bound where it is established."""
    adjustment, tracks, best = depths.adjustment, depths.adjustment.tracks, depths.best
    depth_m = np.where(np.isfinite(tracks.depth_m), tracks.depth_m, best.depth_m)
    residual, kind = adjustment.residuals(best.poses, depth_m)[rows], tracks.kind[tracks.track[rows]]
    used = np.flatnonzero(np.isfinite(residual).all(axis=1))
    used = used[squared(residual[used], scales(kind[used], residual[used])) < 2.0 * _FAR**2]
    size = depths.sequence.camera.width, depths.sequence.camera.height
    part = np.clip(tracks.uv[rows] / size * _PARTS, 0, _PARTS - 1).astype(np.intp)
    place = np.unique((tracks.frame[rows] * _PARTS + part[:, 0]) * _PARTS + part[:, 1], return_inverse=True)[1]
    counts, means = [], []
    for number in range(len(KINDS)):
        of_kind = used[kind[used] == number]
        counts.append(np.bincount(place[of_kind], minlength=int(place.max(initial=0)) + 1))
        sums = [np.bincount(place[of_kind], column, len(counts[-1])) for column in residual[of_kind].T]
        means.append(np.stack(sums, axis=1) / np.maximum(counts[-1], 1)[:, None])
    both = np.minimum(*counts) > 0
    if np.count_nonzero(both) < 2:
        return 0.0
    weight = 1.0 / (1.0 / counts[0][both] + 1.0 / counts[1][both])
    product = np.sum(means[0][both] * means[1][both], axis=1)
    misfit = float(np.average(product, weights=weight))
    error = float(np.sqrt(np.sum((weight * (product - misfit)) ** 2)) / weight.sum())
    return misfit + _BOUND * error if misfit > _BOUND * error else max(misfit, 0.0)


def moved_apart(poses: Array, halves: tuple[Array, Array], factor: float) -> tuple[Array, Array]:
    """Halves whose differences from poses (n, 4, 4) are larger by a factor."""
    moved_halves = []
    for half in halves:
        posed = has_pose(poses) & has_pose(half)
        between, moved = invert(poses[posed]) @ half[posed], half.copy()
        turned = Rotation.from_matrix(between[:, :3, :3]).as_rotvec()
        moved[posed] = poses[posed] @ exponential(factor * np.concatenate([between[:, :3, 3], turned], axis=1))
        moved_halves.append(moved)
    return moved_halves[0], moved_halves[1]
