"""The topic clock: whether poses and images are of the same moment."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.interpolation import interpolate_poses
from tracknoise.inspection.check_report import Item, Severity, Values
from tracknoise.inspection.clock_offset import ClockOffset, Rates, estimate_offset
from tracknoise.inspection.evidence import Evidence
from tracknoise.inspection.optics import focal_px
from tracknoise.inspection.residuals import relative_pose
from tracknoise.inspection.rotation import image_rotation

MOST_SD_FRAMES = 0.25
"""Offsets with a larger standard deviation are not known."""
LEAST_FRAMES, SURE_SD = 0.1, 3.0
"""Offsets smaller than this, or than this many standard deviations, are no offsets."""
LEAST_EFFECT_PX = 0.1
"""Offsets that move points by less than this from frame to frame are no caveat."""
_MOST_UNEXPLAINED = 0.8
_PASSES, _NEIGHBOURS_FRAMES = 3, 1.5
_LEAST_RATE_PX = 0.3
"""Rotation per frame, as image motion, below which a clock cannot be seen."""


def clock(evidence: Evidence, timestamps_s: NDArray[np.float64] | None) -> Item:
    """Offset between the times of poses and images, where the rotation rate changes enough to show it.

    Parameters
    ----------
    evidence
        Of the sequence.
    timestamps_s
        (n,) float64; None where unknown. Then the offset is given in frames only.
    """
    found = measured_offset(evidence)
    if found is None or found.sd_frames > MOST_SD_FRAMES or not found.unexplained <= _MOST_UNEXPLAINED:
        text = "The rotation rate does not change enough to show an offset between the clocks of images and poses."
        return Item("clock", Severity.unknown, text)
    step = None if timestamps_s is None or len(timestamps_s) < 2 else float(np.median(np.diff(timestamps_s)))
    values: Values = {
        "offset_frames": found.frames,
        "sd_frames": found.sd_frames,
        "offset_s": None if step is None else found.frames * step,
        "sd_s": None if step is None else found.sd_frames * step,
    }
    size = _size(found, step)
    effect_px = abs(found.frames) * found.rate_change * focal_px(evidence.camera)
    if abs(found.frames) < max(LEAST_FRAMES, SURE_SD * found.sd_frames) or effect_px < LEAST_EFFECT_PX:
        return Item("clock", Severity.ok, f"Clocks of images and poses agree: the offset is {size}.", values)
    text = f"Poses and images differ in time: the pose that fits an image is the one of {size} later."
    return Item("clock", Severity.caveat, text.replace("later", "later" if found.frames > 0 else "earlier"), values)


def measured_offset(evidence: Evidence) -> ClockOffset | None:
    """Offset of the poses; None where there is next to no rotation, or too little of the recording.

    Rotation and translation are estimated together first. Then the translation is that of the poses at the offset found
    so far, because a small translation and a small rotation look much alike.
    """
    rates = _rates(evidence, None)
    found = None if rates is None else estimate_offset(rates)
    for _ in range(_PASSES if evidence.has_depth else 0):
        if found is not None and (again := _rates(evidence, found.frames)) is not None:
            found = estimate_offset(again)
    return found


def _rates(evidence: Evidence, offset_frames: float | None) -> Rates | None:
    """Rotation rates by images and by poses; by images with the translation of poses at an offset, if one is given."""
    steps = evidence.flow.steps
    by_poses = np.array([_pose_rotation(relative_pose(evidence.poses, pair)) for pair in steps]).reshape(-1, 3)
    turned = np.linalg.norm(by_poses[np.isfinite(by_poses).all(axis=1)], axis=1)
    if not len(turned) or np.percentile(turned, 90) * focal_px(evidence.camera) < _LEAST_RATE_PX:
        return None
    translations = _translations(evidence, offset_frames)
    by_image = [image_rotation(pair, evidence.camera, given) for pair, given in zip(steps, translations, strict=True)]
    return Rates(np.array([pair.first for pair in steps], dtype=np.float64), np.array(by_image), by_poses)


def _translations(evidence: Evidence, offset_frames: float | None) -> list[NDArray[np.float64] | None]:
    """Translation of second_from_first of each step at an offset, metres; None where it is unknown."""
    steps = evidence.flow.steps
    if offset_frames is None:
        return [None] * len(steps)
    frames = np.arange(len(evidence.poses), dtype=np.float64)
    there = interpolate_poses(frames, evidence.poses, frames + offset_frames, max_gap_s=_NEIGHBOURS_FRAMES)
    moved = [relative_pose(there, pair)[:3, 3] for pair in steps]
    return [one if np.isfinite(one).all() else None for one in moved]


def _pose_rotation(relative: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) float64: rotation vector, radians; NaN without a pose."""
    if not np.isfinite(relative).all():
        return np.full(3, np.nan)
    return np.asarray(Rotation.from_matrix(relative[:3, :3]).as_rotvec(), dtype=np.float64)


def _size(found: ClockOffset, step_s: float | None) -> str:
    """The offset without its sign, with its standard deviation."""
    frames = f"{abs(found.frames):.2f} +- {max(found.sd_frames, 0.01):.2f} frames"
    return frames if step_s is None else f"{frames} ({1000 * abs(found.frames) * step_s:.1f} ms)"
