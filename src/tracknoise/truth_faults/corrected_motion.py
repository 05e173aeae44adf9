"""Poses of cameras under corrections of their times and of the shape of their path, and how they change with these.

At the time t of a row, the corrected pose has the rotation R(t') Exp(d * w(t') - c w'(t')) and the position
p(t') - c p''(t'), with t' = t + clock offset + clock drift * u (audit.motion). u is the time of the frame after the
middle of its sequence, in units of half of the longest one. d is the delay of the rotation about each axis, and c the
smoothing. The angular velocity w and the second differences w' and p'' are those of the stated path.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.truth_faults.audit_samples import Moving, Paths
from tracknoise.truth_faults.fault_parameters import Corrections, Parameter

_SMALL_ANGLE = 1e-4


def crossed(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3, 3): the matrices whose products with others are cross products with these vectors (n, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.asarray(np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), -1, 0))


def right_jacobian(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """J with Exp(v + d) = Exp(v) Exp(J d) for small d: of rotation vectors (n, 3), (n, 3, 3) (Sola 2018, eq. 143)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    cross, safe = crossed(vectors), np.maximum(angle, _SMALL_ANGLE)
    is_small = angle < _SMALL_ANGLE
    first = np.where(is_small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(is_small, 0.0, (safe - np.sin(safe)) / safe**3)
    return np.asarray(np.eye(3) - first * cross + second * cross @ cross)


@dataclass(frozen=True, eq=False)
class CorrectedMotion:
    """Corrected poses of n rows, and their derivatives where they are asked for.

    Attributes
    ----------
    paths, corrections
        Stated poses, and what is changed in them.
    frame : (n,) intp
        Frame of each row.
    row_delay : (n,) float64
        Time of each row after that of its frame.
    """

    paths: Paths
    corrections: Corrections
    frame: NDArray[np.intp]
    row_delay: NDArray[np.float64]

    @cached_property
    def moving(self) -> Moving:
        """Corrected poses and velocities."""
        stated = self._stated
        if not self._delay.any() and self._smoothing == 0.0:
            return stated
        rates, change = self._rates
        turn = self._turn
        turned = Rotation.from_rotvec(turn).as_matrix()
        by_time = np.einsum("nij,nj->ni", right_jacobian(turn), self._delay * change[:, 0] - self._smoothing * change[:, 1])
        return Moving(
            stated.rotation @ turned,
            stated.position - self._smoothing * rates[:, 2],
            np.einsum("nji,nj->ni", turned, stated.turning) + by_time,
            stated.velocity - self._smoothing * change[:, 2],
        )

    def by_times(self, phase: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of the times by clock offset, clock drift and readout, (n, 3). `phase` : (n,), of each row."""
        return np.stack([np.ones(len(phase)), self._from_middle, phase], axis=1)

    def by_path(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Turns in the own frame, and moves in the world, for delays of the rotation and smoothing, both (n, 3, 4)."""
        rates, _ = self._rates
        turns, moves = np.zeros((2, len(self.frame), 3, 4))
        turns[:, range(3), range(3)], turns[:, :, 3] = rates[:, 0], -rates[:, 1]
        moves[:, :, 3] = -rates[:, 2]
        return (right_jacobian(self._turn) @ turns if self._turn.any() else turns), moves

    @cached_property
    def _turn(self) -> NDArray[np.float64]:
        """Rotation vectors of the corrections in the own frame, (n, 3)."""
        rates, _ = self._rates
        return np.asarray(self._delay * rates[:, 0] - self._smoothing * rates[:, 1])

    @property
    def _delay(self) -> NDArray[np.float64]:
        return self.corrections.of(Parameter.rotation_delay)

    @property
    def _smoothing(self) -> float:
        return self.corrections.number(Parameter.smoothing)

    @cached_property
    def _from_middle(self) -> NDArray[np.float64]:
        return self.paths.from_middle(self.frame)

    @cached_property
    def _clock(self) -> NDArray[np.float64]:
        """Time of each corrected pose after that of its frame, (n,)."""
        offset = self.corrections.number(Parameter.clock_offset) + self.row_delay
        drift = self.corrections.number(Parameter.clock_drift)
        return np.asarray(offset + drift * self._from_middle if drift else offset)

    @cached_property
    def _stated(self) -> Moving:
        return self.paths.moving(self.frame, self._clock)

    @cached_property
    def _rates(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self.paths.rates_at(self.frame, self._clock)
