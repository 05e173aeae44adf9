"""Keys and values of a calibration file, checked as they are taken out."""

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.sequences.poses import checked_poses

_SHOWN = 60
_POWER_OF_TEN = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+")
"""Numbers that YAML 1.1 takes for a text: 1e-5 has no point, and 1.5e5 no sign of the exponent."""


@dataclass(frozen=True, slots=True)
class Entries:
    """Keys and values of a file, or of a part of it.

    Parameters
    ----------
    place
        The file, for messages.
    values
        What was read.
    """

    place: str | Path
    values: Mapping[str, Any]

    def name(self, *names: str) -> str | None:
        """The first of several names that is a key here; None if none is."""
        return next((name for name in names if name in self.values), None)

    def required(self, *names: str) -> str:
        """The first of several names that is a key here."""
        name = self.name(*names)
        if name is None:
            raise DataError(self.place, f"no {names[0]}", "it")
        return name

    def part(self, name: str) -> "Entries":
        """The keys and values below a key."""
        value = self._value(name)
        if not isinstance(value, Mapping):
            raise self.error(name, "keys and values")
        return Entries(f"{self.place} ({name})", value)

    def text(self, name: str) -> str:
        """A text, in lower case without surrounding spaces."""
        value = self._value(name)
        if not isinstance(value, str):
            raise self.error(name, "a text")
        return value.strip().lower()

    def number(self, name: str, *, whole: bool = False, positive: bool = False) -> float:
        """A finite number."""
        return self._checked(name, self._value(name), whole=whole, positive=positive)

    def numbers(self, name: str, *counts: int) -> tuple[float, ...]:
        """A flat list of numbers, from lists of rows or from OpenCV's rows, columns and data too."""
        values = self._flat(name)
        if counts and len(values) not in counts:
            raise self.error(name, f"{' or '.join(map(str, counts))} numbers")
        return tuple(self._checked(name, value) for value in values)

    def matrix(self, name: str, rows: int, columns: int) -> NDArray[np.float64]:
        """(rows, columns) float64: see `numbers`."""
        return np.array(self.numbers(name, rows * columns)).reshape(rows, columns)

    def rigid(self, name: str) -> NDArray[np.float64]:
        """(4, 4) float64: a pose."""
        (rigid,), _ = checked_poses(self.matrix(name, 4, 4)[None], [f"{self.place}: {name}"])
        return np.asarray(rigid)

    def size(self, name: str) -> tuple[int, int]:
        """Width and height from a list of two."""
        values = self._flat(name)
        if len(values) != 2:
            raise self.error(name, "width and height")
        width, height = (int(self._checked(name, value, whole=True, positive=True)) for value in values)
        return width, height

    def error(self, name: str, expected: str) -> DataError:
        """The error of a key whose value is not what was expected."""
        return DataError(self.place, f"{name} = {_shown(self.values[name])}", expected)

    def _value(self, name: str) -> Any:
        if name not in self.values:
            raise DataError(self.place, f"no {name}", "it")
        return self.values[name]

    def _flat(self, name: str) -> list[Any]:
        value = self._value(name)
        if isinstance(value, Mapping):
            value = value.get("data")
        if not isinstance(value, list):
            raise self.error(name, "a list of numbers")
        if value and all(isinstance(row, list) for row in value):
            return [item for row in value for item in row]
        return value

    def _checked(self, name: str, value: Any, *, whole: bool = False, positive: bool = False) -> float:
        number = _number(value, whole=whole)
        if number is None or (positive and number <= 0.0):
            expected = f"a {'whole' if whole else 'finite'} number{' above 0' if positive else ''}"
            raise DataError(self.place, f"{name} = {_shown(value)}", expected)
        return number


def _number(value: Any, *, whole: bool) -> float | None:
    """A finite number; None for all else."""
    if isinstance(value, str) and _POWER_OF_TEN.fullmatch(value) and not whole:
        value = float(value)
    if not isinstance(value, int if whole else int | float) or isinstance(value, bool):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _shown(value: Any) -> str:
    """A value as JSON, cut off where it is long."""
    try:
        text = json.dumps(value, default=str, skipkeys=True)
    except (RecursionError, ValueError):
        return "lists in lists"
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
