"""Key frames: images in which a tracker may do what it does not do in every image, such as taking new templates."""

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
        places = np.where(np.isin(ids, self._ids), np.searchsorted(self._ids, ids), len(self._ids))
        return rows[places]


class Template(StrEnum):
    """Which patch is aligned.

    previous: that of the previous frame, so that errors of steps add up. first: that of the frame in which the feature
    began, which drifts less and is lost sooner. keyframe: that of the last key frame, or of a later first frame: see
    `tracknoise.trackers.key_frames.KeyFrames`.
    """

    previous = "previous"
    first = "first"
    keyframe = "keyframe"


class Renewal:
    """Decides image by image which of the live features get a new template.

    Parameters
    ----------
    template
        Which patch is aligned.
    key_frames
        For keyframe: those of the tracker. None: there is none.
    """

    def __init__(self, template: Template, key_frames: KeyFrames | None = None) -> None:
        self._template = template
        self._key_frames = key_frames
        self._ids = np.empty(0, dtype=np.int64)

    def rows(self, ids: NDArray[np.int64], index: int) -> NDArray[np.intp]:
        """Where the templates of the features in an image are.

        `ids`: (n,) int64: all features that are alive in the image, ascending. Returns (n,) intp: the row that each had
        in the call before, whose template it keeps; -1 where it gets a new one.
        """
        row = np.searchsorted(self._ids, ids)
        kept = np.isin(ids, self._ids)
        if self._template is Template.previous or (
            self._template is Template.keyframe and self._key_frames is not None and self._key_frames.is_latest(index)
        ):
            kept[:] = False
        self._ids = ids
        return np.where(kept, row, -1)
