"""In which order lightings come, and so which one stands for all where one must."""

import re
from collections.abc import Collection, Iterable

_PLAIN = ("diffuse", "default")
"""What a lighting without a direction is called."""


def lightings_in_order(lightings: Collection[str], named: Iterable[str] | None) -> list[str]:
    """Lightings in the order in which an experiment names them, or else plain ones first; the others by name.

    Parameters
    ----------
    lightings
        Those that there are.
    named
        Those that the experiment names, if it does: some may not be there.
    """
    first = [name for name in dict.fromkeys(named or _PLAIN) if name in lightings]
    return first + sorted({*lightings} - {*first}, key=natural_key)


def natural_key(name: str) -> list[tuple[int, str]]:
    """Sort key that puts ``LR9`` before ``LR10``: digits count as numbers."""
    parts = re.split(r"(\d+)", name)
    return [(int(part), "") if place % 2 else (0, part) for place, part in enumerate(parts)]
