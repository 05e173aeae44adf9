"""Truth by anchors: each track gets one world point, which is projected into all frames in which it was observed."""

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.surroundings import Surroundings, joined_surroundings, unknown_surroundings
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth import TruePositions, TruthSession
from tracknoise.truth.visibility import Located, SequenceGeometry, VisibleSurface, locate

Locate = Callable[[int, NDArray[np.float64]], Located]
"""Takes a frame and world points (n, 3); returns their positions in the frame and whether they can be seen."""

_LEAST_CAPACITY = 1024
_ROUNDING_PX = 1e-6
"""A point that is projected this close to the pixel it was taken from lies on the ray of that pixel."""


class AnchoredTracks:
    """Tracks by number: each has a world point (NaN where unknown) and the status of that point."""

    __slots__ = ("_births", "_count", "_geometry", "_locate", "_located", "_points", "_status")

    def __init__(self, geometry: SequenceGeometry, locate: Locate) -> None:
        self._geometry, self._locate = geometry, locate
        self._count = 0
        self._points = np.empty((_LEAST_CAPACITY, 3))  # the first `_count` rows are in use
        self._status = np.empty(_LEAST_CAPACITY, np.int8)
        self._births: list[tuple[int, slice]] = []
        self._located: list[Located] = []

    def begin(self, index: int, points_world: NDArray[np.float64], status: NDArray[np.int8]) -> None:
        """Add tracks, (n, 3) world points and their status (n,), that begin in a frame."""
        rows = slice(self._count, self._count + len(status))
        self._count = rows.stop
        self._grow()
        self._points[rows], self._status[rows] = points_world, status
        self._births.append((index, rows))

    def anchor(self, tracks: NDArray[np.uint32], points_world: NDArray[np.float64], status: NDArray[np.int8]) -> None:
        """Give tracks that have begun other points."""
        self._points[tracks], self._status[tracks] = points_world, status

    def anchors(self, tracks: NDArray[np.uint32]) -> "Anchors":
        """World points (n, 3) of tracks, and their status (n,)."""
        return self._points[tracks], self._status[tracks]

    def locate(self, index: int, tracks: NDArray[np.uint32], anchors_uv: NDArray[np.float64]) -> None:
        """Add the true positions of tracks observed in a frame.

        The error of a track is exactly 0 where its point was taken from its own ray, without the rounding of the way to
        the point and back.

        `tracks`: (n,) uint32; `anchors_uv`: (n, 2) float64: pixel of this frame from which the point of a track was
        taken, px; NaN where it was taken from another frame.
        """
        projected, seen = self._locate(index, self._points[tracks])
        on_ray = np.abs(projected - anchors_uv).max(axis=1) < _ROUNDING_PX
        uv = np.where(on_ray[:, np.newaxis], anchors_uv, projected)
        status = self._status[tracks]
        by_frame = (status == TruthStatus.valid) | (seen == TruthStatus.no_pose)
        self._located.append((uv, np.where(by_frame, seen, status)))

    def positions(self) -> TruePositions:
        """True positions in all frames, in the order in which they were located."""
        depth_m = [self._geometry.seen(index, self._points[rows])[1][:, 2] for index, rows in self._births]
        return TruePositions(
            uv=np.concatenate([np.empty((0, 2)), *(uv for uv, _ in self._located)]),
            status=np.concatenate([np.empty(0, np.int8), *(status for _, status in self._located)]),
            depth_m=np.concatenate([np.empty(0), *depth_m]),
        )

    def _grow(self) -> None:
        """Double the capacity where needed, so that adding tracks one by one takes linear time."""
        capacity = len(self._status)
        if self._count > capacity:
            more = max(self._count - capacity, capacity)
            self._points = np.concatenate([self._points, np.empty((more, 3))])
            self._status = np.concatenate([self._status, np.empty(more, np.int8)])


Anchors = tuple[NDArray[np.float64], NDArray[np.int8]]
"""World points (n, 3) float64, metres, NaN where the status is not valid; and their `TruthStatus`, (n,) int8."""

Anchor = Callable[[int, NDArray[np.float64]], Anchors]
"""Takes a frame and pixels (n, 2) of it; returns their anchors."""

Surround = Callable[[int, NDArray[np.float64]], Surroundings]
"""Takes a frame and pixels (n, 2) of it; returns what lies around them."""

DepthSigma = Callable[[int, NDArray[np.float64]], NDArray[np.float64]]
"""Takes a frame and pixels (n, 2) of it; returns standard deviations (n,) of their depths, metres, NaN if unknown."""


