"""The scan points that features are associated with, by their projections into a frame."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.anchored import Anchors, anchor_points
from tracknoise.truth.scan_rule import ScanAnchoring, ScanRule
from tracknoise.truth.sequence_geometry import SequenceGeometry


class ScanPoints:
    """Anchors features at the scan points nearest to them in the image.

    Parameters
    ----------
    geometry
        Of the sequence.
    points_world
        (n, 3) float64, metres, finite: the scan.
    rule
        Which point is near enough, and what a feature takes from it.
    """

    __slots__ = ("_geometry", "_index", "_points_world", "_projected", "_rule")

    def __init__(self, geometry: SequenceGeometry, points_world: NDArray[np.float64], rule: ScanRule) -> None:
        self._geometry, self._points_world, self._rule = geometry, points_world, rule
        self._index: int | None = None
        self._projected: tuple[NDArray[np.float64], NDArray[np.intp]] = np.empty((0, 2)), np.empty(0, np.intp)

    def anchor(self, index: int, uv: NDArray[np.float64]) -> Anchors:
        """World points of features in a frame; no_depth where no scan point is near enough."""
        nearest, status = self._nearest(index, uv)
        points_world = self._points_world[nearest]
        if self._rule.anchoring is ScanAnchoring.ray:
            depth_m = self._geometry.to_camera(index, uv, points_world)[:, 2]
            depth_m = np.where(status == TruthStatus.valid, depth_m, 1.0)
            return anchor_points(self._geometry, index, uv, depth_m, status)
        points_world[status != TruthStatus.valid] = np.nan
        return points_world, status

    def _nearest(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.int8]]:
        """Row of the scan point nearest to each feature (0 where none is near enough), and the status."""
        seen, rows = self._near(self._geometry.camera_at(index), *self._seen(index), uv)
        if not len(seen) or not len(uv):
            return np.zeros(len(uv), np.intp), np.full(len(uv), TruthStatus.no_depth, np.int8)
        distance, found = KDTree(seen).query(uv)
        near = distance <= self._rule.radius_px
        status = np.where(near, TruthStatus.valid, TruthStatus.no_depth).astype(np.int8)
        return np.where(near, rows[found], 0), status

    def _seen(self, index: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Projections of the scan points that lie in the image, and their rows; kept for the latest frame only."""
        if index != self._index:
            uv = self._geometry.project(index, self._points_world)
            rows = np.flatnonzero(self._geometry.camera_at(index).contains(uv))
            self._projected, self._index = (uv[rows], rows), index
        return self._projected

    def _near(
        self, camera: CameraModel, seen: NDArray[np.float64], rows: NDArray[np.intp], uv: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """The few scan points in pixels around the features, so that not all need to be searched."""
        reach = int(np.ceil(self._rule.radius_px))
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
