"""The true position of each observation, from the anchors of the tracks and the poses of the frames."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.pose import invert, transform
from tracknoise.measurement.recording import Recording
from tracknoise.sequences.sequence import Sequence


@dataclass(frozen=True, slots=True)
class TruePaths:
    """Where the features of a recording really were.

    Attributes
    ----------
    uv : (n, 2) float64
        True position of each observation, px; NaN where its track has no anchor, or that has no image.
    depth_m : (m,) float64
        Depth of each track's anchor in its first frame, metres; NaN where it has none.
    """

    uv: NDArray[np.float64]
    depth_m: NDArray[np.float64]


def true_paths(recording: Recording, sequence: Sequence) -> TruePaths:
    """Project every track's anchor into every frame in which it was observed: x_true(t) = pi(camera_from_world(t) X_w).

    Frames are taken one at a time, all their observations at once, so that memory does not grow beyond the result.

    Parameters
    ----------
    recording
        Observations in the order of frames, births likewise.
    sequence
        Camera and poses.
    """
    camera_from_world = invert(sequence.world_from_camera)
    uv = np.empty_like(recording.uv)
    for frame, rows in _runs(recording.frame):
        points = recording.points_world[recording.track[rows]]
        uv[rows] = sequence.camera.project(transform(camera_from_world[frame], points))
    depth_m = np.empty(len(recording.first_frame))
    for frame, rows in _runs(recording.first_frame):
        depth_m[rows] = transform(camera_from_world[frame], recording.points_world[rows])[:, 2]
    return TruePaths(uv, depth_m)


def _runs(frames: NDArray[np.uint32]) -> list[tuple[int, slice]]:
    """Stretches of equal values in a sorted array."""
    bounds = [0, *(np.flatnonzero(frames[1:] != frames[:-1]) + 1).tolist(), len(frames)]
    return [(int(frames[a]), slice(a, b)) for a, b in pairwise(bounds) if b > a]
