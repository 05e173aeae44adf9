"""Depths of features at their birth, joined from the depth maps of neighbouring frames.

The map of another frame t sees the point of a feature at the depth Z, where it predicts z(Z) and has the depth z'. The
ray of the feature meets the surface of that map where both are equal: steps

    Z <- Z z' / z(Z)                                                                              (depth.joined)

lead there. The joined depth is the median over the maps that see the same surface, the feature's own among them.
"""

from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.depth import DepthMap, sample
from tracknoise.truth.visibility import SequenceGeometry

Array = NDArray[np.float64]

REACH = 8
"""Frames before and after that of a feature whose maps are joined."""
_STEPS = 3
_MEMORY = 128 * 1024**2
_SAME_SCALES, _SAME_LEAST, _SAME_MOST = 4.0, 0.005, 0.3
"""A map sees the same surface where its depth differs by at most so many robust standard deviations of all
differences, and relative to the depth by no less and no more than this."""
_FEWEST = 3
_MEDIAN_TO_SIGMA = 1.4826
_OF_MEDIAN = float(np.sqrt(np.pi / 2.0))
"""Standard deviation of the median of Gaussian numbers over that of their mean."""


class JoinedDepths:
    """Depths of features of a sequence, by dense depth maps and the poses of their frames.

    Parameters
    ----------
    geometry
        Of the sequence, with the poses that place maps beside each other.
    """

    __slots__ = ("_geometry", "_maps")

    def __init__(self, geometry: SequenceGeometry) -> None:
        self._geometry = geometry
        self._maps: OrderedDict[int, DepthMap | None] = OrderedDict()

    def of(self, index: int, uv: Array, depth_m: Array) -> tuple[Array, Array]:
        """Joined depths (n,), metres, of pixels (n, 2) of a frame with the depths (n,) of its own map, and errors.

        Errors are standard deviations by the spread of the maps, metres; what maps have in common is not in them. A
        feature that fewer than three maps see keeps its own depth, with the error of single maps of the frame.
        """
        difference = self.differences(index, uv, depth_m)
        valid = np.isfinite(difference)
        scale = _MEDIAN_TO_SIGMA * float(np.median(np.abs(difference[valid]))) if valid.any() else _SAME_MOST
        same = valid & (np.abs(difference) <= np.clip(_SAME_SCALES * scale, _SAME_LEAST, _SAME_MOST))
        agreeing = np.where(same, difference, np.nan)
        enough = np.flatnonzero(same.sum(axis=0) + 1 >= _FEWEST)
        middle, sigma = np.zeros(len(uv)), np.full(len(uv), scale / np.sqrt(2.0))
        middle[enough] = np.nanmedian(np.vstack([np.zeros(len(enough)), agreeing[:, enough]]), axis=0)
        single = _MEDIAN_TO_SIGMA * np.nanmedian(np.abs(agreeing[:, enough]), axis=0) / np.sqrt(2.0)
        sigma[enough] = _OF_MEDIAN * single / np.sqrt(same.sum(axis=0)[enough] + 1)
        joined_m = depth_m * np.exp(middle)
        return joined_m, joined_m * sigma

    def differences(self, index: int, uv: Array, depth_m: Array) -> Array:
        """(k, n) float64: log of the depth by each other map over the own one; NaN where a map does not see a point."""
        geometry = self._geometry
        differences = np.full((2 * REACH, len(uv)), np.nan)
        rays = geometry.camera_at(index).bearings(uv)
        for row, frame in enumerate(self._others(index)):
            depth = self._map(frame)
            if depth is None:
                continue
            log = np.zeros(len(uv))
            for _ in range(_STEPS):
                points = rays * (depth_m * np.exp(log))[:, None]
                seen_uv, seen = geometry.seen(frame, geometry.to_world(index, uv, points))
                usable = np.isfinite(seen_uv).all(axis=1) & (seen[:, 2] > 0.0)
                read = sample(depth, np.where(usable[:, None], seen_uv, -1.0), geometry.camera_at(frame))
                step = np.log(read.depth_m / np.where(usable, seen[:, 2], 1.0))
                log = np.where(usable & read.valid, log + np.clip(step, -_SAME_MOST, _SAME_MOST), np.nan)
            differences[row] = log
        return differences

    def _others(self, index: int) -> list[int]:
        first, last = max(0, index - REACH), min(len(self._geometry.sequence), index + REACH + 1)
        return [frame for frame in range(first, last) if frame != index and self._geometry.has_pose(frame)]

    def _map(self, index: int) -> DepthMap | None:
        """Dense depth of a frame. Maps of neighbouring frames are kept, as far as memory for them goes."""
        if index not in self._maps:
            depth = self._geometry.sequence.depth(index)
            self._maps[index] = None if depth is None or depth.radius_px is not None else depth
            size = 0 if depth is None else depth.depth_m.nbytes + depth.valid.nbytes
            while len(self._maps) > 2 * REACH + 1 or (len(self._maps) > 1 and len(self._maps) * size > _MEMORY):
                self._maps.popitem(last=False)
        self._maps.move_to_end(index)
        return self._maps[index]
