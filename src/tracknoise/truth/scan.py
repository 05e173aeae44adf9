"""Anchors from a single scan: the points of a surface that was measured once, seen from the key frame."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from tracknoise.sequences.sequence import Scan
from tracknoise.tables.defaults import SCAN_RADIUS_PX
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.anchor import Anchored, fix
from tracknoise.truth.frames import Frames


class ScanAnchoring(StrEnum):
    """What a feature takes of the scan point it is associated with."""

    ray = "ray"
    """The point's depth, along the feature's own ray, so that the error is zero in the key frame."""
    point = "point"
    """The point itself."""


@dataclass(frozen=True, slots=True)
class ScanRule:
    """How features are associated with a scan.

    Parameters
    ----------
    radius_px
        How far the projection of the nearest scan point may lie from the feature, px.
    anchoring
        What the feature takes of it.
    """

    radius_px: float = SCAN_RADIUS_PX
    anchoring: ScanAnchoring = ScanAnchoring.ray


class ScanPoints:
    """The scan point nearest to a feature in the image: (truth.scan).

    Parameters
    ----------
    frames
        The sequence.
    scan
        Of its scene.
    rule
        Which point is near enough, and what is taken of it.
    """

    __slots__ = ("_frames", "_index", "_projected", "_rule", "_scan")

    def __init__(self, frames: Frames, scan: Scan, rule: ScanRule) -> None:
        self._frames, self._scan, self._rule = frames, scan, rule
        self._index: int | None = None
        self._projected: tuple[NDArray[np.float64], NDArray[np.intp]] = np.empty((0, 2)), np.empty(0, np.intp)

    def points(self, index: int, uv: NDArray[np.float64]) -> Anchored:
        """World points of features that are visible in a frame: see `tracknoise.truth.truth.Truth.anchor`."""
        if self._rule.anchoring is ScanAnchoring.ray:
            return fix(self._frames, self, index, uv)
        nearest, status = self._nearest(index, uv)
        points_world = self._scan.points_world[nearest]
        points_world[status != TruthStatus.valid] = np.nan
        return points_world, status

    def depths(self, index: int, uv: NDArray[np.float64]) -> Anchored:
        """Depth of the associated scan points: see `tracknoise.truth.anchor.Anchor.depths`."""
        nearest, status = self._nearest(index, uv)
        depth_m = self._frames.to_camera(index, self._scan.points_world[nearest])[:, 2]
        return np.where(status == TruthStatus.valid, depth_m, 1.0), status

    def _nearest(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.int8]]:
        """Row of the scan point nearest to each feature, 0 where none is near enough, and the status."""
        seen, rows = self._near(*self._seen(index), uv)
        if not len(seen) or not len(uv):
            return np.zeros(len(uv), np.intp), np.full(len(uv), TruthStatus.no_depth, np.int8)
        distance, found = KDTree(seen).query(uv)
        near = distance <= self._rule.radius_px
        status = np.where(near, TruthStatus.valid, TruthStatus.no_depth).astype(np.int8)
        return np.where(near, rows[found], 0), status

    def _seen(self, index: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Projections of the scan points that lie in the image, and their rows; kept for the latest frame alone."""
        if index != self._index:
            uv = self._frames.camera.project(self._frames.to_camera(index, self._scan.points_world))
            rows = np.flatnonzero(self._frames.camera.contains(uv))
            self._projected, self._index = (uv[rows], rows), index
        return self._projected

    def _near(
        self, seen: NDArray[np.float64], rows: NDArray[np.intp], uv: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """The few scan points in pixels around the features, so that not all need to be searched."""
        camera, reach = self._frames.camera, int(np.ceil(self._rule.radius_px))
        wanted = np.zeros((camera.height, camera.width), np.bool_)
        centre = np.rint(uv).astype(np.intp)
        for down in range(-reach, reach + 1):
            for right in range(-reach, reach + 1):
                column = np.clip(centre[:, 0] + right, 0, camera.width - 1)
                wanted[np.clip(centre[:, 1] + down, 0, camera.height - 1), column] = True
        pixel = np.rint(seen).astype(np.intp)
        pixel = np.clip(pixel, 0, (camera.width - 1, camera.height - 1))
        near = wanted[pixel[:, 1], pixel[:, 0]]
        return seen[near], rows[near]
