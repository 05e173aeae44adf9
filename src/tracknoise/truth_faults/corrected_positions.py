"""True positions as they would be if the stated truth were corrected, and how they change with each correction.

A feature is at pixel x0 of its first frame with depth Z. Its position in a later frame is
x = pi(M^-1 T(t)^-1 T(t0) M w g(Z) pi^-1(x0)), with 1 / g(Z) = 1 / (s Z + o) + q, w = 1 - k + k / |pi^-1(x0)| for the
kind of depth k, the intrinsics in pi, the mounting M of the camera on the sensor that the poses T belong to, and times
t = t_frame + readout ((v + 0.5) / H - 0.5): (audit.prediction). Poses T are corrected by (audit.motion). The row v
of a rolling shutter is that of the position itself, which is solved by Newton's method. Derivatives are computed when
they are asked for: most fits need few of them.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.cameras import Camera, Intrinsics
from tracknoise.geometry.projection import cross_matrices, projection_jacobian
from tracknoise.truth_faults.audit_samples import AuditSamples
from tracknoise.truth_faults.corrected_motion import CorrectedMotion, right_jacobian
from tracknoise.truth_faults.fault_parameters import PLACES, SLICES, Corrections, Parameter, Part

INTRINSIC = 4
"""Numbers of the optics: focal length, principal point in u and v, k1."""
_FOCAL, _CENTRE, _K1 = 0, slice(1, 3), 3


def has_k1(cameras: tuple[Intrinsics, ...]) -> bool:
    """Whether a first radial coefficient can be added to all cameras."""
    return all(isinstance(camera, Camera) for camera in cameras)


def corrected(camera: Intrinsics, theta: NDArray[np.float64]) -> Intrinsics:
    """The camera with corrected intrinsics; k1 is 0 where a lens has none."""
    scale = 1.0 + float(theta[SLICES[Parameter.focal_length]][0])
    u, v = theta[SLICES[Parameter.principal_point]].tolist()
    changed = replace(camera, fx=scale * camera.fx, fy=scale * camera.fy, cx=camera.cx + u, cy=camera.cy + v)
    more = float(theta[SLICES[Parameter.k1]][0])
    if more and isinstance(changed, Camera):
        first, *rest = changed.distortion or (0.0, 0.0, 0.0, 0.0)
        return replace(changed, distortion=(first + more, *rest))
    return changed


@dataclass(frozen=True, slots=True, eq=False)
class Optics:
    """Corrected cameras of n observations.

    Attributes
    ----------
    cameras
        The different ones.
    which : (n,) intp
        Place of each observation's camera among them.
    units : (4,) float64
        Derivatives are by the logarithm of the focal length; over its factor they are by the factor.
    """

    cameras: tuple[Intrinsics, ...]
    which: NDArray[np.intp]
    units: NDArray[np.float64]

    @classmethod
    def of(cls, stated: Sequence[Intrinsics], which: NDArray[np.intp], theta: NDArray[np.float64]) -> "Optics":
        """Stated cameras under corrections, the numbers of all parameters."""
        units = np.array([1.0 + theta[SLICES[Parameter.focal_length]][0], 1.0, 1.0, 1.0])
        return cls(tuple(corrected(camera, theta) for camera in stated), which, units)

    def each(
        self, shape: tuple[int, ...], function: Callable[..., NDArray[np.float64]], *arrays: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """What a function of a camera and of rows of arrays gives for all observations, (n, *shape)."""
        values = np.empty((len(self.which), *shape))
        with np.errstate(all="ignore"):
            if len(self.cameras) == 1:
                return function(self.cameras[0], *arrays)
            for number, camera in enumerate(self.cameras):
                rows = np.flatnonzero(self.which == number)
                if len(rows):
                    values[rows] = function(camera, *(array[rows] for array in arrays))
        return values


def _rays_by_optics(camera: Intrinsics, ray: NDArray[np.float64]) -> NDArray[np.float64]:
    derivatives = np.zeros((len(ray), 3, INTRINSIC))
    inverse = np.empty((len(ray), 2, 2))
    (a, b), (c, d) = np.moveaxis(projection_jacobian(camera, ray)[:, :, :2], 0, -1)
    area = a * d - b * c
    inverse[:, 0, 0], inverse[:, 0, 1], inverse[:, 1, 0], inverse[:, 1, 1] = d / area, -b / area, -c / area, a / area
    derivatives[:, :2] = -inverse @ _by_optics(camera, ray, camera.project(ray))
    return derivatives


def _by_optics(camera: Intrinsics, points: NDArray[np.float64], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives of pixels; that of the focal length is by the logarithm of both."""
    derivatives = np.zeros((len(points), 2, INTRINSIC))
    derivatives[:, :, _FOCAL] = uv - (camera.cx, camera.cy)
    derivatives[:, :, _CENTRE] = np.eye(2)
    if isinstance(camera, Camera):
        derivatives[:, :, _K1] = _by_k1(camera, points)
    return derivatives


