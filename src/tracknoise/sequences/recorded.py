"""A recorded sequence whose images and depths are read one frame at a time, from files or anything else."""

from collections.abc import Callable, Iterable, Iterator, Sized
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.geometry.accuracy import DepthAccuracy, PoseAccuracy, TruthAccuracy
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import PosePath
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.images import Levels, read_gray
from tracknoise.sequences.likely_times import require_likely_times, require_seconds
from tracknoise.sequences.orientation import orientation_notes
from tracknoise.sequences.poses import require_some_poses
from tracknoise.sequences.scenes import with_option
from tracknoise.sequences.sequence import (
    IMAGE_AXES,
    SWEPT,
    TRIANGULATED,
    Axes,
    Body,
    SecondCamera,
    TruthKind,
    facts_of,
    require_directory,
)
from tracknoise.tables.identity import SequenceId, readable
from tracknoise.text import counted, counted_of, html_card, one_line
from tracknoise.time_units import SHORTEST_S

ImageSource = Callable[[int], NDArray[np.uint8]]
DepthSource = Callable[[int], DepthMap | None]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RecordedSequence:
    """A `tracknoise.sequences.sequence.Sequence` whose frames are read when requested, and not kept.

    Parameters
    ----------
    id
        Which sequence.
    source
        Origin of the data, for messages: a folder, a bag, an archive.
    camera
        Intrinsics of all images; where they change, of the first.
    world_from_camera
        (n, 4, 4) float64, rigid: one pose for each frame, all NaN for a frame without a pose.
    images
        Reads the image of a frame from its index: (height, width) uint8. It must be possible to pickle it. If it has a
        length, that must be n. `tracknoise.sequences.recorded.ImageFiles` reads files.
    depths
        Reads the depth of a frame in the same way, None for a frame without depth; or None where no frame has any.
    notes
        What was corrected or assumed while reading, one sentence each. One about turned image files is added.
    caveats
        Which of the notes users should know before they measure, such as images that are missing.
    timestamps_s
        (n,) float64, seconds, increasing; None where unknown.
    time_unit_stated
        Whether somebody stated that they are seconds: otherwise there are 1 to 1,000 per second.
    cameras
        Intrinsics of each frame, where they change.
    pose_accuracy, depth_accuracy
        Stated uncertainty; None where unknown.
    truth_accuracy
        What else is stated, such as the growth of the relative error of poses. It counts before the other two.
    group
        What the scene has in common with others, such as the place; None where it is independent of all others.
    second
        A second camera, for depth from stereo; None where there is none.
    clock_start_ns
        Time 0 of the timestamps by the clock of the recording, ns; None where they are those of this clock.
    shutter
        How images are read out; None where all rows of an image are exposed together. It needs timestamps.
    path
        Camera poses at other times than those of frames, on the clock of the timestamps; None where there are none.
    body
        What the camera is mounted on; None where nothing is stated.
    recorded_axes
        Axes of the camera in the poses that were read, before they were turned into those of the image.
    z_depth_from
        What depths were computed from, along z; None where they are read from files, or there are none.
    poses_elsewhere
        Whether all poses may be NaN, because they are to come from elsewhere.

    Raises
    ------
    DataError
        If there is no frame, fewer than two of several frames have a pose, the counts of images, depths, timestamps or
        cameras differ from that of the poses, the timestamps do not increase or are probably not seconds, there is a
        shutter without timestamps, or the cameras have different sizes.
    """

    id: SequenceId
    source: str
    camera: CameraModel
    world_from_camera: NDArray[np.float64]
    images: ImageSource
    depths: DepthSource | None = None
    notes: tuple[str, ...] = ()
    caveats: tuple[str, ...] = ()
    timestamps_s: NDArray[np.float64] | None = None
    time_unit_stated: bool = False
    clock_start_ns: int | None = None
    cameras: tuple[CameraModel, ...] | None = None
    pose_accuracy: PoseAccuracy | None = None
    depth_accuracy: DepthAccuracy | None = None
    truth_accuracy: TruthAccuracy | None = None
    group: str | None = None
    second: SecondCamera | None = None
    shutter: RollingShutter | None = None
    path: PosePath | None = None
    body: Body | None = None
    recorded_axes: Axes = IMAGE_AXES
    z_depth_from: str | None = None
    poses_elsewhere: bool = False

    def __post_init__(self) -> None:
        place = f"{self.id.dataset} {self.id.scene}"
        if not len(self):
            raise DataError(place, "no frames", "at least one")
        for name, count in self._counts():
            if count != len(self):
                raise DataError(place, counted(count, name), f"one for each of the {counted(len(self), 'pose')}")
        if not self.poses_elsewhere:
            require_some_poses(self.world_from_camera, place)
        if self.timestamps_s is not None and (where := _out_of_order(self.timestamps_s)):
            raise DataError(place, f"timestamps that do not increase ({where})", "increasing timestamps")
        if self.timestamps_s is not None:
            require_seconds(self.timestamps_s, [f"{place}: frame {index}" for index in range(len(self))])
            require_likely_times(self)
        if self.shutter is not None and self.timestamps_s is None:
            raise DataError(place, "a rolling shutter without timestamps", "the time of each frame, seconds")
        if len({(camera.width, camera.height) for camera in (self.camera, *(self.cameras or ()))}) > 1:
            raise DataError(place, "cameras of different image sizes", "one size for all frames")
        if isinstance(self.images, ImageFiles):
            notes = dict.fromkeys((*self.notes, *orientation_notes(self.images.paths)))
            object.__setattr__(self, "notes", tuple(notes))

    def __len__(self) -> int:
        return len(self.world_from_camera)

    def __repr__(self) -> str:
        return one_line("Sequence", readable(self.id.key), facts_of(self))

    def _repr_html_(self) -> str:
        return html_card(f"Sequence {readable(self.id.key)}", facts_of(self))

    @property
    def truths(self) -> tuple[str, ...]:
        """Birth where there are depths; otherwise swept, and triangulated."""
        return (SWEPT, TRIANGULATED) if self.depths is None else (TruthKind.birth,)

    @property
    def surface(self) -> None:
        """None: the exact surface of a recording is unknown."""
        return None

    @property
    def scan(self) -> None:
        """None: its truth is computed from depth maps."""
        return None

    def camera_at(self, index: int) -> CameraModel:
        """Intrinsics of one frame."""
        return self.camera if self.cameras is None else self.cameras[index]

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: one frame in 8-bit grayscale.

        Raises
        ------
        DataError
            If it cannot be read, is not of 8 bits, or is of another size than the camera's.
        """
        image = self.images(index)
        expected = (self.camera.height, self.camera.width)
        if image.dtype != np.uint8 or image.shape != expected:
            found = f"frame {index} of shape {image.shape} and type {image.dtype}"
            raise DataError(self.source, found, f"shape {expected} and type uint8")
        return image

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame, or None where it has none.

        Raises
        ------
        DataError
            If it cannot be read, or is of another size than the camera's.
        """
        depth = None if self.depths is None else self.depths(index)
        expected = (self.camera.height, self.camera.width)
        if depth is not None and depth.valid.shape != expected:
            raise DataError(self.source, f"depth {index} of shape {depth.valid.shape}", f"shape {expected}")
        return depth

    def _counts(self) -> Iterator[tuple[str, int]]:
        """Number of items of everything that each frame must have one of, by name."""
        parts = (
            ("image", self.images),
            ("depth map", self.depths),
            ("timestamp", self.timestamps_s),
            ("camera", self.cameras),
        )
        for name, part in parts:
            if isinstance(part, Sized):
                yield name, len(part)


