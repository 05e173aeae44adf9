"""A scene of DTU Point Features under one lighting."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera import Camera
from tracknoise.sequences.dtu.shots import Shots
from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.tables.identity import SequenceId


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LitSequence:
    """A `tracknoise.sequences.sequence.Sequence` that shares its images with others, and whose truth is a scan.

    Parameters
    ----------
    id
        Which sequence.
    source
        Folder of its scene.
    camera
        Intrinsics of all images.
    world_from_camera
        (n, 4, 4) float64, rigid: one pose per frame.
    scan
        Of its scene.
    shots
        The images, one object for all sequences that were opened together.
    lighting
        Index of its lighting in `shots`.
    notes
        What was corrected or assumed while reading, one sentence each.
    """

    id: SequenceId
    source: str
    camera: Camera
    world_from_camera: NDArray[np.float64]
    scan: Scan
    shots: Shots
    lighting: int
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.world_from_camera)

    @property
    def timestamps_s(self) -> None:
        """None: the data set does not give the times of the images."""
        return None

    @property
    def pose_accuracy(self) -> None:
        """None: the data set does not state it."""
        return None

    @property
    def depth_accuracy(self) -> None:
        """None: there are no depths."""
        return None

    @property
    def z_depth_from(self) -> str:
        """Features get the depths along z of points that are known in the world."""
        return "the points of a scan"

    @property
    def truths(self) -> tuple[TruthKind, ...]:
        """The scan."""
        return (TruthKind.scan,)

    @property
    def surface(self) -> None:
        """None: a scan is not an exact surface."""
        return None

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8, read-only: one frame in 8-bit grayscale.

        Raises
        ------
        DataError
            If a file is missing, truncated or of another size than the camera's.
        """
        return self.shots.image(index, self.lighting)

    def depth(self, index: int) -> None:
        """None: only one frame was scanned."""
