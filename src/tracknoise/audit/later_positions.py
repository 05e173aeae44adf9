"""Positions of world points in later frames at given times of their rows, and how they change with corrections."""

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
from tracknoise.audit.small_turns import crossed, right_jacobian

if TYPE_CHECKING:
    from tracknoise.audit.optics import Optics


@dataclass(frozen=True, eq=False)
class LaterPositions:
    """pi(M^-1 T(t)^-1 X) of (audit.prediction), and its derivatives where they are asked for.

    Attributes
    ----------
    samples, corrections
        Observations, and what is changed in their truth.
    optics
        Corrected cameras of the later frames.
    points : (n, 3) float64
        X, metres.
    row_delay : (n,) float64
        Time of each row after that of its frame.
    """

    samples: AuditSamples
    corrections: Corrections
    optics: "Optics"
    points: NDArray[np.float64]
    row_delay: NDArray[np.float64]

    @cached_property
    def uv(self) -> NDArray[np.float64]:
        """Positions, (n, 2), px; NaN where there is none."""
        return self.optics.project(self._in_camera)

    @cached_property
    def pace(self) -> NDArray[np.float64]:
        """How positions change with the time of their rows, (n, 2), px per unit of time."""
        moving = self._moving
        carried = np.einsum("nij,nj->ni", self._from_world, moving.velocity)
        back = np.cross(moving.turning, self._on_sensor) + carried
        return np.asarray(-np.einsum("nij,nj->ni", self._by_sensor, back))

    def by(self, part: Part, points_by: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives by the numbers of a part at fixed times of the rows, (n, 2, numbers).

        Parameters
        ----------
        part
            Whose numbers.
        points_by : (n, 3, numbers) float64
            Derivatives of X.
        """
        of_points = self._by_world @ points_by
        match part:
            case Part.optics:
                return of_points + self.optics.by_optics(self._in_camera, self.uv)
            case Part.depth:
                return of_points
            case Part.rotation:
                turned = right_jacobian(-self.corrections.of(Parameter.mounting_rotation))
                return of_points + self._by_sensor @ crossed(self._from_mounting) @ turned
            case Part.translation:
                return of_points - self._by_sensor
            case Part.time:
                phase = self.samples.phase(self.samples.along_shutter(self.uv))
                return of_points + np.stack([self.pace, phase[:, None] * self.pace], axis=2)

    @cached_property
    def _moving(self) -> Moving:
        clock = self.corrections.number(Parameter.clock_offset)
        return self.samples.paths.moving(self.samples.now, clock + self.row_delay)

    @cached_property
    def _from_world(self) -> NDArray[np.float64]:
        return np.swapaxes(self._moving.rotation, 1, 2)

    @cached_property
    def _on_sensor(self) -> NDArray[np.float64]:
        """Points in the frame of the sensor that the poses belong to, (n, 3)."""
        return np.asarray(np.einsum("nij,nj->ni", self._from_world, self.points - self._moving.position))

    @cached_property
    def _from_mounting(self) -> NDArray[np.float64]:
        """From the camera to the points, in the axes of the sensor, (n, 3)."""
        return np.asarray(self._on_sensor - self.corrections.of(Parameter.mounting_translation))

    @cached_property
    def _in_camera(self) -> NDArray[np.float64]:
        return np.asarray(self._from_mounting @ self.corrections.mounting)

    @cached_property
    def _by_sensor(self) -> NDArray[np.float64]:
        """Derivatives of positions by points in the frame of the sensor, (n, 2, 3)."""
        return np.asarray(self.optics.by_point(self._in_camera) @ self.corrections.mounting.T)

    @cached_property
    def _by_world(self) -> NDArray[np.float64]:
        """Derivatives of positions by world points, (n, 2, 3)."""
        return np.asarray(self._by_sensor @ self._from_world)
