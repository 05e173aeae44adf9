"""Any camera file: what kind it is follows from its contents."""

import json
from pathlib import Path
from typing import Any

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text
from tracknoise.sequences.camera_files.calibration import cameras_of, read_calibrated, read_chain
from tracknoise.sequences.camera_files.camera_file import CameraFile
from tracknoise.sequences.camera_files.entries import Entries
from tracknoise.sequences.camera_files.matrices import has_matrix, read_matrices
from tracknoise.sequences.camera_files.opencv_xml import read_opencv_xml
from tracknoise.sequences.camera_files.plain import REQUIRED, read_plain
from tracknoise.sequences.camera_files.yaml_file import read_yaml

_JSON = ".json"
_EXPECTED = (
    "a camera file of Kalibr (cam0: ...), EuRoC (intrinsics), OpenCV or ROS (camera_matrix), "
    "or width, height, fx, fy, cx and cy"
)


def read_camera_file(path: Path, *, camera: str | None = None, size: tuple[int, int] | None = None) -> CameraFile:
    """Read a camera from a file of Kalibr, EuRoC, TUM-VI, OpenCV, ROS or tracknoise.

    Positions are not converted: all of these put (0, 0) at the centre of the first pixel.

    Parameters
    ----------
    path
        The file.
    camera
        Which camera, where the file has several: ``cam0`` of Kalibr's chains, ``1`` of OpenCV's pairs; by default the
        first.
    size
        Width and height of the images, px, for a file that does not say.

    Raises
    ------
    DataError
        If the file cannot be read, is of no such kind, lacks something, or has an impossible value.
    UnknownNameError
        If there is no camera of that name.
    """
    entries = Entries(path, _values(path))
    if cameras_of(entries):
        return read_chain(entries, camera)
    if has_matrix(entries, camera):
        return read_matrices(entries, camera, size)
    if camera is not None:
        raise DataError(path, f"no camera {camera}", "a file that names its cameras, or no name")
    if entries.name("intrinsics"):
        return read_calibrated(entries, size)
    if path.suffix == _JSON or entries.name(*REQUIRED):
        return read_plain(entries)
    raise DataError(path, "no camera", _EXPECTED)


def _values(path: Path) -> dict[str, Any]:
    if path.suffix == _JSON:
        return _read_object(path)
    if read_text(path, "a camera file").lstrip().startswith("<"):
        return read_opencv_xml(path)
    return read_yaml(path)


def _read_object(path: Path) -> dict[str, Any]:
    try:
        entries = json.loads(read_text(path, "the camera's width, height, fx, fy, cx and cy in JSON"))
    except json.JSONDecodeError as error:
        raise DataError(f"{path}:{error.lineno}", f"no JSON ({error.msg})", "a JSON object") from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, or thousands of brackets
        raise DataError(path, "unreadable file", "a JSON object") from error
    if not isinstance(entries, dict):
        raise DataError(path, "JSON, but no object", "a JSON object")
    return entries
