"""TartanAir (Wang et al., IROS 2020), v1 and v2: simulated flights with exact poses and depth.

Layout of a scene, v1: ``image_left/NNNNNN_left.png``, ``depth_left/NNNNNN_left_depth.npy`` (float32, metres) and
``pose_left.txt``; v2: the same with ``lcam_front`` for ``left``, and depth in PNG files whose four 8-bit channels are
the bytes of a float32. Row i of a pose file, ``x y z qx qy qz qw``, is the NED camera-to-world pose of frame i; in v2
there may be rows without an image.

The published principal point, (320, 240) or (320, 320), is the centre of the image counted from the corner of its
first pixel. Counted from that pixel's centre, as everywhere here, it is half a pixel less; the optical flow that comes
with v2 agrees with depth and poses to its last bit (1/64 px) then, and not otherwise.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.geometry.accuracy import EXACT_POSE, DepthAccuracy
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert
from tracknoise.sequences.images import first_readable, image_size, read_depth_npy, read_depth_png_float32
from tracknoise.sequences.poses import quaternion_poses, read_rows, require_poses
from tracknoise.sequences.recorded import DepthReader, ImageFiles, RecordedSequence, depth_files, depth_notes
from tracknoise.sequences.scenes import (
    SceneReader,
    any_numbered_files,
    find_scenes,
    numbered_files,
    parent_of,
    require_unbroken,
)
from tracknoise.sequences.sequence import NED_AXES, SecondCamera
from tracknoise.tables.identity import SequenceId

SKY_M = 10_000.0
"""Depth beyond this is sky, metres."""

_CV_FROM_NED = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
_COLUMNS = "x y z qx qy qz qw"
_FLOAT32 = DepthAccuracy(0.0, 2.0**-24)
"""Depths are simulated: exact but for the rounding to float32."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Version:
    intrinsics: Camera
    depth_suffix: str
    read_depth: DepthReader
    image_for_each_pose: bool


_V1 = _Version(
    intrinsics=Camera(640, 480, 320.0, 320.0, 319.5, 239.5),
    depth_suffix="npy",
    read_depth=partial(read_depth_npy, farthest_m=SKY_M),
    image_for_each_pose=True,
)
_V2 = _Version(
    intrinsics=Camera(640, 640, 320.0, 320.0, 319.5, 319.5),
    depth_suffix="png",
    read_depth=partial(read_depth_png_float32, farthest_m=SKY_M),
    image_for_each_pose=False,
)
_SIDES = ("front", "back", "left", "right", "top", "bottom")
_VERSIONS = {
    **dict.fromkeys(("left", "right"), _V1),
    **dict.fromkeys((f"{eye}cam_{side}" for eye in "lr" for side in _SIDES), _V2),
}

_OTHER_EYE = {
    "left": "right",
    "right": "left",
    **{f"{eye}cam_{side}": f"{other}cam_{side}" for eye, other in ("lr", "rl") for side in _SIDES},
}


