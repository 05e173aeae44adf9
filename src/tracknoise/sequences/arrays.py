"""Sequences in memory: images, poses and depths as arrays."""

from collections.abc import Iterable, Iterator
from collections.abc import Sequence as Items
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tracknoise.exceptions import DataError, first_line
from tracknoise.geometry.cameras import Camera, CameraModel
from tracknoise.geometry.depth import LEAST_DEPTH_M, DepthMap
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.likely_times import by_argument, seconds_of
from tracknoise.sequences.poses import checked_poses, has_pose
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import SecondCamera
from tracknoise.tables.identity import SequenceId
from tracknoise.text import is_printable
from tracknoise.time_units import TimeUnit

_PLACE = "arrays"
Picture = TypeVar("Picture", NDArray[np.uint8], NDArray[np.uint8] | None)


class Sequence(RecordedSequence):
    """A sequence in memory. `Sequence.from_arrays` makes one."""

    __slots__ = ()

    @classmethod
    def from_arrays(
        cls,
        images: Items[ArrayLike] | NDArray[Any],
        poses: ArrayLike,
        K: ArrayLike | CameraModel,
        depths: Items[ArrayLike | None] | NDArray[Any] | None = None,
        *,
        timestamps_s: ArrayLike | None = None,
        time_unit: str | None = None,
        distortion: Items[float] = (),
        readout_s: float | None = None,
        second_images: Items[ArrayLike | None] | NDArray[Any] | None = None,
        second_K: ArrayLike | CameraModel | None = None,
        first_from_second: ArrayLike | None = None,
        dataset: str = "arrays",
        scene: str = "scene",
    ) -> "Sequence":
        """Make a sequence of arrays, which are not copied where that is not needed.

        Parameters
        ----------
        images
            n arrays (height, width) uint8 in grayscale, or (height, width, 3) uint8 in RGB.
        poses
            (n, 4, 4), or (n, 3, 4) without the last row: world_from_camera, so that the last column is the position of
            the camera in metres. Axes of the camera: x to the right, y down, z forward. All NaN for a frame without a
            pose.
        K
            (3, 3) matrix of intrinsics without skew, px, where (0, 0) is the centre of the first pixel; or a camera
            with another model.
        depths
            n arrays (height, width) of floats: depth along z, metres; 0, negative or not finite where unknown. None
            for a frame without depth, or for all of them.
        timestamps_s
            (n,) seconds, increasing, at 1 to 1,000 per second.
        time_unit
            Their unit, where it is another one, or seconds with another rate: "s", "ms", "us" or "ns".
        distortion
            Radial-tangential coefficients as OpenCV orders them: 4, 5 or 8.
        readout_s
            Time from the upper edge of the first row to the lower edge of the last of a rolling shutter, seconds; the
            timestamp is that of the middle of the image. By default all rows are exposed together.
        second_images
            Those of a second camera at the same times, as `images`; None for a frame without one.
        second_K
            As `K`, of the second camera.
        first_from_second
            (4, 4): pose of the second camera in the frame of the first, metres.
        dataset, scene
            Names in the tables. Each sequence of an analysis needs its own scene.

        Raises
        ------
        DataError
            Naming the array, its shape and what was expected; or a name that is no text, or no printable one.
        """
        for name, value in (("dataset", dataset), ("scene", scene)):
            _require_name(name, value)
        pictures = _Images(tuple(_gray(index, image) for index, image in _items("images", images)))
        if not len(pictures):
            raise DataError(_PLACE, "no image", "at least one")
        coefficients = tuple(_floats("distortion", distortion, 1).tolist())
        camera = _camera(K, coefficients, pictures.images[0].shape)
        maps = None if depths is None else _Depths(tuple(_depth(*item) for item in _items("depths", depths)))
        _require_size("images", pictures.images, camera)
        _require_size("depths", () if maps is None else maps.values, camera)
        matrices, notes = _poses(poses)
        return cls(
            id=SequenceId(dataset, scene),
            source=f"{dataset} {scene}",
            camera=camera,
            world_from_camera=matrices,
            images=pictures,
            depths=maps,
            notes=notes,
            timestamps_s=None if timestamps_s is None else _times(timestamps_s, time_unit),
            time_unit_stated=time_unit is not None,
            shutter=_shutter(readout_s),
            second=_second(second_images, second_K, first_from_second, len(pictures)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Images(Generic[Picture]):
    """Images by index."""

    images: tuple[Picture, ...]

    def __len__(self) -> int:
        return len(self.images)

    def __call__(self, index: int) -> Picture:
        return self.images[index]


@dataclass(frozen=True, slots=True, eq=False)
class _Depths:
    """Depth maps by index."""

    depths: tuple[DepthMap | None, ...]

    @property
    def values(self) -> Iterator[NDArray[Any] | None]:
        """The numbers of each."""
        return (None if depth is None else depth.depth_m for depth in self.depths)

    def __len__(self) -> int:
        return len(self.depths)

    def __call__(self, index: int) -> DepthMap | None:
        return self.depths[index]


def _second(
    images: Items[ArrayLike | None] | NDArray[Any] | None,
    K: ArrayLike | CameraModel | None,
    pose: ArrayLike | None,
    count: int,
) -> SecondCamera | None:
    """The second camera; None where there is none."""
    given = {"second_images": images, "second_K": K, "first_from_second": pose}
    missing = [name for name, value in given.items() if value is None]
    if len(missing) == len(given):
        return None
    if images is None or K is None or pose is None:
        raise DataError(_PLACE, f"no {missing[0]}", f"{', '.join(given)}, or none of them")
    pictures = _Images(
        tuple(None if one is None else _gray(index, one) for index, one in _items("second_images", images))
    )
    if len(pictures) != count:
        raise DataError(_PLACE, f"{len(pictures)} second_images", f"{count}, as images")
    present = tuple(image for image in pictures.images if image is not None)
    if not present:
        raise DataError(_PLACE, "no second_images", "at least one")
    camera = _camera(K, (), present[0].shape)
    _require_size("second_images", present, camera)
    matrix = _floats("first_from_second", pose, 2)
    if matrix.shape != (4, 4):
        raise DataError(_PLACE, f"first_from_second of shape {matrix.shape}", "shape (4, 4)")
    rigid, _ = checked_poses(matrix[None], ["first_from_second"])
    return SecondCamera(camera, rigid[0], pictures)


def _require_name(name: str, value: object) -> None:
    if not (isinstance(value, str) and is_printable(value)):
        raise DataError(_PLACE, f"{name} is {value!r}", "a text in UTF-8 without control characters")


def _items(name: str, values: Iterable[Any]) -> Iterator[tuple[int, Any]]:
    """The arrays of a list or of an array, with their indices."""
    if not isinstance(values, Iterable):
        raise DataError(_PLACE, f"{name} of type {type(values).__name__}", "a list of arrays, one for each frame")
    return enumerate(values)


def _array(name: str, values: ArrayLike) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except (TypeError, ValueError) as error:
        raise DataError(_PLACE, f"{name} is no array ({first_line(error)})", "numbers in rows of one length") from error


def _require_size(name: str, arrays: Iterable[NDArray[Any] | None], camera: CameraModel) -> None:
    """Refuse arrays of another size than that of the camera's images."""
    expected = (camera.height, camera.width)
    for index, array in enumerate(arrays):
        if array is not None and array.shape != expected:
            raise DataError(_PLACE, f"{name}[{index}] of shape {array.shape}", f"{expected}, the size of the images")


def _gray(index: int, image: ArrayLike) -> NDArray[np.uint8]:
    array = _array(f"images[{index}]", image)
    is_colour = array.ndim == 3 and array.shape[2] == 3
    if array.dtype != np.uint8 or not (array.ndim == 2 or is_colour) or not array.size:
        expected = "shape (height, width) or (height, width, 3) and type uint8"
        raise DataError(_PLACE, f"images[{index}] of shape {array.shape} and type {array.dtype}", expected)
    gray: NDArray[np.uint8] = cv2.cvtColor(array, cv2.COLOR_RGB2GRAY) if is_colour else array  # type: ignore[assignment]
    return gray


def _depth(index: int, depth: ArrayLike | None) -> DepthMap | None:
    if depth is None:
        return None
    array = _array(f"depths[{index}]", depth)
    if array.ndim != 2 or array.dtype not in (np.float32, np.float64):
        found_text = f"depths[{index}] of shape {array.shape} and type {array.dtype}"
        raise DataError(_PLACE, found_text, "shape (height, width) and floats, in metres")
    return DepthMap(array, np.isfinite(array) & (array >= LEAST_DEPTH_M))


def _camera(K: ArrayLike | CameraModel, distortion: tuple[float, ...], shape: tuple[int, ...]) -> CameraModel:
    """The camera of a matrix of intrinsics, or the one that was given."""
    if isinstance(K, CameraModel):
        if distortion:
            raise DataError(_PLACE, "a camera and distortion", "the distortion in the camera")
        return K
    matrix = _floats("K", K, 2)
    expected = "3 x 3 intrinsics fx 0 cx, 0 fy cy, 0 0 1"
    if matrix.shape != (3, 3) or not np.array_equal(matrix * [[0, 1, 0], [1, 0, 0], [1, 1, 1]], np.diag([0.0, 0, 1])):
        raise DataError(_PLACE, f"K {matrix.tolist()}", expected)
    fx, fy, cx, cy = (float(matrix[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    try:
        camera = Camera(shape[1], shape[0], fx, fy, cx, cy, distortion)
    except ValueError as error:
        raise DataError(_PLACE, f"K {matrix.tolist()} and distortion {list(distortion)}", first_line(error)) from error
    if not camera.is_invertible:
        raise DataError(_PLACE, f"distortion {list(distortion)}", "one that can be inverted up to the image's border")
    return camera


def _shutter(readout_s: float | None) -> RollingShutter | None:
    try:
        return RollingShutter(float(readout_s)) if readout_s else None
    except (TypeError, ValueError) as error:
        raise DataError(_PLACE, f"readout_s {readout_s!r}", "seconds between -1 and 1") from error


def _times(timestamps: ArrayLike, unit: str | None) -> NDArray[np.float64]:
    """(n,) float64, seconds."""
    units = [member.value for member in TimeUnit]
    if unit is not None and unit not in units:
        raise DataError(_PLACE, f"time_unit {unit!r}", f"one of {', '.join(units)}")
    times = _floats("timestamps_s", timestamps, 1)
    places = [f"{_PLACE}: timestamps_s[{index}]" for index in range(len(times))]
    return seconds_of(times, None if unit is None else TimeUnit(unit), _PLACE, places, by_argument)


def _poses(poses: ArrayLike) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Rigid matrices (n, 4, 4), and notes about their correction."""
    given = _floats("poses", poses, 3, finite=False)
    if given.shape[1:] == (3, 4):
        last = np.where(has_pose(given)[:, None], (0.0, 0.0, 0.0, 1.0), np.nan)
        given = np.concatenate([given, last[:, None]], axis=1)
    if given.shape[1:] != (4, 4):
        raise DataError(_PLACE, f"poses of shape {given.shape}", "shape (n, 4, 4) or (n, 3, 4), world_from_camera")
    posed = np.flatnonzero(has_pose(given))
    matrices = np.full_like(given, np.nan)
    matrices[posed], notes = checked_poses(given[posed], [f"poses[{index}]" for index in posed])
    return matrices, notes


def _floats(name: str, values: ArrayLike, axes: int, *, finite: bool = True) -> NDArray[np.float64]:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(_PLACE, f"{name} is no array of numbers ({first_line(error)})", "numbers") from error
    if array.ndim != axes:
        raise DataError(_PLACE, f"{name} of shape {array.shape}", f"{axes} {'axis' if axes == 1 else 'axes'}")
    if finite and not np.isfinite(array).all():
        place = np.argwhere(~np.isfinite(array))[0].tolist()
        raise DataError(_PLACE, f"{name}{place} is {array[tuple(place)]}", "finite numbers")
    return array
