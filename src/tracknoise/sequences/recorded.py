"""A sequence whose images and depths are files."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.images import read_gray
from tracknoise.sequences.sequence import TruthKind
from tracknoise.tables.identity import SequenceId

DepthReader = Callable[[Path, Camera], DepthMap]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RecordedSequence:
    """A `tracknoise.sequences.sequence.Sequence` of files, each read when asked for and not kept.

    Parameters
    ----------
    id
        Which sequence.
    camera
        Intrinsics of all images.
    world_from_camera
        (n, 4, 4) float64, rigid: one pose an image.
    image_paths
        n files, at least one.
    depth_paths
        n files, None for a frame without depth; or None where no frame has any.
    read_depth
        Reads one of them: a module's function, or a `functools.partial` of one, so that the sequence can be pickled.
    notes
        What was corrected or assumed while reading, one sentence each.

    Raises
    ------
    DataError
        If there is no frame, or the counts of images, poses and depths differ.
    ValueError
        If only one of `depth_paths` and `read_depth` is given.
    """

    id: SequenceId
    camera: Camera
    world_from_camera: NDArray[np.float64]
    image_paths: tuple[Path, ...]
    depth_paths: tuple[Path | None, ...] | None = None
    read_depth: DepthReader | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if (self.depth_paths is None) != (self.read_depth is None):
            raise ValueError("depth_paths and read_depth go together")
        place = f"{self.id.dataset} {self.id.scene}"
        images, poses = len(self.image_paths), len(self.world_from_camera)
        if not images:
            raise DataError(place, "no images", "at least one")
        if poses != images:
            raise DataError(place, f"{poses} poses", f"one for each of the {images} images")
        if self.depth_paths is not None and len(self.depth_paths) != images:
            raise DataError(place, f"{len(self.depth_paths)} depth maps", f"one for each of the {images} images")

    def __len__(self) -> int:
        return len(self.image_paths)

    @property
    def source(self) -> str:
        """Folder of the images."""
        return str(self.image_paths[0].parent)

    @property
    def truths(self) -> tuple[TruthKind, ...]:
        """Birth where any frame has depth."""
        return (TruthKind.birth,) if self.depth_paths is not None and any(self.depth_paths) else ()

    @property
    def surface(self) -> None:
        """None: a recording knows no exact surface."""
        return None

    @property
    def scan(self) -> None:
        """None: its truth lies in depth maps."""
        return None

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: one frame in 8-bit grayscale.

        Raises
        ------
        DataError
            If the file is missing, truncated or of another size than the camera's.
        """
        return read_gray(self.image_paths[index], self.camera)

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame, or None where it has none.

        Raises
        ------
        DataError
            If the file is missing, damaged or of another size than the camera's.
        """
        if self.depth_paths is None or self.read_depth is None:
            return None
        path = self.depth_paths[index]
        return None if path is None else self.read_depth(path, self.camera)


def depth_notes(depth_paths: tuple[Path | None, ...]) -> tuple[str, ...]:
    """A sentence if there are frames without depth."""
    missing = depth_paths.count(None)
    return (f"{missing} of {len(depth_paths)} frames have no depth",) if missing else ()
