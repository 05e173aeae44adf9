"""Pose files: rows of numbers, and the check that they are rigid transforms."""

import re
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, DataWarning, NothingToMeasureError
from tracknoise.foreign_files import is_number, read_text
from tracknoise.geometry.pose import from_quaternion, nearest_rigid
from tracknoise.text import counted, significant

RIGID_TOLERANCE = 0.05
"""Largest deviation of a rotation's singular values, or of a quaternion's norm, from 1.

Poses rounded to two decimals stay below it, and 7-Scenes deviates by 6e-5; matrices with a scale, swapped columns of
a file and numbers that are not a pose do not.
"""

CORRECTION_NOTED = 1e-3
"""Corrections of a rotation's entries above this are worth a warning: at 500 px focal length, half a pixel."""

_FARTHEST_M = 1e9
_FEWEST = 2

_UNKNOWN = re.compile(r"[-+]?1\.#(?:IND|[QS]?NAN|INF)\d*", re.ASCII)
"""How programs by Microsoft's compiler write numbers that are not finite."""

Place = str | Path


def read_rows(path: Path, columns: str, *, separator: str = " ") -> tuple[NDArray[np.float64], list[str]]:
    """Read a text file of numbers, the same number in each row. Blank lines and ``#`` comments are skipped.

    Returns rows (n, columns). `places`: ``file:line`` of each row.
    """
    rows, places = [], []
    for number, line in enumerate(read_text(path, f"rows of {columns}").splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            places.append(f"{path}:{number}")
            rows.append(numbers(line.replace(separator, " ").split(), columns, places[-1]))
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(columns.split())), places


def read_matrix(path: Path, *, size: int) -> NDArray[np.float64]:
    """Read a text file of one square matrix. Returns (size, size)."""
    rows, _ = read_rows(path, " ".join(f"column{column}" for column in range(1, size + 1)))
    if len(rows) != size:
        raise DataError(path, counted(len(rows), "row"), f"a {size}x{size} matrix")
    return rows


def quaternion_poses(
    translation_m: NDArray[np.float64], xyzw: NDArray[np.float64], places: Sequence[Place]
) -> NDArray[np.float64]:
    """Poses from translations and quaternions that were read from a file.

    Shapes: translation_m (n, 3), xyzw (n, 4); returns (n, 4, 4).
    """
    _require_finite(np.concatenate([translation_m, xyzw], axis=1), places)
    require_near(translation_m, places)
    with np.errstate(over="ignore"):
        norm = np.linalg.norm(xyzw, axis=1)
    for index in np.flatnonzero(np.abs(norm - 1.0) > RIGID_TOLERANCE)[:1]:
        raise DataError(places[index], f"a quaternion of norm {norm[index]:.6g}", "norm 1")
    return from_quaternion(translation_m, xyzw)


