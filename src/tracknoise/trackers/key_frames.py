"""Key frames: images in which a tracker may do what it does not do in every image."""

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.features import Features


class Occasion(StrEnum):
    """In which images new features are detected, or outliers rejected.

    every-frame: in all that the tracker sees. keyframes: in key frames only, see
    `tracknoise.trackers.key_frames.KeyFrames`.
    """

    every_frame = "every-frame"
    keyframes = "keyframes"


class KeyFrames:
    """Decides image by image which are key frames.

    An image becomes a key frame when fewer than a share of the features of the last one are alive in it, or when that
    one is old enough. The first image is one. The features of a key frame are all that are alive in it in the end, new
    ones too.

    Parameters
    ----------
    share
        Of the features of the last key frame.
    every
        Frames of the nominal sequence after which there is a new one at the latest. None: any number.
    """

    def __init__(self, share: float, every: int | None = None) -> None:
        self._share, self._every = share, every
        self._latest: int | None = None
        self._ids, self._uv = np.empty(0, dtype=np.int64), np.empty((0, 2))

    def decide(self, index: int, ids: NDArray[np.int64]) -> bool:
        """Whether the present image becomes a key frame, by the features (n,) of earlier ones that are alive in it."""
        alive = np.count_nonzero(np.isin(self._ids, ids))
        is_old = self._latest is None or (self._every is not None and index - self._latest >= self._every)
        if is_old or not len(self._ids) or alive < self._share * len(self._ids):
            self._latest = index
        return self.is_latest(index)

    def is_latest(self, index: int) -> bool:
        """Whether an image is the last key frame."""
        return self._latest == index

    def complete(self, index: int, features: Features) -> None:
        """State the features that are alive in an image in the end, which count if it is the last key frame."""
        if self.is_latest(index):
            self._ids, self._uv = features.ids, features.uv

    def positions(self, ids: NDArray[np.int64]) -> NDArray[np.float64]:
        """Where features (n,) were in the last key frame that is complete, (n, 2) px; NaN if they began later."""
        rows = np.append(self._uv, [[np.nan, np.nan]], axis=0)
        at = np.where(np.isin(ids, self._ids), np.searchsorted(self._ids, ids), len(self._ids))
        return rows[at]
