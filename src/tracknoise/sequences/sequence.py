"""What every reader yields: a sequence of images with camera, poses and, where there is one, depth."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.depth import DepthMap

DEFAULT_LIGHTING = "default"


class TruthKind(StrEnum):
    """How a feature's true place in the world can be fixed."""

    birth = "birth"
    raycast = "raycast"


@dataclass(frozen=True, slots=True, order=True)
class SequenceId:
    """Name of a sequence: a scene under one lighting and one image rotation.

    Parameters
    ----------
    dataset, scene, lighting
        Names as the user or the data set writes them.
    rotation
        Degrees by which the images are turned counter-clockwise.
    """

    dataset: str
    scene: str
    lighting: str = DEFAULT_LIGHTING
    rotation: int = 0


class Surface(Protocol):
    """The exact surface of a simulated world, for ray-cast truth."""

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels of one frame.

        Parameters
        ----------
        index
            Frame.
        uv
            (n, 2) float64, px.

        Returns
        -------
        points_world : (n, 3) float64
            Metres, world frame; arbitrary where nothing is hit.
        hit : (n,) bool
        """
        ...


@runtime_checkable
class Sequence(Protocol):
    """A camera path through one place, with images loaded one at a time and only when asked for."""

    @property
    def id(self) -> SequenceId:
        """Which sequence this is."""
        ...

    @property
    def source(self) -> str:
        """Where it comes from, for messages: the folder it was read from, or what was simulated."""
        ...

    @property
    def camera(self) -> Camera:
        """Intrinsics of all its images."""
        ...

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: the pose of each frame, with exact rotations."""
        ...

    @property
    def truths(self) -> tuple[TruthKind, ...]:
        """The kinds of truth this sequence offers, best first."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What was corrected or assumed while reading, one sentence each."""
        ...

    def __len__(self) -> int:
        """Count of frames, at least 1."""
        ...

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: one frame in 8-bit grayscale.

        Raises
        ------
        DataError
            If the image is missing, truncated or of another size than the camera's.
        """
        ...

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame, or None where this frame has none.

        Raises
        ------
        DataError
            If the file is missing, truncated or of another size than the camera's.
        """
        ...

    @property
    def surface(self) -> Surface | None:
        """The exact surface, where the sequence is simulated."""
        ...


class Reader(Protocol):
    """A data set in one on-disk format (or none, if simulated). Settings are the fields of a frozen dataclass.

    The first field is ``root: Path``, unless `needs_root` is False; all others are keyword-only with defaults.
    """

    name: ClassVar[str]
    description: ClassVar[str]
    needs_root: ClassVar[bool]

    def sequences(self) -> list[SequenceId]:
        """All sequences, sorted, found from file names alone.

        Raises
        ------
        DataError
            If there is none.
        """
        ...

    def open(self, sequence: SequenceId) -> Sequence:
        """Read and check everything but the images and depths of one sequence.

        Raises
        ------
        DataError
            If a file is missing, damaged or contradicts another.
        UnknownNameError
            If there is no such scene or lighting.
        """
        ...


def require_directory(root: Path) -> Path:
    """Return `root` if it is a directory.

    Raises
    ------
    DataError
        If it is not.
    """
    if not root.is_dir():
        raise DataError(root, "no such directory" if not root.exists() else "not a directory", "a data set's folder")
    return root
