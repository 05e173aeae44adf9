"""Sentences are short: how long they may be, and how a text or a reason becomes several of them."""

import re
from collections.abc import Iterable, Sequence

from tracknoise.words import sentence_case

MOST_WORDS, MOST_NUMBERS = 25, 3
"""No sentence has more words or numbers, apart from names."""
_END = re.compile(r"(?<=[.!?]) +")
_CLAUSE = re.compile(r"[:;.] ")


def sentences_of(text: str) -> list[str]:
    """The sentences of a text, in their order."""
    return [one for one in _END.split(text.strip()) if one]


def joined(sentences: Iterable[str]) -> str:
    """One text of several sentences; empty ones are left out."""
    return " ".join(filter(None, sentences))


def because(opening: str, why: str | None) -> str:
    """An opening without a full stop and its reason; further clauses of the reason are sentences of their own."""
    reason, *more = _CLAUSE.split((why or "").rstrip("."))
    first = f"{opening}: {reason}." if reason else f"{opening}."
    return joined([first, *(f"{sentence_case(clause)}." for clause in more)])


def each_axis(texts: Sequence[str], opening: str = "In u it is") -> list[str]:
    """Sentences about u and v: `opening` and the first text, then ``In v it is`` and the second."""
    u, v = texts
    return [f"{opening} {u}.", f"In v it is {v}."]
