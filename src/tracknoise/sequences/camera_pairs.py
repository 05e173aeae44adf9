"""A second camera beside the first, from calibration files: see docs/data.md.

Files state how points of one camera become those of the other, or poses of both in one body. All is turned into the
pose of the second camera in the frame of the first.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require
from tracknoise.exceptions import DataError
from tracknoise.geometry.pose import from_rotation, invert
from tracknoise.sequences.camera_files import (
    FROM_PREVIOUS,
    SECOND,
    CameraFile,
    Lens,
    cameras_of,
    has_matrix,
    read_camera_file,
    read_entries,
    read_plain,
)
from tracknoise.sequences.entries import Entries
from tracknoise.sequences.poses import checked_poses
from tracknoise.sequences.scenes import with_option
from tracknoise.sequences.system_cameras import camera_names
from tracknoise.text import counted

PLACE = "first_from_second"
"""Option of readers, and key of ``second`` in ``camera.json``: the pose of the second camera in the first."""
STATED_PLACES = (
    f"T_cn_cnm1 or T_cam_imu (Kalibr), T_BS (EuRoC), R and T (OpenCV), {PLACE} (camera.json), "
    f"or {with_option(PLACE, '[16 NUMBERS]')}"
)
"""Where the pose of a second camera may be stated."""
_PAIR = ("1", "2")
_POSE_NUMBERS = 16


def require_pose_numbers(name: str, numbers: Sequence[float] | None) -> None:
    """Raise ValueError unless an option has none, or the 16 numbers of a pose."""
    require(numbers is None or len(numbers) == _POSE_NUMBERS, name, numbers, "16 numbers")


def pose_of_numbers(name: str, numbers: Sequence[float]) -> NDArray[np.float64]:
    """(4, 4) float64: the pose whose rows an option has.

    Raises
    ------
    DataError
        If it is not rigid.
    """
    (pose,), _ = checked_poses(np.array(numbers, np.float64).reshape(1, 4, 4), [name])
    return np.asarray(pose)


def read_second(
    first: CameraFile | None,
    first_file: Path | None,
    first_name: str | None,
    *,
    file: Path | None,
    name: str | None,
    size: tuple[int, int] | None,
    lens: Lens | None,
) -> tuple[CameraFile, NDArray[np.float64] | None]:
    """Read a second camera, and its pose in the frame of the first if files state it.

    Parameters
    ----------
    first
        The first camera; None where it is from no file.
    first_file, first_name
        Its file, and which of the cameras there it is; None for the first of them.
    file, name
        Those of the second camera; by default the other camera of the file of the first.
    size
        Width and height of its images, px, for a file that does not say.
    lens
        Lens of a file of OpenCV with 4 coefficients, which does not say.

    Returns
    -------
    second : CameraFile
    first_from_second : (4, 4) float64 or None
        Metres.

    Raises
    ------
    DataError
        If a file cannot be read, has another number of cameras, or does not say which of several is meant.
    UnknownNameError
        If it has no camera of this name.
    """
    source = file or first_file
    assert source is not None, "one of the files is given"
    entries = read_entries(source)
    names = _names(entries)
    place: NDArray[np.float64] | None = None
    if source != first_file:
        _require_one(source, names, name, set())
        of_matrix = lens if has_matrix(entries, name) else None
        second = read_camera_file(source, camera=name, size=size, lens=of_matrix)
    elif not names and name is None and entries.name(SECOND):
        part = entries.part(SECOND)
        second = read_plain(Entries(part.place, {key: part.values[key] for key in part.values if key != PLACE}))
        place = part.rigid(PLACE) if part.name(PLACE) else None
    else:
        if len(names) < len(_PAIR):
            found = f"one camera{''.join(f' ({one})' for one in names)}"
            raise DataError(source, found, f"two cameras, or {with_option('second_camera_file', 'FILE')}")
        chosen = first_name or names[0]
        other = _require_one(source, names, name, {chosen})
        second = read_camera_file(source, camera=other, size=size, lens=lens)
        place = _place(entries, names, chosen, other)
    bodies = None if first is None else first.body_from_camera, second.body_from_camera
    if place is None and bodies[0] is not None and bodies[1] is not None:
        place = invert(bodies[0]) @ bodies[1]
    return second, place


def _names(entries: Entries) -> list[str]:
    """Names of the cameras of a file with several; none of a file of one camera."""
    numbered = [number for number in _PAIR if has_matrix(entries, number)]
    return cameras_of(entries) or camera_names(entries) or numbered


def _require_one(source: Path, names: list[str], name: str | None, used: set[str]) -> str | None:
    """The camera that is named, or the only one that is not used."""
    others = [one for one in names if one not in used]
    if name in used:
        raise DataError(source, f"{name} as both cameras", f"another one of {', '.join(names)}")
    if name is None and len(others) > 1:
        expected = f"the second one: {with_option('second_camera', others[0])}"
        raise DataError(source, f"{counted(len(names), 'camera')} ({', '.join(names)})", expected)
    return name or next(iter(others), None)


def _place(entries: Entries, names: list[str], first: str, second: str | None) -> NDArray[np.float64] | None:
    """(4, 4) float64: the pose of a camera in another one of a file; None where it is not stated between the two."""
    if second not in names or first not in names:
        return None
    start, stop = sorted(map(names.index, (first, second)))
    later = _along_chain(entries, names[start + 1 : stop + 1]) if cameras_of(entries) else _beside(entries)
    return later if later is None or names[start] == first else invert(later)


def _along_chain(entries: Entries, names: list[str]) -> NDArray[np.float64] | None:
    """Pose of the last camera of a chain in the one before the first of these names."""
    pose: NDArray[np.float64] = np.eye(4)
    for part in map(entries.part, names):
        if not part.name(FROM_PREVIOUS):
            return None
        pose = pose @ invert(part.rigid(FROM_PREVIOUS))
    return pose


def _beside(entries: Entries) -> NDArray[np.float64] | None:
    """Pose of camera 2 in camera 1 of OpenCV: X_2 = R X_1 + T."""
    rotation, translation = entries.name("R"), entries.name("T")
    if rotation is None or translation is None:
        return None
    second_from_first = from_rotation(entries.matrix(rotation, 3, 3), entries.numbers(translation, 3))
    return invert(pose_of_numbers(f"{entries.place}: R, T", second_from_first.ravel().tolist()))
