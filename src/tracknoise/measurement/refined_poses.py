"""Poses of a sequence, refined by reference tracks: which poses lead, and how wrong refined and stated ones are.

What decides is known before a tracker is measured. Poses lead that are stated to be exact, or to be better than the
refined ones. Otherwise refined poses lead where reference tracks determine them.

Two disjoint halves of the reference tracks give poses of their own, with errors e1 and e2. That of the poses by all
tracks is about their mean, and has the variance of

    (e1 - e2) / 2    (refined.floor)

The errors of the halves are taken to be independent. Nothing else is assumed of the tracks.

Relative poses of frames that are k apart differ between stated and refined poses. From the mean squares of each
coordinate, those by (refined.floor) are taken off. What is left is that of the stated poses, and grows by

    mean square = 2 white^2 + walk^2 k    (refined.law)
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.pose import PosePath, invert
from tracknoise.measurement.reference_tracks import KINDS, reference_tracks
from tracknoise.measurement.tracking import Progress
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import Sequence, TruthKind, path_of, stated_accuracy
from tracknoise.sequences.views import frame_step
from tracknoise.tables.manifest import PoseFit
from tracknoise.truth.accuracies import POSE_TOPICS, AccuracyRule, known_accuracy
from tracknoise.truth.pose_adjustment import PoseAdjustment, State
from tracknoise.truth.uncertainty import TrueErrors, TruthDerivatives
from tracknoise.words import percent, pixels

Array = NDArray[np.float64]

REFERENCE = "reference tracks"
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
_LEAST_PARALLAX_PX = 2.0
"""Median parallax of reference tracks, without which the images do not tell depths."""


@dataclass(frozen=True, slots=True, eq=False)
class RefinedPoses(OtherPoses):
    """A sequence with refined poses."""

    # by halves and by each kind of the reference tracks: (n, 4, 4) each
    pose_halves: tuple[Array, Array]
    by_kind: Mapping[str, Array]
    # share of what an unknown readout of a rolling shutter moves that refined poses do not absorb
    readout_left: float = 1.0

    @property
    def path(self) -> PosePath | None:
        """The path of the sequence shown, corrected as its frames are."""
        path, times = path_of(self.sequence), self.timestamps_s
        posed = has_pose(self.poses) & has_pose(self.sequence.world_from_camera)
        if path is None or times is None or posed.sum() < 2:
            return path
        # stated poses are corrected on the left, by the correction of the frame before and after
        change = PosePath(times[posed], self.poses[posed] @ invert(self.sequence.world_from_camera[posed]))
        inside = np.clip(path.times, times[posed][0], times[posed][-1])
        return PosePath(path.times, change.at(inside) @ path.poses)

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
    tracks = reference_tracks(sequence, n_frames, progress=progress)
    frames = np.bincount(tracks.frame, minlength=n_frames) + np.bincount(tracks.birth, minlength=n_frames)
    frames = frames[has_pose(sequence.world_from_camera[:n_frames])]
    references = float(np.median(frames)) if len(frames) else 0.0
    few = np.mean(frames < FEWEST_TRACKS) if len(frames) else 1.0
    if not len(tracks.frame) or few > _FEW_FRAMES:
        frames_with = f"{percent(float(few))} of the frames have fewer than {FEWEST_TRACKS} reference tracks"
        reason = f"Poses are not refined: {frames_with}."
        return sequence, PoseFit(False, references, reason=reason)
    adjustment = PoseAdjustment(sequence, tracks)
    if not adjustment.parallax_px() >= _LEAST_PARALLAX_PX:
        reason = "Poses are not refined: without depth, the camera has to change its position by more."
        return sequence, PoseFit(False, references, reason=reason)
    best = adjustment.best()
    found = _adjusted(adjustment, sequence, best)
    fit = _compared(found, adjustment, best.depth_m, stated, references)
    return (found if fit.leads else sequence), fit


_WITH_DEPTH_OF_BIRTH = (TruthKind.birth,)
"""Kinds of truth whose points are fixed in the first frame of a track by a depth that is no part of the tracks."""


def _only_poses(figures: TruthAccuracy) -> TruthAccuracy:
    return figures.without(figures.topics - {"rotation", "translation"})


def _adjusted(adjustment: PoseAdjustment, sequence: Sequence, best: State) -> RefinedPoses:
    tracks = adjustment.tracks
    half = np.random.default_rng(0).permutation(len(tracks.birth)) % 2 == 0
    halves = adjustment.of(best, half), adjustment.of(best, ~half)
    by_kind = {name: adjustment.of(best, tracks.kind == kind) for kind, name in enumerate(KINDS)}
    return RefinedPoses(sequence, best.poses, REFERENCE, halves, by_kind, _readout_left(adjustment, sequence, best))


def _readout_left(adjustment: PoseAdjustment, sequence: Sequence, best: State) -> float:
    """Share of the displacements by a readout time that no poses absorb; 1 without times."""
    rows = np.arange(len(adjustment.tracks.frame))
    points = adjustment.anchored_points(sequence.world_from_camera, best.depth_m, rows)
    moved = TruthDerivatives(sequence).sensitivity(points).readout
    left, whole = _rms(adjustment.left_of(best, moved)), _rms(moved)
    return min(left / whole, 1.0) if whole > 0.0 else 1.0


def _compared(
    found: RefinedPoses, adjustment: PoseAdjustment, depth_m: Array, stated: TruthAccuracy, references: float
) -> PoseFit:
    """Which poses lead, by what halves of the tracks say and by what is stated."""
    tracks, sequence = adjustment.tracks, found.sequence
    age = tracks.frame - tracks.birth[tracks.track]
    ages = set(age.tolist())
    shown = max((one for one in ages if one <= AGE), default=min(ages))
    rows = age == shown
    every = [
        adjustment.residuals(poses, depth_m) for poses in (*found.pose_halves, found.poses, sequence.world_from_camera)
    ]
    next_px = _rms((every[3] - every[2])[age == 1]) if (age == 1).any() else None
    one, other, best, given = (residual[rows] for residual in every)
    left_px = _rms((one - other) / 2.0)
    fit = PoseFit(True, references, left_px, _rms(given - best), shown, next_px, stated_errors(found))
    residual_px = float(np.nanmedian(np.linalg.norm(best, axis=1)))
    if not residual_px < _MOST_RESIDUAL_PX:
        reason = f"Poses are not refined: with the stated camera and depths, no poses fit ({pixels(residual_px)} px)."
        return PoseFit(False, references, reason=reason)
    if not {"rotation", "translation"} <= stated.topics:
        return fit
    points = adjustment.anchored_points(sequence.world_from_camera, depth_m, np.flatnonzero(rows))
    known = TrueErrors(TruthDerivatives(sequence), _only_poses(stated), step=frame_step(sequence))
    spread = np.concatenate([sum(part.covariance.values()) for _, part in known.of(points)])
    if np.sqrt(np.nanmean(np.trace(spread, axis1=1, axis2=2))) < left_px:
        return replace(
            fit, leads=False, reason="The stated poses are stated to be better than reference tracks can tell."
        )
    return fit


def stated_errors(found: RefinedPoses) -> dict[str, float] | None:
    """How the errors of relative stated poses grow, by (refined.law) and the names of `TruthAccuracy`.

    Degrees about each axis and metres along each, in frames of the recording. None where they are not larger than
    reference tracks can tell.
    """
    given, best, (one, other) = found.sequence.world_from_camera, found.poses, found.pose_halves
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


def _rms(moved: Array) -> float:
    """RMS of both coordinates (n, 2) together."""
    squares = np.sum(moved**2, axis=1)
    return float(np.sqrt(np.nanmean(squares))) if np.isfinite(squares).any() else 0.0
