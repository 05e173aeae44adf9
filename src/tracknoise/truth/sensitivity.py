"""How true positions move with errors of poses, depth, clock, shutter and focal length.

A track is anchored in frame a, as a point X_a of its camera, and seen in frame f as X_f = R X_a + t. All derivatives
are taken of the true position in f. In f = a they are zero: there the true position is the observation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import Sequence, shutter_of, times_of
from tracknoise.truth.observed_cameras import ObservedCameras
from tracknoise.truth.truth import TruePositions

_QUARTERS = (90, 270)


@dataclass(frozen=True, slots=True, eq=False)
class AnchoredPoints:
    """Observations with a true position, their frames, and their points in the world.

    Attributes
    ----------
    anchor, frame : (n,) intp
        The frame in which the point was fixed, and the frame of the observation.
    points_world : (n, 3) float64
        Metres.
    """

    anchor: NDArray[np.intp]
    frame: NDArray[np.intp]
    points_world: NDArray[np.float64]

    def part(self, rows: slice) -> "AnchoredPoints":
        """Some of the observations."""
        return AnchoredPoints(self.anchor[rows], self.frame[rows], self.points_world[rows])


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Derivatives of n true positions.

    Attributes
    ----------
    translation : (n, 2, 3) float64
        By the translation of the relative pose, in the camera frame of f, px per metre.
    rotation_here, rotation_there : (n, 2, 3) float64
        By its rotation, about the camera of f and about that of a, px per radian.
    depth : (n, 2) float64
        By the depth in a, px per metre.
    depth_m : (n,) float64
        That depth, metres.
    clock, readout : (n, 2) float64
        By the clock offset and by the readout time, px per second; NaN in a sequence without times.
    focal : (n, 2) float64
        By the relative focal length, px.
    """

    translation: NDArray[np.float64]
    rotation_here: NDArray[np.float64]
    rotation_there: NDArray[np.float64]
    depth: NDArray[np.float64]
    depth_m: NDArray[np.float64]
    clock: NDArray[np.float64]
    readout: NDArray[np.float64]
    focal: NDArray[np.float64]


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
        found = Sensitivity(
            translation=by_point,
            rotation_here=np.cross(by_point, here[:, None]),
            rotation_there=np.cross(by_point, (here - moved)[:, None]),
            depth=_times(by_anchor, there / there[:, 2:]),
            depth_m=there[:, 2],
            clock=_times(by_anchor, flow_there) - _times(by_point, flow),
            readout=_times(by_anchor, flow_there * read_there) - _times(by_point, flow * read),
            focal=uv - cameras.centres() + _times(by_anchor, squeezed),
        )
        return _without_anchors(found, points.anchor == points.frame)

    def _flow(self, frame: NDArray[np.intp], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64: velocity that a pose gives to points of its camera frame, metres per second."""
        linear, angular = self._velocity[frame, :3], self._velocity[frame, 3:]
        return np.asarray(linear + np.cross(angular, points))

    def _read_at(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 1) float64: time of pixels after that of their frame, in readout times."""
        return self._shutter.phase(self._sequence.camera, uv)[:, None]


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


def _without_anchors(found: Sensitivity, at_anchor: NDArray[np.bool_]) -> Sensitivity:
    """The derivatives, exactly 0 in the frame of the anchor."""
    values = {name: getattr(found, name) for name in Sensitivity.__slots__}
    for name, value in values.items():
        if name != "depth_m":
            value[at_anchor] = 0.0
    return Sensitivity(**values)


def _body_velocity(poses: NDArray[np.float64], times_s: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """(n, 6) float64: linear and angular velocity in each camera's frame, per second; NaN where unknown.

    It is the central difference of the neighbouring frames with a pose.
    """
    velocity = np.full((len(poses), 6), np.nan)
    known = np.flatnonzero(has_pose(poses))
    if times_s is None or len(known) < 2:
        return velocity
    place = np.arange(len(known))
    before, after = known[np.maximum(place - 1, 0)], known[np.minimum(place + 1, len(known) - 1)]
    turned = Rotation.from_matrix(poses[before, :3, :3]).inv() * Rotation.from_matrix(poses[after, :3, :3])
    moved = np.einsum("nji,nj->ni", poses[known, :3, :3], poses[after, :3, 3] - poses[before, :3, 3])
    velocity[known] = np.hstack([moved, turned.as_rotvec()]) / (times_s[after] - times_s[before])[:, None]
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
    return rows, AnchoredPoints(anchor[track[rows]], frame[rows], points[track[rows]])
