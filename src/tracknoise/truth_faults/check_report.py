"""The result of a check as plain data: one item per topic, and the verdict."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import TypeAlias

Values: TypeAlias = Mapping[str, float | int | str | None]
"""Numbers behind a sentence, by name; None where unknown."""


class Severity(StrEnum):
    """What an item means for measuring: nothing, unknown, to be kept in mind, or that results would be wrong."""

    ok = "ok"
    unknown = "unknown"
    caveat = "caveat"
    fatal = "fatal"


class Verdict(StrEnum):
    """Whether a recording can be measured."""

    ready = "ready"
    caveats = "usable, with these caveats"
    unusable = "not usable"


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
    """

    sequence: str
    items: tuple[Item, ...]


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
    def verdict(self) -> Verdict:
        """The worst severity decides."""
        found = {item.severity for item in self.every_item()}
        if Severity.fatal in found:
            return Verdict.unusable
        return Verdict.caveats if Severity.caveat in found else Verdict.ready

    def every_item(self) -> Iterable[Item]:
        """Items of all sequences, then those about all together."""
        for report in self.sequences:
            yield from report.items
        yield from self.items

    def reasons(self) -> list[str]:
        """Texts of the items that decide the verdict, each once."""
        worst = {Verdict.unusable: Severity.fatal, Verdict.caveats: Severity.caveat}.get(self.verdict)
        return list(dict.fromkeys(item.text for item in self.every_item() if item.severity is worst))

    def to_json(self) -> str:
        """The report as a JSON document with `format`, `verdict`, `reasons` and the items with their values."""
        document = {"format": 1, "verdict": self.verdict.name, "reasons": self.reasons(), **asdict(self)}
        return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
