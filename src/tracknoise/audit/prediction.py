"""True positions as they would be if the stated truth were corrected, and how they change with the corrections.

A feature is at pixel x0 of its first frame with depth Z. Its position in a later frame is
x = pi(M^-1 T(t)^-1 T(t0) M w (s Z + o) pi^-1(x0)), with w = 1 - k + k / |pi^-1(x0)| for the kind of depth k, the
intrinsics in pi, the mounting M of the camera on the
sensor that the poses T belong to, and times t = t_frame + clock offset + readout ((v + 0.5) / H - 0.5):
(audit.prediction). The row v of a rolling shutter is that of the position itself, which is solved by Newton's method.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.audit.motion import Moving
from tracknoise.audit.optics import INTRINSIC, Projected, corrected, project, rays
from tracknoise.audit.parameters import COUNT, SLICES, Parameter
from tracknoise.audit.samples import AuditSamples
from tracknoise.audit.sight import sight

_ROWS_STEPS = 4
_ROWS_SOLVED = 1e-10
_ROTATION, _TRANSLATION = SLICES[Parameter.mounting_rotation], SLICES[Parameter.mounting_translation]
_SCALE, _OFFSET, _KIND = (SLICES[one] for one in (Parameter.depth_scale, Parameter.depth_offset, Parameter.ray_depth))
_CLOCK, _READOUT = SLICES[Parameter.clock_offset], SLICES[Parameter.readout]


@dataclass(frozen=True, slots=True)
class Predicted:
    """Corrected true positions.

    Attributes
    ----------
    uv : (n, 2) float64
        px; NaN where there is none.
    by_parameters : (n, 2, COUNT) float64
        Derivatives by the numbers of all parameters.
    """

    uv: NDArray[np.float64]
    by_parameters: NDArray[np.float64]


def predict(samples: AuditSamples, theta: NDArray[np.float64]) -> Predicted:
    """True positions of samples under corrections: (audit.prediction).

    Parameters
    ----------
    samples
        Observations, with what the truth states.
    theta : (COUNT,) float64
        Numbers of all parameters; zeros for the truth as stated.
    """
    at_birth = _AtBirth.of(samples, theta)
    readout = samples.readout + theta[_READOUT]
    if not readout.any():
        return _later(samples, theta, at_birth, np.zeros(len(samples.age))).predicted(readout)
    row = _axis(samples, samples.stated)
    for _ in range(_ROWS_STEPS):
        found = _later(samples, theta, at_birth, readout * samples.phase(row))
        wrong = _axis(samples, found.seen.uv) - row
        row = row - wrong / (found.by_row(readout) - 1.0)
        if np.nanmax(np.abs(wrong), initial=0.0) < _ROWS_SOLVED:
            break
    return _later(samples, theta, at_birth, readout * samples.phase(row)).predicted(readout)


@dataclass(frozen=True, slots=True)
class _AtBirth:
    """World points of features, and their derivatives."""

    points: NDArray[np.float64]
    by_parameters: NDArray[np.float64]

    @classmethod
    def of(cls, samples: AuditSamples, theta: NDArray[np.float64]) -> "_AtBirth":
        seen_by = sight(*_of_cameras_rays(samples, theta), float(theta[_KIND][0]))
        scale, offset = 1.0 + theta[_SCALE][0], theta[_OFFSET][0]
        depth = scale * samples.depth + offset
        points, mounting = depth[:, None] * seen_by.point, _matrix(theta)
        seen = points @ mounting.T + theta[_TRANSLATION]
        phase = samples.phase_at_birth
        delay = theta[_CLOCK][0] + (samples.readout + theta[_READOUT]) * phase
        moving = _moving(samples, samples.birth, delay)
        to_world = moving.rotation @ mounting
        by = np.zeros((len(depth), 3, COUNT))
        by[:, :, :INTRINSIC] = to_world @ (depth[:, None, None] * seen_by.by_optics)
        by[:, :, _SCALE] = to_world @ (samples.depth[:, None] * seen_by.point)[:, :, None]
        by[:, :, _OFFSET] = to_world @ seen_by.point[:, :, None]
        by[:, :, _KIND] = to_world @ (depth[:, None] * seen_by.by_kind)[:, :, None]
        by[:, :, _ROTATION] = -to_world @ _crossed(points) @ _right_jacobian(theta[_ROTATION])
        by[:, :, _TRANSLATION] = moving.rotation
        pace = np.einsum("nij,nj->ni", moving.rotation, np.cross(moving.turning, seen)) + moving.velocity
        by[:, :, _CLOCK], by[:, :, _READOUT] = pace[:, :, None], (phase[:, None] * pace)[:, :, None]
        return cls(np.einsum("nij,nj->ni", moving.rotation, seen) + moving.position, by)


@dataclass(frozen=True, slots=True)
class _Later:
    """Positions in later frames, at given times of their rows."""

    samples: AuditSamples
    seen: Projected
    by_parameters: NDArray[np.float64]
    pace: NDArray[np.float64]

    def by_row(self, readout: NDArray[np.float64]) -> NDArray[np.float64]:
        """How the position along the rows changes with the row at whose time it is computed, (n,)."""
        along = np.take_along_axis(self.pace, self.samples.axis[:, None], axis=1)[:, 0]
        moved: NDArray[np.float64] = along * readout / self.samples.side
        return moved

    def predicted(self, readout: NDArray[np.float64]) -> Predicted:
        """With the derivatives that include the change of the row."""
        axis = self.samples.axis[:, None, None]
        of_row = np.take_along_axis(self.by_parameters, axis, axis=1) / (1.0 - self.by_row(readout))[:, None, None]
        follows = (readout / self.samples.side)[:, None, None] * self.pace[:, :, None] * of_row
        return Predicted(self.seen.uv, self.by_parameters + follows)


def _later(
    samples: AuditSamples, theta: NDArray[np.float64], at_birth: _AtBirth, row_delay: NDArray[np.float64]
) -> _Later:
    moving = _moving(samples, samples.now, theta[_CLOCK][0] + row_delay)
    mounting = _matrix(theta)
    from_world = np.swapaxes(moving.rotation, 1, 2)
    there = np.einsum("nij,nj->ni", from_world, at_birth.points - moving.position)
    apart = there - theta[_TRANSLATION]
    seen = _of_cameras_seen(samples, theta, apart @ mounting)
    by_there = seen.by_point @ mounting.T
    by = by_there @ from_world @ at_birth.by_parameters
    by[:, :, :INTRINSIC] += seen.by_optics / _units_of_optics(theta)
    by[:, :, _ROTATION] += by_there @ _crossed(apart) @ _right_jacobian(-theta[_ROTATION])
    by[:, :, _TRANSLATION] -= by_there
    back = np.cross(moving.turning, there) + np.einsum("nij,nj->ni", from_world, moving.velocity)
    pace = -np.einsum("nij,nj->ni", by_there, back)
    by[:, :, _CLOCK] += pace[:, :, None]
    by[:, :, _READOUT] += (_phase_of(samples, seen) * pace)[:, :, None]
    return _Later(samples, seen, by, pace)


def _moving(samples: AuditSamples, frame: NDArray[np.intp], delay: NDArray[np.float64]) -> Moving:
    return samples.paths.at(frame, delay) if np.any(delay) else samples.paths.still(frame)


def _phase_of(samples: AuditSamples, seen: Projected) -> NDArray[np.float64]:
    return samples.phase(_axis(samples, seen.uv))[:, None]


def _axis(samples: AuditSamples, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinate of pixels (n, 2) along which the shutter moves."""
    return np.take_along_axis(uv, samples.axis[:, None], axis=1)[:, 0]


