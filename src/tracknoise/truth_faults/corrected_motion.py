"""Poses of cameras under corrections of their times and of the shape of their path, and how they change with these.

At the time t of a row, the corrected pose has the rotation R(t') Exp(l - c R'') and the position p(t') - c p'', with
t' = t + clock offset + clock drift * u (audit.motion). u is the time of the frame after the middle of its sequence, in
units of half of the longest one. l_i = Log(R(t')^T R(t' + d_i))_i for the delay d_i of the rotation about axis i. c is
the smoothing, and R'' and p'' are the second differences of the stated path at t'.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.projection import cross_matrices
from tracknoise.truth_faults.audit_samples import Moving, Paths, steps
from tracknoise.truth_faults.fault_parameters import Corrections, Parameter

_SMALL_ANGLE = 1e-4


def right_jacobian(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """J with Exp(v + d) = Exp(v) Exp(J d) for small d: of rotation vectors (n, 3), (n, 3, 3) (Sola 2018, eq. 143)."""
    first, second = (coefficient[:, :, None] for coefficient in _coefficients(vectors))
    cross = cross_matrices(vectors)
    return np.asarray(np.eye(3) - first * cross + second * cross @ cross)


def _turned(vectors: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """`right_jacobian` times other vectors, (n, 3)."""
    first, second = _coefficients(vectors)
    cross = _cross(vectors, others)
    return np.asarray(others - first * cross + second * _cross(vectors, cross))


def _coefficients(vectors: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Factors of one and of two cross products in `right_jacobian`, (n, 1)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None]
    safe = np.maximum(angle, _SMALL_ANGLE)
    is_small = angle < _SMALL_ANGLE
    first = np.where(is_small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(is_small, 0.0, (safe - np.sin(safe)) / safe**3)
    return first, second


def _undone(vectors: NDArray[np.float64], turned: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of `right_jacobian` times other vectors, (n, 3) (Sola 2018, eq. 144)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None]
    safe = np.maximum(angle, _SMALL_ANGLE)
    bent = 1.0 / safe**2 - (1.0 + np.cos(safe)) / (2.0 * safe * np.sin(safe))
    second = np.where(angle < _SMALL_ANGLE, 1.0 / 12.0, bent)
    cross = _cross(vectors, turned)
    return np.asarray(turned + 0.5 * cross + second * _cross(vectors, cross))


def _of_axes(vectors: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """The number of each axis from the vectors of that axis, (n, 3) each."""
    return np.stack([of_axis[:, axis] for axis, of_axis in enumerate(vectors)], axis=1)


def _cross(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cross products of vectors (n, 3), in a third of the time of `numpy.cross`."""
    (x, y, z), (a, b, c) = one.T, other.T
    return np.stack([y * c - z * b, z * a - x * c, x * b - y * a], axis=1)


