"""The second camera of a recording, as a sequence of its own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.pose import PosePath
from tracknoise.geometry.stereo_pair import StereoPair
from tracknoise.sequences.sequence import (
    SecondCamera,
    Sequence,
    fault_bounds_of,
    fault_shares_of,
    halves_of,
    joins_depths,
    path_of,
)
from tracknoise.sequences.views import View
from tracknoise.text import counted_of


@dataclass(frozen=True, slots=True)
class SomeImages:
    """Reads the image of a second camera of a frame; None for a frame without one."""

    images: Callable[[int], NDArray[np.uint8]]  # reads an image from its own number
    numbers: tuple[int, ...]  # of the image of each frame; -1 for a frame without one

    def __call__(self, index: int) -> NDArray[np.uint8] | None:
        """(height, width) uint8, or None."""
        number = self.numbers[index]
        return None if number < 0 else self.images(number)

    def notes(self, of: str) -> tuple[str, ...]:
        """A sentence if there are frames without an image of the camera of this name."""
        missing = self.numbers.count(-1)
        have = counted_of(missing, len(self.numbers), "frame", "has", "have")
        return (f"{have} no image of {of}, and no depth from it",) if missing else ()


def second_image(second: SecondCamera, index: int, source: str) -> NDArray[np.uint8] | None:
    """(height, width) uint8: the image of a second camera of a frame; None of a frame without one.

    Raises
    ------
    DataError
        If it cannot be read, or its size is not that of the camera. `source` is named then.
    """
    image = second.images(index)
    expected = second.camera.height, second.camera.width
    if image is not None and image.shape != expected:
        raise DataError(source, f"an image of the second camera of shape {image.shape}", f"shape {expected}")
    return image


def pair_of(sequence: Sequence, second: SecondCamera) -> StereoPair:
    """The camera of a sequence and the second one beside it."""
    return StereoPair(sequence.camera, second.camera, second.first_from_second)


@dataclass(frozen=True, slots=True, eq=False)
class Beside(View):
    """A sequence as its second camera sees it: with the poses, the camera and the images of that.

    Rows of a rolling shutter are read out as those of the first camera.
    """

    camera_beside: SecondCamera  # the second camera of the sequence shown

    @property
    def second(self) -> None:
        """None: it is this."""

    @property
    def camera(self) -> CameraModel:
        """The second camera."""
        return self.camera_beside.camera

    def camera_at(self, index: int) -> CameraModel:
        """The second camera, in all frames."""
        return self.camera_beside.camera

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: poses of the second camera; all NaN for a frame without a pose."""
        return np.asarray(self.sequence.world_from_camera @ self._place)

    @property
    def path(self) -> PosePath | None:
        """Poses of the second camera over time; None without timestamps."""
        path = path_of(self.sequence)
        return None if path is None else replace(path, poses=path.poses @ self._place)

    @property
    def pose_halves(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Poses of the second camera by both halves; None where there are none."""
        halves = halves_of(self.sequence)
        return None if halves is None else (halves[0] @ self._place, halves[1] @ self._place)

    @property
    def joins_depths(self) -> bool:
        """As of the sequence shown."""
        return joins_depths(self.sequence)

    @property
    def fault_shares(self) -> Mapping[str, float]:
        """Those of the sequence shown."""
        return fault_shares_of(self.sequence)

    @property
    def fault_bounds(self) -> TruthAccuracy:
        """Those of the sequence shown."""
        return fault_bounds_of(self.sequence)

    @property
    def _place(self) -> NDArray[np.float64]:
        return self.camera_beside.first_from_second

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: that of the second camera.

        Raises
        ------
        DataError
            As `second_image`, or if a frame has none.
        """
        image = self.image_or_none(index)
        if image is None:
            raise DataError(self.source, f"no image of the second camera of frame {index}", "one")
        return image

    def image_or_none(self, index: int) -> NDArray[np.uint8] | None:
        """(height, width) uint8: see `second_image`."""
        return second_image(self.camera_beside, index, self.source)
