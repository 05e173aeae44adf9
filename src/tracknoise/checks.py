"""Range checks of settings, whose message names the field; `tracknoise.plugins` turns it into a `SettingsError`."""

import math


def require(holds: bool, field: str, value: object, expected: str) -> None:
    """Raise ValueError, naming field, value and what was expected, unless `holds`."""
    if not holds:
        raise ValueError(f"{field} is {value!r}, expected {expected}")


def require_positive(field: str, value: float) -> None:
    """Raise ValueError unless `value` is finite and above zero."""
    require(math.isfinite(value) and value > 0, field, value, "a number above 0")


def require_at_least(field: str, value: float, least: float) -> None:
    """Raise ValueError unless `value` is finite and not below `least`."""
    require(math.isfinite(value) and value >= least, field, value, f"a number not below {least}")


def require_odd(field: str, value: int, least: int = 1) -> None:
    """Raise ValueError unless `value` is odd and not below `least`."""
    require(value >= least and value % 2 == 1, field, value, f"an odd number not below {least}")


def require_share(field: str, value: float) -> None:
    """Raise ValueError unless `value` is a probability."""
    require(0 <= value <= 1, field, value, "a number from 0 to 1")
