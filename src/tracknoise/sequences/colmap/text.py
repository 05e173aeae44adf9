"""Text files of COLMAP: ``cameras.txt`` and ``images.txt``."""

import math
from collections.abc import Iterator
from pathlib import Path

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import MIB, read_text
from tracknoise.printable import counted
from tracknoise.sequences.colmap.model import PARAMETERS, ColmapCamera, ColmapImage

_MOST_BYTES = 4096 * MIB
_CAMERA = "CAMERA_ID MODEL WIDTH HEIGHT PARAMS"
_IMAGE = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
_POINT = "X Y POINT3D_ID"
_LONGEST_NUMBER = 40
_LONGEST_SHOWN = 80


def read_cameras(path: Path) -> dict[int, ColmapCamera]:
    """Cameras by their numbers.

    Raises
    ------
    DataError
        If the file is missing, or naming the first line that is damaged.
    """
    cameras = {}
    for place, line in _lines(path, _CAMERA):
        if not line:
            continue
        fields = line.split()
        if len(fields) < 4 or fields[1] not in PARAMETERS:
            raise DataError(place, repr(line[:_LONGEST_SHOWN]), f"{_CAMERA} with MODEL one of {', '.join(PARAMETERS)}")
        number, width, height = (_whole(place, field) for field in (fields[0], *fields[2:4]))
        parameters = tuple(_number(place, field) for field in fields[4:])
        if len(parameters) != PARAMETERS[fields[1]]:
            found = f"{counted(len(parameters), 'parameter')} of the model {fields[1]}"
            raise DataError(place, found, f"{PARAMETERS[fields[1]]}")
        cameras[number] = ColmapCamera(place, fields[1], width, height, parameters)
    return cameras


def read_images(path: Path) -> list[ColmapImage]:
    """Registered images. Each has two lines, of which the second lists its points and may be empty.

    Raises
    ------
    DataError
        If the file is missing, or naming the first line that is damaged or no list of points.
    """
    images: list[ColmapImage] = []
    lines = _lines(path, _IMAGE)
    for place, line in lines:
        if not line:
            continue
        fields = line.split(maxsplit=9)
        if len(fields) != 10:
            raise DataError(place, counted(len(fields), "field"), f"10 ({_IMAGE})")
        pose = tuple(_number(place, field) for field in fields[1:8])
        images.append(ColmapImage(place, fields[9], _whole(place, fields[8]), pose))
        _require_points(*next(lines, (place, "")))
    return images


def _require_points(place: str, line: str) -> None:
    """Check that a line lists points. Where files lack these lines, every second image would be taken for one."""
    fields = line.split()
    last = fields[-1].removeprefix("-") if fields else "0"
    if len(fields) % len(_POINT.split()) or not last.isdecimal():
        raise DataError(place, repr(line[:_LONGEST_SHOWN]), f"points ({_POINT}), or an empty line, after each image")


def _lines(path: Path, expected: str) -> Iterator[tuple[str, str]]:
    """Place and text of each line that is not a comment, without surrounding spaces."""
    for number, line in enumerate(read_text(path, f"lines of {expected}", most=_MOST_BYTES).split("\n"), start=1):
        if not line.lstrip().startswith("#"):
            yield f"{path}:{number}", line.strip()


def _number(place: str, field: str) -> float:
    try:
        number = float(field)
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or "_" in field:
        raise DataError(place, repr(field[:_LONGEST_NUMBER]), "a finite number")
    return number


def _whole(place: str, field: str) -> int:
    if not (field.isascii() and field.isdigit() and len(field) < _LONGEST_NUMBER // 2):
        raise DataError(place, repr(field[:_LONGEST_NUMBER]), "a whole number")
    return int(field)