def _out_of_order(times_s: NDArray[np.float64]) -> str:
    """The first time that is not finite, or not later than the one before; empty if there is none."""
    later = np.append(True, np.diff(times_s) > SHORTEST_S) & np.isfinite(times_s)
    if later.all():
        return ""
    number = int(np.argmin(later))
    before = f" after {times_s[number - 1]:.9f}" if number else ""
    return f"frame {number}: {times_s[number]:.9f}{before} s"


DepthReader = Callable[[Path, CameraModel], DepthMap]
"""Reads one depth file: a module's function, or a `functools.partial` of one, so that it can be pickled."""


@dataclass(frozen=True, slots=True)
class ImageFiles:
    """Reads the image of a frame from its file."""

    paths: tuple[Path, ...]  # one file for each frame
    camera: CameraModel  # whose size the images must have
    # values of 16-bit images that become 0 and 255; None where all images must have 8 bits
    levels: Levels | None = None

    def __len__(self) -> int:
        return len(self.paths)

    def __call__(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `tracknoise.sequences.images.read_gray`."""
        return read_gray(self.paths[index], self.camera, levels=self.levels)


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
        """Depth of one frame, or None where it has none."""
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


_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp")


def folders_of(names: Iterable[str]) -> list[str]:
    """Folders of files, sorted; "." for files without."""
    return sorted({str(PurePosixPath(name).parent) for name in names})


def chosen_folder(names: Iterable[str], folder: str | None, place: str | Path) -> str:
    """The folder that the option `folder` names, or the only one that images lie in.

    Parameters
    ----------
    names
        Paths of the images.
    folder
        The option; None for the only folder.
    place
        Where images are listed, for the error.

    Raises
    ------
    UnknownNameError
        If no image lies in the folder of this name.
    DataError
        If images lie in several folders, and none is chosen.
    """
    folders = folders_of(names)
    if folder is not None and folder not in folders:
        raise UnknownNameError("folder of images", folder, folders)
    if folder is None and len(folders) > 1:
        found = f"images of several folders: {', '.join(folders)}"
        raise DataError(place, found, f"one; choose it with {with_option('folder', folders[0])}")
    return folders[0] if folder is None else folder


def image_names(root: Path, folder: str) -> list[str]:
    """Names of the image files in a folder below another, without those in deeper folders and hidden ones."""
    files = (path for path in require_directory(root / folder).iterdir() if path.suffix.lower() in _SUFFIXES)
    return [path.relative_to(root).as_posix() for path in files if not path.name.startswith(".")]
