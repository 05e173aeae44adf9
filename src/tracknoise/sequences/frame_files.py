"""Images and depths that are files, one for each frame: what `RecordedSequence` calls to read a frame."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.printable import counted_of
from tracknoise.sequences.images import Levels, read_gray

DepthReader = Callable[[Path, CameraModel], DepthMap]
"""Reads one depth file: a module's function, or a `functools.partial` of one, so that it can be pickled."""


@dataclass(frozen=True, slots=True)
class ImageFiles:
    """Reads the image of a frame from its file.

    Parameters
    ----------
    paths
        One file for each frame.
    camera
        Whose size the images must have.
    levels
        Values of 16-bit images that become 0 and 255; None where all images must have 8 bits.
    as_stored
        Whether what EXIF data say of the orientation is ignored, as the program that made the poses did.
    """

    paths: tuple[Path, ...]
    camera: CameraModel
    levels: Levels | None = None
    as_stored: bool = False

    def __len__(self) -> int:
        return len(self.paths)

    def __call__(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `tracknoise.sequences.images.read_gray`."""
        return read_gray(self.paths[index], self.camera, levels=self.levels, as_stored=self.as_stored)


@dataclass(frozen=True, slots=True)
class DepthFiles:
    """Reads the depth of a frame from its file.

    Parameters
    ----------
    paths
        One file for each frame, None for a frame without depth.
    camera
        Whose size the depth maps must have.
    read
        Reads one file.
    """

    paths: tuple[Path | None, ...]
    camera: CameraModel
    read: DepthReader

    def __len__(self) -> int:
        return len(self.paths)

    def __call__(self, index: int) -> DepthMap | None:
        """Depth of one frame, or None where it has none.

        Raises
        ------
        DataError
            If the file is missing, damaged or of another size than the camera's.
        """
        path = self.paths[index]
        return None if path is None else self.read(path, self.camera)


def depth_files(paths: tuple[Path | None, ...], camera: CameraModel, read: DepthReader) -> DepthFiles | None:
    """What reads the depths of a sequence; None where no frame has any."""
    return DepthFiles(paths, camera, read) if any(paths) else None


def depth_notes(paths: tuple[Path | None, ...]) -> tuple[str, ...]:
    """A sentence if there are frames without depth."""
    missing = paths.count(None)
    have = counted_of(missing, len(paths), "frame", "has", "have")
    return (f"{have} no depth",) if missing else ()
