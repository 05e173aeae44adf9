"""Poses of a sequence, refined by reference tracks: which poses lead, and how wrong refined and stated ones are.

What decides is known before a tracker is measured. Poses lead that are stated to be exact, or to be better than the
refined ones. Otherwise refined poses lead where reference tracks determine them.

Two disjoint halves of the reference tracks give poses of their own, with errors e1 and e2. That of the poses by all
tracks is about their mean, and has the variance of

    (e1 - e2) / 2    (refined.floor)

The errors of the halves are taken to be independent. Nothing else is assumed of the tracks. The halves are the two
kinds of tracks where these differ by more.

Poses absorb a part of a constant fault, such as a readout time that is not stated or a wrong focal length, and both
halves do so alike. What they leave is in all positions, and in the residuals r of the reference tracks. With D, what a
fault of size 1 leaves in these, its size is fitted,

    r = sum of D theta + noise    (refined.faults)

and its bound^2 is theta^2 and the square of twice its standard error: that between tracks, or half of the difference of
both kinds where this is larger. It counts where nothing is stated of the fault, and where tracks contradict it.

Other faults of the geometry, such as parts of the scene that move, are shared by both halves as well. Where a part of
the image does not fit, both kinds of tracks say so. With their mean residuals f and m in the same part and frame,

    misfit^2 = mean of f . m    (refined.misfit)

Noise of single tracks, and what one kind has of its own, cancel. A misfit that is larger than what the bounds of faults
make is in the halves, which are moved apart for it.

Relative poses of frames that are k apart differ between stated and refined poses. From the mean squares of each
coordinate, those by (refined.floor) are taken off. What is left is that of the stated poses, and grows by

    mean square = 2 white^2 + walk^2 k    (refined.law)
"""

from collections.abc import Mapping
from collections.abc import Sequence as Items
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from tracknoise.geometry.accuracy import AccuracyKind, TruthAccuracy
from tracknoise.geometry.pose import PosePath, invert, transform
from tracknoise.inference.robust_fits import scales, squared, weights
from tracknoise.measurement.reference_tracks import FOLLOWED, KINDS, MATCHED, reference_tracks
from tracknoise.measurement.tracking import Progress
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import (
    SWEPT,
    Sequence,
    TruthKind,
    best_truth,
    halves_of,
    path_of,
    shutter_of,
    stated_accuracy,
)
from tracknoise.sequences.views import frame_step
from tracknoise.tables.manifest import PoseFit
from tracknoise.truth.accuracies import POSE_TOPICS, AccuracyRule, known_accuracy
from tracknoise.truth.pose_adjustment import PoseAdjustment, ReferenceTracks, State, exponential
from tracknoise.truth.uncertainty import TrueErrors, TruthDerivatives
from tracknoise.words import percent, pixels

Array = NDArray[np.float64]

AGE = 10
"""Age at which errors of poses are stated, frames."""
FEWEST_TRACKS = 40
"""Reference tracks in a frame, of which each half has half."""
_FEW_FRAMES = 0.1
"""Share of frames that may have fewer."""
LARGEST_LAG = 24
"""Largest distance of two frames to which (refined.law) is fitted, frames."""
_MOST_RESIDUAL_PX = 3.0
"""Median residual of reference tracks at `AGE` beyond which no poses fit them."""
_CLEARLY = 2.0
"""How much larger what the stated poses would add has to be than what is left of the errors of refined ones."""
_FAULT_STEPS, _AS_WELL = 5, 1.1
_LEAST_PARALLAX_PX = 2.0
"""Median parallax of reference tracks, without which the images do not tell depths."""


