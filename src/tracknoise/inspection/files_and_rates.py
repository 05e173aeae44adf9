"""Topics that need no image: counts and rates, timestamps, rotations, intrinsics."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.inspection.check_report import Item, Severity, Values
from tracknoise.inspection.optics import focal_px, principal_point
from tracknoise.printable import counted, counted_of, significant
from tracknoise.sequences.sequence import Sequence, caveats_of

_SLOWEST_HZ, _FASTEST_HZ = 0.5, 2000.0
_GAP_STEPS = 1.75
_FOCAL_RANGE = 0.25, 4.0
_CENTRE_SHARE = 0.15


def counts(sequence: Sequence) -> Item:
    """Number and size of images, and how many frames have a pose."""
    n = len(sequence)
    posed = int(np.isfinite(sequence.world_from_camera).all(axis=(1, 2)).sum())
    camera = sequence.camera
    size = f"{camera.width}x{camera.height} px"
    have = "has" if posed == 1 else "have"
    text = f"{counted(n, 'image')} of {size}; {posed} of them {have} a pose."
    if n == 1:
        text = f"1 image of {size}, {'with' if posed else 'without'} a pose."
    values: Values = {"n_frames": n, "n_poses": posed, "width_px": camera.width, "height_px": camera.height}
    if posed < 2:
        return Item("counts", Severity.fatal, f"{text} At least 2 poses are needed.", values)
    if posed < n:
        return Item("counts", Severity.caveat, f"{text} The other frames have no truth.", values)
    return Item("counts", Severity.ok, text, values)


def timestamps(sequence: Sequence) -> Item:
    """Rate, gaps, and whether the unit of the timestamps can be seconds."""
    times = sequence.timestamps_s
    if times is None or len(times) < 2:
        return Item("timestamps", Severity.unknown, "There are no timestamps: rates and gaps are unknown.")
    steps = np.diff(times)
    step = float(np.median(steps))
    gaps = int((steps > _GAP_STEPS * step).sum())
    rate = 1.0 / step
    exceed = counted_of(gaps, len(steps), "interval", "exceeds", "exceed")
    text = f"Images come at {significant(rate, 4)} Hz. {exceed} {_GAP_STEPS:g} times the median."
    values: Values = {"rate_hz": rate, "n_gaps": gaps, "longest_s": float(steps.max())}
    if not _SLOWEST_HZ <= rate <= _FASTEST_HZ:
        why = f"The median interval is {significant(step, 4)} s. The unit of the timestamps is probably not seconds."
        return Item("timestamps", Severity.caveat, why, values)
    if gaps > 0.02 * len(steps) and gaps > 1:
        return Item("timestamps", Severity.caveat, f"{text} Ages count frames, not time.", values)
    return Item("timestamps", Severity.ok, text, values)


def reader_notes(sequence: Sequence) -> list[Item]:
    """What the reader corrected or assumed, rotations that are not orthonormal among it, and its caveats."""
    caveats = caveats_of(sequence)
    return [
        Item("reader", Severity.caveat if note in caveats else Severity.ok, note if note.endswith(".") else f"{note}.")
        for note in sequence.notes
    ]


def rotations(sequence: Sequence) -> Item:
    """Whether rotations are orthonormal, and whether poses change at all."""
    poses = _known_poses(sequence)
    error = np.abs(poses[:, :3, :3] @ np.swapaxes(poses[:, :3, :3], 1, 2) - np.eye(3)).max(initial=0.0)
    values: Values = {"deviation": float(error)}
    if error > 1e-6:
        text = f"Rotations are not orthonormal: entries deviate by up to {error:.2g}."
        return Item("rotations", Severity.fatal, text, values)
    if len(poses) > 1 and np.ptp(poses, axis=0).max() == 0.0:
        return Item("rotations", Severity.fatal, "All poses are the same, so that the camera does not move.", values)
    return Item("rotations", Severity.ok, f"Rotations are orthonormal to {max(error, 1e-15):.1g}.", values)


def intrinsics(sequence: Sequence) -> Item:
    """Whether focal length and principal point can belong to images of this size."""
    camera = sequence.camera
    focal, centre = focal_px(camera), principal_point(camera)
    relative = focal / camera.width
    off = np.abs(centre - ((camera.width - 1) / 2, (camera.height - 1) / 2)) / (camera.width, camera.height)
    values: Values = {"focal_px": focal, "cx_px": float(centre[0]), "cy_px": float(centre[1])}
    text = (
        f"The focal length is {significant(focal, 4)} px, {relative:.2f} times the width. "
        f"The principal point is ({centre[0]:.1f}, {centre[1]:.1f})."
    )
    if not _FOCAL_RANGE[0] <= relative <= _FOCAL_RANGE[1]:
        text += " Such a focal length is unusual for images of this size."
        return Item("intrinsics", Severity.caveat, text, values)
    if off.max() > _CENTRE_SHARE:
        text += f" It is {off.max():.0%} of the size of the image away from the centre."
        return Item("intrinsics", Severity.caveat, text, values)
    return Item("intrinsics", Severity.ok, text, values)


def _known_poses(sequence: Sequence) -> NDArray[np.float64]:
    poses = sequence.world_from_camera
    known: NDArray[np.float64] = poses[np.isfinite(poses).all(axis=(1, 2))]
    return known
