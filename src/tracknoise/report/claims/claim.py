"""The paper's claims as data: every cell of its summary tables, and the claims of its abstract, text and captions."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache
from typing import Any

from tracknoise.findings.wording import STATISTICS
from tracknoise.report import paper


class Agreement(StrEnum):
    """Verdict on a claim.

    agrees: in direction and size, as far as the claim states them. opposite: the effect is there with the opposite
    sign. disagrees: the effect is not there, or has another size. open: the run cannot tell.
    """

    agrees = "agrees"
    opposite = "opposite sign"
    disagrees = "disagrees"
    open = "cannot be judged"


@dataclass(frozen=True, slots=True)
class Judgement:
    """Verdict on a claim under one reading.

    Attributes
    ----------
    agreement
        The verdict.
    value
        What was measured, with its interval where there is one; empty where nothing was.
    reason
        Why; empty where the value says it all.
    """

    agreement: Agreement
    value: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim.

    Attributes
    ----------
    id
        Unique within an experiment.
    experiment
        Of the paper.
    kind
        How it is judged: a name in `tracknoise.report.claims.judge`.
    text
        What is claimed.
    source
        Where it stands in the paper.
    note
        What is not on record about it; empty where nothing is missing.
    stated
        What is compared, by kind.
    """

    id: str
    experiment: str
    kind: str
    text: str
    source: str
    note: str = ""
    stated: Mapping[str, Any] = field(default_factory=dict)


@cache
def claims() -> tuple[Claim, ...]:
    """Claims of abstract, text, figures and captions, in the order of the experiments."""
    order = list(paper.findings())
    found = [one for entry in paper.stated_claims() for one in _of_entry(entry)]
    return tuple(sorted(found, key=lambda claim: order.index(claim.experiment)))


@cache
def cells() -> tuple[Claim, ...]:
    """Cells of the summary tables: one for each experiment, factor, statistic and, where it matters, tracker."""
    return tuple(
        _cell(experiment, factor, role, kind, said)
        for experiment, tables in paper.findings().items()
        for factor, table in tables.items()
        if factor != "title"
        for role, value in table.items()
        for kind, said in _by_tracker(factor, value)
    )


def _of_entry(entry: Mapping[str, Any]) -> Iterator[Claim]:
    """One claim for each of the experiments that an entry names."""
    named = entry["experiment"]
    fields = {name: entry[name] for name in ("id", "kind", "text", "source", "note") if name in entry}
    stated = {name: value for name, value in entry.items() if name not in (*fields, "experiment")}
    for experiment in [named] if isinstance(named, str) else named:
        yield Claim(experiment=experiment, stated=stated, **fields)


def _by_tracker(factor: str, value: str | Mapping[str, str]) -> Iterator[tuple[str | None, str]]:
    """The paper's word for each kind of tracker; for None where the trackers are compared."""
    for kind in (None,) if factor == "tracker" else paper.TRACKERS:
        yield kind, value if isinstance(value, str) else value[kind or ""]


def _cell(experiment: str, factor: str, role: str, kind: str | None, said: str) -> Claim:
    whose = f" of {kind}" if kind else ""
    text = f"The {factor} {'changes' if said == 'yes' else 'does not change'} the {STATISTICS[role]}{whose}."
    name = "-".join([factor, role, *([kind] if kind else [])])
    stated = {"factor": factor, "role": role, "said": said, "rises": _rises(experiment, factor, role, kind)}
    return Claim(name, experiment, "cell", text, "summary table", stated={**stated, "tracker": kind})


def _rises(experiment: str, factor: str, role: str, kind: str | None) -> bool | None:
    """Whether text or captions say that a statistic rises with speed. None where they say nothing."""
    asked = {"kind": "trend", "role": role, "tracker": kind} if factor == "speed" else {}
    found = [
        entry["rises"]
        for entry in paper.stated_claims()
        if asked and entry["experiment"] == experiment and all(entry.get(key) == value for key, value in asked.items())
    ]
    return found[0] if found else None
