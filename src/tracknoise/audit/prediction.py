"""True positions as they would be if the stated truth were corrected, and how they change with the corrections.

A feature is at pixel x0 of its first frame with depth Z. Its position in a later frame is
x = pi(M^-1 T(t)^-1 T(t0) M w (s Z + o) pi^-1(x0)), with w = 1 - k + k / |pi^-1(x0)| for the kind of depth k, the
intrinsics in pi, the mounting M of the camera on the sensor that the poses T belong to, and times
t = t_frame + clock offset + readout ((v + 0.5) / H - 0.5): (audit.prediction). The row v
of a rolling shutter is that of the position itself, which is solved by Newton's method. Derivatives are computed when
they are asked for: most fits need few of them.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.corrections import Corrections
from tracknoise.audit.later_positions import LaterPositions
from tracknoise.audit.optics import Optics
from tracknoise.audit.parameters import Parameter
from tracknoise.audit.parts import PLACES, Part
from tracknoise.audit.samples import AuditSamples
from tracknoise.audit.world_points import WorldPoints

_ROWS_STEPS = 4
_ROWS_SOLVED = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """Corrected true positions, and their derivatives, which are computed when they are first asked for."""

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
        places = [PLACES[one] for one in parameters]
        columns = [self._by(part)[:, :, columns] for part, columns in places]
        return np.concatenate([np.empty((*self.uv.shape, 0)), *columns], axis=2)

    def _by(self, part: Part) -> NDArray[np.float64]:
        if part not in self._by_part:
            at_fixed_times = self._later.by(part, self._world.by(part))
            self._by_part[part] = _with_rows(self._later, at_fixed_times, self._readout)
        return self._by_part[part]


def predict(samples: AuditSamples, theta: NDArray[np.float64]) -> Predicted:
    """True positions of samples under corrections: (audit.prediction).

    Parameters
    ----------
    samples
        Observations, with what the truth states.
    theta : (COUNT,) float64
        Numbers of all parameters; zeros for the truth as stated.
    """
    corrections = Corrections(theta)
    readout = samples.readout + corrections.of(Parameter.readout)
    at_birth, now = (Optics.of(samples.cameras, samples.camera[frame], theta) for frame in (samples.birth, samples.now))
    world = WorldPoints(samples, corrections, at_birth)

    def at(row_delay: NDArray[np.float64]) -> LaterPositions:
        return LaterPositions(samples, corrections, now, world.points, row_delay)

    row_delay = _row_delay(at, samples, readout) if readout.any() else np.zeros(len(samples.age))
    return Predicted(world, at(row_delay), readout)


def _row_delay(
    at: Callable[[NDArray[np.float64]], LaterPositions], samples: AuditSamples, readout: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Time of the row of each position after that of its frame, (n,)."""
    row = samples.along_shutter(samples.stated)
    for _ in range(_ROWS_STEPS):
        found = at(readout * samples.phase(row))
        wrong = samples.along_shutter(found.uv) - row
        row = row - wrong / (_by_row(found, readout) - 1.0)
        if np.nanmax(np.abs(wrong), initial=0.0) < _ROWS_SOLVED:
            break
    return readout * samples.phase(row)


def _by_row(found: LaterPositions, readout: NDArray[np.float64]) -> NDArray[np.float64]:
    """How the position along the rows changes with the row at whose time it is computed, (n,)."""
    return np.asarray(found.samples.along_shutter(found.pace) * readout / found.samples.side)


def _with_rows(found: LaterPositions, by: NDArray[np.float64], readout: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (n, 2, numbers) with the change of the row, from those at fixed times of the rows."""
    samples = found.samples
    if not readout.any():
        return by
    own = 1.0 - _by_row(found, readout)[:, None, None]
    of_row = np.take_along_axis(by, samples.axis[:, None, None], axis=1) / own
    return np.asarray(by + (readout / samples.side)[:, None, None] * found.pace[:, :, None] * of_row)
