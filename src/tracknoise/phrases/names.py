"""Names of sequences and conditions in sentences."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tracknoise.words import listing

MOST_NAMED = 4
"""Of more names than this, only the first few are listed."""


def by_statement(statements: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Names by their statement.

    Parameters
    ----------
    statements
        Pairs of a name and its statement.
    """
    names: dict[str, list[str]] = {}
    for name, statement in statements:
        names.setdefault(statement, []).append(name)
    return names


def together(names: Sequence[str]) -> str:
    """Names as part of a sentence: ``a and b``, or ``a, b, c and 17 others``."""
    named = names if len(names) <= MOST_NAMED else [*names[: MOST_NAMED - 1], f"{len(names) - MOST_NAMED + 1} others"]
    return listing(named)


def condition_name(names: Mapping[str, Any]) -> str:
    """Name a condition."""
    lighting = f" under lighting {names['lighting']}" if "lighting" in names else ""
    rotation = f" at rotation {names['rotation']}°" if "rotation" in names else ""
    direction = f" played {names['direction']}" if "direction" in names else ""
    camera = f" of camera {names['camera']}" if "camera" in names else ""
    return f"{names['tracker']} at speed {names['speed']}{lighting}{rotation}{direction}{camera}"
