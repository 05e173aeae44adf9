"""Order of lightings; the first is the reference."""

import re
from collections.abc import Collection, Iterable

_PLAIN = ("diffuse", "default")
"""Names of lightings without a direction."""


def lightings_in_order(lightings: Collection[str], named: Iterable[str] | None) -> list[str]:
    """Lightings in the order of the experiment, by default plain ones first; the others by name.

    Parameters
    ----------
    lightings
        Those that were measured.
    named
        Those that the experiment names, if it does; some may not have been measured.
    """
    first = [name for name in dict.fromkeys(named or _PLAIN) if name in lightings]
    return first + sorted({*lightings} - {*first}, key=natural_key)


def natural_key(name: str) -> list[tuple[int, str]]:
    """Sort key that puts ``LR9`` before ``LR10``: digits count as numbers."""
    parts = re.split(r"(\d+)", name)
    return [(int(part), "") if place % 2 else (0, part) for place, part in enumerate(parts)]
