"""Still stretches: frames in which the camera does not move, so that tracks grow older without moving.

At the reader's limit of 2 cm per frame, a point 15 m away and 300 px from the centre moves by 0.4 px per frame: less
than the error of a tracker. A car at walking pace moves five times as far. The measured position of a car that stands
jitters by millimetres. A car does not turn on the spot, so its position alone is enough.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class StillRule:
    """When a drive counts as having a still stretch.

    Parameters
    ----------
    frames
        Count of frames one after another.
    step_m
        Each less than this from the one before, metres.
    """

    frames: int
    step_m: float


def still_stretch(world_from_camera: NDArray[np.float64], rule: StillRule) -> range | None:
    """The longest still stretch, the first of several, or None.

    Parameters
    ----------
    world_from_camera
        (n, 4, 4) float64.
    rule
        What is still.

    Returns
    -------
    range or None
        Indices of the frames that are less than ``rule.step_m`` from the one before.
    """
    steps_m = np.linalg.norm(np.diff(world_from_camera[:, :3, 3], axis=0), axis=1)
    still = np.concatenate([[False], steps_m < rule.step_m, [False]])
    starts, stops = np.flatnonzero(still[1:] & ~still[:-1]), np.flatnonzero(still[:-1] & ~still[1:])
    lengths = stops - starts
    if not lengths.size or lengths.max() < rule.frames:
        return None
    longest = int(np.argmax(lengths))
    return range(int(starts[longest]) + 1, int(stops[longest]) + 1)
