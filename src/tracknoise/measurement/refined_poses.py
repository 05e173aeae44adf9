"""Poses of a sequence, refined by reference tracks: which poses lead, and how wrong refined and stated ones are.

What decides is known before a tracker is measured. Poses lead that are stated to be exact, or to be better than the
refined ones. Otherwise refined poses lead where reference tracks determine them.

Two disjoint halves of the reference tracks give poses of their own, with errors e1 and e2. That of the poses by all
tracks is about their mean, and has the variance of

    (e1 - e2) / 2    (refined.floor)

The errors of the halves are taken to be independent. Nothing else is assumed of the tracks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

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
from tracknoise.truth.pose_adjustment import PoseAdjustment, ReferenceTracks, State
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
        """Those of the sequence shown: the refinement has a sentence of its own."""
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
    return refined_by(sequence, reference_tracks(sequence, n_frames, progress=progress), stated, n_frames)


def refined_by(
    sequence: Sequence, tracks: ReferenceTracks, stated: TruthAccuracy, n_frames: int
) -> tuple[Sequence, PoseFit]:
    """As `refined`, by tracks that were made before; `stated` is known of the errors of the truth."""
    frames = np.bincount(tracks.frame, minlength=n_frames) + np.bincount(tracks.birth, minlength=n_frames)
    frames = frames[has_pose(sequence.world_from_camera[:n_frames])]
    references = float(np.median(frames)) if len(frames) else 0.0
    few = np.mean(frames < FEWEST_TRACKS)
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
    half = adjustment.half(best)
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
    rows = age == min(AGE, int(age.max()))
    one, other, best, given = (
        adjustment.residuals(poses, depth_m)[rows]
        for poses in (*found.pose_halves, found.poses, sequence.world_from_camera)
    )
    left_px = _rms((one - other) / 2.0)
    fit = PoseFit(True, references, left_px, _rms(given - best), int(age[rows][0]))
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


def _rms(moved: Array) -> float:
    """RMS of both coordinates (n, 2) together."""
    squares = np.sum(moved**2, axis=1)
    return float(np.sqrt(np.nanmean(squares))) if np.isfinite(squares).any() else 0.0
