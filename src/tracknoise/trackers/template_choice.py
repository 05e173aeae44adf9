"""Which patch a feature is aligned to, and when it gets a new one."""

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray


class Template(StrEnum):
    """Which patch is aligned.

    previous: that of the previous frame, so that errors of steps add up. first: that of the frame in which the feature
    began, which drifts less and is lost sooner. keyframe: that of the last key frame, or of a later first frame. An
    image becomes a key frame when fewer than a share of the features of the last one are alive.
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
    keyframe_share
        For keyframe: the share of the features of the last key frame below which there is a new one.
    """

    def __init__(self, template: Template, keyframe_share: float = 0.0) -> None:
        self._template = template
        self._share = keyframe_share
        self._ids = self._key_ids = np.empty(0, dtype=np.int64)

    def rows(self, ids: NDArray[np.int64]) -> NDArray[np.intp]:
        """Where the templates of the features in an image are.

        Parameters
        ----------
        ids
            (n,) int64: all features that are alive in the image, ascending.

        Returns
        -------
        (n,) intp
            The row that each had in the call before, whose template it keeps; -1 where it gets a new one.
        """
        row = np.searchsorted(self._ids, ids)
        kept = np.isin(ids, self._ids)
        if self._template is Template.previous:
            kept[:] = False
        elif self._template is Template.keyframe and self._is_key_frame(ids):
            kept[:], self._key_ids = False, ids
        self._ids = ids
        return np.where(kept, row, -1)

    def _is_key_frame(self, ids: NDArray[np.int64]) -> bool:
        alive = np.count_nonzero(np.isin(self._key_ids, ids))
        return not len(self._key_ids) or bool(alive < self._share * len(self._key_ids))
