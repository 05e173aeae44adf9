"""Range checks of settings, whose message names the field; `tracknoise.plugins` turns it into a `SettingsError`."""

import math
from collections.abc import Iterable, Mapping

MOST_LEVELS = 16
"""How deep lists and tables in settings can nest."""
_WHOLE = range(-(2**63), 2**63)


def require(holds: bool, field: str, value: object, expected: str) -> None:
    """Raise ValueError, naming field, value and what was expected, unless `holds`."""
    if not holds:
        raise ValueError(f"{field} is {value!r}, expected {expected}")


def require_positive(field: str, value: float) -> None:
    """Raise ValueError unless `value` is finite and above zero."""
    require(_is_finite(value) and value > 0, field, value, "a number above 0")


def require_at_least(field: str, value: float, least: float) -> None:
    """Raise ValueError unless `value` is finite and not below `least`."""
    require(_is_finite(value) and value >= least, field, value, f"a number not below {least}")


def require_odd(field: str, value: int, least: int = 1) -> None:
    """Raise ValueError unless `value` is odd and not below `least`."""
    require(value >= least and value % 2 == 1, field, value, f"an odd number not below {least}")


def require_share(field: str, value: float) -> None:
    """Raise ValueError unless `value` is a probability."""
    require(0 <= value <= 1, field, value, "a number from 0 to 1")


def require_at_most(field: str, value: float, most: float) -> None:
    """Raise ValueError if `value` is above `most`."""
    require(value <= most, field, value, f"a number not above {most}")


def require_storable(value: object) -> None:
    """Check what a TOML or JSON file holds: numbers and nests that every other program can read too.

    Raises
    ------
    ValueError
        If a whole number needs more than 64 bits, a text contains a null character, or lists and tables nest deeper
        than `MOST_LEVELS`.
    """
    level: list[object] = [value]
    for _ in range(MOST_LEVELS):
        for item in level:
            _require_plain(item)
        level = [part for item in level for part in _parts(item)]
    if level:
        raise ValueError(f"lists and tables more than {MOST_LEVELS} deep, expected fewer levels")


def _require_plain(value: object) -> None:
    if isinstance(value, int) and value not in _WHOLE:
        raise ValueError(f"a whole number of {value.bit_length()} bits, expected at most 64 bits")
    if isinstance(value, str) and "\0" in value:
        raise ValueError(f"{value!r}, expected a text without null characters")


def _parts(value: object) -> Iterable[object]:
    if isinstance(value, Mapping):
        return [*value.keys(), *value.values()]
    return value if isinstance(value, list | tuple) else ()


def _is_finite(value: float) -> bool:
    return -math.inf < value < math.inf  # unlike math.isfinite, without an error for whole numbers of any size
