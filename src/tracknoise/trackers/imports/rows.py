"""Rows of a file of tracks, before they are assigned to the frames of a sequence."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """What a file states about each observation, in its order.

    Exactly one of `frame`, `time_s` and `time_ns` is given.

    Attributes
    ----------
    path
        The file.
    track : (n,) int64
        Which track.
    uv : (n, 2) float64
        Position as the file states it.
    frame : (n,) int64
        Number of the frame as the file states it; None where it states times.
    time_s : (n,) float64
        Time, seconds; None where the file states frames.
    time_ns : (n,) int64
        Time, whole nanoseconds, which float64 does not hold exactly; None where the file states another time.
    line : (n,) int64
        Number of the line, or of the row if the file has no lines; None where it has neither.
    has_lines
        Whether `line` counts lines.
    response : (n,) float32
        NaN where unknown; None where no response is known.
    quality : (n,) float32 each
        By name; NaN where unknown.
    """

    path: Path
    track: NDArray[np.int64]
    uv: NDArray[np.float64]
    frame: NDArray[np.int64] | None = None
    time_s: NDArray[np.float64] | None = None
    time_ns: NDArray[np.int64] | None = None
    line: NDArray[np.int64] | None = None
    has_lines: bool = True
    response: NDArray[np.float32] | None = None
    quality: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)

    def place(self, row: int) -> str:
        """Where a row is, for an error."""
        if self.line is None:
            return str(self.path)
        return f"{self.path}:{self.line[row]}" if self.has_lines else f"{self.path}: row {self.line[row]}"

    def chosen(self, kept: NDArray[np.intp], frame: NDArray[np.intp], uv: NDArray[np.float64]) -> "Rows":
        """Some of the rows, by index, with frames and positions."""
        return Rows(
            self.path,
            self.track[kept],
            uv,
            frame=frame.astype(np.int64),
            line=None if self.line is None else self.line[kept],
            has_lines=self.has_lines,
            response=None if self.response is None else self.response[kept],
            quality={name: values[kept] for name, values in self.quality.items()},
        )

    def refuse(self, bad: NDArray[np.bool_], name: str, values: NDArray[np.generic], expected: str) -> None:
        """Raise an error that shows the first bad value.

        Raises
        ------
        DataError
            Unless no row is bad.
        """
        rows = np.flatnonzero(bad)
        if len(rows):
            row = int(rows[0])
            raise DataError(self.place(row), f"{name} {values[row].item()!r}", expected)


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Observations of imported tracks in the frames of a sequence, sorted by frame and track.

    Attributes
    ----------
    track, frame : (n,) int64
        Frames are indices in the nominal sequence.
    uv : (n, 2) float64
        px; an integer is the centre of a pixel.
    response : (n,) float32
        NaN where unknown.
    quality : (n,) float32 each
        Columns ``quality_<name>`` by name; NaN where unknown.
    """

    track: NDArray[np.int64]
    frame: NDArray[np.int64]
    uv: NDArray[np.float64]
    response: NDArray[np.float32]
    quality: Mapping[str, NDArray[np.float32]]
