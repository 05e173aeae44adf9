"""What is done to an image before features are detected and followed in it."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import Positive, require_bounds, settle_members
from tracknoise.trackers.tracker import Frame


class Equalisation(StrEnum):
    """How gray values are spread.

    none: they stay. histogram: over the whole image, so that each is about as frequent. clahe: the same in each of
    several tiles, with limited contrast.
    """

    none = "none"
    histogram = "histogram"
    clahe = "clahe"


@dataclass(frozen=True, slots=True)
class Preprocessing:
    """What is done to an image before features are detected and followed in it. By default nothing.

    Parameters
    ----------
    equalisation
        How gray values are spread: see `tracknoise.trackers.preprocessing.Equalisation`.
    clip_limit
        For clahe: the limit of contrast, as OpenCV has it.
    tiles
        For clahe: number of tiles along each side of the image.
    """

    equalisation: Equalisation = Equalisation.none
    clip_limit: Positive = 3.0
    tiles: Annotated[int, Ge(1), Le(64)] = 8

    def __post_init__(self) -> None:
        settle_members(self, equalisation=Equalisation)
        require_bounds(self)

    def applied(self, frame: Frame) -> Frame:
        """The frame with another image, which trackers of the same settings share; itself if nothing is to be done."""
        if self.equalisation is Equalisation.none:
            return frame
        return frame.memo(("preprocessed", self), lambda image: Frame(frame.index, self._equalised(image)))

    def _equalised(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        if self.equalisation is Equalisation.histogram:
            return np.asarray(cv2.equalizeHist(image), dtype=np.uint8)
        return np.asarray(cv2.createCLAHE(self.clip_limit, (self.tiles, self.tiles)).apply(image), dtype=np.uint8)


def resized(frame: Frame, size: tuple[int, int]) -> Frame:
    """The frame with a smaller image, of (width, height) px."""
    return Frame(frame.index, np.asarray(cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA), np.uint8))
