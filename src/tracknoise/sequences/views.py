"""Sequences seen differently: the first frames only, backward, or turned."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.sequence import Scan, Sequence, Surface, TruthKind
from tracknoise.tables.identity import Direction, SequenceId

QUARTER_DEG = 90


def view(sequence: Sequence, *, n_frames: int | None, direction: Direction, rotation: int) -> Sequence:
    """A sequence as an experiment wants to see it.

    Parameters
    ----------
    sequence
        As its reader opened it.
    n_frames
        No more frames than this, from the first; None for all.
    direction
        In which order those are played.
    rotation
        By how many degrees the images are turned counter-clockwise: a multiple of 90.
    """
    if n_frames is not None and n_frames < len(sequence):
        sequence = Shortened(sequence, n_frames)
    if direction is Direction.backward:
        sequence = Backward(sequence)
    return turned(sequence, rotation)


def turned(sequence: Sequence, degrees: int) -> Sequence:
    """The sequence with its images, and the camera with them, turned counter-clockwise by a multiple of 90 degrees.

    Raises
    ------
    ValueError
        If `degrees` is no multiple of 90.
    """
    quarters, rest = divmod(degrees % 360, QUARTER_DEG)
    if rest:
        raise ValueError(f"images can be turned by multiples of 90 degrees, not by {degrees}")
    for _ in range(quarters):
        sequence = Turned(sequence)
    return sequence


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A `tracknoise.sequences.sequence.Sequence` that shows another one, unchanged where a subclass does not say so.

    Parameters
    ----------
    sequence
        What is shown.
    """

    sequence: Sequence

    def __len__(self) -> int:
        return len(self.sequence)

    @property
    def id(self) -> SequenceId:
        """That of the sequence shown."""
        return self.sequence.id

    @property
    def source(self) -> str:
        """That of the sequence shown."""
        return self.sequence.source

    @property
    def camera(self) -> Camera:
        """That of the sequence shown."""
        return self.sequence.camera

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64."""
        return self.sequence.world_from_camera

    @property
    def truths(self) -> tuple[TruthKind, ...]:
        """Those of the sequence shown."""
        return self.sequence.truths

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence shown."""
        return self.sequence.notes

    @property
    def scan(self) -> Scan | None:
        """That of the sequence shown."""
        return self.sequence.scan

    @property
    def surface(self) -> Surface | None:
        """That of the sequence shown, seen as the images are: the view's own `cast`."""
        return None if self.sequence.surface is None else self

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `Sequence.image`."""
        return self.sequence.image(index)

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame: see `Sequence.depth`."""
        return self.sequence.depth(index)

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels: see `Surface.cast`."""
        surface = self.sequence.surface
        assert surface is not None, "only a view with a surface is asked for it"
        return surface.cast(index, uv)


@dataclass(frozen=True, slots=True, eq=False)
class Shortened(View):
    """The first frames of a sequence.

    Parameters
    ----------
    sequence
        What is shown.
    n_frames
        How many of its frames, at most all.
    """

    n_frames: int

    def __len__(self) -> int:
        return self.n_frames

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: of the frames that are left."""
        return self.sequence.world_from_camera[: self.n_frames]


@dataclass(frozen=True, slots=True, eq=False)
class Backward(View):
    """A sequence whose last frame comes first, as if the camera had gone its way back."""

    @property
    def id(self) -> SequenceId:
        """The name of the sequence shown, with the other direction."""
        return replace(self.sequence.id, direction=Direction.backward)

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: the last first."""
        return self.sequence.world_from_camera[::-1]

    @property
    def scan(self) -> Scan | None:
        """That of the sequence shown; its key frame lies as far from the end as it lay from the beginning."""
        scan = self.sequence.scan
        return None if scan is None else replace(scan, key_frame=self._there(scan.key_frame))

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `Sequence.image`."""
        return self.sequence.image(self._there(index))

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame: see `Sequence.depth`."""
        return self.sequence.depth(self._there(index))

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels: see `Surface.cast`."""
        return View.cast(self, self._there(index), uv)

    def _there(self, index: int) -> int:
        return len(self.sequence) - 1 - index


@dataclass(frozen=True, slots=True, eq=False)
class Turned(View):
    """A sequence whose images, and the camera with them, are turned a quarter counter-clockwise.

    The pixel (u, v) of the upright image becomes (v, width - 1 - u), and the camera's axes turn likewise: what was up
    in the upright image now lies to the left.
    """

    @property
    def id(self) -> SequenceId:
        """The name of the sequence shown, with 90 degrees more."""
        name = self.sequence.id
        return replace(name, rotation=(name.rotation + QUARTER_DEG) % 360)

    @property
    def camera(self) -> Camera:
        """The camera of the turned images."""
        return self.sequence.camera.turned()

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: the same places, with the camera's axes turned."""
        upright_from_turned = np.diag([0.0, 0.0, 1.0, 1.0])
        upright_from_turned[0, 1], upright_from_turned[1, 0] = -1.0, 1.0
        turned: NDArray[np.float64] = self.sequence.world_from_camera @ upright_from_turned
        return turned

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `Sequence.image`."""
        return np.ascontiguousarray(np.rot90(self.sequence.image(index)))

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame: see `Sequence.depth`."""
        depth = self.sequence.depth(index)
        if depth is None:
            return None
        return replace(depth, depth_m=np.rot90(depth.depth_m), valid=np.rot90(depth.valid))

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels: see `Surface.cast`."""
        upright = np.stack([self.sequence.camera.width - 1 - uv[:, 1], uv[:, 0]], axis=-1)
        return View.cast(self, index, upright)
