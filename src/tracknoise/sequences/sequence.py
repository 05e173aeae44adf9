"""Interfaces of readers and sequences: images with cameras, poses and, if available, depth."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.foreign_files import is_folder, is_regular_file
from tracknoise.geometry.accuracy import DepthAccuracy, PoseAccuracy, TruthAccuracy
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import PosePath
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.tables.identity import SequenceId

_PACKAGE = __name__.partition(".")[0]


class TruthKind(StrEnum):
    """Kinds of truth that require data of the sequence: depth maps, an exact surface or a scan."""

    birth = "birth"
    raycast = "raycast"
    scan = "scan"


SWEPT = "swept"
"""Kind of truth that needs images and poses: a recording without any of `TruthKind` offers it first."""
TRIANGULATED = "triangulated"
"""Kind of truth that needs poses only, the last that a recording offers."""


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """Points on the surface of a scene, from a single scan, for features that are visible in one frame.

    Parameters
    ----------
    points_world
        (n, 3) float64, metres, world frame, finite.
    key_frame
        The frame in which features are associated with the points.
    """

    points_world: NDArray[np.float64]
    key_frame: int


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
    """A camera path through one place. Each image is loaded when it is requested."""

    @property
    def id(self) -> SequenceId:
        """Identity of the sequence."""
        ...

    @property
    def source(self) -> str:
        """Origin of the data, for messages: a folder, an archive, or the name of a simulated scene."""
        ...

    @property
    def camera(self) -> CameraModel:
        """Intrinsics of all images, or of the first if they change (`FurtherFacts.camera_at`), of one size."""
        ...

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: the pose of each frame, with exact rotations; all NaN for a frame without a pose."""
        ...

    @property
    def timestamps_s(self) -> NDArray[np.float64] | None:
        """(n,) float64: the time of each frame, seconds, increasing, with any origin; None where unknown."""
        ...

    @property
    def pose_accuracy(self) -> PoseAccuracy | None:
        """Stated uncertainty of the poses; None where unknown."""
        ...

    @property
    def depth_accuracy(self) -> DepthAccuracy | None:
        """Stated uncertainty of the depths; None where unknown, or where there are none."""
        ...

    @property
    def truths(self) -> tuple[str, ...]:
        """Kinds of truth for which this sequence has the data, best first: of `TruthKind` or of a plug-in."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Corrections and assumptions of the reader, one sentence each."""
        ...

    def __len__(self) -> int:
        """Number of frames, at least 1."""
        ...

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: one frame in 8-bit grayscale.

        Raises
        ------
        DataError
            If the image is missing or truncated, or its size differs from that of the camera.
        """
        ...

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame, or None where this frame has none.

        Raises
        ------
        DataError
            If the file is missing or truncated, or its size differs from that of the camera.
        """
        ...

    @property
    def surface(self) -> Surface | None:
        """The exact surface of a simulated sequence; None for others."""
        ...

    @property
    def scan(self) -> Scan | None:
        """Points of the surface and the key frame, if there is a scan; None otherwise.

        Raises
        ------
        DataError
            If its file is missing or damaged.
        """
        ...


def facts_of(sequence: Sequence) -> dict[str, object]:
    """What a sequence shows of itself, by name."""
    n_posed = int(np.isfinite(sequence.world_from_camera).all(axis=(1, 2)).sum())
    return {
        "frames": len(sequence),
        "size": f"{sequence.camera.width} x {sequence.camera.height} px",
        "frames with a pose": n_posed,
        "truth": ", ".join(sequence.truths) or TRIANGULATED,
        "notes": len(sequence.notes),
    }


@dataclass(frozen=True, slots=True, eq=False)
class SecondCamera:
    """A calibrated camera beside the first, which took images at the times of frames."""

    camera: CameraModel  # intrinsics of its images
    # (4, 4) float64, metres: its pose in the frame of the first camera, constant
    first_from_second: NDArray[np.float64]
    # Reads its image of a frame from the frame's index: (height, width) uint8; None of a frame without one. It must be
    # possible to pickle it.
    images: Callable[[int], NDArray[np.uint8] | None]


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """What the camera of a recording is mounted on, such as an IMU or a reference camera."""

    from_camera: NDArray[np.float64]  # (4, 4) float64, metres: pose of the camera in the frame of the body, constant
    time_shift_s: float = 0.0  # to be added to the time of an image to get the time of the body's clock, seconds


Axes: TypeAlias = tuple[int, int, int]
"""For x, y and z of poses: which axis of the image it is (1 right, 2 down, 3 forward), negative if opposite."""
IMAGE_AXES: Axes = (1, 2, 3)
OPENGL_AXES: Axes = (1, -2, -3)
NED_AXES: Axes = (3, 1, 2)


