"""The topic pose jumps: steps of the camera that no camera makes."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.inspection.check_report import Item, Severity, Values
from tracknoise.printable import counted, significant
from tracknoise.sequences.sequence import Sequence

_JUMP_STEPS, _JUMP_AROUND = 8.0, 3.0
"""A jump is this many times the median step, and this many times the steps around it."""
_JUMP_DEG, _JUMP_M = 1.0, 0.02
"""A jump is at least this large."""


def pose_jumps(sequence: Sequence) -> Item:
    """Steps of the camera that are far larger than their neighbours."""
    moved_m, turned_deg = steps_of(sequence.world_from_camera)
    known = np.isfinite(moved_m)
    if known.sum() < 3:
        return Item("pose jumps", Severity.unknown, "There are too few poses in a row to look for jumps.")
    jumped = is_jump(moved_m, _JUMP_M) | is_jump(turned_deg, _JUMP_DEG)
    worst = int(np.nanargmax(np.where(jumped, moved_m / _median(moved_m) + turned_deg / _median(turned_deg), -1.0)))
    values: Values = {
        "n_jumps": int(jumped.sum()),
        "median_step_m": _median(moved_m),
        "median_step_deg": _median(turned_deg),
    }
    typical = f"The median step is {significant(_median(moved_m), 3)} m and {significant(_median(turned_deg), 3)} deg"
    if not jumped.any():
        return Item("pose jumps", Severity.ok, f"{typical}; no step is far larger than those around it.", values)
    text = (
        f"Poses jump in {counted(int(jumped.sum()), 'place')}. The largest jump follows frame {worst}: "
        f"{significant(moved_m[worst], 3)} m and {significant(turned_deg[worst], 3)} deg. {typical}."
    )
    return Item("pose jumps", Severity.caveat, text, {**values, "worst_frame": worst})


def steps_of(poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n - 1,) float64 each: distance (m) and angle (deg) from each pose to the next; NaN without a pose."""
    moved = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    relative = np.swapaxes(poses[:-1, :3, :3], 1, 2) @ poses[1:, :3, :3]
    off_axis = np.stack([relative[:, 2, 1], relative[:, 0, 2], relative[:, 1, 0]], axis=1)
    off_axis -= np.stack([relative[:, 1, 2], relative[:, 2, 0], relative[:, 0, 1]], axis=1)
    sine, cosine = np.linalg.norm(off_axis, axis=1) / 2, (np.trace(relative, axis1=1, axis2=2) - 1) / 2
    return moved, np.degrees(np.arctan2(sine, cosine))


def is_jump(steps: NDArray[np.float64], least: float) -> NDArray[np.bool_]:
    """(n,) bool: steps far above the median of all and above their neighbours."""
    padded = np.pad(np.nan_to_num(steps), 2)
    around = np.max([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]], axis=0)
    large = (steps > least) & (steps > _JUMP_STEPS * _median(steps)) & (steps > _JUMP_AROUND * around)
    return np.asarray(large, dtype=np.bool_)


def _median(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return max(float(np.median(known)), 1e-12) if len(known) else 1e-12
