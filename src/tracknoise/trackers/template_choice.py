"""Which patch a feature is aligned to, and when it gets a new one."""

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.key_frames import KeyFrames


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

        Parameters
        ----------
        ids
            (n,) int64: all features that are alive in the image, ascending.
        index
            Of the image.

        Returns
        -------
        (n,) intp
            The row that each had in the call before, whose template it keeps; -1 where it gets a new one.
        """
        row = np.searchsorted(self._ids, ids)
        kept = np.isin(ids, self._ids)
        if self._template is Template.previous or (
            self._template is Template.keyframe and self._key_frames is not None and self._key_frames.is_latest(index)
        ):
            kept[:] = False
        self._ids = ids
        return np.where(kept, row, -1)