class FurtherFacts:
    """What a `Sequence` may state besides, and what counts where it does not; the functions below read it.

    Sequences of plug-ins with another public name are refused: one that is misspelt would state nothing. Names of
    helpers begin with an underscore.
    """

    camera_at: Callable[[int], CameraModel] | None = None
    """Intrinsics of one frame, where they change from frame to frame, such as those of a camera with autofocus."""
    time_unit_stated: bool = False
    """Whether somebody stated that the times are seconds: without that, rates from 1 to 1,000 Hz are accepted."""
    clock_start_ns: int | None = None
    """Time 0 by the clock of the recording, ns; None where times are those of this clock."""
    group: str | None = None
    """Name of what this scene and others that are not independent have in common: a place, or a recording."""
    caveats: tuple[str, ...] = ()
    """Which of the notes users should know before they measure."""
    shutter: RollingShutter | None = None
    """How its images are read out, which needs timestamps; None where all rows are exposed at the frame's time."""
    path: PosePath | None = None
    """Poses over time, on the clock of the timestamps, such as those of frames left out; None without others.

    At the time of a frame it has the pose of the frame.
    """
    truth_accuracy: TruthAccuracy | None = None
    """More than the accuracy of single poses and depths, such as the growth of the relative error of its poses."""
    pose_halves: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    """Poses (n, 4, 4) by two disjoint halves of what its poses are from: how they differ shows their error."""
    joins_depths: bool = False
    """Whether depths of features are to be joined from the maps of neighbouring frames."""
    fault_shares: Mapping[str, float] = MappingProxyType({})
    """Share of what a fault moves that its poses do not absorb, by the figure of `TruthAccuracy`."""
    fault_bounds: TruthAccuracy = TruthAccuracy()
    """How large faults may be by the tracks that its poses are from, where these say more than what is stated."""
    files: Iterable[Path] = ()
    """All files on which its images, poses, cameras and depths depend.

    Without this, the files count that Python opens while it is measured. Compiled code, such as ``cv2.imread``,
    opens files without Python.
    """
    second: SecondCamera | None = None
    """A second camera, whose images tell depth too."""
    body: Body | None = None
    """What the camera is mounted on, if the recording states where: other poses may be those of it."""
    recorded_axes: Axes = IMAGE_AXES
    """Axes of the camera in recorded poses, which the reader turned into those of the image."""
    z_depth_from: str | None = None
    """What this program computed the depths of all frames from, along z; None where it read them, or has none.

    What a format states of its files is no such knowledge: whatever wrote them may have followed another convention.
    """


class _Facts(FurtherFacts):
    """Those of a sequence, each read when it is asked for."""

    def __init__(self, sequence: Sequence) -> None:
        self._sequence = sequence

    def __getattribute__(self, name: str) -> Any:
        sequence = object.__getattribute__(self, "_sequence")
        return getattr(sequence, name, getattr(FurtherFacts, name))


_facts: Callable[[Sequence], FurtherFacts] = _Facts


def with_known_facts(sequence: Sequence) -> Sequence:
    """A sequence that a reader opened, if all its public names are those of this package.

    Raises
    ------
    UnknownNameError
        If another one is there, which may be a misspelt one of `FurtherFacts`.
    """
    kind = type(sequence)
    bases = [base for base in kind.__mro__ if base.__module__.partition(".")[0] == _PACKAGE]
    allowed = {name for base in (Sequence, Surface, FurtherFacts, *bases) for name in dir(base)}
    for name in dir(sequence) if kind not in bases else ():
        if not name.startswith("_") and name not in allowed:
            facts = [fact for fact in vars(FurtherFacts) if not fact.startswith("_")]
            raise UnknownNameError(f"fact of {kind.__name__}", name, facts)
    return sequence


def camera_at(sequence: Sequence, index: int) -> CameraModel:
    """Intrinsics of one frame of a sequence; those of `Sequence.camera` if they do not change."""
    changing = _facts(sequence).camera_at
    return sequence.camera if changing is None else changing(index)


def group_of(sequence: Sequence) -> str | None:
    """Name of the group of a sequence's scene; None where it is independent of all others, or nothing is known."""
    return _facts(sequence).group


def caveats_of(sequence: Sequence) -> tuple[str, ...]:
    """Notes of a sequence that are caveats; empty where nothing is known."""
    return _facts(sequence).caveats


def shutter_of(sequence: Sequence) -> RollingShutter | None:
    """The rolling shutter of a sequence; None where all rows of an image are exposed together."""
    return _facts(sequence).shutter


def times_of(sequence: Sequence) -> NDArray[np.float64] | None:
    """(n,) float64: the time of each frame, seconds; None where unknown, as of sequences that have no such property."""
    times: NDArray[np.float64] | None = getattr(sequence, "timestamps_s", None)
    return times


def has_stated_times(sequence: Sequence) -> bool:
    """Whether the unit of a sequence's times is stated, and no assumption that an unlikely rate makes doubtful."""
    return _facts(sequence).time_unit_stated


