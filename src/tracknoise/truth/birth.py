"""Truth from depth streams: the depth of each feature's first frame."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.depth import DepthSample, at_pixels, sample
from tracknoise.geometry.surroundings import Surroundings, around, find_surroundings, unknown_surroundings
from tracknoise.sequences.sequence import Sequence, TruthKind, joins_depths
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.anchored import AnchoredTruth, Anchors, anchor_points
from tracknoise.truth.joined_depths import JoinedDepths
from tracknoise.truth.visibility import DepthMapSurface, SequenceGeometry


@dataclass(frozen=True, slots=True)
class BirthDepth:
    """Depth at birth, read at the sub-pixel position in the first frame.

    Where the sequence says so, it is joined from the maps of neighbouring frames: (depth.joined).
    """

    kind: ClassVar[str] = TruthKind.birth

    def open(self, sequence: Sequence) -> AnchoredTruth:
        """Make the truth of one sequence. Features whose first frame has no depth there get no true position."""
        geometry = SequenceGeometry(sequence)
        births = BirthDepths(geometry)

        def anchor(index: int, uv: NDArray[np.float64]) -> Anchors:
            return anchor_points(geometry, index, uv, *births.of(index, uv))

        surround = partial(_mapped_surroundings, geometry)
        sigma = births.sigma_m if joins_depths(sequence) else None
        return AnchoredTruth(self.kind, geometry, anchor, DepthMapSurface(geometry), surround, sigma)


def _mapped_surroundings(geometry: SequenceGeometry, index: int, uv: NDArray[np.float64]) -> Surroundings:
    """Surroundings of features by the depth map of a frame; unknown where it has none, or a sparse one."""
    depth = geometry.depth(index)
    if depth is None or depth.radius_px is not None:
        return unknown_surroundings(len(uv))
    return find_surroundings(geometry.camera_at(index), uv, *at_pixels(depth, around(uv)), depth.accuracy)


class BirthDepths:
    """Depths of features in the first frame of their tracks.

    Parameters
    ----------
    geometry
        Of the sequence.
    """

    __slots__ = ("_geometry", "_joined")

    def __init__(self, geometry: SequenceGeometry) -> None:
        self._geometry = geometry
        self._joined = JoinedDepths(geometry) if joins_depths(geometry.sequence) else None

    def of(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
        """Depths (n,), metres, of pixels (n, 2) of a frame, and their status: edge next to a depth discontinuity."""
        depth = self._geometry.depth(index)
        if depth is None:
            return np.ones(len(uv)), np.full(len(uv), TruthStatus.no_depth, np.int8)
        read = sample(depth, uv, self._geometry.camera_at(index))
        status = np.full(len(uv), TruthStatus.no_depth, np.int8)
        status[read.edge] = TruthStatus.edge
        status[read.valid] = TruthStatus.valid
        return self._joined_with_errors(index, uv, read)[0], status

    def sigma_m(self, index: int, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) float64, metres: standard deviations of joined depths of pixels (n, 2); NaN where unknown."""
        depth = self._geometry.depth(index)
        if depth is None:
            return np.full(len(uv), np.nan)
        return self._joined_with_errors(index, uv, sample(depth, uv, self._geometry.camera_at(index)))[1]

    def _joined_with_errors(
        self, index: int, uv: NDArray[np.float64], read: DepthSample
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        depth_m, sigma_m = read.depth_m.copy(), np.full(len(uv), np.nan)
        if self._joined is not None and read.valid.any():
            joined = self._joined.of(index, uv[read.valid], depth_m[read.valid])
            depth_m[read.valid], sigma_m[read.valid] = joined
        return depth_m, sigma_m
