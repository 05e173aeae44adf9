"""How errors grow with age, as far as the truth lets it be known."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.phrases.answer_summary import Measure
from tracknoise.phrases.bands import AGE
from tracknoise.phrases.headline import (
    Headline,
    Part,
    ReportedConditions,
    RunTables,
    by_tracker,
)
from tracknoise.phrases.measures import (
    POOLED_WORDS,
    Subject,
    answer,
    asked_sentence,
    card_number,
    first,
    larger,
    reported_conditions,
    trimmed_word,
)
from tracknoise.phrases.run_data import RunData
from tracknoise.phrases.withheld import (
    audited_rise,
    growth_cover,
    withheld_growth,
)
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.enumerations import Axis, Behaviour, Verdict
from tracknoise.words import (
    count,
    format_estimate,
    listing,
    pixels,
    ratio,
    sentence_case,
)

_GROWTH: Mapping[str, tuple[str, str, str]] = {
    Behaviour.white: ("constant", "white_px", "px"),
    Behaviour.random_walk: ("random walk", "walk_px_per_sqrt_frame", "px per sqrt(frame)"),
    Behaviour.drift: ("drift", "drift_px_per_frame", "px per frame"),
    Behaviour.saturating: ("saturating", "saturating_px", "px"),
}
"""Name of a behaviour, and the column and the unit of its size."""


_GROWING = (Behaviour.random_walk, Behaviour.drift, Behaviour.saturating)
"""Behaviours that the errors of poses have too."""


_RISING = ("walk_px_per_sqrt_frame", "drift_px_per_frame")


def growth(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How errors grow with age."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _growth_of(tables, conditions, tracker),
        opening=f"Growth of {trimmed_word(conditions)}errors {conditions.where(tables['summary'])}, {POOLED_WORDS}.",
        topic="growth",
        figure="time-structure",
        table="time_structure",
    )


def _growth_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(tables["time_structure"], tracker).filter(trimming=conditions.trimmings[0])
    withheld, covered = _growth_withheld(tables, conditions, tracker, rows)
    texts: dict[str, list[str]] = {}
    estimates = []
    for row in rows.filter(~pl.col("coordinate").is_in(covered)).sort("coordinate").to_dicts():
        name, size = _behaviour(row)
        estimates += size
        texts.setdefault(", ".join([name, *map(format_estimate, size)]), []).append(row["coordinate"])
    sentences = [f"{tracker} in {listing(coordinates)}: {text}." for text, coordinates in texts.items()]
    sentences += withheld
    estimates += [Estimate.verdict(row, "growth") for row in rows.sort("coordinate").to_dicts()]
    return Part(" ".join(sentences), estimates) if sentences else None


def _growth_withheld(
    tables: RunTables, conditions: ReportedConditions, tracker: str, rows: pl.DataFrame
) -> tuple[list[str], list[str]]:
    """Sentences about coordinates that grow as the truth floor or faults of the truth do, and these coordinates."""
    summary = first(conditions.of(tables["summary"], tracker))
    if summary is None or summary["at"] is None:
        return [], []
    growing = rows.filter(pl.col("verdict").is_in(_GROWING))["coordinate"].sort().to_list()
    covers = {axis: growth_cover(tables, conditions, tracker, axis, summary["at"]) for axis in growing}
    covered = [axis for axis, cover in covers.items() if cover is not None and cover.is_covered]
    by_floor = withheld_growth(tracker, conditions.place(summary["at"]), covers)
    rest = [axis for axis in growing if axis not in covered]
    audited = {axis: audited_rise(tables, conditions, tracker, axis, summary["at"]) for axis in rest}
    by_audit = {axis: sentence for axis, sentence in audited.items() if sentence is not None}
    return [*([] if by_floor is None else [by_floor]), *by_audit.values()], [*covered, *by_audit]


def _behaviour(row: Mapping[str, Any]) -> tuple[str, list[Estimate]]:
    """Name of the behaviour of one coordinate, and its size if it has one."""
    if row["verdict"] not in _GROWTH:
        undecided = f"undecided; {row['why']}" if row["why"] else "undecided"
        none = row["why"] or "none of the models fits"
        return (none if row["verdict"] == Behaviour.none else undecided), []
    name, column, unit = _GROWTH[row["verdict"]]
    size = Estimate.of_row(row, column, f"{column}_low", f"{column}_high", unit)
    return f"mostly {name}" if rises(row) else name, [] if size.value is None else [size]


def rises(row: Mapping[str, Any]) -> bool:
    """Whether errors of a coordinate are mostly constant, but have a part that grows, by its interval.

    Parameters
    ----------
    row
        Of `TIME_STRUCTURE`.
    """
    return row["verdict"] == Behaviour.white and any((row[f"{part}_low"] or 0.0) > 0 for part in _RISING)


def growth_verdict(data: RunData, conditions: ReportedConditions, row: Mapping[str, Any], at: int | None) -> Verdict:
    """Whether the error of one coordinate grows; undecided where the errors of the truth can grow as much.

    An error that is mostly constant grows where a part of it does, by its interval. `at`: None where no age has enough
    features.
    """
    if row["verdict"] in (Behaviour.undecided, Behaviour.none):
        return Verdict.undecided
    if (row["verdict"] not in _GROWING and not rises(row)) or at is None:
        return Verdict.no
    tables = {"curves": data.curves, "floor": data.floor, "audit_curves": data.audit_curves}
    where = tables, conditions, row["tracker"], row["coordinate"], at
    cover = growth_cover(*where)
    is_covered = (cover is not None and cover.is_covered) or audited_rise(*where) is not None
    return Verdict.undecided if is_covered else Verdict.yes


def growth_message(data: RunData) -> str:
    """The RMS error that grows most, where growth is established; empty where it is not."""
    found = [(times, text) for row in _fits(data).to_dicts() for times, text in _grown(data, row)]
    return max(found)[1] if found else ""


def behaviour(data: RunData, tracker: str) -> str | None:
    """How the error of a tracker grows, where this is established and the same in u and in v; otherwise None."""
    rows = _fits(data).filter(tracker=tracker).to_dicts()
    ends = [_ends(data, row) for row in rows]
    found = {
        (row["verdict"], growth_verdict(data, reported_conditions(data, data.slowest), row, points["at"].last()))  # type: ignore[arg-type]
        for row, points in zip(rows, ends, strict=True)
    }
    if len(rows) < 2 or len(found) > 1:
        return None
    kind, verdict = found.pop()
    if verdict == Verdict.undecided or (kind == Behaviour.white and verdict == Verdict.yes):
        return None
    return str(kind)


def _fits(data: RunData) -> pl.DataFrame:
    return data.nominal(data.time_structure).filter(pl.col("tracker").is_in(data.trackers), trimming=data.trimming)


def _grown(data: RunData, row: Mapping[str, Any]) -> list[tuple[float, str]]:
    """How many times the RMS of one tracker and coordinate grows up to the reference age; nothing if it does not."""
    axis, ends = row["coordinate"], _ends(data, row)
    if row["verdict"] not in _GROWING or ends.height < 2 or not ends[axis][0]:
        return []
    at, since, last = ends.row(-1)
    verdict = growth_verdict(data, reported_conditions(data, data.slowest), row, at)
    times = last / ends[axis][0]
    if verdict != Verdict.yes or times <= 1.0:
        return []
    place = f"up to age {since}" if data.axis is AGE else f"within {count(since, 'frame')}"
    return [(times, f"The RMS error of {row['tracker']} in {axis} grows {ratio(times)} times {place}")]


def _ends(data: RunData, row: Mapping[str, Any]) -> pl.DataFrame:
    """RMS of one tracker and coordinate up to the reference age: columns at, since and that of the coordinate."""
    points = data.nominal(data.points).filter(
        pl.col("since").is_between(1, REFERENCE_AGE),
        role="second",
        trimming=data.trimming,
        population=data.population,
        tracker=row["tracker"],
    )
    return points.sort("since").select("at", "since", row["coordinate"])


_BEHAVIOURS: Mapping[str, str] = {Behaviour.white: "constant", Behaviour.none: "no model fits"}


def growth_measure(subject: Subject) -> Measure | None:
    """RMS error at the first and at the reference age, and how it grows.

    It is that of the coordinate that the verdict is about: the larger one where it is about both.
    """
    rows = subject.of("time_structure").filter(trimming=subject.conditions.trimming).sort("coordinate").to_dicts()
    if not rows or subject.at is None:
        return None
    verdicts = {row["coordinate"]: growth_verdict(subject.data, subject.conditions, row, subject.at) for row in rows}
    verdict = next((one for one in (Verdict.yes, Verdict.undecided) if one in verdicts.values()), Verdict.no)
    ages = _growth_ages(subject)
    about = [axis for axis, one in verdicts.items() if one == verdict]
    found = larger({axis: _rms_at(subject, ages[-1], axis) for axis in about}) if ages else None
    if found is None:
        return None
    axis, last = found
    first, shown = card_number(_rms_at(subject, ages[0], axis)), card_number(last)
    change = f"the RMS in {axis} goes from {first.text} to {shown.text}"
    first = replace(first, text=pixels(first.value))
    note = f"RMS in {axis}, {_places(subject, ages)}; {_behaviours(rows)}"
    errors = f"errors of {subject.tracker}"
    sentence = asked_sentence(verdict, f"{errors} grow with age", f"No growth of {errors} was found", change)
    sentence = sentence_case(sentence) if verdict == Verdict.yes else sentence
    answered = answer("grows", verdict, wished=Verdict.no)
    return Measure("growth", "px", shown, first, None, answered, note, sentence, "time-structure")


def _growth_ages(subject: Subject) -> list[int]:
    """The first place after zero that has an RMS, and the reference place; empty where these are the same."""
    points = subject.of("points").filter(
        pl.col("since") > 0, role="second", trimming=subject.conditions.trimming, population=subject.data.population
    )
    known: list[int] = points.filter(pl.col("at") <= subject.at)["at"].sort().to_list()
    return [known[0], known[-1]] if len(known) > 1 else []


def _places(subject: Subject, ages: Sequence[int]) -> str:
    """The first and the last of some ages or frames, in words."""
    first, last = (subject.conditions.since(at) for at in (ages[0], ages[-1]))
    if subject.conditions.axis == Axis.age:
        return f"at age {first} and {last}"
    return f"{first} and {count(last, 'frame')} after the key frame"


def _rms_at(subject: Subject, at: int, axis: str) -> Estimate | None:
    points = subject.of("points").filter(
        role="second", trimming=subject.conditions.trimming, population=subject.data.population, at=at
    )
    row = first(points)
    return None if row is None else Estimate.of_row(row, axis, f"{axis}_low", f"{axis}_high", "px")


def _behaviours(rows: list[dict[str, Any]]) -> str:
    named: dict[str, list[str]] = {}
    for row in rows:
        name = _BEHAVIOURS.get(row["verdict"], row["verdict"])
        named.setdefault(f"mostly {name}" if rises(row) else name, []).append(row["coordinate"])
    if len(named) == 1:
        return next(iter(named))
    return ", ".join(f"{name} in {listing(axes)}" for name, axes in named.items())
