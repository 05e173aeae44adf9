"""Poses of a recording at times at which a sequence has no frame."""

import numpy as np

from tracknoise.geometry.interpolation import PosePath
from tracknoise.sequences.sequence import Sequence, path_of, times_of

_SAME_TIME = 1e-6
"""Times are the same if they differ by less than this share of the time between frames: a velocity between them would
be one of rounding."""


def path_between_frames(sequence: Sequence, n_frames: int) -> PosePath | None:
    """Poses over time that are not those of the first frames of a sequence; None where there are none.

    Parameters
    ----------
    sequence
        The sequence.
    n_frames
        How many of its frames are read.
    """
    path, times = path_of(sequence), times_of(sequence)
    if path is None or times is None or n_frames < 2:
        return None
    read = times[:n_frames]
    after = np.clip(np.searchsorted(read, path.times), 1, n_frames - 1)
    apart = np.minimum(np.abs(path.times - read[after - 1]), np.abs(path.times - read[after]))
    other = apart > _SAME_TIME * float(np.median(np.diff(read)))
    return PosePath(path.times[other], path.poses[other]) if other.any() else None