def checked_poses(poses: NDArray[np.float64], places: Sequence[Place]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Check that matrices are rigid to within rounding, and make their rotations exact.

    Parameters
    ----------
    poses
        (n, 4, 4) float64.
    places
        n names of files, or ``file:line``.

    Returns
    -------
    poses : (n, 4, 4) float64
        With the nearest rotations.
    notes : tuple of str
        One sentence if the correction is above `CORRECTION_NOTED`. A `DataWarning` is issued too.

    Raises
    ------
    DataError
        Naming the first place with NaN, infinity, a reflection, a scale, a shear, or a last row other than 0 0 0 1.
    """
    _require_finite(poses, places)
    require_near(poses[:, :3, 3], places)
    _require_rigid(poses, places)
    rigid, correction = nearest_rigid(poses)
    worst = int(np.argmax(correction)) if len(correction) else 0
    if not len(correction) or correction[worst] <= CORRECTION_NOTED:
        return rigid, ()
    note = (
        f"{places[worst]}: the rotation is not orthonormal; "
        f"replaced by the nearest rotation, which changes its entries by up to {significant(correction[worst], 2)}"
    )
    warnings.warn(note, DataWarning, stacklevel=2)
    return rigid, (note,)


def has_pose(world_from_camera: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each frame has a pose: (n,) bool, from (n, 4, 4) float64 poses that are NaN where there is none."""
    return np.asarray(~np.isnan(world_from_camera).all(axis=(1, 2)))


def no_poses(n_frames: int) -> NDArray[np.float64]:
    """(n, 4, 4) float64: the poses of frames that have none."""
    return np.full((n_frames, 4, 4), np.nan)


def pose_notes(world_from_camera: NDArray[np.float64]) -> tuple[str, ...]:
    """A sentence if there are frames without a pose."""
    posed = has_pose(world_from_camera)
    missing = int(np.count_nonzero(~posed))
    verb, whose = ("has", "its") if missing == 1 else ("have", "their")
    counted = f"{missing} of {len(posed)} frames {verb} no pose"
    return (f"{counted}: {whose} observations have no true position",) if missing else ()


def surplus_notes(place: Place, *, poses: int, images: int) -> tuple[str, ...]:
    """A sentence if there are more poses than images."""
    used = "is" if images == 1 else f"{images} are"
    counts = f"{counted(poses, 'pose')} for {counted(images, 'image')}"
    return (f"{place}: {counts}: only the first {used} used",) * (poses > images)


def require_some_poses(world_from_camera: NDArray[np.float64], place: Place) -> None:
    """Check that each pose is complete or missing, and that at least 2 are there (1 of a single frame).

    Parameters
    ----------
    world_from_camera
        (n, 4, 4) float64: all NaN for a frame without a pose.
    place
        Origin of the poses, for messages.

    Raises
    ------
    DataError
        If a pose is partly NaN or infinite, or there are too few.
    """
    posed = has_pose(world_from_camera)
    for index in np.flatnonzero(posed & ~np.isfinite(world_from_camera).all(axis=(1, 2)))[:1]:
        raise DataError(place, f"pose {index} with NaN or infinity in it", "finite numbers, or NaN in all of it")
    count, least = int(np.count_nonzero(posed)), min(_FEWEST, len(posed))
    if count < least:
        found = f"{counted(count, 'pose')} for {counted(len(posed), 'frame')}"
        raise NothingToMeasureError(place, found, f"poses for at least {least}")


def require_poses(place: Place, *, poses: int, images: int) -> None:
    """Check that there is a pose for every image; there may be more."""
    if poses < images:
        raise DataError(place, counted(poses, "pose"), f"at least {images}, one for each image")


def numbers(fields: list[str], columns: str, place: str) -> list[float]:
    """Numbers of one row of a text file."""
    expected = len(columns.split())
    if len(fields) != expected:
        raise DataError(place, counted(len(fields), "field"), f"{expected} ({columns})")
    plain = ["nan" if _UNKNOWN.fullmatch(field) else field for field in fields]
    for field in plain:
        if not is_number(field):
            raise DataError(place, repr(field), f"a number ({columns})")
    return [float(field) for field in plain]


def _require_finite(values: NDArray[np.float64], places: Sequence[Place]) -> None:
    finite = np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
    for index in np.flatnonzero(~finite)[:1]:
        raise DataError(places[index], "NaN or infinity in the pose", "finite numbers")


def require_near(translation_m: NDArray[np.float64], places: Sequence[Place]) -> None:
    """Check that positions, (n, any) float64, are not so far away that arithmetic with them overflows."""
    for index in np.flatnonzero(~(np.abs(translation_m).max(axis=1, initial=0.0) <= _FARTHEST_M))[:1]:
        found = f"a position of {' '.join(f'{value:g}' for value in translation_m[index])}"
        raise DataError(places[index], found, f"metres, up to {_FARTHEST_M:g}")


def _require_rigid(poses: NDArray[np.float64], places: Sequence[Place]) -> None:
    block = poses[:, :3, :3]
    stretch = np.abs(np.linalg.svd(block, compute_uv=False) - 1.0).max(axis=1, initial=0.0)
    with np.errstate(all="ignore"):  # of entries that no rotation has
        reflected = np.linalg.det(block) < 0
    last_row = np.abs(poses[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=1, initial=0.0) > 1e-6
    for index in np.flatnonzero((stretch > RIGID_TOLERANCE) | reflected | last_row)[:1]:
        if last_row[index]:
            row = " ".join(f"{value:g}" for value in poses[index, 3])
            raise DataError(places[index], f"a pose whose last row is {row}", "0 0 0 1")
        if reflected[index]:
            raise DataError(places[index], "a pose with a reflection", "a rotation")
        found = f"a pose whose singular values differ from 1 by {significant(stretch[index], 2)}"
        raise DataError(places[index], found, f"a rotation (at most {RIGID_TOLERANCE:g})")
