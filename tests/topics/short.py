"""Whether every sentence of a text is short."""

import re
from collections.abc import Iterable, Mapping
from typing import Any

from tracknoise.topics.sentences import MOST_NUMBERS, MOST_WORDS, sentences_of


def too_long(text: str, names: Iterable[str] = ()) -> list[str]:
    """Sentences with more words or numbers than allowed. `names` count as one word each, and have no numbers."""
    found = []
    for sentence in sentences_of(text):
        plain = sentence.replace("\N{NO-BREAK SPACE}", " ")
        for name in sorted(names, key=len, reverse=True):
            plain = plain.replace(name, "it")
        if len(plain.split()) > MOST_WORDS or len(re.findall(r"\d[\d.,]*", plain)) > MOST_NUMBERS:
            found.append(sentence)
    return found


def long_in_findings(rows: Iterable[Mapping[str, Any]], names: Iterable[str]) -> list[str]:
    """The same of all texts of findings: their text, opening, closing, parts and short sentence."""
    texts = [
        text
        for row in rows
        for text in (
            *(row[name] for name in ("text", "opening", "closing", "brief")),
            *(p["text"] for p in row["parts"]),
        )
    ]
    return [sentence for text in texts for sentence in too_long(text, names)]
