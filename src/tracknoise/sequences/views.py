"""Views of a sequence: its first frames only, played backward, or with turned images."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.accuracy import DepthAccuracy, PoseAccuracy
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.sequence import Scan, Sequence, Surface, camera_at, group_of
from tracknoise.tables.identity import Direction, SequenceId

QUARTER_DEG = 90


def view(sequence: Sequence, *, n_frames: int | None, direction: Direction, rotation: int) -> Sequence:
    """Make the view of a sequence that an experiment requires.

    Parameters
    ----------
    sequence
        The sequence as opened by its reader.
    n_frames
        At most this many frames, from the first; None for all.
    direction
        In which order they are played.
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
        If `degrees` is not a multiple of 90.
    """
    quarters, rest = divmod(degrees % 360, QUARTER_DEG)
    if rest:
        raise ValueError(f"images can be turned by multiples of 90 degrees, not by {degrees}")
    for _ in range(quarters):
        sequence = Turned(sequence)
    return sequence


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A `tracknoise.sequences.sequence.Sequence` that shows another one. Subclasses say what they change.

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
    def camera(self) -> CameraModel:
        """That of the sequence shown."""
        return self.sequence.camera

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64."""
        return self.sequence.world_from_camera

    @property
    def timestamps_s(self) -> NDArray[np.float64] | None:
        """(n,) float64, seconds; None where unknown."""
        return self.sequence.timestamps_s

    @property
    def pose_accuracy(self) -> PoseAccuracy | None:
        """That of the sequence shown."""
        return self.sequence.pose_accuracy

    @property
    def depth_accuracy(self) -> DepthAccuracy | None:
        """That of the sequence shown."""
        return self.sequence.depth_accuracy

    @property
    def truths(self) -> tuple[str, ...]:
        """Those of the sequence shown."""
        return self.sequence.truths

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence shown."""
        return self.sequence.notes

    @property
    def group(self) -> str | None:
        """That of the sequence shown."""
        return group_of(self.sequence)

    @property
    def scan(self) -> Scan | None:
        """That of the sequence shown."""
        return self.sequence.scan

    @property
    def surface(self) -> Surface | None:
        """That of the sequence shown, seen as the images are: the view's own `cast`."""
        return None if self.sequence.surface is None else self

    def camera_at(self, index: int) -> CameraModel:
        """Intrinsics of one frame: see `tracknoise.sequences.sequence.camera_at`."""
        return camera_at(self.sequence, index)

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

    @property
    def timestamps_s(self) -> NDArray[np.float64] | None:
        """(n,) float64, seconds, of the frames that are left; None where unknown."""
        times = self.sequence.timestamps_s
        return None if times is None else times[: self.n_frames]


@dataclass(frozen=True, slots=True, eq=False)
class Backward(View):
    """A sequence played backward: its last frame comes first."""

    @property
    def id(self) -> SequenceId:
        """The name of the sequence shown, with the other direction."""
        return replace(self.sequence.id, direction=Direction.backward)

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: the last first."""
        return self.sequence.world_from_camera[::-1]

    @property
    def timestamps_s(self) -> NDArray[np.float64] | None:
        """(n,) float64, seconds, increasing: the intervals are shown in reverse order; None where unknown."""
        times = self.sequence.timestamps_s
        return None if times is None else times[0] + (times[-1] - times[::-1])

    @property
    def camera(self) -> CameraModel:
        """That of the last frame of the sequence shown."""
        return self.camera_at(0)

    @property
    def scan(self) -> Scan | None:
        """That of the sequence shown; its key frame is counted from the other end."""
        scan = self.sequence.scan
        return None if scan is None else replace(scan, key_frame=self._mirrored(scan.key_frame))

    def camera_at(self, index: int) -> CameraModel:
        """Intrinsics of one frame: see `tracknoise.sequences.sequence.camera_at`."""
        return camera_at(self.sequence, self._mirrored(index))

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `Sequence.image`."""
        return self.sequence.image(self._mirrored(index))

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame: see `Sequence.depth`."""
        return self.sequence.depth(self._mirrored(index))

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels: see `Surface.cast`."""
        return View.cast(self, self._mirrored(index), uv)

    def _mirrored(self, index: int) -> int:
        """Index in the sequence shown, counted from its end."""
        return len(self.sequence) - 1 - index


@dataclass(frozen=True, slots=True, eq=False)
class Turned(View):
    """A sequence whose images, and the camera with them, are turned a quarter counter-clockwise.

    The pixel (u, v) of the upright image becomes (v, width - 1 - u), and the camera's axes turn likewise: up
    in the upright image is now left.
    """

    @property
    def id(self) -> SequenceId:
        """The name of the sequence shown, with 90 degrees more."""
        name = self.sequence.id
        return replace(name, rotation=(name.rotation + QUARTER_DEG) % 360)

    @property
    def camera(self) -> CameraModel:
        """The camera of the turned images."""
        return self.sequence.camera.turned()

    def camera_at(self, index: int) -> CameraModel:
        """The camera of one turned image."""
        return camera_at(self.sequence, index).turned()

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: the same positions, with the axes of the camera turned."""
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
