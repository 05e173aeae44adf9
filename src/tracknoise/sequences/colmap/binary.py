"""Binary files of COLMAP: ``cameras.bin`` and ``images.bin``, little-endian."""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import MIB, read_bytes
from tracknoise.foreign.parsing import damage_reported
from tracknoise.printable import counted
from tracknoise.sequences.colmap.model import PARAMETERS, ColmapCamera, ColmapImage

_MOST_BYTES = 4096 * MIB
_COUNT = struct.Struct("<Q")
_CAMERA = struct.Struct("<IiQQ")
"""Number, number of the model, width, height."""
_IMAGE = struct.Struct("<I7dI")
"""Number, quaternion with the scalar first, translation, number of the camera."""
_POINT_BYTES = struct.calcsize("<ddq")
_LARGEST_SIDE = 1 << 20


@dataclass(slots=True)
class _Cursor:
    """A position in the content of a file."""

    content: bytes
    at: int = 0

    def take(self, layout: struct.Struct) -> tuple[Any, ...]:
        values = layout.unpack_from(self.content, self.at)
        self.at += layout.size
        return values

    def text(self) -> str:
        """What comes before the next zero byte."""
        end = self.content.index(b"\0", self.at)
        value = self.content[self.at : end].decode()
        self.at = end + 1
        return value

    def skip(self, count: int) -> None:
        if count > len(self.content) - self.at:
            raise ValueError(
                f"{counted(count, 'byte')} at {self.at}, where the file ends after {len(self.content) - self.at}"
            )
        self.at += count


def read_cameras(path: Path) -> dict[int, ColmapCamera]:
    """Cameras by their numbers.

    Raises
    ------
    DataError
        If the file is missing or damaged.
    """
    cursor = _Cursor(read_bytes(path, "cameras of COLMAP", most=_MOST_BYTES))
    with damage_reported(path, "a damaged or truncated file", "cameras of COLMAP", with_reason=True):
        (count,) = cursor.take(_COUNT)
        return dict(_camera(path, cursor) for _ in range(count))


def read_images(path: Path) -> list[ColmapImage]:
    """Registered images.

    Raises
    ------
    DataError
        If the file is missing or damaged.
    """
    cursor = _Cursor(read_bytes(path, "images of COLMAP", most=_MOST_BYTES))
    with damage_reported(path, "a damaged or truncated file", "images of COLMAP", with_reason=True):
        (count,) = cursor.take(_COUNT)
        return [_image(path, cursor) for _ in range(count)]


def _camera(path: Path, cursor: _Cursor) -> tuple[int, ColmapCamera]:
    number, kind, width, height = cursor.take(_CAMERA)
    place = f"{path} camera {number}"
    if not 0 <= kind < len(PARAMETERS):
        raise DataError(place, f"camera model {kind}", f"a number from 0 to {len(PARAMETERS) - 1}")
    if max(width, height) > _LARGEST_SIDE:
        raise DataError(place, f"an image size of {width}x{height}", f"at most {_LARGEST_SIDE} each")
    model = list(PARAMETERS)[kind]
    parameters = cursor.take(struct.Struct(f"<{PARAMETERS[model]}d"))
    return number, ColmapCamera(place, model, width, height, parameters)


def _image(path: Path, cursor: _Cursor) -> ColmapImage:
    number, *pose, camera_id = cursor.take(_IMAGE)
    image = ColmapImage(f"{path} image {number}", cursor.text(), camera_id, tuple(pose))
    cursor.skip(cursor.take(_COUNT)[0] * _POINT_BYTES)
    return image
