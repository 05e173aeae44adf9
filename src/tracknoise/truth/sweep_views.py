"""What a plane sweep compares a frame with: images of other frames, and those of a second camera.

The images of a second camera are numbered after those of the frames: with n frames, n + i is its image of frame i.
"""

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tracknoise.sequences.second_camera import Beside
from tracknoise.sequences.sequence import second_of
from tracknoise.trackers.alignment import pyramid
from tracknoise.truth.visibility import SequenceGeometry

Floats = NDArray[np.float64]
Images = tuple[NDArray[np.float32], NDArray[np.float32]]
"""An image, and the same of half the size."""

OFFSETS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
"""How many frames before and after a frame the images lie that it is compared with."""
SECOND_OFFSETS = (0, 1, 2, 4, 8)
"""The same of images of a second camera: one of the frame's own time shows most of what that adds."""
CACHE_BYTES = 160 << 20
"""Size of the images that are kept. Large images are compared with fewer frames, so that each is read once."""

_NUMBER_BYTES = 5
"""Of a pixel: float32, and a quarter of it for the image of half the size."""


class Cameras(StrEnum):
    """Whose images frames are compared with.

    both: those of both cameras. first: those of the frames alone. pair: that of the second camera at their own time.
    """

    both = "both"
    first = "first"
    pair = "pair"


class SweepViews:
    """Images of a sequence, and where they show points. Those that were used last are kept.

    Parameters
    ----------
    first
        Geometry of the sequence. Its depths are not used.
    cameras
        Whose images frames are compared with; those of the frames alone where there is no second camera.
    """

    __slots__ = ("_centres", "_first", "_kept", "_most", "_offsets", "_posed", "_reach", "_second", "_side", "n_frames")

    def __init__(self, first: SequenceGeometry, cameras: Cameras = Cameras.both) -> None:
        sequence, second = first.sequence, None if cameras is Cameras.first else second_of(first.sequence)
        self._offsets = ((), (0,)) if cameras is Cameras.pair else (OFFSETS, SECOND_OFFSETS)
        self._first, self.n_frames = first, len(sequence)
        self._side = None if second is None else Beside(sequence, second)
        self._second = None if self._side is None else SequenceGeometry(self._side)
        seen = [sequence, *([] if self._side is None else [self._side])]
        self._centres = np.concatenate([source.world_from_camera[:, :3, 3] for source in seen])
        self._posed = [first.has_pose(index) for index in range(self.n_frames)]
        largest = max(source.camera.width * source.camera.height for source in seen)
        room = CACHE_BYTES // (_NUMBER_BYTES * largest)
        more = 0 if second is None else 2 * max(SECOND_OFFSETS) + 1
        fair = room // (2 * len(seen))
        self._reach = int(np.clip(max((room - more) // 2, min(fair, max(SECOND_OFFSETS))), 2, max(OFFSETS)))
        self._most = 2 * self._reach + 1 + min(more, 2 * self._reach + 1)
        self._kept: dict[int, Images | None] = {}

    def around(self, index: int) -> list[int]:
        """Views that a frame is compared with, other than its own: those with a pose and an image."""
        frames, beside = (self._reached(index, offsets) for offsets in self._offsets)
        shown = (self.n_frames + frame for frame in beside) if self._side is not None else ()
        return frames + [view for view in shown if self.images(view) is not None]

    def _reached(self, index: int, offsets: tuple[int, ...]) -> list[int]:
        near = dict.fromkeys(index + side * step for step in offsets if step <= self._reach for side in (-1, 1))
        return [frame for frame in near if 0 <= frame < self.n_frames and self._posed[frame]]

    def is_second(self, view: int) -> bool:
        """Whether a view is one of the second camera."""
        return view >= self.n_frames

    def frame(self, view: int) -> int:
        """The frame at whose time a view was taken."""
        return view % self.n_frames

    def baseline(self, index: int, view: int) -> float:
        """Distance of a view from a frame, in the unit of the poses."""
        return float(np.linalg.norm(self._centres[view] - self._centres[index]))

    @property
    def pair_baseline(self) -> float:
        """Distance of both cameras, metres; 0 without a second camera."""
        return 0.0 if self._side is None else float(np.linalg.norm(self._side.camera_beside.first_from_second[:3, 3]))

    def project(self, view: int, points_world: Floats) -> Floats:
        """(n, 2) float64, px: positions of world points (n, 3) in a view; NaN where it has none."""
        geometry = self._second if self._second is not None and self.is_second(view) else self._first
        return geometry.project(self.frame(view), points_world)

    def images(self, view: int) -> Images | None:
        """Image of a view as numbers, and the same of half the size; None where the second camera has none.

        Raises
        ------
        DataError
            If it cannot be read.
        """
        if view in self._kept:
            images = self._kept.pop(view)
        else:
            image = self._read(view)
            images = None if image is None else _two_sizes(image)
        self._kept[view] = images  # the last in order
        while len(self._kept) > self._most:
            del self._kept[next(iter(self._kept))]
        return images

    def level(self, view: int, level: int) -> NDArray[np.float32]:
        """Image of a view that has one, whole (0) or of half the size (1): see `images`."""
        images = self.images(view)
        assert images is not None, "views without an image are left out"
        return images[level]

    def _read(self, view: int) -> NDArray[np.uint8] | None:
        if self._side is not None and self.is_second(view):
            return self._side.image_or_none(self.frame(view))
        return self._first.sequence.image(view)


def _two_sizes(image: NDArray[np.uint8]) -> Images:
    whole, half = pyramid(image, 1, 1)
    return whole, half
