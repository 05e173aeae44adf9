"""The calibration file: what the camera calibration toolbox for MATLAB saves.

The toolbox counts pixels from the centre of the first, as everywhere here.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.pose import invert
from tracknoise.sequences.dtu.layout import POSITIONS
from tracknoise.sequences.dtu.matlab import Variable, numbers, read_mat
from tracknoise.sequences.poses import checked_poses

_SIZE = (1600, 1200)
_SKEW = 1e-6
_INTRINSICS = {"fc": 2, "cc": 2, "kc": 5}


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Where the camera of all scenes was, and what it was like.

    Parameters
    ----------
    camera
        Of the images that it was calibrated with.
    world_from_camera
        (49, 4, 4) float64: poses of the positions of arc 1.
    notes
        What was corrected.
    """

    camera: Camera
    world_from_camera: NDArray[np.float64]
    notes: tuple[str, ...]


def read_calibration(path: Path) -> Calibration:
    """Read ``fc``, ``cc``, ``kc`` and, for each position i, ``Rc_i`` and ``Tc_i`` (world to camera, metres).

    ``kc`` is k1, k2, p1, p2, k3 in OpenCV's order. ``nx``, ``ny``, the size of the images, is 1600x1200 unless the file
    has another. ``alpha_c``, the skew, may be missing, but must be 0.

    Raises
    ------
    DataError
        If the file or one of these is missing or has other numbers; if a rotation is none, the principal point lies
        outside the image, or the distortion cannot be inverted.
    """
    poses = [f"{kind}_{position}" for kind in ("Rc", "Tc") for position in POSITIONS]
    variables = read_mat(path, [*_INTRINSICS, "nx", "ny", "alpha_c", *poses])
    camera = _camera(path, variables)
    camera_from_world = np.broadcast_to(np.eye(4), (len(POSITIONS), 4, 4)).copy()
    for index, position in enumerate(POSITIONS):
        rotation = numbers(path, variables, f"Rc_{position}", count=9)
        if rotation.shape != (3, 3):
            raise DataError(path, f"Rc_{position} of shape {'x'.join(map(str, rotation.shape))}", "a 3x3 matrix")
        camera_from_world[index, :3, :3] = rotation
        camera_from_world[index, :3, 3] = numbers(path, variables, f"Tc_{position}", count=3).ravel()
    rigid, notes = checked_poses(camera_from_world, [f"{path}: Rc_{position}" for position in POSITIONS])
    return Calibration(camera, invert(rigid), notes)


def _camera(path: Path, variables: Mapping[str, Variable]) -> Camera:
    (fx, fy), (cx, cy), distortion = (
        numbers(path, variables, name, count=count).ravel().tolist() for name, count in _INTRINSICS.items()
    )
    if "alpha_c" in variables and abs(skew := float(numbers(path, variables, "alpha_c", count=1).item())) > _SKEW:
        raise DataError(path, f"a skew of alpha_c = {skew:g}", "0: pixels with right angles")
    width, height = _size(path, variables)
    if not (fx > 0.0 and fy > 0.0):
        raise DataError(path, f"fc = {fx:g}, {fy:g}", "focal lengths above 0")
    if not (0.0 <= cx <= width - 1 and 0.0 <= cy <= height - 1):
        raise DataError(path, f"cc = {cx:g}, {cy:g}", f"a principal point within the image of {width}x{height}")
    camera = Camera(width, height, fx, fy, cx, cy, tuple(distortion) if any(distortion) else ())
    if not camera.is_invertible:
        raise DataError(path, "kc that cannot be inverted over the whole image", "a ray of its own for every pixel")
    return camera


def _size(path: Path, variables: Mapping[str, Variable]) -> tuple[int, int]:
    """Width and height; both even, so that the images can be halved."""
    if "nx" not in variables and "ny" not in variables:
        return _SIZE
    width, height = (float(numbers(path, variables, name, count=1).item()) for name in ("nx", "ny"))
    if min(width, height) < 2 or width % 2 or height % 2:
        raise DataError(path, f"nx = {width:g}, ny = {height:g}", "even numbers of pixels")
    return int(width), int(height)
