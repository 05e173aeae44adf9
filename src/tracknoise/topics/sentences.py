"""Sentences: how long they may be, how a text or a reason becomes several of them, and the names in them."""

import re
from collections.abc import Iterable, Sequence

from tracknoise.words import listing, sentence_case

MOST_WORDS, MOST_NUMBERS = 25, 3
"""No sentence has more words or numbers, apart from names."""
MOST_NAMED = 4
"""Of more names than this, only the first few are listed."""
_END = re.compile(r"(?<=[.!?]) +")
_CLAUSE = re.compile(r"[:;.] ")


def sentences_of(text: str) -> list[str]:
    """The sentences of a text, in their order."""
    return [sentence for sentence in _END.split(text.strip()) if sentence]


def joined(sentences: Iterable[str]) -> str:
    """One text of several sentences; empty ones are left out."""
    return " ".join(filter(None, sentences))


def because(opening: str, why: str | None) -> str:
    """An opening without a full stop and its reason; further clauses of the reason are sentences of their own."""
    reason, *more = _clauses(why)
    return joined([f"{opening}: {reason}." if reason else f"{opening}.", *map(_as_sentence, more)])


def reasons(why: str | None) -> list[str]:
    """A reason as sentences; none where there is none."""
    return [_as_sentence(clause) for clause in _clauses(why) if clause]


def _clauses(why: str | None) -> list[str]:
    return _CLAUSE.split((why or "").rstrip("."))


def _as_sentence(clause: str) -> str:
    return f"{sentence_case(clause)}."


def each_axis(texts: Sequence[str], opening: str = "In u it is") -> list[str]:
    """Sentences about u and v: `opening` and the first text, then ``In v it is`` and the second."""
    u, v = texts
    return [f"{opening} {u}.", f"In v it is {v}."]


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
    shown = names if len(names) <= MOST_NAMED else [*names[: MOST_NAMED - 1], f"{len(names) - MOST_NAMED + 1} others"]
    return listing(shown)
