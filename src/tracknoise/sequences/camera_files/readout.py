"""The rolling shutter of a camera: a key that any camera file of keys and values may have."""

from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.camera_files.entries import Entries

READOUT = "readout_s"
"""Time from the upper edge of the first row to the lower edge of the last, seconds; 0 for a global shutter."""


def shutter_at(entries: Entries) -> RollingShutter | None:
    """The rolling shutter of a camera; None where the file states none.

    Raises
    ------
    DataError
        If the readout is impossible.
    """
    readout_s = entries.number(READOUT) if entries.name(READOUT) else 0.0
    try:
        return RollingShutter(readout_s) if readout_s else None
    except ValueError as error:
        raise entries.error(READOUT, "seconds between -1 and 1") from error
