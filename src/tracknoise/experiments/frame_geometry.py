"""Poses and cameras of a sequence as arrays."""

import numpy as np

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.sequences.sequence import Sequence, camera_at


def frame_geometry(sequence: Sequence, n_frames: int) -> FrameGeometry:
    """Stated poses and cameras of the first frames of a sequence.

    Parameters
    ----------
    sequence
        The sequence.
    n_frames
        How many frames.
    """
    numbers: dict[CameraModel, int] = {}
    which = [numbers.setdefault(camera_at(sequence, index), len(numbers)) for index in range(n_frames)]
    return FrameGeometry(sequence.world_from_camera[:n_frames], tuple(numbers), np.array(which, np.intp))
