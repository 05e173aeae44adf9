"""World points of features, from where they were found, and how they change with corrections."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.corrections import Corrections
from tracknoise.audit.motion import Moving
from tracknoise.audit.parameters import Parameter
from tracknoise.audit.parts import Part
from tracknoise.audit.samples import AuditSamples
from tracknoise.audit.sight import Sight
from tracknoise.audit.small_turns import crossed, right_jacobian

if TYPE_CHECKING:
    from tracknoise.audit.optics import Optics


@dataclass(frozen=True, eq=False)
class WorldPoints:
    """T(t0) M w (s Z + o) pi^-1(x0) of (audit.prediction), and its derivatives where they are asked for.

    Attributes
    ----------
    samples, corrections
        Observations, and what is changed in their truth.
    optics
        Corrected cameras of the first frames.
    """

    samples: AuditSamples
    corrections: Corrections
    optics: "Optics"

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """World points, (n, 3), metres."""
        return np.asarray(np.einsum("nij,nj->ni", self._moving.rotation, self._on_sensor) + self._moving.position)

    def by(self, part: Part) -> NDArray[np.float64]:
        """Derivatives of the points by the numbers of a part, (n, 3, numbers)."""
        match part:
            case Part.optics:
                rays = self.optics.rays_by_optics(self._sight.ray)
                return self._to_world @ (self._depth[:, None, None] * self._sight.by_optics(rays))
            case Part.depth:
                return self._by_depth()
            case Part.rotation:
                turned = right_jacobian(self.corrections.of(Parameter.mounting_rotation))
                return -self._to_world @ crossed(self._in_camera) @ turned
            case Part.translation:
                return self._moving.rotation
            case Part.time:
                return self._by_time()

    def _by_depth(self) -> NDArray[np.float64]:
        stated, point = self.samples.depth[:, None], self._sight.point
        moves = (stated * point, point, self._depth[:, None] * self._sight.by_kind)
        return np.concatenate([self._to_world @ move[:, :, None] for move in moves], axis=2)

    def _by_time(self) -> NDArray[np.float64]:
        moving = self._moving
        turned = np.einsum("nij,nj->ni", moving.rotation, np.cross(moving.turning, self._on_sensor))
        pace = turned + moving.velocity
        return np.stack([pace, self.samples.phase_at_birth[:, None] * pace], axis=2)

    @cached_property
    def _sight(self) -> Sight:
        ray = self.optics.rays(self.samples.uv_at_birth)
        return Sight.along(ray, self.corrections.number(Parameter.ray_depth))

    @cached_property
    def _depth(self) -> NDArray[np.float64]:
        scale = 1.0 + self.corrections.number(Parameter.depth_scale)
        return np.asarray(scale * self.samples.depth + self.corrections.number(Parameter.depth_offset))

    @cached_property
    def _in_camera(self) -> NDArray[np.float64]:
        return np.asarray(self._depth[:, None] * self._sight.point)

    @cached_property
    def _on_sensor(self) -> NDArray[np.float64]:
        """Points in the frame of the sensor that the poses belong to, (n, 3)."""
        turned = self._in_camera @ self.corrections.mounting.T
        return np.asarray(turned + self.corrections.of(Parameter.mounting_translation))

    @cached_property
    def _moving(self) -> Moving:
        samples, clock = self.samples, self.corrections.number(Parameter.clock_offset)
        readout = samples.readout + self.corrections.of(Parameter.readout)
        return samples.paths.moving(samples.birth, clock + readout * samples.phase_at_birth)

    @cached_property
    def _to_world(self) -> NDArray[np.float64]:
        """Rotations from the camera to the world, (n, 3, 3)."""
        return np.asarray(self._moving.rotation @ self.corrections.mounting)
