"""What a run changed in the verdict that `tracknoise check` had given on the truth, and why.

A check measures the same causes as a run, with one tracker and fewer points. What differs is which shares of the errors
they may explain, and what is established.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tracknoise.exceptions import DataError, StoreError
from tracknoise.foreign_files import read_json_object
from tracknoise.tables.enumerations import Trust, TruthCause
from tracknoise.tables.identity import readable
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import AssessedTruth, Range
from tracknoise.truth_faults.check_report import worst
from tracknoise.words import listing, percent

CHECK_JSON = "check.json"
"""The document of a run with what a check of its recording found."""
_CHANGED = 0.05
"""Smallest change of a share of the squared errors that is named."""
_CAUSES: Mapping[str, str] = {
    TruthCause.every: "all causes together",
    TruthCause.faults: "established faults",
    TruthCause.poses: "camera motions missing in the poses",
    TruthCause.any_fault: "constant faults, established or not",
    TruthCause.depths: "random errors of depths",
}
_NOTHING: Range = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Checked:
    """The verdict of a check on one sequence.

    Attributes
    ----------
    sequence
        Its name.
    verdict
        The verdict.
    ranges
        Shares of the squared errors that the truth may explain, by cause; empty where they were not measured.
    """

    sequence: str
    verdict: Trust
    ranges: Mapping[str, Range]


def read_check(path: Path) -> str:
    """The document that a check wrote, as text.

    Raises
    ------
    DataError
        If the file is missing, or is none of `tracknoise check -o FILE.json`.
    """
    document = read_json_object(path, _EXPECTED)
    try:
        _checked(document)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(path, "another JSON document", _EXPECTED) from error
    return json.dumps(document, indent=1, ensure_ascii=False)


_EXPECTED = "what `tracknoise check -o FILE.json` writes"


def truth_change(run: RunFolder, truth: AssessedTruth) -> str | None:
    """What a run changed in the verdict of a check, and why; None where it knows of no check.

    Parameters
    ----------
    run
        The run.
    truth
        What it says about its truth.

    Raises
    ------
    StoreError
        If a file of the run is missing or damaged.
    """
    document = run.document(CHECK_JSON)
    if document is None:
        return None
    measured = {readable(key) for key in run.manifest().sequences}
    try:
        checks = _checked(json.loads(document))
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise StoreError(f"{run.path / 'statistics' / CHECK_JSON}: damaged ({error}), expected {_EXPECTED}") from error
    compared = [item for item in checks if item.sequence in measured]
    if not compared:
        return f"`tracknoise check` was of {listing(item.sequence for item in checks)}, which this run did not measure."
    return _sentence(worst(compared, lambda item: item.verdict), truth.verdict.verdict, truth.ranges)


def _checked(document: Mapping[str, Any]) -> list[Checked]:
    """What a document says of each sequence."""
    return [
        Checked(
            str(entry["sequence"]),
            Trust(entry["truth"]["verdict"]),
            {str(TruthCause(cause)): (float(low), float(high)) for cause, (low, high) in entry["ranges"].items()},
        )
        for entry in document["sequences"]
    ]


def _sentence(before: Checked, verdict: Trust, now: Mapping[str, Range]) -> str:
    said = f"`tracknoise check` said {before.verdict}{' too' if before.verdict == verdict else ''}."
    if not before.ranges:
        return f"{said} The check could not measure what the truth explains." if now else said
    if not now:
        return f"{said} The run could not measure what the truth explains."
    parts = [
        f"{name} {_text(new)} (check: {_text(old)})"
        for cause, name in _CAUSES.items()
        for old, new in [(before.ranges.get(cause, _NOTHING), now.get(cause, _NOTHING))]
        if max(abs(new[0] - old[0]), abs(new[1] - old[1])) >= _CHANGED
    ]
    if parts:
        return f"{said} With the tracks of the run, shares of the squared errors changed: {'; '.join(parts)}."
    return (
        said
        if before.verdict == verdict
        else f"{said} Shares changed by less than {percent(_CHANGED)}, but one crossed a limit."
    )


def _text(interval: Range) -> str:
    """``up to 12 %`` or ``10 % to 12 %``."""
    low, high = interval
    return f"{percent(low)} to {percent(high)}" if low > 0.0 else f"up to {percent(high)}"
