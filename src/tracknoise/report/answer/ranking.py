"""Which tracker is better: verdicts of the paired comparison of trackers."""

from typing import Any

import polars as pl

from tracknoise.findings.factor_text import bound_text
from tracknoise.findings.roles import ROLES
from tracknoise.findings.wording import count, ratio
from tracknoise.report.answer.subject import answer
from tracknoise.report.answer.summary import Answer, Judgement, Measure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Verdict

_SECTION = "factor-effects"
_QUESTION = "shown"


def compared(data: ReportData, role: str) -> dict[str, Any] | None:
    """Row of the comparison of trackers at the lowest speed by one statistic; None where there is none.

    Parameters
    ----------
    data
        The run.
    role
        Of the statistic, as in `tracknoise.findings.wording.STATISTICS`.
    """
    names = [name for name, of in ROLES.items() if of == role]
    rows = data.dependence.filter(pl.col("statistic").is_in(names), pl.col("n_levels") > 1, factor="tracker")
    rows = rows.filter(pl.col("speed").is_null() | (pl.col("speed") == data.slowest))
    return rows.row(0, named=True) if rows.height else None


def best(data: ReportData, tracker: str, role: str, question: str) -> Answer | None:
    """Whether a tracker is the best by a statistic; None where trackers are not compared.

    The comparison is of the two trackers that differ most. Of others it is not known. Nor is it where they differ at a
    single age (or frame) only.

    Parameters
    ----------
    data
        The run.
    tracker
        Its name.
    role
        Of the statistic.
    question
        A word, such as ``smallest``.
    """
    row = compared(data, role)
    if row is None:
        return None
    if row["verdict"] != Verdict.yes or row["better"] is None or row["at"] is not None:
        return answer(question, Verdict.undecided, wished=Verdict.yes)
    pair = {row["level_a"], row["level_b"]}
    if tracker in pair - {row["better"]}:
        return answer(question, Verdict.no, wished=Verdict.yes)
    only_two = row["n_levels"] == len(pair)
    return answer(question, Verdict.yes if only_two else Verdict.undecided, wished=Verdict.yes)


def accuracy(data: ReportData, errors: dict[str, Measure | None]) -> Judgement:
    """Which tracker is more accurate, and by how much.

    Parameters
    ----------
    data
        The run.
    errors
        Size of the errors of every tracker.
    """
    row = compared(data, "core")
    if len(data.trackers) < 2:
        return _alone(errors)
    if row is None or row["effect"] is None:
        return _unproven(data, errors)
    verdict = Verdict(row["verdict"]) if row["at"] is None else Verdict.undecided
    text = _sentence(data, row, verdict) if row["at"] is None else _at_one_place(data, row)
    return Judgement(answer(_QUESTION, verdict, wished=Verdict.yes), text, _SECTION)


def _sentence(data: ReportData, row: dict[str, Any], verdict: Verdict) -> str:
    """The verdict on all ages (or frames) that both trackers have, and both coordinates, together."""
    pair = [row["level_a"], row["level_b"]]
    bounds = "" if row["low"] is None else f" ({ratio(row['low'])} to {ratio(row['high'])})"
    size, everywhere = f"{ratio(row['effect'])} times", f"over shared {data.axis.name}s"
    if verdict == Verdict.yes and row["better"] in pair:
        worse = pair[1 - pair.index(row["better"])]
        than = f" than {worse}" if row["n_levels"] > len(pair) else ""
        core = f"the core error of {worse} is {size} as large{bounds}"
        return f"{row['better']} is more accurate{than}: {core} {everywhere}."
    if verdict == Verdict.no:
        return f"{pair[0]} and {pair[1]} are equally accurate: core errors differ by less than {_margin(row)}."
    core = f"the core error of {row['larger'] or pair[0]} is {size} that of {_smaller(row)}{bounds}"
    return f"It is undecided which is more accurate: {core} {everywhere}."


def _at_one_place(data: ReportData, row: dict[str, Any]) -> str:
    """Where the trackers differ most clearly, if only a single age (or frame) and coordinate shows it."""
    bound = "" if row["low"] is None else f" ({ratio(row['low'])} or more)"
    where = f"in {row['coordinate']} {data.axis.place(row['at'])}"
    core = (
        f"the core error of {row['larger'] or row['level_a']} is {ratio(row['effect'])} times that of {_smaller(row)}"
    )
    return f"Undecided overall; {where}, {core}{bound}."


def _smaller(row: dict[str, Any]) -> str:
    """The tracker with the smaller error."""
    return str(row["level_b"] if row["larger"] in (None, row["level_a"]) else row["level_a"])


def _margin(row: dict[str, Any]) -> str:
    return f"a factor of {bound_text(row['margin'], row['unit']).removesuffix('times').strip()}"


def _alone(errors: dict[str, Measure | None]) -> Judgement:
    """One tracker has nothing to be compared with: its error is the answer."""
    found = [measure for measure in errors.values() if measure is not None]
    text = found[0].sentence if found else "No error could be measured."
    return Judgement(answer("measured", Verdict.yes if found else Verdict.no, wished=Verdict.yes), text, "findings")


def _unproven(data: ReportData, errors: dict[str, Measure | None]) -> Judgement:
    """No comparison: errors of these scenes, without a claim about others."""
    sizes = {name: one.number.value for name, one in errors.items() if one is not None and one.number.value}
    undecided = answer(_QUESTION, Verdict.undecided, wished=Verdict.yes)
    if len(sizes) < 2:
        return Judgement(undecided, "Too few trackers have a measured error to compare them.", _SECTION)
    scenes = count(len({entry.sequence.scene for entry in data.sequences.values()}), "scene")
    if data.nominal(data.summary).filter(pl.col("tracker").is_in(list(sizes)))["at"].n_unique() > 1:
        text = f"Undecided from {scenes}: the errors are not known at the same {data.axis.name}."
        return Judgement(undecided, text, _SECTION)
    low, high = min(sizes, key=lambda name: sizes[name] or 0.0), max(sizes, key=lambda name: sizes[name] or 0.0)
    times = ratio((sizes[high] or 0.0) / (sizes[low] or 1.0))
    text = f"Undecided from {scenes}; there, the error of {high} is {times} times as large as that of {low}."
    return Judgement(undecided, text, _SECTION)


def counted(data: ReportData) -> str:
    """How many questions about factors have which answer, as a sentence; empty where none was asked."""
    rows = data.dependence.filter(pl.col("n_levels") > 1)
    counts = {verdict: rows.filter(verdict=verdict).height for verdict in Verdict}
    known = ", ".join(f"{n} {verdict}" for verdict, n in counts.items() if n)
    return f"Does a factor change a statistic: {known}." if known else ""
