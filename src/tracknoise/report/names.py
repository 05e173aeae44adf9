"""Names of sequences and conditions in sentences, and names as identifiers."""

import itertools
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tracknoise.findings.wording import listing

_LONGEST = 80
"""Characters of an identifier without its number. Names of files are longer and may have up to 255."""
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


def identifiers(names: Sequence[str], *, taken: Iterable[str] = ()) -> dict[str, str]:
    """Identifiers of names, for files and anchors: lower-case letters, digits and hyphens, unique by construction.

    Names that would share an identifier get numbers: their position, or the next number that is free.

    Parameters
    ----------
    names
        All different.
    taken
        Identifiers that must not be used.
    """
    wished = {name: re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:_LONGEST] or "tracker" for name in names}
    shared = {slug for slug, times in Counter([*wished.values(), *taken]).items() if times > 1}
    given = {name: slug for name, slug in wished.items() if slug not in shared}
    used = {*given.values(), *taken}
    for place, name in enumerate(names, start=1):
        if name not in given:
            numbered = (f"{wished[name]}-{number}" for number in itertools.count(place))
            given[name] = next(slug for slug in numbered if slug not in used)
            used.add(given[name])
    return given


def condition_name(names: Mapping[str, Any]) -> str:
    """Name a condition.

    Parameters
    ----------
    names
        Its values of `ReportData.condition_columns`.
    """
    lighting = f" under lighting {names['lighting']}" if "lighting" in names else ""
    rotation = f" at rotation {names['rotation']}°" if "rotation" in names else ""
    direction = f" played {names['direction']}" if "direction" in names else ""
    camera = f" of camera {names['camera']}" if "camera" in names else ""
    return f"{names['tracker']} at speed {names['speed']}{lighting}{rotation}{direction}{camera}"