def clock_start_of(sequence: Sequence) -> int | None:
    """Time 0 of a sequence by the clock of its recording, ns; None where its times are those of this clock."""
    return _facts(sequence).clock_start_ns


def path_of(sequence: Sequence) -> PosePath | None:
    """Poses of a sequence over time: its own, or those of its frames; None without two frames with timestamps."""
    path, times = _facts(sequence).path, times_of(sequence)
    if path is not None or times is None or len(times) < 2:
        return path
    return PosePath(times, sequence.world_from_camera)


def stated_accuracy(sequence: Sequence) -> TruthAccuracy | None:
    """What a sequence states besides the accuracy of single poses and depths; None where nothing is known."""
    return _facts(sequence).truth_accuracy


def accuracy_of(sequence: Sequence) -> TruthAccuracy:
    """What a sequence states about the errors of its truth; figures that it does not state are None."""
    pose, depth = (getattr(sequence, name, None) for name in ("pose_accuracy", "depth_accuracy"))
    single, more = TruthAccuracy.of(pose, depth, source=sequence.id.dataset), stated_accuracy(sequence)
    return single if more is None else more.over(single)


def best_truth(sequence: Sequence) -> str:
    """The best kind of truth that a sequence offers, or fitted points where it offers none."""
    return next(iter(sequence.truths), TRIANGULATED)


def halves_of(sequence: Sequence) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Poses by two halves of what the poses of a sequence are from; None where there are none."""
    return _facts(sequence).pose_halves


def joins_depths(sequence: Sequence) -> bool:
    """Whether depths of features are to be joined from the maps of neighbouring frames."""
    return _facts(sequence).joins_depths


def fault_shares_of(sequence: Sequence) -> Mapping[str, float]:
    """Shares of what faults move that the poses of a sequence do not absorb; none of stated poses."""
    return _facts(sequence).fault_shares


def fault_bounds_of(sequence: Sequence) -> TruthAccuracy:
    """How large faults may be by the tracks that the poses of a sequence are from."""
    return _facts(sequence).fault_bounds


def files_of(sequence: Sequence) -> tuple[Path, ...]:
    """The files that a sequence states; none where it states nothing."""
    return tuple(map(Path, _facts(sequence).files))


def second_of(sequence: Sequence) -> SecondCamera | None:
    """The second camera of a sequence; None where there is none."""
    return _facts(sequence).second


def body_of(sequence: Sequence) -> Body | None:
    """What the camera of a sequence is mounted on; None where nothing is stated."""
    return _facts(sequence).body


def recorded_axes(sequence: Sequence) -> Axes:
    """Axes of the camera that the reader of a sequence expects in its poses; those of the image if it states none."""
    return _facts(sequence).recorded_axes


def z_depth_from(sequence: Sequence) -> str | None:
    """What depths that are along z by construction were computed from; None where their kind is only stated."""
    return _facts(sequence).z_depth_from


class Reader(Protocol):
    """A data set in one on-disk format (or none, if simulated). Settings are the fields of a frozen dataclass.

    The first field is ``root: Path``, unless `needs_root` is False. All others are options: keyword-only, with
    defaults. Options that name a file or folder have the type `Path`.
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
        """Read and check one sequence, except for its images and depths.

        Raises
        ------
        DataError
            If a file is missing, damaged or contradicts another.
        UnknownNameError
            If there is no such scene or lighting.
        """
        ...


@runtime_checkable
class SharingReader(Protocol):
    """A `Reader` whose sequences of one scene share files, such as images from which several lightings are made."""

    def open_together(self, sequences: list[SequenceId]) -> list[Sequence]:
        """Open several sequences of one scene that will be read together, frame by frame.

        Raises
        ------
        TracknoiseError
            As `Reader.open`.
        """
        ...


@runtime_checkable
class FilteringReader(Protocol):
    """A `Reader` that excludes some scenes of the data set from what it lists."""

    def excluded_scenes(self) -> dict[str, str]:
        """The reason for each excluded scene, one sentence each, by name of the scene.

        Raises
        ------
        DataError
            If the files that determine it cannot be read.
        """
        ...


@runtime_checkable
class ImageReader(Protocol):
    """A `Reader` of recordings whose poses may be elsewhere."""

    def recordings(self) -> list[SequenceId]:
        """All sequences, those without poses too, sorted: see `Reader.sequences`."""
        ...

    def open_images(self, sequence: SequenceId) -> Sequence:
        """As `Reader.open`, without poses: none are looked for, and all are NaN."""
        ...


def require_directory(root: Path) -> Path:
    """Return `root` if it is a directory.

    Raises
    ------
    DataError
        If it is not.
    """
    if not is_folder(root):
        found = "not a directory" if is_regular_file(root) else "no such directory"
        raise DataError(root, found, "a data set's folder")
    return root