def _units_of_optics(theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """The focal length is a factor: its derivative is that by the logarithm over the factor."""
    return np.array([1.0 + theta[SLICES[Parameter.focal_length]][0], 1.0, 1.0, 1.0])


def _of_cameras_rays(
    samples: AuditSamples, theta: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    found, by_optics = np.empty((len(samples.age), 3)), np.empty((len(samples.age), 3, INTRINSIC))
    which = samples.camera[samples.birth]
    for number, camera in enumerate(samples.cameras):
        rows = np.flatnonzero(which == number)
        if len(rows):
            found[rows], by_optics[rows] = rays(corrected(camera, theta), samples.uv_at_birth[rows])
    return found, by_optics / _units_of_optics(theta)


def _of_cameras_seen(samples: AuditSamples, theta: NDArray[np.float64], points: NDArray[np.float64]) -> Projected:
    n = len(points)
    found = Projected(np.empty((n, 2)), np.empty((n, 2, 3)), np.empty((n, 2, INTRINSIC)))
    which = samples.camera[samples.now]
    for number, camera in enumerate(samples.cameras):
        rows = np.flatnonzero(which == number)
        if len(rows):
            one = project(corrected(camera, theta), points[rows])
            found.uv[rows], found.by_point[rows], found.by_optics[rows] = one.uv, one.by_point, one.by_optics
    return found


def _matrix(theta: NDArray[np.float64]) -> NDArray[np.float64]:
    turned: NDArray[np.float64] = Rotation.from_rotvec(theta[_ROTATION]).as_matrix()
    return turned


def _crossed(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3, 3): the matrices whose products with others are cross products with these vectors."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.asarray(np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), -1, 0))


def _right_jacobian(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """J with Exp(v + d) = Exp(v) Exp(J d) for small d: of rotation vectors (Sola et al. 2018, eq. 143)."""
    angle = float(np.linalg.norm(vector))
    cross = _crossed(vector[None])[0]
    if angle < 1e-4:
        return np.asarray(np.eye(3) - 0.5 * cross)
    first, second = (1.0 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) - first * cross + second * cross @ cross)
