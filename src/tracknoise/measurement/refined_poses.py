"""Poses of a sequence, refined by reference tracks: which poses lead, and how wrong refined and stated ones are.

What decides is known before a tracker is measured. Poses lead that are stated to be exact, or to be better than the
refined ones. Otherwise refined poses lead where reference tracks determine them.

Two disjoint halves of the reference tracks give poses of their own, with errors e1 and e2. That of the poses by all
tracks is about their mean, and has the variance of

    (e1 - e2) / 2    (refined.floor)

The errors of the halves are taken to be independent. Nothing else is assumed of the tracks. The halves are the two
kinds of tracks where these differ by more.

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
from scipy.special import fdtri

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.corrections import Corrections
from tracknoise.geometry.pose import PosePath, invert
from tracknoise.measurement.adjusted_depths import FOCAL, READOUT, AdjustedDepths
from tracknoise.measurement.fault_bounds import FaultBounds, misfit_px2, moved_apart, rms, size
from tracknoise.measurement.reference_tracks import FOLLOWED, KINDS, MATCHED, KeptTracks, reference_tracks
from tracknoise.measurement.tracking import Progress
from tracknoise.sequences.depth_samples import MOST_EDGES, edge_share, sampled_depths
from tracknoise.sequences.kept_frames import KEPT_BYTES, KEPT_DEPTH_BYTES, KeptFrames
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import (
    SWEPT,
    Sequence,
    TruthKind,
    best_truth,
    halves_of,
    path_of,
    stated_accuracy,
)
from tracknoise.sequences.views import frame_step
from tracknoise.tables.manifest import PoseFit
from tracknoise.truth.accuracies import POSE_TOPICS, AccuracyRule, known_accuracy
from tracknoise.truth.pose_adjustment import PoseAdjustment, ReferenceTracks, State
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
_CLEARLY, _LEAST_PX = 1.5, 0.01
"""How much larger what the stated poses would add has to be than what is left of the errors of refined ones, and its
least size."""
_BY_CHANCE = 1e-3
"""Probability with which exact poses of few frames look worse than refined ones."""
_MUCH = 1.0 / 3.0
"""Share of the errors by stated poses that an error of the camera makes, beyond which poses are not refined."""
_MOST = 2.0 / 3.0
"""Share of what refined poses explain, beyond which an error of the camera explains most of it."""
_CLEAR = 2.0
"""Standard deviations by which a focal length is off that refined poses leave, and stated ones explain."""
_OUTLIER_SIZES = 3.0
"""Residuals of so many robust sizes do not count where a focal length is fitted."""
_LEAST_PARALLAX_PX = 2.0
"""Median parallax of reference tracks, without which the images do not tell depths."""


@dataclass(frozen=True, slots=True, eq=False)
class RefinedPoses(OtherPoses):
    """A sequence with refined poses."""

    # by halves and by each kind of the reference tracks: (n, 4, 4) each; none where they are not at hand
    pose_halves: tuple[Array, Array] | None = None
    by_kind: Mapping[str, Array] = field(default_factory=dict)
    # whether depths of features are joined from the maps of neighbouring frames
    joins_depths: bool = False
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
        of_depths = TruthAccuracy.of(None, self.depth_accuracy, source=self.id.dataset)
        stated = stated_accuracy(self.sequence)
        return of_depths if stated is None else stated.without(POSE_TOPICS).over(of_depths)

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
        kept: Items[KeptTracks | None] = (),
        progress: Progress | None = None,
    ) -> "Leading":
        """Of sequences that are measured together: where stated poses lead in one, they lead in all.

        `kind`: of the truth, by default the best of each. `n_frames`: those that are measured, by default all. `kept`:
        where the reference tracks of each are kept. `progress`: called with 0 after each frame through which they are
        followed. The stated truth becomes the second, unless there is another.
        """
        if only_stated:
            return cls(sequences, second, [None for _ in sequences])
        follow = None if progress is None else lambda _, total: progress(0, total)
        shares = KEPT_BYTES // len(sequences), KEPT_DEPTH_BYTES // len(sequences)
        sequences = [KeptFrames(sequence, *shares) for sequence in sequences]
        kinds = [kind or best_truth(sequence) for sequence in sequences]
        fitted = [
            refined(sequence, truth, rule, min(len(sequence), n_frames or len(sequence)), kept=place, progress=follow)
            for sequence, truth, place in zip(sequences, kinds, kept or [None for _ in sequences], strict=True)
        ]
        fits = [fit for _, fit in fitted]
        if all(fit.leads for fit in fits):
            stated = () if SWEPT in kinds else sequences  # depths are swept once, with the poses that lead
            return cls([sequence for sequence, _ in fitted], second or stated, fits)
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
    sequence: Sequence,
    kind: str,
    rule: AccuracyRule,
    n_frames: int,
    *,
    kept: KeptTracks | None = None,
    progress: Progress | None = None,
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
    kept
        Where its reference tracks are kept.
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
    tracks = reference_tracks(sequence, n_frames, kept=kept, progress=progress)
    return refined_by(sequence, tracks, stated, n_frames)


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
    edges = edge_share(sequence, sampled_depths(sequence, n_frames))
    if edges > MOST_EDGES:
        reason = f"Poses are not refined: noise makes depths of neighbours differ at {percent(edges)} of the pixels."
        return sequence, PoseFit(False, references, reason=reason)
    adjustment = PoseAdjustment(sequence, tracks)
    if not adjustment.parallax_px() >= _LEAST_PARALLAX_PX:
        reason = f"Poses are not refined: without depth, reference tracks need a parallax of {_LEAST_PARALLAX_PX:g} px."
        return sequence, PoseFit(False, references, reason=reason)
    try:
        depths = AdjustedDepths.of(sequence, adjustment, adjustment.best())
        faults = FaultBounds.of(depths, stated, _shown(tracks)[1])
        adjusted = _adjusted(depths, faults)
    except np.linalg.LinAlgError:  # poses that are too far apart for the precision of numbers
        reason = "Poses are not refined: no poses near the stated ones fit reference tracks."
        return sequence, PoseFit(False, references, reason=reason)
    fit = _compared(adjusted, depths, faults, stated, references)
    return (adjusted if fit.leads else sequence), fit


_WITH_DEPTH_OF_BIRTH = (TruthKind.birth, SWEPT)
"""Kinds of truth whose points are fixed in the first frame of a track by a depth that is no part of the tracks."""


def _only_poses(figures: TruthAccuracy) -> TruthAccuracy:
    return figures.without(figures.topics - {"rotation", "translation"})


def _adjusted(depths: AdjustedDepths, faults: FaultBounds) -> RefinedPoses:
    adjustment, sequence, best = depths.adjustment, depths.sequence, depths.best
    tracks = adjustment.tracks
    half = adjustment.half(best)
    halves = adjustment.of(best, half), adjustment.of(best, ~half)
    by_kind = {name: adjustment.of(best, tracks.kind == kind) for kind, name in enumerate(KINDS)}
    pairs = [halves]
    if min(np.bincount(tracks.kind[tracks.track], minlength=len(KINDS))) >= FEWEST_TRACKS * len(best.poses) / 2:
        pairs.append((by_kind[FOLLOWED], by_kind[MATCHED]))  # what tracks of one kind have in common
    farthest = max(pairs, key=lambda pair: _apart_px(adjustment, best, *pair))
    rows = _shown(tracks)[1]
    more = misfit_px2(depths, rows) - faults.in_floor_px**2
    if more > 0.0:
        first, second = (adjustment.residuals(poses, best.depth_m)[rows] for poses in farthest)
        apart_px = rms((first - second) / 2.0)
        farthest = moved_apart(best.poses, farthest, float(np.hypot(1.0, np.sqrt(more) / max(apart_px, 1e-6))))
    of_faults: dict[str, Any] = {"fault_shares": faults.shares, "fault_bounds": faults.bounds}
    of_tracks = {"pose_halves": farthest, "by_kind": by_kind, "joins_depths": depths.joins_depths}
    return RefinedPoses.of(sequence, best.poses, **of_tracks, **of_faults)


def _shown(tracks: ReferenceTracks) -> tuple[int, NDArray[np.bool_]]:
    """The age at which errors of poses are stated, and the observations (n,) bool of it."""
    age = tracks.frame - tracks.birth[tracks.track]
    shown = int(age[age <= AGE].max(initial=int(age.min())))
    return shown, age == shown


def _apart_px(adjustment: PoseAdjustment, best: State, first: Array, second: Array) -> float:
    """Size of the differences of predicted positions by two sets of poses, px."""
    return rms(adjustment.residuals(first, best.depth_m) - adjustment.residuals(second, best.depth_m))


def _compared(
    adjusted: RefinedPoses, depths: AdjustedDepths, faults: FaultBounds, stated: TruthAccuracy, references: float
) -> PoseFit:
    """Which poses lead, by what halves of the tracks say and by what is stated."""
    adjustment, depth_m, best = depths.adjustment, depths.best.depth_m, depths.by_best
    tracks, sequence = adjustment.tracks, adjusted.sequence
    age = tracks.frame - tracks.birth[tracks.track]
    shown, rows = _shown(tracks)
    first, second = (adjustment.residuals(poses, depth_m)[rows] for poses in halves_of(adjusted) or ())
    given_px = size(depths.by_stated[age <= AGE])
    added = depths.by_stated - best
    next_px = rms(added[age == 1], tracks.frame[age == 1]) if (age == 1).any() else None
    left_px = float(np.hypot(rms((first - second) / 2.0), faults.left_px))
    stated_px = rms(added[rows], tracks.frame[rows])
    errors = stated_errors(adjusted)
    fit = PoseFit(
        True, references, left_px, stated_px, shown, next_px, errors, depths.corrections, adjusted.joins_depths
    )
    residual_px = float(np.nanmedian(np.linalg.norm(best[rows], axis=1)))
    if not residual_px < _MOST_RESIDUAL_PX:
        reason = (
            f"Poses are not refined: no poses fit the stated camera and depths ({pixels(residual_px)} px are left)."
        )
        return PoseFit(False, references, reason=reason)
    of_camera = "Poses are not refined: an error of the camera or of the kind of depth causes much of the errors."
    if _is_of_camera(depths, given_px):
        return replace(fit, leads=False, reason=of_camera)
    most_px = max(stated_px, next_px or 0.0)  # errors that repeat may be the same in both frames
    if not (most_px > max(_clearly(len(adjusted.poses)) * left_px, _LEAST_PX) or adjusted.joins_depths):
        reason = "The stated poses differ from refined ones by less than reference tracks can resolve."
        return replace(fit, leads=False, reason=reason)
    if not adjustment.has_depth:  # where parts of the scene move, refined poses may be about these
        by_poses = (
            adjustment.epipolar_distances(poses, rows) for poses in (sequence.world_from_camera, adjusted.poses)
        )
        by_stated, by_refined = map(np.nanmedian, by_poses)
        if by_stated < by_refined:
            reason = "Poses are not refined: stated ones fit reference tracks better."
            return PoseFit(False, references, reason=reason)
    if _is_of_lens(depths):
        return replace(fit, leads=False, reason=of_camera)
    if not {"rotation", "translation"} <= stated.topics:
        return fit
    points = adjustment.anchored_points(sequence.world_from_camera, depth_m, np.flatnonzero(rows))
    true_errors = TrueErrors(TruthDerivatives(sequence), _only_poses(stated), step=frame_step(sequence))
    spread = np.concatenate([sum(part.covariance.values()) for _, part in true_errors.of(points)])
    if np.sqrt(np.nanmedian(np.trace(spread, axis1=1, axis2=2))) < left_px:
        reason = "The stated accuracy of the poses is better than reference tracks can resolve."
        return replace(fit, leads=False, reason=reason)
    return fit


def _clearly(frames: int) -> float:
    """How much larger what the stated poses would add has to be than what is left of the errors of refined ones.

    Both sizes are of three motions of the image in each frame: few frames may differ by more, by chance.
    """
    degrees = 3 * max(frames - 1, 1)
    return max(_CLEARLY, float(np.sqrt(fdtri(degrees, degrees, 1.0 - _BY_CHANCE))))


def _is_of_camera(depths: AdjustedDepths, stated_px: float) -> bool:
    """Whether an error of the focal length, or of the kind of depth, makes much of what stated poses leave, px.

    It has to be established: no poses absorb all of it. That is too little to see where it is small. The focal length
    that fits with stated poses then has to be confirmed, and to explain most of what other poses would explain. These
    would only hide it.
    """
    young = _young(depths)
    if any(
        fault.is_established and size(fault.size * depths.displaced[name][young]) > _MUCH * stated_px
        for name, fault in depths.faults.items()
        if name != READOUT
    ):
        return True
    focal, with_stated = depths.faults[FOCAL], _focal_error(depths)
    least = max(abs(with_stated) / 2.0, _CLEAR * focal.deviation)
    return focal.size * np.sign(with_stated) > least and _explains_most(depths, {"focal_scale": 1.0 + with_stated})


def _focal_error(depths: AdjustedDepths) -> float:
    """The relative change of the focal length that fits best with stated poses, by least squares without outliers."""
    missed, moved = depths.by_stated, depths.displaced[FOCAL]
    used = _young(depths) & np.isfinite(missed + moved).all(axis=1)
    used &= np.linalg.norm(missed, axis=1) < _OUTLIER_SIZES * size(missed[used])
    square = float(np.sum(moved[used].astype(np.float64) ** 2))
    return float(np.sum(moved[used] * missed[used])) / square if square > 0.0 else 0.0


def _is_of_lens(depths: AdjustedDepths) -> bool:
    """Whether another k1 explains most of what other poses would explain."""
    return depths.radial is not None and _explains_most(depths, {"k1": depths.radial.size})


def _young(depths: AdjustedDepths) -> NDArray[np.bool_]:
    tracks = depths.adjustment.tracks
    return np.asarray(tracks.frame - tracks.birth[tracks.track] <= AGE)


def _explains_most(depths: AdjustedDepths, correction: dict[str, Any]) -> bool:
    """Whether a corrected camera with stated poses and depths explains most of what refined poses do.

    Of squared residuals of tracks of each kind, whose own errors neither explains.
    """
    try:
        other = depths.with_camera(Corrections(**correction))
    except (DataError, SettingsError):  # numbers that no camera has
        return False
    tracks, young = depths.adjustment.tracks, _young(depths)
    by_other = other.residuals(depths.sequence.world_from_camera, depths.stated_m)
    residuals = (depths.by_stated, by_other, depths.by_best)
    kind = tracks.kind[tracks.track]
    for of_kind in (young & (kind == number) for number in np.unique(kind)):
        before, after, by_refined = (size(one[of_kind]) ** 2 for one in residuals)
        if not before - after > _MOST * max(before - by_refined, 0.0) > 0.0:
            return False
    return True


def stated_errors(found: RefinedPoses) -> dict[str, float] | None:
    """How the errors of relative stated poses grow, by (refined.law) and the names of `TruthAccuracy`.

    Degrees about each axis and metres along each, in frames of the recording. None where they are not larger than
    reference tracks can tell.
    """
    given, best, halves = found.sequence.world_from_camera, found.poses, halves_of(found)
    if halves is None:
        return None
    first, second = halves
    lags = np.arange(1, min(LARGEST_LAG, len(best) // 2) + 1)
    squares = np.array(
        [_relative_squares(given, best, lag) - _relative_squares(first, second, lag) / 4.0 for lag in lags.tolist()]
    )
    valid = np.isfinite(squares).all(axis=1)
    if not valid.any():
        return None
    lags, squares = lags[valid], squares[valid]
    weight = lags**-1.5  # mean squares of a random walk spread in proportion to k sqrt(k)
    law = np.column_stack([2.0 * np.ones(len(lags)), lags * frame_step(found.sequence)])
    parts = [nnls(law * weight[:, None], column * weight)[0] for column in squares.T]
    values = np.sqrt(np.concatenate(parts)).tolist()
    return dict(zip(_LAW, values, strict=True)) if any(values) else None


_LAW = ("rotation_white_deg", "rotation_deg_per_sqrt_frame", "translation_white_m", "translation_m_per_sqrt_frame")


def _relative_squares(first: Array, second: Array, lag: int) -> Array:
    """(2,): mean squares of the differences of relative poses, deg^2 about each axis and m^2 along each."""
    relative = [invert(poses[:-lag]) @ poses[lag:] for poses in (first, second)]
    between = invert(relative[0]) @ relative[1]
    between = between[np.isfinite(between).all(axis=(1, 2))]
    if not len(between):
        return np.full(2, np.nan)
    turned = Rotation.from_matrix(between[:, :3, :3]).as_rotvec(degrees=True)
    return np.array([np.mean(np.square(turned)), np.mean(np.square(between[:, :3, 3]))])
