"""The result of a check as plain data: one item per topic, and the verdict on the truth."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import TypeAlias, TypeVar

from tracknoise.tables.enumerations import Trust
from tracknoise.tables.trust import Range, TruthVerdict

Values: TypeAlias = Mapping[str, float | int | str | None]
"""Numbers behind a sentence, by name; None where unknown."""


class Severity(StrEnum):
    """What an item means for measuring: nothing, unknown, to be kept in mind, or that results would be wrong."""

    ok = "ok"
    unknown = "unknown"
    caveat = "caveat"
    fatal = "fatal"


CAUTIONS = frozenset({"pose jumps", "intrinsics", "clipped depth", "repeated frames", "repeated images"})
"""Topics about single parts of the data, whose caveats count in the verdict; how much others explain is measured."""
_WORST = (Trust.not_trusted, Trust.unknown, Trust.limited, Trust.trusted)


_One = TypeVar("_One")


def worst(found: Iterable[_One], verdict: Callable[[_One], Trust]) -> _One:
    """The first of those with the worst verdict."""
    return min(found, key=lambda item: _WORST.index(verdict(item)))


@dataclass(frozen=True, slots=True)
class Item:
    """What one topic of a check found.

    Attributes
    ----------
    topic
        One or two words.
    severity
        What it means for measuring.
    text
        One or two sentences with numbers.
    values
        The numbers, by name; the unit is part of the name.
    """

    topic: str
    severity: Severity
    text: str
    values: Values = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SequenceReport:
    """The check of one sequence.

    Attributes
    ----------
    sequence
        Its name.
    items
        In the order of the topics.
    truth
        The verdict on its truth.
    ranges
        Shares of the squared errors that the truth may explain, by cause; empty where they were not measured.
    """

    sequence: str
    items: tuple[Item, ...]
    truth: TruthVerdict
    ranges: Mapping[str, Range] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class CheckReport:
    """The check of a recording.

    Attributes
    ----------
    reader, source
        Which reader was used, and on which folder.
    sequences
        One report per sequence that was checked.
    items
        About all sequences together.
    """

    reader: str
    source: str
    sequences: tuple[SequenceReport, ...]
    items: tuple[Item, ...] = ()

    @property
    def truth(self) -> TruthVerdict:
        """The worst verdict of all sequences."""
        truths = [report.truth for report in self.sequences]
        return worst(truths, lambda truth: truth.verdict) if truths else TruthVerdict()

    def every_item(self) -> Iterable[Item]:
        """Items of all sequences, then those about all together."""
        for report in self.sequences:
            yield from report.items
        yield from self.items

    def reasons(self) -> list[str]:
        """Texts of the items that make results wrong, or are to be kept in mind, each once."""
        telling = (Severity.fatal, Severity.caveat)
        return list(
            dict.fromkeys(item.text for severity in telling for item in self.every_item() if item.severity is severity)
        )

    def to_json(self) -> str:
        """The report as a JSON document with `format`, the verdict on the truth, `reasons` and the items."""
        truth = self.truth
        document = {
            "format": 2,
            "verdict": truth.verdict,
            "sentence": truth.sentence,
            "reasons": self.reasons(),
            **asdict(self),
        }
        return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
