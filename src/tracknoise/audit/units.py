"""Parameters in units that engineers use, beside their stated values."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.parameters import NUMBERS, TIMED, Parameter
from tracknoise.audit.samples import AuditSamples
from tracknoise.geometry.camera import Camera

_MS = 1000.0


@dataclass(frozen=True, slots=True)
class Shown:
    """How a parameter is shown: value = stated + factor * number of the fit.

    Attributes
    ----------
    unit
        px, deg, m, ms, frames, or empty.
    stated
        What the truth states, of each component.
    factor
        Unit of the fit in this unit.
    """

    unit: str
    stated: tuple[float, ...]
    factor: float

    def values(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Corrected values for numbers of the fit."""
        found: NDArray[np.float64] = np.array(self.stated) + self.factor * numbers
        return found


def shown(samples: AuditSamples, parameter: Parameter) -> Shown:
    """Unit and stated value of a parameter; factors and shifts where cameras differ."""
    camera = samples.cameras[0] if len(samples.cameras) == 1 else None
    nothing = (0.0,) * NUMBERS[parameter].count
    if parameter is Parameter.focal_length:
        return Shown("px", (camera.fx,), camera.fx) if camera else Shown("", (1.0,), 1.0)
    if parameter is Parameter.principal_point:
        return Shown("px", (camera.cx, camera.cy) if camera else nothing, 1.0)
    if parameter is Parameter.k1:
        known = isinstance(camera, Camera) and camera.distortion
        return Shown("", (camera.distortion[0],) if known and isinstance(camera, Camera) else nothing, 1.0)
    if parameter in (Parameter.depth_scale, Parameter.ray_depth):
        return Shown("", (1.0 if parameter is Parameter.depth_scale else 0.0,), 1.0)
    if parameter is Parameter.mounting_rotation:
        return Shown("deg", nothing, float(np.degrees(1.0)))
    if parameter in TIMED:
        return _timed(samples, parameter)
    return Shown("m", nothing, 1.0)


def _timed(samples: AuditSamples, parameter: Parameter) -> Shown:
    """Milliseconds, or frames where times are unknown."""
    unit, factor = ("frames", 1.0) if samples.interval_s is None else ("ms", _MS * samples.interval_s)
    readout = float(np.median(samples.readout)) if parameter is Parameter.readout else 0.0
    return Shown(unit, (factor * readout,), factor)
