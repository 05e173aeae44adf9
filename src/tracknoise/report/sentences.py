"""Words and numbers as the report writes them."""

import math
import re
from collections.abc import Iterable, Sequence

SPACE = "\N{NO-BREAK SPACE}"
MINUS, DASH, TIMES = "\N{MINUS SIGN}", "\N{EN DASH}", "\N{MULTIPLICATION SIGN}"
NU, MU, KAPPA = "\N{GREEK SMALL LETTER NU}", "\N{GREEK SMALL LETTER MU}", "\N{GREEK SMALL LETTER KAPPA}"
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | None, *, digits: int = 3) -> str:
    """Write a number to `digits` significant digits; whole numbers whole, a dash where it is missing."""
    if value is None:
        return DASH
    if isinstance(value, int) or abs(value) >= 10**digits:
        return f"{round(value):,}".replace("-", MINUS)
    if value != 0 and abs(value) < 1e-3:
        mantissa, exponent = f"{value:.{digits - 2}e}".split("e")
        return f"{mantissa} {TIMES} 10{str(int(exponent)).translate(_SUPERSCRIPT)}".replace("-", MINUS)
    if value == 0:
        return "0"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}".replace("-", MINUS)


def pixels(value: float | None) -> str:
    """Write a length in px without its unit: to a thousandth where it is short, otherwise to three digits."""
    if value is None or value == 0 or abs(value) < 5e-4 or abs(value) >= 10:
        return number(value)
    return f"{value:.3f}".replace("-", MINUS)


def px(value: float | None) -> str:
    """Write a length in px."""
    return "unknown" if value is None else f"{pixels(value)}{SPACE}px"


def percent(share: float | None) -> str:
    """Write a share between 0 and 1 in percent, to a tenth."""
    return "unknown" if share is None else f"{100 * share:.1f}{SPACE}%"


def count(n: int, noun: str) -> str:
    """Write a count with its noun: ``no tracks``, ``1 track``, ``1,200 tracks``."""
    return f"{number(n) if n else 'no'} {noun}{'' if n == 1 else 's'}"


def natural_key(name: str) -> list[tuple[int, str]]:
    """Sort key that puts ``LR9`` before ``LR10``: digits count as numbers."""
    parts = re.split(r"(\d+)", name)
    return [(int(part), "") if place % 2 else (0, part) for place, part in enumerate(parts)]


def listing(items: Iterable[str], *, joint: str = "and") -> str:
    """Join items as prose does: ``a``, ``a and b``, ``a, b and c``."""
    parts: Sequence[str] = list(items)
    return f" {joint} ".join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else "".join(parts)
