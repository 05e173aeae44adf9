"""One image, and the computations on it that several trackers share."""

from collections.abc import Callable, Hashable
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")


class Frame:
    """One grayscale image of a sequence.

    Parameters
    ----------
    index
        Frame of the nominal sequence.
    image
        (height, width) uint8; never modified.

    Raises
    ------
    ValueError
        If the image is not 2-D uint8.
    """

    __slots__ = ("_memo", "image", "index")

    def __init__(self, index: int, image: NDArray[np.uint8]) -> None:
        if image.ndim != 2 or image.dtype != np.uint8:
            raise ValueError(f"a frame is a 2-D uint8 image, not {image.ndim}-D {image.dtype}")
        self.index = index
        self.image = image
        self._memo: dict[Hashable, object] = {}

    @property
    def size(self) -> tuple[int, int]:
        """(width, height), px."""
        height, width = self.image.shape
        return width, height

    def memo(self, key: Hashable, compute: Callable[[NDArray[np.uint8]], T]) -> T:
        """The result of `compute` on the image, computed at most once for each key.

        Trackers at all speeds share a frame, and so share work that depends only on the image and the settings.
        """
        if key not in self._memo:
            self._memo[key] = compute(self.image)
        return cast(T, self._memo[key])
