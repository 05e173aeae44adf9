"""Poses that lead in a check: as in a run, refined by reference tracks where these determine them."""

import numpy as np

from tracknoise.exceptions import DataError
from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.pose import invert
from tracknoise.measurement.adjusted_depths import depth_corrections
from tracknoise.measurement.fault_bounds import largest_bounds
from tracknoise.measurement.refined_poses import RefinedPoses, refined
from tracknoise.sequences.corrected import corrected
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import Sequence, best_truth
from tracknoise.sequences.views import PartOfSequence
from tracknoise.tables.manifest import PoseFit, joined_fit
from tracknoise.truth.accuracies import DEFAULT_RULE
from tracknoise.truth_faults.check_report import Item, Severity
from tracknoise.truth_faults.image_evidence import windows

_MOST_FRAMES, _WINDOW_FRAMES = 60, 30
"""Frames of which poses are refined in a check: of longer recordings, in windows. Reference tracks take its time."""
_LONGEST = 240
"""Frames that are refined at once when a whole trajectory is, so that memory does not grow with its length."""


def leading_poses(sequence: Sequence) -> tuple[Sequence, PoseFit, Item]:
    """The sequence with the poses that lead, what reference tracks say of them, and this as an item.

    Refined poses are of windows of frames, and other frames then have none. Depths are corrected as with these poses.

    Raises
    ------
    DataError
        If an image or depth map cannot be read.
    """
    parts = windows(len(sequence), most=_MOST_FRAMES, length=_WINDOW_FRAMES)
    of_parts = [_refined(sequence, part) for part in parts]
    leading = [(part, window, fit) for part, (window, fit) in zip(parts, of_parts, strict=True) if fit.leads]
    if 2 * len(leading) < len(of_parts) or not leading:
        fit = joined_fit([fit for _, fit in of_parts if not fit.leads])
        assert fit is not None, "there is a window"
        return sequence, fit, Item("poses", Severity.ok, fit.reason, _values(fit))
    fit = joined_fit([fit for *_, fit in leading])
    assert fit is not None, "there is a window"
    halves = np.full((2, *sequence.world_from_camera.shape), np.nan)
    poses = halves[0].copy()
    shares, bounds = dict[str, float](), TruthAccuracy()
    for part, window, _ in leading:
        assert isinstance(window, RefinedPoses), "the refined poses of a window lead"
        poses[part.start : part.stop] = window.poses
        assert window.pose_halves is not None, "it was refined just now"
        halves[:, part.start : part.stop] = window.pose_halves
        shares = {name: max(share, shares.get(name, 0.0)) for name, share in window.fault_shares.items()}
        bounds = largest_bounds(bounds, window.fault_bounds)
    frames = f"{has_pose(poses).sum()} of {len(poses)} frames"
    text = " ".join(filter(None, [f"Poses were refined in {frames}.", fit.of_depths]))
    item = Item("poses", Severity.ok, text, _values(fit))
    of_halves = halves[0], halves[1]
    with_depths = corrected(sequence, depth_corrections(fit.corrections))
    shown = RefinedPoses.of(with_depths, poses, pose_halves=of_halves, fault_shares=shares, fault_bounds=bounds)
    return shown, fit, item


def refined_trajectory(sequence: Sequence) -> tuple[Sequence, tuple[str, ...]]:
    """The whole sequence with refined poses, which go on from the first stated one, and what is to be known of them.

    Windows of frames are refined one by one. Each begins with the last frame of the one before. Relative poses of a
    window that is not refined, because the stated ones are as good or nothing determines them, stay as stated.

    Raises
    ------
    DataError
        If reference tracks determine no window, or an image or depth map cannot be read.
    """
    n_frames = len(sequence)
    poses, moved = np.full((n_frames, 4, 4), np.nan), np.eye(4)
    fits, notes = list[PoseFit](), list[str]()
    for start in range(0, max(n_frames - 1, 1), _LONGEST - 1):
        part = range(start, min(start + _LONGEST, n_frames))
        window, fit = _refined(sequence, part)
        fits.append(fit)
        part_poses = window.world_from_camera if fit.leads else sequence.world_from_camera[part.start : part.stop]
        if not fit.leads:
            notes.append(f"frames {part[0]} to {part[-1]} keep their stated relative poses. {fit.reason}")
        if start and np.isfinite(poses[start]).all() and np.isfinite(part_poses[0]).all():
            moved = poses[start] @ invert(part_poses[:1])[0]
        poses[part.start : part.stop] = moved @ part_poses
    if not any(fit.leads or fit.stated_px is not None for fit in fits):
        raise DataError(sequence.source, fits[0].reason.rstrip("."), "poses that reference tracks refine")
    return RefinedPoses.of(sequence, poses), tuple(notes)


def _refined(sequence: Sequence, part: range) -> tuple[Sequence, PoseFit]:
    shown = sequence if len(part) == len(sequence) else PartOfSequence(sequence, part)
    return refined(shown, best_truth(sequence), DEFAULT_RULE, len(part))


def _values(fit: PoseFit) -> dict[str, float | int | str | None]:
    """Numbers of an item; what was not determined is None."""
    return {
        "are_refined": fit.leads,
        "n_references": fit.references,
        "left_px": fit.left_px,
        "stated_px": fit.stated_px,
        "age": fit.age,
        "stated_next_px": fit.next_px,
        **{f"stated_{name}": value for name, value in (fit.stated_errors or {}).items()},
        **fit.corrections,
    }
