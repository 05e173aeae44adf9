"""Names of sequences and conditions of which the same is to be said: told together."""

from collections.abc import Iterable, Sequence

from tracknoise.report.sentences import listing

MOST_NAMED = 4
"""Of more names than this, the first few stand for all."""


def by_statement(statements: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Names of which the same is to be said, by that.

    Parameters
    ----------
    statements
        Pairs of a name and what is to be said of it.
    """
    names: dict[str, list[str]] = {}
    for name, statement in statements:
        names.setdefault(statement, []).append(name)
    return names


def together(names: Sequence[str]) -> str:
    """Names as part of a sentence: ``a and b``, or ``a, b, c and 17 others``."""
    named = names if len(names) <= MOST_NAMED else [*names[: MOST_NAMED - 1], f"{len(names) - MOST_NAMED + 1} others"]
    return listing(named)
