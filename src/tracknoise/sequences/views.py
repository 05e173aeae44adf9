"""Views of a sequence: some of its frames only, played backward, or with turned images."""

from collections.abc import Callable
from collections.abc import Sequence as Items
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.accuracy import DepthAccuracy, PoseAccuracy, TruthAccuracy
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import PosePath
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.frame_range import frame_range, range_note
from tracknoise.sequences.sequence import (
    IMAGE_AXES,
    Axes,
    Body,
    Scan,
    SecondCamera,
    Sequence,
    Surface,
    body_of,
    camera_at,
    caveats_of,
    clock_start_of,
    group_of,
    path_of,
    recorded_axes,
    second_of,
    shutter_of,
    stated_accuracy,
    z_depth_from,
)
from tracknoise.tables.identity import Direction, SequenceId

QUARTER_DEG = 90
_UPRIGHT_FROM_TURNED = np.array(
    [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""Pose of the axes of a turned camera in those of the upright one."""


def view(
    sequence: Sequence,
    *,
    n_frames: int | None,
    direction: Direction,
    rotation: int,
    frames: Items[int] | None = None,
    part: range | None = None,
) -> Sequence:
    """Make the view of a sequence that an experiment requires.

    Parameters
    ----------
    sequence
        The sequence as opened by its reader.
    n_frames
        At most this many frames, from the first of those that are chosen; None for all.
    direction
        In which order they are played.
    rotation
        By how many degrees the images are turned counter-clockwise: a multiple of 90.
    frames
        First, last and step of the frames that are chosen; None for all.
    part
        Which of these frames are played, in the order of play; None for all.

    Raises
    ------
    SettingsError, DataError
        As `chosen_frames`.
    """
    sequence = chosen_frames(sequence, frames)
    if n_frames is not None and n_frames < len(sequence):
        sequence = ChosenFrames(sequence, range(n_frames))
    if part is not None:
        last_first = direction is Direction.backward
        recorded = range(len(sequence) - part.stop, len(sequence) - part.start) if last_first else part
        sequence = PartOfSequence(sequence, recorded)
    if direction is Direction.backward:
        sequence = Backward(sequence)
    return turned(sequence, rotation)


def chosen_frames(sequence: Sequence, frames: Items[int] | None) -> Sequence:
    """The sequence with some of its frames only, numbered from 0; None for all.

    Raises
    ------
    SettingsError
        If `frames` is not first, last and step.
    DataError
        If fewer than two frames of the sequence are chosen.
    """
    if frames is None:
        return sequence
    return ChosenFrames(sequence, frame_range(frames, len(sequence), sequence.source))


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
    """A `tracknoise.sequences.sequence.Sequence` that shows another one. Subclasses say what they change."""

    keeps_kind_of_depth: ClassVar[bool] = False
    """Whether depths are those of the sequence shown: otherwise their kind is not known by construction."""

    sequence: Sequence  # what is shown

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
    def clock_start_ns(self) -> int | None:
        """That of the sequence shown."""
        return clock_start_of(self.sequence)

    @property
    def pose_accuracy(self) -> PoseAccuracy | None:
        """That of the sequence shown."""
        return self.sequence.pose_accuracy

    @property
    def depth_accuracy(self) -> DepthAccuracy | None:
        """That of the sequence shown."""
        return self.sequence.depth_accuracy

    @property
    def truth_accuracy(self) -> TruthAccuracy | None:
        """That of the sequence shown; frames are those of the recording."""
        return stated_accuracy(self.sequence)

    @property
    def truths(self) -> tuple[str, ...]:
        """Those of the sequence shown."""
        return self.sequence.truths

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence shown."""
        return self.sequence.notes

    @property
    def caveats(self) -> tuple[str, ...]:
        """Those of the sequence shown."""
        return caveats_of(self.sequence)

    @property
    def group(self) -> str | None:
        """That of the sequence shown."""
        return group_of(self.sequence)

    @property
    def shutter(self) -> RollingShutter | None:
        """That of the sequence shown."""
        return shutter_of(self.sequence)

    @property
    def body(self) -> Body | None:
        """That of the sequence shown."""
        return body_of(self.sequence)

    @property
    def second(self) -> SecondCamera | None:
        """That of the sequence shown, seen as its images are."""
        return second_of(self.sequence)

    @property
    def recorded_axes(self) -> Axes:
        """That of the sequence shown."""
        return recorded_axes(self.sequence)

    @property
    def z_depth_from(self) -> str | None:
        """That of the sequence shown, where the view keeps the kind of its depths."""
        return z_depth_from(self.sequence) if self.keeps_kind_of_depth else None

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


def source_frames(sequence: Sequence) -> range | None:
    """Frames of the recording that a sequence consists of, in its order; None if nothing was chosen.

    None also for a sequence that is played backward, whose frames have no numbers in the recording.
    """
    if isinstance(sequence, ChosenFrames):
        inner = source_frames(sequence.sequence) or range(len(sequence.sequence))
        return inner[sequence.frames.start : sequence.frames.stop : sequence.frames.step]
    if isinstance(sequence, Backward) or not isinstance(sequence, View):
        return None
    return source_frames(sequence.sequence)


def image_names_of(sequence: Sequence) -> tuple[str, ...] | None:
    """The image file of each frame of a sequence; None where images are no files."""
    if isinstance(sequence, View):
        names = image_names_of(sequence.sequence)
        if names is None:
            return None
        if isinstance(sequence, ChosenFrames):
            return tuple(names[index] for index in sequence.frames)
        return names[::-1] if isinstance(sequence, Backward) else names
    paths = getattr(getattr(sequence, "images", None), "paths", None)
    return None if paths is None else tuple(path.name for path in paths)


def first_of_part(sequence: Sequence) -> int:
    """Where the part of a sequence begins that is played; 0 where all of it is."""
    if isinstance(sequence, PartOfSequence):
        return sequence.frames.start
    return first_of_part(sequence.sequence) if isinstance(sequence, View) else 0


def whole_of(sequence: Sequence) -> tuple[Sequence, int]:
    """The sequence of which a part is played, as it is played, and the first frame of the part in it.

    Itself and 0 where all of it is. Of other views, those that change its order or its camera are kept.
    """
    if isinstance(sequence, PartOfSequence):
        return sequence.sequence, sequence.frames.start
    if not isinstance(sequence, View):
        return sequence, 0
    inner, first = whole_of(sequence.sequence)
    if inner is sequence.sequence:
        return sequence, 0
    if isinstance(sequence, Backward):
        first = len(inner) - first - len(sequence)
    return (replace(sequence, sequence=inner) if isinstance(sequence, Backward | Turned) else inner), first


def frame_step(sequence: Sequence) -> int:
    """Number of frames of the recording from one frame of a sequence to the next."""
    if not isinstance(sequence, View):
        return 1
    inner = frame_step(sequence.sequence)
    return inner * sequence.frames.step if isinstance(sequence, ChosenFrames) else inner


@dataclass(frozen=True, slots=True, eq=False)
class ChosenFrames(View):
    """Some frames of a sequence, numbered from 0. Nothing is read of the others."""

    keeps_kind_of_depth: ClassVar[bool] = True

    frames: range  # which of its frames, ascending

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def camera(self) -> CameraModel:
        """That of the first chosen frame."""
        return self.camera_at(0)

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: of the chosen frames."""
        return self.sequence.world_from_camera[self._slice]

    @property
    def timestamps_s(self) -> NDArray[np.float64] | None:
        """(n,) float64, seconds, of the chosen frames; None where unknown."""
        times = self.sequence.timestamps_s
        return None if times is None else times[self._slice]

    @property
    def second(self) -> SecondCamera | None:
        """That of the sequence shown, with images of the chosen frames."""
        return _with_images_of(second_of(self.sequence), self.frames)

    @property
    def path(self) -> PosePath | None:
        """That of the sequence shown: the poses of all its frames."""
        return path_of(self.sequence)

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence shown, and which of its frames are used unless they are the first."""
        first = range(len(self.frames))
        more = () if self.frames == first else (range_note(self.frames, len(self.sequence)),)
        return (*self.sequence.notes, *more)

    @property
    def scan(self) -> Scan | None:
        """That of the sequence shown, with its key frame counted among the chosen frames."""
        scan = self.sequence.scan
        if scan is None:
            return None
        place, skipped = divmod(scan.key_frame - self.frames.start, self.frames.step)
        if place < 0 or skipped:
            found = f"frames {self.frames[0]} to {self.frames[-1]} in steps of {self.frames.step}"
            raise DataError(self.source, found, f"a choice with the key frame {scan.key_frame} in it")
        return replace(scan, key_frame=place)

    def camera_at(self, index: int) -> CameraModel:
        """Intrinsics of one frame: see `tracknoise.sequences.sequence.camera_at`."""
        return camera_at(self.sequence, self.frames[index])

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `Sequence.image`."""
        return self.sequence.image(self.frames[index])

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame: see `Sequence.depth`."""
        return self.sequence.depth(self.frames[index])

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels: see `Surface.cast`."""
        return View.cast(self, self.frames[index], uv)

    @property
    def _slice(self) -> slice:
        return slice(self.frames.start, self.frames.stop, self.frames.step)


@dataclass(frozen=True, slots=True, eq=False)
class PartOfSequence(ChosenFrames):
    """Some successive frames of a sequence that is measured in parts."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence shown."""
        return self.sequence.notes


@dataclass(frozen=True, slots=True, eq=False)
class Backward(View):
    """A sequence played backward: its last frame comes first."""

    keeps_kind_of_depth: ClassVar[bool] = True

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
        return None if times is None else _reversed(times, times)

    @property
    def clock_start_ns(self) -> int | None:
        """None: time runs backward."""
        return None

    @property
    def path(self) -> PosePath | None:
        """Poses over time, the last first; None without timestamps."""
        times, path = self.sequence.timestamps_s, path_of(self.sequence)
        return None if times is None or path is None else PosePath(_reversed(path.times, times), path.poses[::-1])

    @property
    def second(self) -> SecondCamera | None:
        """That of the sequence shown, with its last image first."""
        return _with_images_of(second_of(self.sequence), range(len(self.sequence))[::-1])

    @property
    def shutter(self) -> RollingShutter | None:
        """That of the sequence shown, with its last row first; None where all rows are exposed together."""
        shutter = shutter_of(self.sequence)
        return None if shutter is None else shutter.backward()

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

    keeps_kind_of_depth: ClassVar[bool] = True

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
        turned: NDArray[np.float64] = self.sequence.world_from_camera @ _UPRIGHT_FROM_TURNED
        return turned

    @property
    def recorded_axes(self) -> Axes:
        """Those of the turned image: what is in a file is said of upright images alone."""
        return IMAGE_AXES

    @property
    def path(self) -> PosePath | None:
        """Poses over time, with the axes of the camera turned; None without timestamps."""
        path = path_of(self.sequence)
        return None if path is None else replace(path, poses=path.poses @ _UPRIGHT_FROM_TURNED)

    @property
    def second(self) -> SecondCamera | None:
        """That of the sequence shown, with turned images."""
        second = second_of(self.sequence)
        if second is None:
            return None
        turned = _UPRIGHT_FROM_TURNED.T @ second.first_from_second @ _UPRIGHT_FROM_TURNED
        return SecondCamera(second.camera.turned(), turned, partial(_turned_image, second.images))

    @property
    def shutter(self) -> RollingShutter | None:
        """That of the turned images; None where all rows are exposed together."""
        shutter = shutter_of(self.sequence)
        return None if shutter is None else shutter.turned()

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `Sequence.image`."""
        return _quarter_turned(self.sequence.image(index))

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


Images = Callable[[int], NDArray[np.uint8] | None]


def _with_images_of(second: SecondCamera | None, frames: range) -> SecondCamera | None:
    return None if second is None else replace(second, images=partial(_image_of, second.images, frames))


def _image_of(images: Images, frames: range, index: int) -> NDArray[np.uint8] | None:
    return images(frames[index])


def _turned_image(images: Images, index: int) -> NDArray[np.uint8] | None:
    image = images(index)
    return None if image is None else _quarter_turned(image)


def _quarter_turned(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An image turned counter-clockwise."""
    return np.ascontiguousarray(np.rot90(image))


def _reversed(times_s: NDArray[np.float64], frames_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times in the reverse order, so that the first and the last of `frames_s` change places."""
    times: NDArray[np.float64] = frames_s[0] + (frames_s[-1] - times_s[::-1])
    return times