def _by_k1(camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """F x r^2 / D: the first radial term; D is the denominator of the rational model."""
    xy = points[:, :2] / points[:, 2:]
    r2 = np.sum(xy * xy, axis=1, keepdims=True)
    k4, k5, k6 = camera.distortion[5:] if len(camera.distortion) == 8 else (0.0, 0.0, 0.0)
    return np.asarray(xy * (r2 / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))) * (camera.fx, camera.fy))


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """Points of n features at a stated depth of 1 m: w r with w = 1 - k + k / |r| (audit.prediction).

    Attributes
    ----------
    ray : (n, 3) float64
        r, with z = 1.
    kind
        k: 0 if depth is along the optical axis, 1 if it is along the ray.
    inverse, share : (n, 1) float64
        1 / |r|, and w.
    """

    ray: NDArray[np.float64]
    kind: float
    inverse: NDArray[np.float64]
    share: NDArray[np.float64]

    @classmethod
    def along(cls, ray: NDArray[np.float64], kind: float) -> "Sight":
        """Look along rays (n, 3) at depths of a kind."""
        inverse = 1.0 / np.linalg.norm(ray, axis=1, keepdims=True)
        return cls(ray, kind, inverse, 1.0 - kind + kind * inverse)

    @property
    def point(self) -> NDArray[np.float64]:
        """Points in the camera frame, (n, 3), metres."""
        return self.share * self.ray

    @property
    def by_kind(self) -> NDArray[np.float64]:
        """Derivatives of the points by the kind of depth, (n, 3)."""
        return (self.inverse - 1.0) * self.ray

    def by_optics(self, ray_by_optics: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of the points by the numbers of the optics, from those of the rays, both (n, 3, 4)."""
        if self.kind == 0.0:
            return np.asarray(self.share[:, :, None] * ray_by_optics)
        turned = np.einsum("ni,nij->nj", self.ray, ray_by_optics)
        shrinks = self.kind * (self.ray * self.inverse**3)[:, :, None] * turned[:, None, :]
        return np.asarray(self.share[:, :, None] * ray_by_optics - shrinks)


class WorldPoints:
    """T(t0) M w g(Z) pi^-1(x0) of (audit.prediction), and its derivatives where they are asked for.

    Attributes
    ----------
    points : (n, 3) float64
        World points, metres.
    """

    def __init__(self, samples: AuditSamples, corrections: Corrections, optics: Optics) -> None:
        """Locate the points of samples; `optics`: corrected cameras of their first frames."""
        self._samples, self._corrections, self._optics = samples, corrections, optics
        kept = samples.rays
        if optics.cameras not in kept:
            kept.clear()
            kept[optics.cameras] = optics.each((3,), Intrinsics.bearings, samples.uv_at_birth)
        self._sight = Sight.along(kept[optics.cameras], corrections.number(Parameter.ray_depth))
        scale = 1.0 + corrections.number(Parameter.depth_scale)
        self._in_line = scale * samples.depth + corrections.number(Parameter.depth_offset)  # s Z + o, (n,), metres
        bend = 1.0 + corrections.number(Parameter.inverse_depth_offset) * self._in_line
        self._depth = self._in_line / np.where(bend > 0.0, bend, np.nan)  # g(Z), (n,), metres
        self._in_camera = self._depth[:, None] * self._sight.point
        turned = self._in_camera @ corrections.mounting.T
        self._on_sensor = turned + corrections.of(Parameter.mounting_translation)  # where the poses belong to, (n, 3)
        row_delay = (samples.readout + corrections.of(Parameter.readout)) * samples.phase_at_birth
        self._motion = CorrectedMotion(samples.paths, corrections, samples.birth, row_delay)
        turned_on = np.einsum("nij,nj->ni", self._motion.rotation, self._on_sensor)
        self.points: NDArray[np.float64] = turned_on + self._motion.position

    def by(self, part: Part) -> NDArray[np.float64]:
        """Derivatives of the points by the numbers of a part, (n, 3, numbers)."""
        match part:
            case Part.optics:
                rays = self._optics.each((3, INTRINSIC), _rays_by_optics, self._sight.ray) / self._optics.units
                return self._to_world @ (self._depth[:, None, None] * self._sight.by_optics(rays))
            case Part.depth:
                return self._by_depth()
            case Part.rotation:
                turned = right_jacobian(self._corrections.of(Parameter.mounting_rotation)[None])
                return -self._to_world @ cross_matrices(self._in_camera) @ turned
            case Part.translation:
                return self._motion.rotation
            case Part.time:
                factors = self._motion.by_times(self._samples.phase_at_birth)
                return np.asarray(self._pace[:, :, None] * factors[:, None, :])
            case Part.path:
                turns, moves = self._motion.by_path()
                return moves - self._motion.rotation @ cross_matrices(self._on_sensor) @ turns

    def _by_depth(self) -> NDArray[np.float64]:
        steep = (self._depth / self._in_line)[:, None] ** 2 * self._sight.point
        bent = -(self._depth[:, None] ** 2) * self._sight.point
        moves = (self._samples.depth[:, None] * steep, steep, bent, self._depth[:, None] * self._sight.by_kind)
        return np.asarray(self._to_world @ np.stack(moves, axis=2))

    @property
    def _pace(self) -> NDArray[np.float64]:
        """How the points change with the time of their first row, (n, 3), metres per unit of time."""
        motion = self._motion
        turned = np.einsum("nij,nj->ni", motion.rotation, np.cross(motion.turning, self._on_sensor))
        return np.asarray(turned + motion.velocity)

    @cached_property
    def _to_world(self) -> NDArray[np.float64]:
        """Rotations from the camera to the world, (n, 3, 3)."""
        return _times(self._motion.rotation, self._corrections.mounting)


class LaterPositions:
    """pi(M^-1 T(t)^-1 X) of (audit.prediction), and its derivatives where they are asked for.

    Attributes
    ----------
    samples
        Observations.
    uv : (n, 2) float64
        Positions, px; NaN where there is none.
    """

    def __init__(
        self,
        samples: AuditSamples,
        corrections: Corrections,
        optics: Optics,
        points: NDArray[np.float64],
        row_delay: NDArray[np.float64],
    ) -> None:
        """See X, `points` (n, 3), metres, at the time of each row after that of its frame, `row_delay` (n,).

        `optics`: corrected cameras of the later frames.
        """
        self.samples, self._corrections, self._optics = samples, corrections, optics
        self._motion = CorrectedMotion(samples.paths, corrections, samples.now, row_delay)
        self._from_world = np.swapaxes(self._motion.rotation, 1, 2)
        # in the frame of the sensor that the poses belong to, and from the camera in the axes of the sensor, (n, 3)
        self._on_sensor = np.einsum("nij,nj->ni", self._from_world, points - self._motion.position)
        self._from_mounting = self._on_sensor - corrections.of(Parameter.mounting_translation)
        self._in_camera = self._from_mounting @ corrections.mounting
        self.uv = optics.each((2,), Intrinsics.project, self._in_camera)

    @cached_property
    def pace(self) -> NDArray[np.float64]:
        """How positions change with the time of their rows, (n, 2), px per unit of time."""
        carried = np.einsum("nij,nj->ni", self._from_world, self._motion.velocity)
        back = np.cross(self._motion.turning, self._on_sensor) + carried
        return np.asarray(-np.einsum("nij,nj->ni", self._by_points[0], back))

    def by(self, part: Part, points_by: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives by the numbers of a part at fixed times of the rows, (n, 2, numbers).

        Shapes: points_by (n, 3, numbers).
        """
        by_sensor, by_world = self._by_points
        of_points = by_world @ points_by
        match part:
            case Part.optics:
                changes = self._optics.each((2, INTRINSIC), _by_optics, self._in_camera, self.uv)
                return of_points + changes / self._optics.units
            case Part.depth:
                return of_points
            case Part.rotation:
                turned = right_jacobian(-self._corrections.of(Parameter.mounting_rotation)[None])
                return of_points + by_sensor @ cross_matrices(self._from_mounting) @ turned
            case Part.translation:
                return of_points - by_sensor
            case Part.time:
                phase = self.samples.phase(self.samples.along_shutter(self.uv))
                return of_points + self.pace[:, :, None] * self._motion.by_times(phase)[:, None, :]
            case Part.path:
                turns, moves = self._motion.by_path()
                back = cross_matrices(self._on_sensor) @ turns - self._from_world @ moves
                return of_points + by_sensor @ back

    @cached_property
    def _by_points(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Derivatives of positions by points in the frame of the sensor, and of the world, both (n, 2, 3)."""
        by_camera = self._optics.each((2, 3), projection_jacobian, self._in_camera)
        by_sensor = _times(by_camera, self._corrections.mounting.T)
        return by_sensor, by_sensor @ self._from_world


def _times(matrices: NDArray[np.float64], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Products of matrices (n, k, 3) with one other (3, 3), as those of all their rows at once."""
    return np.asarray((matrices.reshape(-1, 3) @ matrix).reshape(matrices.shape))


_ROWS_STEPS = 4
_ROWS_SOLVED = 1e-6
"""Largest error of a row before the last step, px, which needs no new slope."""


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """Corrected true positions, and their derivatives, which are computed when they are first asked for.

    Attributes
    ----------
    theta : (COUNT,) float64
        Numbers of all parameters.
    """

    theta: NDArray[np.float64]
    _world: WorldPoints
    _later: LaterPositions
    _readout: NDArray[np.float64]
    _by_part: dict[Part, NDArray[np.float64]] = field(default_factory=dict)

    @property
    def uv(self) -> NDArray[np.float64]:
        """Positions, (n, 2), px; NaN where there is none."""
        return self._later.uv

    def by(self, parameters: Iterable[Parameter]) -> NDArray[np.float64]:
        """Derivatives by the numbers of some parameters, in the order given, (n, 2, numbers)."""
        places = [PLACES[parameter] for parameter in parameters]
        for part, _ in places:
            if part not in self._by_part:
                at_fixed_times = self._later.by(part, self._world.by(part))
                self._by_part[part] = _with_rows(self._later, at_fixed_times, self._readout)
        columns = [self._by_part[part][:, :, columns] for part, columns in places]
        return np.concatenate([np.empty((*self.uv.shape, 0)), *columns], axis=2)


def predict(samples: AuditSamples, theta: NDArray[np.float64], near: Predicted | None = None) -> Predicted:
    """True positions of samples under corrections: (audit.prediction).

    `near`: what like corrections predict, from where rows of a rolling shutter are found sooner.
    """
    corrections = Corrections(theta)
    readout = samples.readout + corrections.of(Parameter.readout)
    at_birth, now = (Optics.of(samples.cameras, samples.camera[frame], theta) for frame in (samples.birth, samples.now))
    world = WorldPoints(samples, corrections, at_birth)
    later = partial(LaterPositions, samples, corrections, now, world.points)
    row_delay = _row_delay(later, samples, readout, near) if readout.any() else np.zeros(len(samples.age))
    return Predicted(theta, world, later(row_delay), readout)


def _row_delay(
    later: Callable[[NDArray[np.float64]], LaterPositions],
    samples: AuditSamples,
    readout: NDArray[np.float64],
    near: Predicted | None,
) -> NDArray[np.float64]:
    """Time of the row of each position after that of its frame, (n,)."""
    row, slope = samples.along_shutter(samples.stated), None
    if near is not None:
        of_near = samples.along_shutter(near.uv)
        row = np.where(np.isfinite(of_near), of_near, row)
    for _ in range(_ROWS_STEPS):
        positions = later(readout * samples.phase(row))
        wrong = samples.along_shutter(positions.uv) - row
        is_last = np.nanmax(np.abs(wrong), initial=0.0) < _ROWS_SOLVED
        if slope is None or not is_last:
            slope = _by_row(positions, readout) - 1.0
        row = row - wrong / slope
        if is_last:
            break
    return readout * samples.phase(row)


def _by_row(positions: LaterPositions, readout: NDArray[np.float64]) -> NDArray[np.float64]:
    """How the position along the rows changes with the row at whose time it is computed, (n,)."""
    return np.asarray(positions.samples.along_shutter(positions.pace) * readout / positions.samples.side)


def _with_rows(positions: LaterPositions, by: NDArray[np.float64], readout: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (n, 2, numbers) with the change of the row, from those at fixed times of the rows."""
    samples = positions.samples
    if not readout.any():
        return by
    divisor = 1.0 - _by_row(positions, readout)[:, None, None]
    of_row = np.take_along_axis(by, samples.axis[:, None, None], axis=1) / divisor
    return np.asarray(by + (readout / samples.side)[:, None, None] * positions.pace[:, :, None] * of_row)
