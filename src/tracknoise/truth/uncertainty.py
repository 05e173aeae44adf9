"""How true positions move with errors of what the truth states, and their covariance.

A track is anchored in frame a, as a point X_a of its camera, and seen in frame f as X_f = R X_a + t. All derivatives
are taken of the true position in f. In f = a they are zero: there the true position is the observation.

With the derivatives by poses, depth, clock, shutter and focal length, and the variances r^2 and s^2 that
(accuracy.growth) gives the relative rotation and translation after k frames, the covariance of a true position is

    C = s^2 J J' + r^2 B B' + sigma_Z^2 d d' + sigma_c^2 c c' + sigma_r^2 q q' + sigma_f^2 g g'    (truth.floor)

It is zero in the frame of the anchor. A rotation acts about the camera in which it is wrong: B B' is the mean over both
cameras for errors of single poses, and over the straight line between them for errors that every step adds.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.projection import projection_jacobian
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import Sequence, camera_at, halves_of, shutter_of, times_of
from tracknoise.tables.enumerations import FloorSource
from tracknoise.truth.truth import TruePositions


@dataclass(frozen=True, slots=True, eq=False)
class ObservedCameras:
    """Projects points into the frames of observations, and gives rays through their pixels."""

    cameras: tuple[CameraModel, ...]  # all different cameras
    which: NDArray[np.intp]  # (n,) integers: place of the camera of each observation

    @classmethod
    def of(cls, sequence: Sequence, frames: NDArray[np.intp]) -> "ObservedCameras":
        """The cameras of observations in these frames, (n,), of a sequence."""
        cameras: list[CameraModel] = []
        numbers = np.zeros(int(frames.max(initial=-1)) + 1, np.intp)
        for index in np.unique(frames).tolist():
            camera = camera_at(sequence, index)
            if camera not in cameras:
                cameras.append(camera)
            numbers[index] = cameras.index(camera)
        return cls(tuple(cameras), numbers[frames])

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2) float64, px: points of the camera frames, (n, 3) float64; NaN where one has no image."""
        return self._each(lambda camera, rows: camera.project(points[rows]), 2)

    def bearings(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64: rays through pixels (n, 2), px, scaled to depth 1; NaN where a pixel has none."""
        return self._each(lambda camera, rows: camera.bearings(uv[rows]), 3)

    def contain(self, uv: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) bool: whether pixels (n, 2) lie in the image."""
        return self._each(lambda camera, rows: camera.contains(uv[rows])[:, None], 1)[:, 0] > 0

    def jacobians(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2, 3) float64, px per metre: see `projection_jacobian`; points of the camera frames, (n, 3) float64."""
        flat = self._each(lambda camera, rows: projection_jacobian(camera, points[rows]).reshape(-1, 6), 6)
        return flat.reshape(-1, 2, 3)

    def centres(self) -> NDArray[np.float64]:
        """(n, 2) float64, px: the images of the optical axes."""
        axis = np.array([[0.0, 0.0, 1.0]])
        return self._each(lambda camera, rows: np.repeat(camera.project(axis), len(rows), axis=0), 2)

    def chosen(self, rows: NDArray[np.intp]) -> "ObservedCameras":
        """The cameras of some of the observations."""
        return ObservedCameras(self.cameras, self.which[rows])

    def _each(
        self, compute: Callable[[CameraModel, NDArray[np.intp]], NDArray[np.generic]], width: int
    ) -> NDArray[np.float64]:
        """Values of each camera's observations, in their rows."""
        values = np.full((len(self.which), width), np.nan)
        for number, camera in enumerate(self.cameras):
            rows = np.flatnonzero(self.which == number)
            values[rows] = compute(camera, rows)
        return values


_QUARTERS = (90, 270)


@dataclass(frozen=True, slots=True, eq=False)
class AnchoredPoints:
    """Observations with a true position, their frames, and their points in the world."""

    # anchor, frame: (n,): the frame in which the point was fixed, and the frame of the observation
    anchor: NDArray[np.intp]
    frame: NDArray[np.intp]
    points_world: NDArray[np.float64]  # (n, 3): metres
    # (n,): standard deviation of the depth in `anchor`, metres; None where it follows from the stated accuracy
    depth_sigma_m: NDArray[np.float64] | None = None

    def part(self, rows: slice) -> "AnchoredPoints":
        """Some of the observations."""
        sigma_m = None if self.depth_sigma_m is None else self.depth_sigma_m[rows]
        return AnchoredPoints(self.anchor[rows], self.frame[rows], self.points_world[rows], sigma_m)


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Derivatives of n true positions."""

    # (n, 2, 3): by the translation of the relative pose, in the camera frame of f, px per metre
    translation: NDArray[np.float64]
    # rotation_here, rotation_there: (n, 2, 3): by its rotation, about the camera of f and about that of a, px per
    # radian
    rotation_here: NDArray[np.float64]
    rotation_there: NDArray[np.float64]
    depth: NDArray[np.float64]  # (n, 2): by the depth in a, px per metre
    depth_m: NDArray[np.float64]  # (n,): that depth, metres
    # clock, readout: (n, 2): by the clock offset and by the readout time, px per second; NaN in a sequence without
    # times
    clock: NDArray[np.float64]
    readout: NDArray[np.float64]
    focal: NDArray[np.float64]  # (n, 2): by the relative focal length, px
    # (n, 2): half of the difference of positions by two halves of what the poses are from, px; 0 without these
    halves: NDArray[np.float64]


class TruthDerivatives:
    """Poses, velocities and cameras of a sequence, to differentiate true positions.

    Parameters
    ----------
    sequence
        The sequence.
    """

    __slots__ = ("_poses", "_sequence", "_shutter", "_velocity")

    def __init__(self, sequence: Sequence) -> None:
        self._sequence, self._poses = sequence, sequence.world_from_camera
        self._velocity = _body_velocity(self._poses, times_of(sequence))
        self._shutter = RollingShutter(0.0, axis=_axis(sequence))

    @property
    def has_halves(self) -> bool:
        """Whether there are poses by two halves of what the poses are from."""
        return halves_of(self._sequence) is not None

    def sensitivity(self, points: AnchoredPoints) -> Sensitivity:
        """Derivatives of true positions by everything that may be wrong."""
        here_from_there = invert(self._poses[points.frame]) @ self._poses[points.anchor]
        there = transform(invert(self._poses[points.anchor]), points.points_world)
        here = transform(here_from_there, there)
        rotation, moved = here_from_there[:, :3, :3], here_from_there[:, :3, 3]
        cameras, cameras_there = (
            ObservedCameras.of(self._sequence, frames) for frames in (points.frame, points.anchor)
        )
        by_point = cameras.jacobians(here)
        by_anchor = by_point @ rotation
        uv, uv_there = cameras.project(here), cameras_there.project(there)
        flow, flow_there = self._flow(points.frame, here), self._flow(points.anchor, there)
        read, read_there = self._read_at(uv), self._read_at(uv_there)
        squeezed = _squeezed(cameras_there, there, uv_there)
        sensitivity = Sensitivity(
            translation=by_point,
            rotation_here=np.cross(by_point, here[:, None]),
            rotation_there=np.cross(by_point, (here - moved)[:, None]),
            depth=_times(by_anchor, there / there[:, 2:]),
            depth_m=there[:, 2],
            clock=_times(by_anchor, flow_there) - _times(by_point, flow),
            readout=_times(by_anchor, flow_there * read_there) - _times(by_point, flow * read),
            focal=uv - cameras.centres() + _times(by_anchor, squeezed),
            halves=self._by_halves(points, there, cameras),
        )
        return _without_anchors(sensitivity, points.anchor == points.frame)

    def _by_halves(
        self, points: AnchoredPoints, there: NDArray[np.float64], cameras: ObservedCameras
    ) -> NDArray[np.float64]:
        """(n, 2) float64, px: (refined.floor), of points (n, 3) in the camera of their anchor."""
        halves = halves_of(self._sequence)
        if halves is None:
            return np.zeros((len(there), 2))
        first, second = (_seen_by(poses, points, there, cameras) for poses in halves)
        return np.asarray((first - second) / 2.0)

    def _flow(self, frame: NDArray[np.intp], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64: velocity that a pose gives to points of its camera frame, metres per second."""
        linear, angular = self._velocity[frame, :3], self._velocity[frame, 3:]
        return np.asarray(linear + np.cross(angular, points))

    def _read_at(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 1) float64: time of pixels after that of their frame, in readout times."""
        return self._shutter.phase(self._sequence.camera, uv)[:, None]


def _seen_by(
    poses: NDArray[np.float64], points: AnchoredPoints, there: NDArray[np.float64], cameras: ObservedCameras
) -> NDArray[np.float64]:
    """(n, 2) float64, px: positions by poses (frames, 4, 4), of points (n, 3) in the camera of their anchor."""
    return cameras.project(transform(invert(poses[points.frame]) @ poses[points.anchor], there))


def moved_by(sequence: Sequence, points: AnchoredPoints, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) float64, px: positions by other poses (frames, 4, 4) less those by the poses of a sequence.

    Points keep their place in the camera of their anchor.
    """
    own_poses, cameras = sequence.world_from_camera, ObservedCameras.of(sequence, points.frame)
    there = transform(invert(own_poses[points.anchor]), points.points_world)
    return _seen_by(poses, points, there, cameras) - _seen_by(own_poses, points, there, cameras)


def _axis(sequence: Sequence) -> int:
    """Axis along which rows are read out: that of the shutter where there is one, otherwise of an upright camera."""
    shutter = shutter_of(sequence)
    if shutter is not None:
        return shutter.axis
    return 0 if sequence.id.rotation in _QUARTERS else 1


def _times(jacobian: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) float64: jacobians (n, 2, 3) by vectors (n, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", jacobian, vectors))


def _squeezed(cameras: ObservedCameras, points: NDArray[np.float64], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) float64: how anchored points move with the relative focal length, at the same pixel and depth."""
    across = cameras.jacobians(points)[:, :, :2]
    moved = np.zeros_like(points)
    moved[:, :2] = np.linalg.solve(across, (cameras.centres() - uv)[:, :, None])[:, :, 0]
    return moved


def _without_anchors(sensitivity: Sensitivity, at_anchor: NDArray[np.bool_]) -> Sensitivity:
    """The derivatives, exactly 0 in the frame of the anchor."""
    values = {name: getattr(sensitivity, name) for name in Sensitivity.__slots__}
    for name, value in values.items():
        if name != "depth_m":
            value[at_anchor] = 0.0
    return Sensitivity(**values)


def _body_velocity(poses: NDArray[np.float64], times_s: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """(n, 6) float64: linear and angular velocity in each camera's frame, per second; NaN where unknown.

    It is the central difference of the neighbouring frames with a pose.
    """
    velocity = np.full((len(poses), 6), np.nan)
    posed = np.flatnonzero(has_pose(poses))
    if times_s is None or len(posed) < 2:
        return velocity
    place = np.arange(len(posed))
    before, after = posed[np.maximum(place - 1, 0)], posed[np.minimum(place + 1, len(posed) - 1)]
    turned = Rotation.from_matrix(poses[before, :3, :3]).inv() * Rotation.from_matrix(poses[after, :3, :3])
    moved = np.einsum("nji,nj->ni", poses[posed, :3, :3], poses[after, :3, 3] - poses[before, :3, 3])
    velocity[posed] = np.hstack([moved, turned.as_rotvec()]) / (times_s[after] - times_s[before])[:, None]
    return velocity


def anchored_points(
    sequence: Sequence,
    frame: NDArray[np.intp],
    track: NDArray[np.intp],
    positions: TruePositions,
    *,
    key_frame: int | None,
) -> tuple[NDArray[np.intp], AnchoredPoints]:
    """The points of observations whose true position and depth are known.

    Parameters
    ----------
    sequence
        The sequence.
    frame, track
        (n,) intp: of each observation, in the order of frames.
    positions
        Their true positions.
    key_frame
        The frame in which all points are fixed; None where each is fixed in the first frame of its track.

    Returns
    -------
    rows : (m,) intp
        Those observations.
    points
        Of these.
    """
    first = np.zeros(len(positions.depth_m), np.intp)
    first[track[::-1]] = np.arange(len(track))[::-1]
    births = frame[first]
    cameras = ObservedCameras.of(sequence, births)
    rays = cameras.bearings(positions.uv[first])
    poses = sequence.world_from_camera[births]
    points = np.einsum("nij,nj->ni", poses[:, :3, :3], rays * positions.depth_m[:, None]) + poses[:, :3, 3]
    anchor = births if key_frame is None else np.full(len(births), key_frame, np.intp)
    located = np.isfinite(points).all(axis=1) & has_pose(sequence.world_from_camera)[anchor]
    rows = np.flatnonzero(located[track] & np.isfinite(positions.uv).all(axis=1))
    sigma_m = None if positions.depth_sigma_m is None else positions.depth_sigma_m[track[rows]]
    return rows, AnchoredPoints(anchor[track[rows]], frame[rows], points[track[rows]], sigma_m)


_ROWS_AT_ONCE = 1 << 15
"""Observations that are differentiated together: their derivatives stay in the cache."""

SOURCES: Mapping[FloorSource, tuple[str, ...]] = {
    FloorSource.poses: ("rotation", "translation"),
    FloorSource.depth: ("depth",),
    FloorSource.clock: ("clock",),
    FloorSource.readout: ("readout",),
    FloorSource.focal: ("focal",),
}
"""Sources of errors of true positions, and the topics of an accuracy that state their size."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseLaws:
    """Standard deviations of the errors of poses, for three translations (metres) and three rotations (rad)."""

    # white, walk, drift: (6,): as in `tracknoise.geometry.accuracy.GrowthLaw`, per frame of the sequence
    white: NDArray[np.float64]
    walk: NDArray[np.float64]
    drift: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """Errors of n true positions, each source by itself."""

    covariance: Mapping[FloorSource, NDArray[np.float64]]  # by source, px^2
    # (n, 2, 6): derivative by translation and rotation of the relative pose, px per metre and px per radian
    by_pose: NDArray[np.float64]
    # By source other than the poses: displacement by one standard deviation, px. That of depth is independent from
    # track to track. All others have the same sign in the whole recording.
    moved_px: Mapping[FloorSource, NDArray[np.float64]]


class TrueErrors:
    """Uncertainty of the true positions of a sequence.

    Parameters
    ----------
    derivatives
        Of the true positions.
    accuracy
        Of the truth.
    step
        Frames of the recording from one frame of the sequence to the next.
    own_depth
        Whether the points bring the errors of their depths.
    """

    __slots__ = ("_accuracy", "_derivatives", "_has_halves", "_step", "own_depth", "sources")

    def __init__(
        self, derivatives: "TruthDerivatives", accuracy: TruthAccuracy, *, step: int, own_depth: bool = False
    ) -> None:
        self._derivatives, self._accuracy, self._step, self.own_depth = derivatives, accuracy, step, own_depth
        self._has_halves = derivatives.has_halves
        topics = accuracy.topics | ({"depth"} if own_depth else set()) | ({"rotation"} if self._has_halves else set())
        self.sources = tuple(source for source in SOURCES if not topics.isdisjoint(SOURCES[source]))

    @property
    def is_exact(self) -> bool:
        """Whether all that is known about the truth is that it has no errors."""
        return self._accuracy.is_exact and not self.own_depth and not self._has_halves

    @property
    def pose_laws(self) -> PoseLaws:
        """Laws of the errors of poses."""
        laws = self._accuracy.translation, self._accuracy.rotation
        return PoseLaws(
            white=np.repeat([law.white for law in laws], 3),
            walk=np.repeat([law.walk * np.sqrt(self._step) for law in laws], 3),
            drift=np.repeat([law.drift * self._step for law in laws], 3),
        )

    def of(self, points: "AnchoredPoints") -> Iterator[tuple[slice, Uncertainty]]:
        """The uncertainty of observations, some at a time."""
        for start in range(0, len(points.frame), _ROWS_AT_ONCE):
            rows = slice(start, start + _ROWS_AT_ONCE)
            part = points.part(rows)
            yield rows, self._uncertainty(part, self._derivatives.sensitivity(part))

    def _uncertainty(self, points: "AnchoredPoints", sensitivity: "Sensitivity") -> Uncertainty:
        moved = {
            source: movement(sensitivity)
            for source, movement in self._movements(points.depth_sigma_m).items()
            if source in self.sources
        }
        covariance = {source: _outer(px[:, :, None]) for source, px in moved.items()}
        if FloorSource.poses in self.sources and not self._has_halves:
            lag = self._step * np.abs(points.frame - points.anchor).astype(np.float64)
            covariance[FloorSource.poses] = self._of_poses(sensitivity, lag)
        turned = (sensitivity.rotation_here + sensitivity.rotation_there) / 2.0
        return Uncertainty(covariance, np.concatenate([sensitivity.translation, turned], axis=2), moved)

    def _movements(
        self, depth_sigma_m: NDArray[np.float64] | None
    ) -> Mapping[FloorSource, Callable[["Sensitivity"], NDArray[np.float64]]]:
        """Displacement by one standard deviation of each source that has one, px."""
        accuracy = self._accuracy
        clock_s, readout_s = (1e-3 * (value or 0.0) for value in (accuracy.clock_ms, accuracy.readout_ms))
        halves: dict[FloorSource, Callable[[Sensitivity], NDArray[np.float64]]] = {}
        if self._has_halves:
            halves[FloorSource.poses] = lambda sensitivity: sensitivity.halves
        return halves | {
            FloorSource.depth: lambda sensitivity: (
                sensitivity.depth
                * (accuracy.depth.sigma_m(sensitivity.depth_m) if depth_sigma_m is None else depth_sigma_m)[:, None]
            ),
            FloorSource.clock: lambda sensitivity: sensitivity.clock * clock_s,
            FloorSource.readout: lambda sensitivity: sensitivity.readout * readout_s,
            FloorSource.focal: lambda sensitivity: sensitivity.focal * (accuracy.focal_relative or 0.0),
        }

    def _of_poses(self, sensitivity: "Sensitivity", lag: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2, 2) float64: covariance by relative poses `lag` frames of the recording apart, px^2."""
        rotation, translation = self._accuracy.rotation, self._accuracy.translation
        here, there = sensitivity.rotation_here, sensitivity.rotation_there
        ends = (_outer(here) + _outer(there)) / 2.0
        line = ends - _outer(here - there) / 6.0
        moved = translation.variance(lag)[:, None, None] * _outer(sensitivity.translation)
        single = np.where(lag > 0.0, 2.0 * rotation.white**2, 0.0)
        stepwise = rotation.variance(lag) - single
        return moved + single[:, None, None] * ends + stepwise[:, None, None] * line


def _outer(factors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2, 2) float64: B B' of (n, 2, m) float64."""
    return np.asarray(factors @ np.swapaxes(factors, 1, 2))
