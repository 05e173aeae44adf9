"""Images and depth maps of a sequence that is read twice from the first frame to the last."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import PosePath
from tracknoise.sequences.sequence import path_of
from tracknoise.sequences.views import View

KEPT_BYTES = 64 << 20
"""Of images that are kept."""
KEPT_DEPTH_BYTES = 96 << 20
"""Of depth maps that are kept: to register one again costs more than to decode an image."""


@dataclass(frozen=True, slots=True, eq=False)
class KeptFrames(View):
    """A sequence that keeps what is read of it, as far as there is room for it: images until they are read again.

    The depth map that was read last is kept beside these, as several truths read it one after the other.
    """

    keeps_kind_of_depth: ClassVar[bool] = True

    most_bytes: int = KEPT_BYTES  # of images
    most_depth_bytes: int = KEPT_DEPTH_BYTES  # of depth maps
    _images: dict[int, NDArray[np.uint8]] = field(default_factory=dict, repr=False)
    _depths: dict[int, DepthMap | None] = field(default_factory=dict, repr=False)
    _last: dict[int, DepthMap | None] = field(default_factory=dict, repr=False)

    @property
    def path(self) -> PosePath | None:
        """That of the sequence shown."""
        return path_of(self.sequence)

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `Sequence.image`."""
        if index in self._images:
            return self._images.pop(index)
        image = self.sequence.image(index)
        if (len(self._images) + 1) * image.nbytes <= self.most_bytes:
            self._images[index] = image
        return image

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame: see `Sequence.depth`."""
        for kept in (self._last, self._depths):
            if index in kept:
                return kept[index]
        self._last.clear()
        depth = self._last[index] = self.sequence.depth(index)
        size = 0 if depth is None else depth.depth_m.nbytes + depth.valid.nbytes
        if (len(self._depths) + 1) * size <= self.most_depth_bytes:
            self._depths[index] = depth
        return depth
