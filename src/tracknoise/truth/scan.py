"""Truth from a single scan: features found in the key frame are associated with the scan points nearest to them."""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import CameraModel
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.tables.defaults import SCAN_RADIUS_PX
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.anchored import Anchor, AnchoredTruth, Anchors, anchor_points
from tracknoise.truth.truth import TruePositions
from tracknoise.truth.visibility import DepthMapSurface, SequenceGeometry


class ScanAnchoring(StrEnum):
    """What a feature takes from the scan point that it is associated with."""

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
        Largest distance between a feature and the projection of its scan point, px.
    anchoring
        What the feature takes from the scan point.
    """

    radius_px: float = SCAN_RADIUS_PX
    anchoring: ScanAnchoring = ScanAnchoring.ray


SCAN_RULE = ScanRule()
"""The rule that applies by default."""


class ScanPoints:
    """Anchors features at the scan points nearest to them in the image. Shapes: points_world (n, 3) m."""

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
        distance, nearest = KDTree(seen).query(uv)
        near = distance <= self._rule.radius_px
        status = np.where(near, TruthStatus.valid, TruthStatus.no_depth).astype(np.int8)
        return np.where(near, rows[nearest], 0), status

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


@dataclass(frozen=True, slots=True)
class KeyFrameScan:
    """The scan point next to each feature in the key frame.

    Parameters
    ----------
    rule
        How features are associated with the scan.
    """

    kind: ClassVar[str] = TruthKind.scan

    rule: ScanRule = SCAN_RULE

    def open(self, sequence: Sequence) -> "ScanTruth":
        """Make the truth of one sequence.

        Raises
        ------
        DataError
            If the sequence has no scan, its file is missing or damaged, or the key frame has no pose.
        """
        scan = sequence.scan
        if scan is None:
            raise DataError(sequence.source, "no scan", "one, as the sequence offers the truth 'scan'")
        geometry = SequenceGeometry(sequence)
        if 0 <= scan.key_frame < len(sequence) and not geometry.has_pose(scan.key_frame):
            found = f"no pose of the key frame {scan.key_frame}"
            raise DataError(sequence.source, found, "one, so that features can be associated with the scan")
        points = ScanPoints(geometry, scan.points_world, self.rule)
        return ScanTruth(geometry, points.anchor, scan.key_frame)


class ScanTruth(AnchoredTruth):
    """A truth that gives a world point to each track that is found in the key frame."""

    __slots__ = ("_key_frame",)

    def __init__(self, geometry: SequenceGeometry, anchor: Anchor, key_frame: int) -> None:
        super().__init__(TruthKind.scan, geometry, anchor, DepthMapSurface(geometry))
        self._key_frame = key_frame

    @property
    def key_frame(self) -> int:
        """The frame in which features are anchored."""
        return self._key_frame

    def start(self) -> "KeyFrameSession":
        """Start a session for one tracker setup."""
        return KeyFrameSession(self)


class KeyFrameSession:
    """The tracks of one tracker setup, anchored in the key frame where they are found there.

    Earlier observations wait for the key frame: only then are their true positions known.
    """

    __slots__ = ("_tracks", "_truth", "_waiting")

    def __init__(self, truth: ScanTruth) -> None:
        self._truth = truth
        self._tracks = truth.tracks()
        self._waiting: list[tuple[int, NDArray[np.uint32], NDArray[np.float64]]] = []

    def observe(self, index: int, tracks: NDArray[np.uint32], uv: NDArray[np.float64], born: NDArray[np.bool_]) -> None:
        """Anchor tracks in the key frame, and locate them: see `tracknoise.truth.truth.TruthSession.observe`."""
        new = int(np.count_nonzero(born))
        self._tracks.begin(index, np.full((new, 3), np.nan), np.full(new, TruthStatus.no_depth, np.int8))
        is_anchored = index == self._truth.key_frame
        self._waiting.append((index, tracks, uv if is_anchored else np.full_like(uv, np.nan)))
        if is_anchored:
            self._tracks.anchor(tracks, *self._truth.anchor(index, uv))
        if index >= self._truth.key_frame:
            self._locate_waiting()

    def resolve(self) -> TruePositions:
        """True positions of all observations: see `tracknoise.truth.truth.TruthSession.resolve`."""
        self._locate_waiting()
        return self._tracks.positions()

    def _locate_waiting(self) -> None:
        for waiting in self._waiting:
            self._tracks.locate(*waiting)
        self._waiting = []
