"""Read a gate: a TOML file of tolerances by statistic."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.findings.comparison.estimands import ESTIMANDS
from tracknoise.findings.comparison.gate import Gate
from tracknoise.foreign.files import MIB, read_text
from tracknoise.tables.defaults import LEVEL
from tracknoise.tables.enumerations import ComparedAges
from tracknoise.toml_text import parse_toml

_KEYS = ("tolerances", "trackers", "speeds", "level", "ages")
_MOST = 1000
"""Largest tolerance."""
_RENAMED = {
    "window_sigma": "residual_sigma, its name now, or consistent_sigma, which is the sigma to set in an estimator",
}
"""Former names of statistics, and what to write instead."""


def read_gate(path: Path) -> Gate:
    """Read and check a gate.

    Parameters
    ----------
    path
        A TOML file with a table ``tolerances``, and optionally ``trackers``, ``speeds``, ``level`` and ``ages``.

    Raises
    ------
    SettingsError, UnknownNameError
        If it cannot be read, or a key or value is wrong.
    """
    found = _loaded(path)
    for key in found:
        if key not in _KEYS:
            raise UnknownNameError(f"key in {path}", key, _KEYS)
    return Gate(
        _tolerances(path, found.get("tolerances", {})),
        trackers=_listed(path, found, "trackers", str),
        speeds=_listed(path, found, "speeds", int),
        level=_level(path, found.get("level", LEVEL)),
        ages=_ages(path, found.get("ages", ComparedAges.every)),
    )


def _loaded(path: Path) -> Mapping[str, Any]:
    try:
        return parse_toml(read_text(path, "a file of tolerances", most=MIB))
    except DataError as error:
        raise SettingsError(f"{path}: cannot be read ({error.found}), expected TOML with tolerances") from error
    except ValueError as error:
        found, _, expected = str(error).partition(", expected ")
        kind = f"TOML with {expected}" if expected not in ("", "TOML") else "TOML"
        raise SettingsError(f"{path}: {found}, expected {kind}") from error


def _tolerances(path: Path, found: object) -> dict[str, float]:
    if not isinstance(found, dict) or not found:
        raise SettingsError(f"{path}: tolerances: found {found!r}, expected a table with at least one statistic")
    for name, value in found.items():
        if name in _RENAMED:
            raise SettingsError(f"{path}: tolerances: found the former name {name!r}, expected {_RENAMED[name]}")
        if name not in ESTIMANDS:
            raise UnknownNameError(f"statistic in {path}", name, ESTIMANDS)
        if not _is_number(value) or not 0 < value <= _MOST:
            raise SettingsError(f"{path}: tolerances.{name}: found {value!r}, expected more than 0, at most {_MOST}")
    return {name: float(value) for name, value in found.items()}


def _listed(path: Path, found: Mapping[str, Any], key: str, kind: type) -> tuple[Any, ...] | None:
    """A list of texts or whole numbers."""
    if key not in found:
        return None
    values = found[key]
    if not isinstance(values, list) or not values or not all(type(value) is kind for value in values):
        names = {str: "names", int: "whole numbers"}
        raise SettingsError(f"{path}: {key}: found {values!r}, expected a list of {names[kind]}")
    return tuple(values)


def _level(path: Path, value: object) -> float:
    if not _is_number(value) or not 0.5 <= value <= 0.99:  # type: ignore[operator]
        raise SettingsError(f"{path}: level: found {value!r}, expected a number from 0.5 to 0.99")
    return float(value)  # type: ignore[arg-type]


def _ages(path: Path, value: object) -> ComparedAges:
    if value not in list(ComparedAges):
        raise SettingsError(f"{path}: ages: found {value!r}, expected one of {', '.join(ComparedAges)}")
    return ComparedAges(str(value))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
