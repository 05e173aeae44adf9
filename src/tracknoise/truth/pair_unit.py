"""Whether poses are in metres, as the distance to a second camera is.

Where the camera moves, the images of frames alone give inverse depths r in the unit of the poses, and the image of the
second camera at the frame's own time gives inverse depths q in metres. In one unit, the median of log(q / r) over the
points of a frame is 0 but for errors, which the points of a frame have in common: frames count as independent.
"""

from dataclasses import dataclass

import numpy as np

from tracknoise.truth.plane_sweep import PlaneSweep, Swept
from tracknoise.truth.sweep_views import Cameras
from tracknoise.truth.visibility import SequenceGeometry

SAME_UNIT, SAME_SIGMAS = 0.02, 3.0
"""A smaller relative difference, or one within so many standard deviations, is none."""

_FRAMES, _COLUMNS, _ROWS = 8, 10, 6
"""Frames that are asked, and the grid of points in each."""
_FEWEST_POINTS, _FEWEST_FRAMES, _LARGEST_SIGMA = 5, 3, 0.1
"""Points of a frame, and frames, that decide; a point counts with a smaller relative standard deviation by each way."""


@dataclass(frozen=True, slots=True)
class PairUnit:
    """Depths by the poses over those by the second camera."""

    ratio: float  # 1 where nothing is known
    sigma: float  # its relative standard deviation; inf where nothing is known

    @property
    def is_same(self) -> bool:
        """Whether nothing contradicts that poses are in metres."""
        return bool(abs(np.log(self.ratio)) <= max(SAME_UNIT, SAME_SIGMAS * self.sigma))


def pair_unit(geometry: SequenceGeometry) -> PairUnit:
    """Compare depths by the poses and by the second camera in some frames of a sequence that has one.

    Raises
    ------
    DataError
        If an image cannot be read.
    """
    by_poses, by_pair = (PlaneSweep(geometry, cameras) for cameras in (Cameras.first, Cameras.pair))
    camera, logs = geometry.sequence.camera, []
    u, v = (
        (np.arange(count) + 0.5) / count * size for count, size in ((_COLUMNS, camera.width), (_ROWS, camera.height))
    )
    uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    posed = [index for index in range(len(geometry.sequence)) if geometry.has_pose(index)]
    for place in np.unique(np.linspace(0, len(posed) - 1, _FRAMES).astype(int)):
        of_poses, of_pair = (sweep.found(posed[place], uv) for sweep in (by_poses, by_pair))
        both = _is_exact(of_poses) & _is_exact(of_pair)
        if np.count_nonzero(both) >= _FEWEST_POINTS:
            logs.append(float(np.median(np.log(of_pair.inverse_depth[both] / of_poses.inverse_depth[both]))))
    if len(logs) < _FEWEST_FRAMES:
        return PairUnit(1.0, np.inf)
    middle = float(np.median(logs))
    apart = 1.4826 * float(np.median(np.abs(np.array(logs) - middle)))
    return PairUnit(float(np.exp(middle)), float(np.sqrt(np.pi / 2.0 / len(logs))) * apart)


def _is_exact(swept: Swept) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    return np.asarray(swept.sigma < _LARGEST_SIGMA * swept.inverse_depth)
