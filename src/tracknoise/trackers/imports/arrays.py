"""Imported tracks that are in memory."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tracknoise.exceptions import SettingsError, first_line
from tracknoise.trackers.imports.assign import Assignment
from tracknoise.trackers.imports.normalised import Normalised
from tracknoise.trackers.imports.pixels import PixelOrigin, Raster, Units
from tracknoise.trackers.imports.replay import ImportedTracker, subsampled
from tracknoise.trackers.imports.rows import Rows
from tracknoise.trackers.quality import is_quality_name
from tracknoise.trackers.tracker import SequenceContext

_PLACE = Path("imported arrays")


@dataclass(frozen=True, slots=True, eq=False)
class ImportedArrays:
    """Tracks in memory as settings of a tracker. `Imported.from_arrays` makes them.

    Parameters
    ----------
    rows
        Observations with frames.
    units
        What their positions are.
    """

    kind: ClassVar[str] = "imported"
    description: ClassVar[str] = "tracks of another front end, in memory"
    reports_causes: ClassVar[bool] = False

    rows: Rows
    units: Units = Units.pixels

    @classmethod
    def of(
        cls,
        track: ArrayLike,
        frame: ArrayLike,
        u_px: ArrayLike,
        v_px: ArrayLike,
        *,
        response: ArrayLike | None = None,
        quality: Mapping[str, ArrayLike] | None = None,
        units: str = Units.pixels,
    ) -> "ImportedArrays":
        """Make settings of arrays with one element per observation, in any order.

        Parameters
        ----------
        track, frame
            (n,) whole numbers: the track, and the index of the frame in the sequence, from 0.
        u_px, v_px
            (n,) finite numbers: the position; an integer is the centre of a pixel. With normalised units, x/z and y/z
            in the frame of the camera, without distortion.
        response
            (n,): response of the detector; NaN where unknown.
        quality
            (n,) each, by name: what the front end states about each observation; NaN where unknown.
        units
            ``pixels`` or ``normalised``.

        Raises
        ------
        SettingsError
            If an array has another length or type, an element is not finite, or the units are unknown.
        """
        if units not in tuple(Units):
            raise SettingsError(f"imported arrays: units {units!r}, expected one of {', '.join(Units)}")
        tracks = _whole("track", track)
        uv = np.column_stack([_finite("u_px", u_px, len(tracks)), _finite("v_px", v_px, len(tracks))])
        if not len(tracks):
            raise SettingsError("imported arrays: found no observation, expected at least one")
        _require_named(quality)
        rows = Rows(
            _PLACE,
            tracks,
            uv,
            frame=_whole("frame", frame, len(tracks)),
            line=np.arange(len(tracks)),
            has_lines=False,
            response=None if response is None else _numbers("response", response, len(tracks)).astype(np.float32),
            quality={
                name: _numbers(f"quality {name}", values, len(tracks)).astype(np.float32)
                for name, values in (quality or {}).items()
            },
        )
        return cls(rows, Units(units))

    def start(self, context: SequenceContext) -> ImportedTracker:
        """Report the tracks in one sequence at one speed.

        Raises
        ------
        DataError
            If a frame is not in the sequence, a track has two observations in one frame, or positions have other units.
        """
        raster = Normalised() if self.units is Units.normalised else Raster(PixelOrigin.centre)
        tracks, notes = Assignment(raster).tracks(self.rows, context)
        return ImportedTracker(tracks, notes + subsampled(context, every_speed=False))


def _require_named(quality: object) -> None:
    if not isinstance(quality, Mapping | None):
        found = f"quality of type {type(quality).__name__}"
        raise SettingsError(f"imported arrays: found {found}, expected a dictionary of arrays")
    for name in quality or {}:
        if not is_quality_name(name):
            raise SettingsError(f"imported arrays: found quality {name!r}, expected a name such as 'residual'")


def _numbers(name: str, values: ArrayLike, length: int | None = None) -> NDArray[np.float64]:
    found = _array(name, values)
    if found.dtype.kind not in "fiu":
        raise SettingsError(f"imported arrays: {name} is of type {found.dtype}, expected numbers")
    if found.ndim != 1 or length not in (None, len(found)):
        expected = "one axis" if length is None else f"shape ({length},) as track"
        raise SettingsError(f"imported arrays: {name} has shape {found.shape}, expected {expected}")
    return found.astype(np.float64)


def _array(name: str, values: ArrayLike) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except (TypeError, ValueError) as error:
        raise SettingsError(f"imported arrays: {name} is no array ({first_line(error)}), expected numbers") from error


def _finite(name: str, values: ArrayLike, length: int | None = None) -> NDArray[np.float64]:
    found = _numbers(name, values, length)
    bad = np.flatnonzero(~np.isfinite(found))
    if len(bad):
        raise SettingsError(f"imported arrays: {name}[{bad[0]}] is {found[bad[0]]}, expected a finite number")
    return found


def _whole(name: str, values: ArrayLike, length: int | None = None) -> NDArray[np.int64]:
    found = _finite(name, values, length)
    bad = np.flatnonzero(found != np.rint(found))
    if len(bad):
        raise SettingsError(f"imported arrays: {name}[{bad[0]}] is {found[bad[0]]}, expected a whole number")
    return np.asarray(values).astype(np.int64)