@dataclass(frozen=True, slots=True, eq=False)
class RefinedPoses(OtherPoses):
    """A sequence with refined poses."""

    # by halves and by each kind of the reference tracks: (n, 4, 4) each; none where they are not at hand
    pose_halves: tuple[Array, Array] | None = None
    by_kind: Mapping[str, Array] = field(default_factory=dict)
    # share of what a fault moves that refined poses do not absorb, and bounds of faults that count, by the figures of
    # `TruthAccuracy`
    fault_shares: Mapping[str, float] = field(default_factory=dict)
    fault_bounds: TruthAccuracy = TruthAccuracy()  # noqa: RUF009

    @classmethod
    def of(cls, sequence: Sequence, poses: Array, **more: Any) -> "RefinedPoses":
        """Of refined poses (n, 4, 4): the path of the sequence is corrected as its frames are."""
        return cls(sequence, poses, "reference tracks", _corrected_path(sequence, poses), **more)

    @property
    def truth_accuracy(self) -> TruthAccuracy:
        """What is stated about the depths and the camera: that of poses and clock belongs to the stated poses."""
        known = TruthAccuracy.of(None, self.depth_accuracy, source=self.id.dataset)
        stated = stated_accuracy(self.sequence)
        return known if stated is None else stated.without(POSE_TOPICS).over(known)

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence shown: `PoseFit` states what was refined."""
        return self.sequence.notes


@dataclass(frozen=True, slots=True)
class Leading:
    """Sequences with the poses that lead."""

    sequences: Items[Sequence]
    second: Items[Sequence]  # the same with a second truth; none where there is none
    fits: Items[PoseFit | None]  # which poses lead, of each; None where only stated ones were to

    @classmethod
    def of(
        cls,
        sequences: Items[Sequence],
        second: Items[Sequence],
        *,
        kind: str | None,
        rule: AccuracyRule,
        n_frames: int | None = None,
        only_stated: bool = False,
        progress: Progress | None = None,
    ) -> "Leading":
        """Of sequences that are measured together: where stated poses lead in one, they lead in all.

        `kind`: of the truth, by default the best of each. `n_frames`: those that are measured, by default all. The
        stated truth becomes the second, unless there is another.
        """
        if only_stated:
            return cls(sequences, second, [None for _ in sequences])
        kinds = [kind or best_truth(one) for one in sequences]
        found = [
            refined(one, of, rule, min(len(one), n_frames or len(one)), progress=progress)
            for one, of in zip(sequences, kinds, strict=True)
        ]
        fits = [fit for _, fit in found]
        if all(fit.leads for fit in fits):
            stated = () if SWEPT in kinds else sequences  # depths are swept once, with the poses that lead
            return cls([one for one, _ in found], second or stated, fits)
        return cls(sequences, second, [replace(fit, leads=False, reason=fit.reason or _OTHERS) for fit in fits])


_OTHERS = "Poses are not refined, as those of other lightings are not."


def _corrected_path(sequence: Sequence, poses: Array) -> PosePath | None:
    """The path of a sequence with the corrections of its frames, on the left of its poses, interpolated in time."""
    path, times = path_of(sequence), sequence.timestamps_s
    posed = has_pose(poses) & has_pose(sequence.world_from_camera)
    if path is None or times is None or posed.sum() < 2:
        return path
    change = PosePath(times[posed], poses[posed] @ invert(sequence.world_from_camera[posed]))
    inside = np.clip(path.times, times[posed][0], times[posed][-1])
    return PosePath(path.times, change.at(inside) @ path.poses)


def refined(
    sequence: Sequence, kind: str, rule: AccuracyRule, n_frames: int, *, progress: Progress | None = None
) -> tuple[Sequence, PoseFit]:
    """The sequence with the poses that lead, and why these.

    Parameters
    ----------
    sequence
        With stated poses.
    kind
        Of its truth.
    rule
        What the user says about the errors of the truth.
    n_frames
        Frames that are measured, from the first.
    progress
        Called after each frame.

    Raises
    ------
    DataError
        If an image or depth map cannot be read.
    """
    if kind not in _WITH_DEPTH_OF_BIRTH:
        return sequence, PoseFit(False, reason=f"Poses are not refined for truth of the kind {kind}.")
    stated = known_accuracy(sequence, kind, rule).figures
    if {"rotation", "translation"} <= stated.topics and _only_poses(stated).is_exact:
        return sequence, PoseFit(False, reason="The stated poses are exact.")
    return refined_by(sequence, reference_tracks(sequence, n_frames, progress=progress), stated, n_frames)


def refined_by(
    sequence: Sequence, tracks: ReferenceTracks, stated: TruthAccuracy, n_frames: int
) -> tuple[Sequence, PoseFit]:
    """As `refined`, by tracks that were made before; `stated` is known of the errors of the truth."""
    frames = np.bincount(tracks.frame, minlength=n_frames) + np.bincount(tracks.birth, minlength=n_frames)
    posed = frames[has_pose(sequence.world_from_camera[:n_frames])]
    references = float(np.median(posed)) if len(posed) else 0.0
    few = np.count_nonzero(posed < FEWEST_TRACKS) / len(posed) if len(posed) else 1.0
    if not len(tracks.frame) or few > _FEW_FRAMES:
        frames_with = f"{percent(few)} of the frames have fewer than {FEWEST_TRACKS} reference tracks"
        reason = f"Poses are not refined: {frames_with}."
        return sequence, PoseFit(False, references, reason=reason)
    adjustment = PoseAdjustment(sequence, tracks)
    if not adjustment.parallax_px() >= _LEAST_PARALLAX_PX:
        reason = "Poses are not refined: without depth, the camera has to change its position by more."
        return sequence, PoseFit(False, references, reason=reason)
    best = adjustment.best()
    faults = _Faults.of(adjustment, sequence, best, stated)
    found = _adjusted(adjustment, sequence, best, faults)
    fit = _compared(found, adjustment, best.depth_m, stated, references, faults)
    return (found if fit.leads else sequence), fit


_WITH_DEPTH_OF_BIRTH = (TruthKind.birth, SWEPT)
"""Kinds of truth whose points are fixed in the first frame of a track by a depth that is no part of the tracks."""


def _only_poses(figures: TruthAccuracy) -> TruthAccuracy:
    return figures.without(figures.topics - {"rotation", "translation"})


_FAULTS: Mapping[str, tuple[str, float]] = {"readout_ms": ("readout", 1e-3), "focal_relative": ("focal", 1.0)}
"""Faults that poses absorb in part, by the figures of `TruthAccuracy`: their derivatives, by one of the figure."""
_SMALL_PX = 0.1
_BOUND, _CONTRADICTS = 2.0, 3.0
"""Standard errors."""


@dataclass(frozen=True, slots=True, eq=False)
class _Faults:
    """What constant faults may leave of the errors of refined poses."""

    shares: Mapping[str, float]  # of what a fault moves that poses do not absorb, by its figure
    bounds: TruthAccuracy  # of those that count
    left_px2: Array  # (n,): squared displacements of observations by the bounds

    @classmethod
    def of(cls, adjustment: PoseAdjustment, sequence: Sequence, best: State, stated: TruthAccuracy) -> "_Faults":
        """By (refined.faults)."""
        tracks = adjustment.tracks
        points = adjustment.anchored_points(best.poses, best.depth_m, np.arange(len(tracks.frame)))
        derivatives = TruthDerivatives(RefinedPoses.of(sequence, best.poses)).sensitivity(points)
        moved = {figure: getattr(derivatives, name) * unit for figure, (name, unit) in _FAULTS.items()}
        sizes = {figure: _size(one) for figure, one in moved.items()}
        moved = {figure: one * (_SMALL_PX / sizes[figure]) for figure, one in moved.items() if sizes[figure] > 0.0}
        if not moved:
            return cls({}, TruthAccuracy(), np.zeros(len(tracks.frame)))
        residual, positions = zip(*(adjustment.left_of(best, one) for one in moved.values()), strict=True)
        is_free = ~np.isfinite(tracks.depth_m[tracks.track])[:, None]  # depths of such points absorb what these do
        left = [np.where(is_free, *pair) for pair in zip(residual, positions, strict=True)]
        found, error = _fitted(tracks, adjustment.residuals(best.poses, best.depth_m), np.stack(residual, axis=2))
        bounds, squares = dict[str, float](), np.zeros(len(tracks.frame))
        for figure, one, theta, sigma in zip(moved, left, np.abs(found), error, strict=True):
            known = stated.figures((figure,)).get(figure)
            if known is None and figure == "readout_ms" and shutter_of(sequence) is not None:
                known = 0.0
            unit = _SMALL_PX / sizes[figure]
            if known is None or (theta - _CONTRADICTS * sigma) * unit > known:
                bound = float(np.hypot(theta, _BOUND * sigma))
                bounds[figure] = bound * unit
                squares += np.nan_to_num(np.sum(one**2, axis=1)) * bound**2
        shares = {
            figure: float(min(np.sqrt(np.nanmean(one**2) / np.nanmean(moved[figure] ** 2)), 1.0))
            for figure, one in zip(moved, left, strict=True)
        }
        source = "reference tracks"
        return cls(shares, TruthAccuracy(**bounds, source=source, kind=AccuracyKind.measured), squares)


def _fitted(tracks: ReferenceTracks, residual: Array, design: Array) -> tuple[Array, Array]:
    """Sizes of faults and their standard errors. Shapes: residual (n, 2), design (n, 2, faults)."""
    kind, age = tracks.kind[tracks.track], tracks.frame - tracks.birth[tracks.track]
    known = np.isfinite(residual).all(axis=1) & np.isfinite(design).all(axis=(1, 2))
    kind, age, track = (one[known] for one in (kind, age, tracks.track))
    residual, design = residual[known], design[known]
    scale = scales(kind * (int(age.max(initial=0)) + 1) + age, residual)
    weight = weights(squared(residual, scale)) / scale**2

    def solved(rows: NDArray[np.bool_]) -> tuple[Array, Array]:
        flat = design[rows].reshape(-1, design.shape[2])
        weighted = flat * np.repeat(weight[rows], 2)[:, None]
        curvature: Array = np.asarray(np.linalg.pinv(flat.T @ weighted, rcond=1e-15), np.float64)
        return curvature @ (weighted.T @ residual[rows].ravel()), curvature

    theta, curvature = solved(np.ones(len(kind), np.bool_))
    scores = weight[:, None] * np.einsum("nij,ni->nj", design, residual - design @ theta)
    of_tracks = np.stack([np.bincount(track, one) for one in scores.T], axis=1) @ curvature
    error = np.sqrt(np.sum(of_tracks**2, axis=0))
    kinds = [solved(kind == one)[0] for one in np.unique(kind)]
    apart = np.ptp(np.array(kinds), axis=0) / 2.0
    return theta, np.asarray(np.maximum(error, apart), np.float64)


def largest_bounds(one: TruthAccuracy, other: TruthAccuracy) -> TruthAccuracy:
    """The larger bound of each fault by reference tracks."""
    figures = tuple(_FAULTS)
    both = [bounds.figures(figures) for bounds in (one, other)]
    largest: dict[str, Any] = {name: max(bounds.get(name, 0.0) for bounds in both) for name in {**both[0], **both[1]}}
    return replace(other, **largest)


def _adjusted(adjustment: PoseAdjustment, sequence: Sequence, best: State, faults: _Faults) -> RefinedPoses:
    tracks = adjustment.tracks
    half = adjustment.half(best)
    halves = adjustment.of(best, half), adjustment.of(best, ~half)
    by_kind = {name: adjustment.of(best, tracks.kind == kind) for kind, name in enumerate(KINDS)}
    pairs = [halves]
    if min(np.bincount(tracks.kind[tracks.track], minlength=len(KINDS))) >= FEWEST_TRACKS * len(best.poses) / 2:
        pairs.append((by_kind[FOLLOWED], by_kind[MATCHED]))  # what tracks of one kind have in common
    farthest = max(pairs, key=lambda pair: _apart_px(adjustment, best, *pair))
    rows = _shown(tracks)[1]
    more = _misfit_px2(adjustment, sequence, best, rows) - float(np.mean(faults.left_px2[rows]))
    if more > 0.0:
        one, other = (adjustment.residuals(poses, best.depth_m)[rows] for poses in farthest)
        apart_px = _rms((one - other) / 2.0)
        farthest = _moved_apart(best.poses, farthest, np.hypot(1.0, np.sqrt(more) / max(apart_px, 1e-6)))
    of_faults: dict[str, Any] = {"fault_shares": faults.shares, "fault_bounds": faults.bounds}
    return RefinedPoses.of(sequence, best.poses, pose_halves=farthest, by_kind=by_kind, **of_faults)


_PARTS = 3
"""Parts of the image along each side."""
_FAR = 3.0
"""Sizes of residuals beyond which tracks are outliers."""


def _shown(tracks: ReferenceTracks) -> tuple[int, NDArray[np.bool_]]:
    """The age at which errors of poses are stated, and the observations (n,) bool of it."""
    age = tracks.frame - tracks.birth[tracks.track]
    shown = max((one for one in set(age.tolist()) if one <= AGE), default=int(age.min()))
    return shown, age == shown


def _misfit_px2(adjustment: PoseAdjustment, sequence: Sequence, best: State, rows: NDArray[np.bool_]) -> float:
    """(refined.misfit) with stated depths, px^2; where one is established, its upper bound."""
    tracks = adjustment.tracks
    depth_m = np.where(np.isfinite(tracks.depth_m), tracks.depth_m, best.depth_m)
    residual, kind = adjustment.residuals(best.poses, depth_m)[rows], tracks.kind[tracks.track[rows]]
    used = np.flatnonzero(np.isfinite(residual).all(axis=1))
    used = used[squared(residual[used], scales(kind[used], residual[used])) < 2.0 * _FAR**2]
    size = sequence.camera.width, sequence.camera.height
    part = np.clip(tracks.uv[rows] / size * _PARTS, 0, _PARTS - 1).astype(np.intp)
    place = np.unique((tracks.frame[rows] * _PARTS + part[:, 0]) * _PARTS + part[:, 1], return_inverse=True)[1]
    counts, means = [], []
    for one in range(len(KINDS)):
        own = used[kind[used] == one]
        counts.append(np.bincount(place[own], minlength=int(place.max(initial=0)) + 1))
        sums = [np.bincount(place[own], column, len(counts[-1])) for column in residual[own].T]
        means.append(np.stack(sums, axis=1) / np.maximum(counts[-1], 1)[:, None])
    both = np.minimum(*counts) > 0
    if np.count_nonzero(both) < 2:
        return 0.0
    weight = 1.0 / (1.0 / counts[0][both] + 1.0 / counts[1][both])
    product = np.sum(means[0][both] * means[1][both], axis=1)
    found = float(np.average(product, weights=weight))
    error = float(np.sqrt(np.sum((weight * (product - found)) ** 2)) / weight.sum())
    return found + _BOUND * error if found > _BOUND * error else max(found, 0.0)


def _moved_apart(poses: Array, halves: tuple[Array, Array], factor: float) -> tuple[Array, Array]:
    """Halves whose differences from poses (n, 4, 4) are larger by a factor."""
    found = []
    for half in halves:
        known = has_pose(poses) & has_pose(half)
        between, moved = invert(poses[known]) @ half[known], half.copy()
        turned = Rotation.from_matrix(between[:, :3, :3]).as_rotvec()
        moved[known] = poses[known] @ exponential(factor * np.concatenate([between[:, :3, 3], turned], axis=1))
        found.append(moved)
    return found[0], found[1]


def _apart_px(adjustment: PoseAdjustment, best: State, one: Array, other: Array) -> float:
    """Size of the differences of predicted positions by two sets of poses, px."""
    return _rms(adjustment.residuals(one, best.depth_m) - adjustment.residuals(other, best.depth_m))


def _compared(
    found: RefinedPoses,
    adjustment: PoseAdjustment,
    depth_m: Array,
    stated: TruthAccuracy,
    references: float,
    faults: _Faults,
) -> PoseFit:
    """Which poses lead, by what halves of the tracks say and by what is stated."""
    tracks, sequence = adjustment.tracks, found.sequence
    age = tracks.frame - tracks.birth[tracks.track]
    shown, rows = _shown(tracks)
    every = [
        adjustment.residuals(poses, depth_m)
        for poses in (*(halves_of(found) or ()), found.poses, sequence.world_from_camera)
    ]
    next_px = _size((every[3] - every[2])[age == 1]) if (age == 1).any() else None
    one, other, best, given = (residual[rows] for residual in every)
    left_px = float(np.hypot(_rms((one - other) / 2.0), np.sqrt(np.mean(faults.left_px2[rows]))))
    stated_px = _size(given - best)
    fit = PoseFit(True, references, left_px, stated_px, shown, next_px, stated_errors(found))
    residual_px = float(np.nanmedian(np.linalg.norm(best, axis=1)))
    if not residual_px < _MOST_RESIDUAL_PX:
        reason = f"Poses are not refined: with the stated camera and depths, no poses fit ({pixels(residual_px)} px)."
        return PoseFit(False, references, reason=reason)
    if _is_of_camera_or_depths(adjustment, found):
        reason = "An error of the focal length or the depths explains reference tracks as well as other poses would."
        return replace(fit, leads=False, reason=reason)
    if not stated_px > _CLEARLY * left_px:
        reason = "The stated poses differ from refined ones by no more than reference tracks can tell."
        return replace(fit, leads=False, reason=reason)
    if not {"rotation", "translation"} <= stated.topics:
        return fit
    points = adjustment.anchored_points(sequence.world_from_camera, depth_m, np.flatnonzero(rows))
    known = TrueErrors(TruthDerivatives(sequence), _only_poses(stated), step=frame_step(sequence))
    spread = np.concatenate([sum(part.covariance.values()) for _, part in known.of(points)])
    if np.sqrt(np.nanmedian(np.trace(spread, axis1=1, axis2=2))) < left_px:
        reason = "The stated poses are stated to be better than reference tracks can tell."
        return replace(fit, leads=False, reason=reason)
    return fit


def _is_of_camera_or_depths(adjustment: PoseAdjustment, found: RefinedPoses) -> bool:
    """Whether the focal length and a law of the errors of depths explain what stated poses leave, as refined ones do.

    No poses mend such an error: they would only hide it.
    """
    tracks, stated = adjustment.tracks, found.sequence.world_from_camera
    age = tracks.frame - tracks.birth[tracks.track]
    rows = np.flatnonzero((age <= AGE) & np.isfinite(tracks.depth_m[tracks.track]))
    if len(rows) < FEWEST_TRACKS:
        return False
    depth_m, points = tracks.depth_m, adjustment.anchored_points(stated, tracks.depth_m, rows)
    moved = TruthDerivatives(found.sequence).sensitivity(points)
    z = moved.depth_m[:, None]
    slant = np.linalg.norm(transform(invert(stated[points.anchor]), points.points_world), axis=1)[:, None] / z - 1.0
    faults = np.stack([moved.focal, moved.depth, *(moved.depth * z * one for one in (1.0, z, slant))], axis=2)
    left = adjustment.residuals(stated, depth_m)[rows]
    known = np.isfinite(faults).all(axis=(1, 2)) & np.isfinite(left).all(axis=1)
    faults, left = faults[known], left[known]
    unit = np.maximum(np.sqrt(np.mean(faults**2, axis=(0, 1))), 1e-12)
    rest = left
    for _ in range(_FAULT_STEPS):
        weight = weights(np.sum(rest**2, axis=1) / max(_size(rest), 1e-6) ** 2 * 2.0)[:, None, None] ** 0.5
        design = (faults / unit * weight).reshape(-1, faults.shape[2])
        theta = np.linalg.lstsq(design, (left * weight[:, :, 0]).ravel(), rcond=1e-6)[0]
        rest = left - (faults / unit) @ theta
    refined_px = _size(adjustment.residuals(found.poses, depth_m)[rows][known])
    return _size(rest) <= _AS_WELL * refined_px < _size(left)


def _size(moved: Array) -> float:
    """Robust RMS of both coordinates (n, 2) together, px: that of a round Gaussian with the same median length."""
    length = np.linalg.norm(moved, axis=1)
    return float(np.nanmedian(length) / _MEDIAN_TO_RMS) if np.isfinite(length).any() else 0.0


_MOST_SIZES = 10.0
"""Larger displacements, of points next to the camera, count as so many robust sizes."""


def _rms(moved: Array) -> float:
    """RMS of both coordinates (n, 2) together, px: as the floor has it."""
    length = np.linalg.norm(moved, axis=1)
    length = np.minimum(length[np.isfinite(length)], _MOST_SIZES * _size(moved))
    return float(np.sqrt(np.mean(length**2))) if len(length) else 0.0


_MEDIAN_TO_RMS = float(np.sqrt(np.log(2.0)))


def stated_errors(found: RefinedPoses) -> dict[str, float] | None:
    """How the errors of relative stated poses grow, by (refined.law) and the names of `TruthAccuracy`.

    Degrees about each axis and metres along each, in frames of the recording. None where they are not larger than
    reference tracks can tell.
    """
    given, best, halves = found.sequence.world_from_camera, found.poses, halves_of(found)
    if halves is None:
        return None
    one, other = halves
    lags = np.arange(1, min(LARGEST_LAG, len(best) // 2) + 1)
    squares = np.array(
        [_relative_squares(given, best, lag) - _relative_squares(one, other, lag) / 4.0 for lag in lags.tolist()]
    )
    known = np.isfinite(squares).all(axis=1)
    if not known.any():
        return None
    lags, squares = lags[known], squares[known]
    weight = lags**-1.5  # mean squares of a random walk spread in proportion to k sqrt(k)
    law = np.column_stack([2.0 * np.ones(len(lags)), lags * frame_step(found.sequence)])
    parts = [nnls(law * weight[:, None], column * weight)[0] for column in squares.T]
    values = np.sqrt(np.concatenate(parts)).tolist()
    return dict(zip(_LAW, values, strict=True)) if any(values) else None


_LAW = ("rotation_white_deg", "rotation_deg_per_sqrt_frame", "translation_white_m", "translation_m_per_sqrt_frame")


def _relative_squares(one: Array, other: Array, lag: int) -> Array:
    """(2,): mean squares of the differences of relative poses, deg^2 about each axis and m^2 along each."""
    relative = [invert(poses[:-lag]) @ poses[lag:] for poses in (one, other)]
    between = invert(relative[0]) @ relative[1]
    between = between[np.isfinite(between).all(axis=(1, 2))]
    if not len(between):
        return np.full(2, np.nan)
    turned = Rotation.from_matrix(between[:, :3, :3]).as_rotvec(degrees=True)
    return np.array([np.mean(np.square(turned)), np.mean(np.square(between[:, :3, 3]))])