class CorrectedMotion:
    """Corrected poses of n rows, and their derivatives where they are asked for.

    What rows of a frame have in common is computed once for each frame, where they have no times of their own.
    """

    def __init__(
        self, paths: Paths, corrections: Corrections, frame: NDArray[np.intp], row_delay: NDArray[np.float64]
    ) -> None:
        """Correct stated poses: `frame` (n,), of each row; `row_delay` (n,), time of each after that of its frame."""
        self._paths = paths
        self._frame, self._row = _once_each(frame, row_delay, len(paths.times))
        self._delays = corrections.of(Parameter.rotation_delay)
        self._smoothing = corrections.number(Parameter.smoothing)
        self._is_stated = not self._delays.any() and self._smoothing == 0.0  # whether the shape of the path is
        offset, drift = (corrections.number(parameter) for parameter in (Parameter.clock_offset, Parameter.clock_drift))
        self._from_middle = paths.from_middle(self._frame)
        delay = offset + (row_delay if self._row is None else np.zeros(len(self._frame)))
        self._clock = delay + drift * self._from_middle if drift else delay  # time of each pose after its frame
        self._stated = paths.at(self._frame, self._clock)

    @cached_property
    def rotation(self) -> NDArray[np.float64]:
        """Corrected rotations, (n, 3, 3)."""
        stated = self._stated.rotation
        return self._of_rows(stated if self._is_stated else stated @ self._turned)

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """Corrected positions, (n, 3), metres."""
        stated = self._stated.position
        return self._of_rows(stated if self._is_stated else stated - self._smoothing * self._bend[0][:, 1])

    @cached_property
    def turning(self) -> NDArray[np.float64]:
        """Angular velocities, (n, 3), see `Moving`."""
        stated = self._stated.turning
        if self._is_stated:
            return self._of_rows(stated)
        faster = self._delayed_by_time - self._smoothing * self._bend[1][:, 0]
        return self._of_rows(np.einsum("nji,nj->ni", self._turned, stated) + _turned(self._turn, faster))

    @cached_property
    def velocity(self) -> NDArray[np.float64]:
        """Velocities, (n, 3), see `Moving`."""
        stated = self._stated.velocity
        return self._of_rows(stated if self._is_stated else stated - self._smoothing * self._bend[1][:, 1])

    def by_times(self, phase: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of the times by clock offset, clock drift and readout, (n, 3). `phase` : (n,), of each row."""
        return np.stack([np.ones(len(phase)), self._of_rows(self._from_middle), phase], axis=1)

    def by_path(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Turns in the own frame, and moves in the world, for delays of the rotation and smoothing, both (n, 3, 4)."""
        bend, _ = self._bend
        turns, moves = np.zeros((2, len(self._frame), 3, 4))
        turns[:, range(3), range(3)], turns[:, :, 3] = self._delayed_by_delay, -bend[:, 0]
        moves[:, :, 3] = -bend[:, 1]
        turned = right_jacobian(self._turn) @ turns if self._turn.any() else turns
        return self._of_rows(turned), self._of_rows(moves)

    def _of_rows(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        return values if self._row is None else values[self._row]

    @cached_property
    def _turn(self) -> NDArray[np.float64]:
        """Rotation vectors of the corrections in the own frame, (n, 3)."""
        bend, _ = self._bend
        return np.asarray(_of_axes([turn for _, turn in self._delayed]) - self._smoothing * bend[:, 0])

    @cached_property
    def _turned(self) -> NDArray[np.float64]:
        """The same as matrices, (n, 3, 3)."""
        rotations: NDArray[np.float64] = Rotation.from_rotvec(np.nan_to_num(self._turn)).as_matrix()
        return rotations

    @cached_property
    def _delayed(self) -> list[tuple[Moving, NDArray[np.float64]]]:
        """Stated poses after the delay about each axis, and the rotation vectors to them, (n, 3), in the own frame."""
        stated = self._stated
        if not self._delays.any():
            return [(stated, np.zeros((len(self._frame), 3)))] * 3
        later = [self._paths.at(self._frame, self._clock + delay) for delay in self._delays]
        return [(moving, steps(stated.rotation, moving.rotation)) for moving in later]

    @cached_property
    def _delayed_by_delay(self) -> NDArray[np.float64]:
        """How the turn about each axis changes with its delay, (n, 3)."""
        if not self._delays.any():
            return self._stated.turning
        return _of_axes([_undone(turn, later.turning) for later, turn in self._delayed])

    @cached_property
    def _delayed_by_time(self) -> NDArray[np.float64]:
        """How it changes with time, (n, 3)."""
        if not self._delays.any():
            return np.zeros((len(self._frame), 3))
        before = _of_axes([_undone(-turn, self._stated.turning) for _, turn in self._delayed])
        return np.asarray(self._delayed_by_delay - before)

    @cached_property
    def _bend(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._paths.bend_at(self._frame, self._clock)


def _once_each(
    frame: NDArray[np.intp], row_delay: NDArray[np.float64], n_frames: int
) -> tuple[NDArray[np.intp], NDArray[np.intp] | None]:
    """Each frame once, and where rows are among these; all frames and None where rows have times of their own."""
    if row_delay.any():
        return frame, None
    used = np.bincount(frame, minlength=n_frames) > 0
    frames = np.flatnonzero(used)
    return (frame, None) if len(frames) == len(frame) else (frames, (np.cumsum(used) - 1)[frame])