def anchor_points(
    geometry: SequenceGeometry,
    index: int,
    uv: NDArray[np.float64],
    depth_m: NDArray[np.float64],
    status: NDArray[np.int8],
) -> Anchors:
    """World points of features by their depth: X_w = world_from_camera pi^-1(x, Z), each by the pose of its own pixel.

    Shapes: uv (n, 2) px, depth_m (n,), status (n,); returns points_world (n, 3) m, status (n,). `points_world`: NaN
    where the status is not valid. `status`: as given. no_depth where the camera model gives the pixel no ray.
    """
    points = geometry.camera_at(index).unproject(uv, depth_m)
    blind = (status == TruthStatus.valid) & np.isnan(points).any(axis=1)
    status = np.where(blind, np.int8(TruthStatus.no_depth), status)
    points_world = geometry.to_world(index, uv, points)
    points_world[status != TruthStatus.valid] = np.nan
    return points_world, status


class AnchoredTruth:
    """A truth that gives each track one world point, taken from the track's first frame.

    All methods accept any number of features, including 0, and treat each feature independently. Calls for one frame
    should come together, as only the depth of the latest frame is kept. `surround`: None where there is no dense
    depth. `depth_sigma`: None where errors of depths are not known one by one. `note`: says what is to be known of the
    truth, once it was used.
    """

    __slots__ = ("_anchor", "_geometry", "_note", "_surface", "depth_sigma", "kind", "surround")

    def __init__(
        self,
        kind: str,
        geometry: SequenceGeometry,
        anchor: Anchor,
        surface: VisibleSurface,
        surround: Surround | None = None,
        depth_sigma: DepthSigma | None = None,
        note: Callable[[], str | None] = lambda: None,
    ) -> None:
        self.kind = kind
        self._note = note
        self.depth_sigma = depth_sigma
        self.surround = surround
        self._geometry = geometry
        self._anchor = anchor
        self._surface = surface

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be known of the truth, one sentence each; complete once it was used."""
        return tuple(filter(None, [self._note()]))

    @property
    def key_frame(self) -> int | None:
        """None: each track is anchored in its own first frame."""
        return None

    def positions_only(self) -> Self:
        """The same truth, which states neither surroundings nor errors of single depths."""
        part = copy(self)
        part.surround = part.depth_sigma = None
        return part

    def start(self) -> TruthSession:
        """Start a session for one tracker setup."""
        return BirthSession(self)

    def anchor(self, index: int, uv: NDArray[np.float64]) -> Anchors:
        """World points of features by their positions in a frame: see `anchor_points`; no_pose if it has none."""
        if not self._geometry.has_pose(index):
            return np.full((len(uv), 3), np.nan), np.full(len(uv), TruthStatus.no_pose, np.int8)
        return self._anchor(index, uv)

    def project(self, index: int, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions of (n, 3) world points in a frame, (n, 2) px: see `SequenceGeometry.project`."""
        return self._geometry.project(index, points_world)

    def displaced(
        self, index: int, points_world: NDArray[np.float64], by_px: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Points of the same depth beside (n, 3) world points in a frame: see `SequenceGeometry.displaced`."""
        return self._geometry.displaced(index, points_world, by_px)

    def locate(self, index: int, points_world: NDArray[np.float64]) -> Located:
        """Positions of (n, 3) world points in a frame, and whether the points can be seen: see `locate`."""
        return locate(self._geometry, self._surface, index, points_world)

    def tracks(self) -> AnchoredTracks:
        """No tracks yet; their positions will be those of this truth."""
        return AnchoredTracks(self._geometry, partial(locate, self._geometry, self._surface))


class BirthSession:
    """The tracks of one tracker setup, each anchored in its first frame."""

    __slots__ = ("_sigmas", "_surroundings", "_tracks", "_truth")

    def __init__(self, truth: AnchoredTruth) -> None:
        self._truth = truth
        self._surroundings: list[Surroundings] = []
        self._sigmas: list[NDArray[np.float64]] = []
        self._tracks = truth.tracks()

    def observe(self, index: int, tracks: NDArray[np.uint32], uv: NDArray[np.float64], born: NDArray[np.bool_]) -> None:
        """Anchor new tracks and locate all: see `tracknoise.truth.truth.TruthSession.observe`."""
        self._tracks.begin(index, *self._truth.anchor(index, uv[born]))
        new, surround = uv[born], self._truth.surround
        surroundings = unknown_surroundings(len(new)) if surround is None or not len(new) else surround(index, new)
        self._surroundings.append(surroundings)
        if self._truth.depth_sigma is not None:
            self._sigmas.append(self._truth.depth_sigma(index, new))
        self._tracks.locate(index, tracks, np.where(born[:, np.newaxis], uv, np.nan))

    def anchors(self, tracks: NDArray[np.uint32]) -> Anchors:
        """World points (n, 3) of tracks, and their status (n,)."""
        return self._tracks.anchors(tracks)

    def resolve(self) -> TruePositions:
        """True positions of all observations: see `tracknoise.truth.truth.TruthSession.resolve`."""
        sigma_m = None if self._truth.depth_sigma is None else np.concatenate([np.empty(0), *self._sigmas])
        around = joined_surroundings(self._surroundings)
        return replace(self._tracks.positions(), surroundings=around, depth_sigma_m=sigma_m)