@dataclass(frozen=True, slots=True)
class TartanAir(SceneReader):
    """Reader of TartanAir, v1 and v2.

    Parameters
    ----------
    root
        The data set's folder, or one below, down to that of a single trajectory.
    camera
        ``left`` or ``right`` (v1), ``lcam_front``, ``rcam_back`` and so on (v2, the pinhole cameras); by default the
        first that a trajectory has, in this order.

    Raises
    ------
    UnknownNameError
        If there is no such camera.
    """

    name: ClassVar[str] = "tartanair"
    description: ClassVar[str] = "TartanAir v1 and v2: simulated flights, exact poses and depth"
    needs_root: ClassVar[bool] = True

    root: Path
    camera: str | None = None

    def __post_init__(self) -> None:
        if self.camera is not None and self.camera not in _VERSIONS:
            raise UnknownNameError("camera", str(self.camera), _VERSIONS)

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one sequence, except for its images and depths."""
        folder = self._folder(sequence)
        camera = self._camera_of({path.name for path in folder.iterdir()})
        version = _VERSIONS[str(camera)]
        images = numbered_files(folder / f"image_{camera}", rf"(\d+)_{camera}\.png")
        depth_paths = any_numbered_files(folder / f"depth_{camera}", rf"(\d+)_{camera}_depth\.{version.depth_suffix}")
        rows, places = read_rows(folder / f"pose_{camera}.txt", _COLUMNS)
        other_frames = {*depth_paths, *(range(len(rows)) if version.image_for_each_pose else ())}
        frames = require_unbroken(
            images, other_frames, lambda number: folder / f"image_{camera}" / f"{number:06d}_{camera}.png"
        )
        require_poses(folder / f"pose_{camera}.txt", poses=len(rows), images=frames.stop)
        _require_size(first_readable(images.values()), version.intrinsics)
        depths = tuple(map(depth_paths.get, frames))
        return RecordedSequence(
            id=sequence,
            source=str(folder / f"image_{camera}"),
            camera=version.intrinsics,
            world_from_camera=_poses(rows[frames.start : frames.stop], places[frames.start : frames.stop]),
            images=ImageFiles(tuple(images.values()), version.intrinsics),
            depths=depth_files(depths, version.intrinsics, version.read_depth),
            notes=depth_notes(depths),
            group=parent_of(sequence.scene, levels=2),  # <environment>/<difficulty>/<trajectory>
            recorded_axes=NED_AXES,
            second=_second(folder, str(camera), rows, frames),
            pose_accuracy=EXACT_POSE,
            depth_accuracy=_FLOAT32,
        )

    def _scenes(self) -> dict[str, Path]:
        expected = f"folders with image_{self.camera or 'left'} and pose_{self.camera or 'left'}.txt"
        expected += "" if self.camera else ", or lcam_front for left"
        return find_scenes(
            self.root, lambda below, files: self._camera_of({*below, *files}) is not None, expected=expected
        )

    def _camera_of(self, names: set[str]) -> str | None:
        """The first camera asked for that is among the names in a folder, by its images or poses."""
        cameras = [self.camera] if self.camera else _VERSIONS
        return next((camera for camera in cameras if names & {f"image_{camera}", f"pose_{camera}.txt"}), None)


def _second(folder: Path, first: str, rows: NDArray[np.float64], frames: range) -> SecondCamera | None:
    """The other eye, beside the first; None where it has no images of all frames, or is ahead or behind."""
    other = _OTHER_EYE[first]
    poses, images = folder / f"pose_{other}.txt", folder / f"image_{other}"
    if not (poses.is_file() and images.is_dir()):
        return None
    files = numbered_files(images, rf"(\d+)_{other}\.png")
    other_rows, places = read_rows(poses, _COLUMNS)
    if not files.keys() >= {*frames} or len(other_rows) != len(rows):
        return None
    start = slice(frames.start, frames.start + 1)
    first_pose, second_pose = _poses(rows[start], places[start])[0], _poses(other_rows[start], places[start])[0]
    place = invert(first_pose) @ second_pose
    if not abs(place[0, 3]) > abs(place[2, 3]):
        return None
    camera = _VERSIONS[first].intrinsics
    return SecondCamera(camera, place, ImageFiles(tuple(files[number] for number in frames), camera))


def _poses(rows: NDArray[np.float64], places: list[str]) -> NDArray[np.float64]:
    """(n, 4, 4) float64: world_from_camera, where the world is NED with its axes renamed as a camera's: M T M^-1."""
    poses: NDArray[np.float64] = _CV_FROM_NED @ quaternion_poses(rows[:, :3], rows[:, 3:], places) @ _CV_FROM_NED.T
    return poses


def _require_size(image: Path, camera: Camera) -> None:
    size = image_size(image)
    if size != (camera.width, camera.height):
        raise DataError(
            image, f"size {size[0]}x{size[1]}", f"{camera.width}x{camera.height}, whose intrinsics are known"
        )
