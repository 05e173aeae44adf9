"""How errors grow with age, as far as the truth lets it be known."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import polars as pl

from tracknoise.analysis.estimand import OVER_SCENES, Estimand, RoleValues, Wording
from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.analysis.time_structure import LONG_LIVED, TIME_STRUCTURE, lagged, time_structure
from tracknoise.inference.estimates import Estimate
from tracknoise.statistics.changes import change_curves
from tracknoise.statistics.curves import ASPECT_COLUMNS, aspect_curves
from tracknoise.statistics.grouping import in_chunks
from tracknoise.tables.enumerations import Axis, Behaviour, Trimming, Verdict
from tracknoise.tables.findings_schema import ASPECT_CURVES, CHANGES
from tracknoise.tables.schema import INCREMENTS
from tracknoise.topics.answer_summary import Measure
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables
from tracknoise.topics.measures import Subject, answer, card_number, first, shown_size, trimmed_word, with_interval
from tracknoise.topics.run_data import RunData
from tracknoise.topics.sentences import because, joined
from tracknoise.topics.topic import NO_ROWS, Analysis, Column, Topic
from tracknoise.topics.withheld import audited_rise, growth_cover, only_covered, withheld_growth
from tracknoise.words import DASH, count, coverage_sentence, format_estimate, listing, ratio, sentence_case

_PARTS: Mapping[str, tuple[str, str]] = {
    "white_px_geometric": ("constant part", "px"),
    "walk_px_per_sqrt_frame_geometric": ("random walk", "px per sqrt(frame)"),
    "drift_px_per_frame_geometric": ("drift", "px per frame"),
}
"""Name and unit of the parts of the polynomial, by column."""
_LIMITED: Mapping[str, tuple[str, str]] = {
    "saturating_white_px": ("constant part", "px"),
    "saturating_px": ("saturating part", "px"),
    "saturating_frames": ("time constant", "frames"),
}
_OPENINGS: Mapping[Verdict, str] = {
    Verdict.yes: "errors grow",
    Verdict.no: "errors do not grow",
    Verdict.undecided: "growth is undecided",
}
_CHANGES: Mapping[Verdict, str] = {
    Verdict.yes: "the RMS grows; it becomes {} as large",
    Verdict.no: "the RMS does not grow; it becomes {} as large",
    Verdict.undecided: "growth of the RMS is undecided; it becomes {} as large",
}
_MOST_SPAN = 1000.0
"""A ratio whose interval spans more, from a fall to a rise, is unknown."""
_BESIDE_MODELS = " Outliers are included; a noise model excludes them, so that its walk and drift can be far smaller."
_KNOWN = (Behaviour.white, Behaviour.random_walk, Behaviour.drift, Behaviour.saturating)


def growth(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How errors grow with age."""
    rows = conditions.reported(tables["time_structure"]).filter(trimming=conditions.trimmings[0])
    ages = [_from_to(conditions, row) for row in rows.drop_nulls("growth_ratio").to_dicts()]
    shared = f" Growth is {ages[0]}." if len(set(ages)) == 1 else ""
    beside = _BESIDE_MODELS if conditions.trimmings[0] == Trimming.untrimmed else ""
    errors = f"{trimmed_word(conditions)}errors of the same tracks"
    return conditions.headline(
        lambda tracker: _growth_of(tables, conditions, tracker, names_ages=not shared),
        opening=f"Growth of {errors} {conditions.where(tables)}.{shared}",
        closing=f"All scenes have equal weight. Growth by less than the margin counts as none.{beside}",
        figure="time-structure",
        table="time_structure",
    )


def _growth_of(tables: RunTables, conditions: ReportedConditions, tracker: str, *, names_ages: bool) -> Part | None:
    rows = conditions.of(tables["time_structure"], tracker).filter(trimming=conditions.trimmings[0])
    sentences, covered = _growth_withheld(tables, conditions, tracker, rows)
    estimates: list[Estimate] = []
    for row in rows.filter(~pl.col("coordinate").is_in(covered)).sort("coordinate").to_dicts():
        text, row_estimates = _grown(row, f"This is {_from_to(conditions, row)}." if names_ages else "")
        sentences = [text, *sentences] if row["coordinate"] == "u" else [*sentences, text]
        estimates += row_estimates
    estimates += [Estimate.verdict(row, "growth") for row in rows.sort("coordinate").to_dicts()]
    return Part(" ".join(sentences), estimates) if sentences else None


def behaviour_of(
    tables: RunTables, conditions: ReportedConditions, tracker: str, coordinate: str, trimming: Trimming
) -> str | None:
    """How the error of a coordinate grows, in a word; None where no model was fitted."""
    row = first(conditions.of(tables["time_structure"], tracker).filter(coordinate=coordinate, trimming=trimming))
    return None if row is None else str(row["verdict"])


def _grown(row: Mapping[str, Any], ages: str) -> tuple[str, list[Estimate]]:
    """Sentences about one coordinate: whether the error grows, and how. `ages`: a sentence about them, or empty."""
    ratio_found, parts = growth_ratio(row), _parts(row)
    estimates = [] if ratio_found is None else [ratio_found]
    subject = f"{row['tracker']} in {row['coordinate']}"
    how, of_parts = _how(row, parts)
    if ratio_found is None:
        return joined([f"{subject}: {_OPENINGS[_grows(row)]}.", how]), estimates + of_parts
    size = format_estimate(replace(ratio_found, unit="times"))
    return joined([f"{subject}: {_CHANGES[_grows(row)].format(size)}.", ages, how]), estimates + of_parts


def _how(row: Mapping[str, Any], parts: Mapping[str, Estimate]) -> tuple[str, list[Estimate]]:
    """A sentence on how the error of one coordinate grows, from its established parts."""
    if row["verdict"] in _KNOWN and parts:
        listed = [f"{sentence_case(name)} is established: {format_estimate(size)}." for name, size in parts.items()]
        stated = coverage_sentence("Errors have heavy tails:", row["level"], row["coverage"])
        return joined([*listed, stated]), list(parts.values())
    if row["verdict"] == Behaviour.none:
        return because("No growth model fits", row["why"]), []
    is_told = _grows(row) == Verdict.undecided and growth_ratio(row) is not None
    return because("How it grows is undecided", row["why"]) if row["why"] and not is_told else "", []


def _parts(row: Mapping[str, Any]) -> dict[str, Estimate]:
    """The parts that are established: their intervals do not reach zero."""
    columns = _LIMITED if row["verdict"] == Behaviour.saturating else _PARTS
    sizes = {
        name: Estimate.of_row(row, column, f"{column}_low", f"{column}_high", unit)
        for column, (name, unit) in columns.items()
    }
    return {name: size for name, size in sizes.items() if size.above(0.0)}


def growth_ratio(row: Mapping[str, Any]) -> Estimate | None:
    """RMS at the last age that is compared over that at the first, by a row of `TIME_STRUCTURE`; None where unknown.

    Unknown it is too where the interval spans three orders of magnitude, from a fall to a rise.
    """
    factor = Estimate.of_row(row, "growth_ratio", "growth_ratio_low", "growth_ratio_high")
    low, high = factor.low, factor.high
    is_open = low is not None and high is not None and low < _NO_GROWTH < high and low * _MOST_SPAN < high
    return None if factor.value is None or is_open else factor


def _grows(row: Mapping[str, Any]) -> Verdict:
    """Whether errors grow; undecided in a run of an earlier version, which did not ask."""
    return Verdict(row["grows"] or Verdict.undecided)


def _growth_withheld(
    tables: RunTables, conditions: ReportedConditions, tracker: str, rows: pl.DataFrame
) -> tuple[list[str], list[str]]:
    """Sentences about coordinates that grow as the truth floor or faults of the truth do, and these coordinates."""
    summary = first(conditions.of(tables["summary"], tracker))
    if summary is None or summary["at"] is None:
        return [], []
    growing = rows.filter(grows=Verdict.yes)["coordinate"].sort().to_list()
    covers = {axis: growth_cover(tables, conditions, tracker, axis, summary["at"]) for axis in growing}
    covered = [*only_covered(covers)]
    by_floor = withheld_growth(tracker, conditions.place(summary["at"]), covers)
    uncovered = [axis for axis in growing if axis not in covered]
    audited = {axis: audited_rise(tables, conditions, tracker, axis, summary["at"]) for axis in uncovered}
    by_audit = {axis: sentence for axis, sentence in audited.items() if sentence is not None}
    return [*([] if by_floor is None else [by_floor]), *by_audit.values()], [*covered, *by_audit]


def growth_verdict(data: RunData, conditions: ReportedConditions, row: Mapping[str, Any], at: int | None) -> Verdict:
    """Whether the error of one coordinate grows; undecided where the errors of the truth can grow as much.

    `at`: the reference age; None where no age has enough features.
    """
    verdict = _grows(row)
    if verdict != Verdict.yes or at is None:
        return verdict
    where = data.tables, conditions, row["tracker"], row["coordinate"], at
    cover = growth_cover(*where)
    is_covered = (cover is not None and cover.is_covered) or audited_rise(*where) is not None
    return Verdict.undecided if is_covered else Verdict.yes


def growth_message(data: RunData) -> str:
    """The error that grows most, where growth is established; empty where it is not."""
    conditions = data.conditions()
    messages = []
    for row in _fits(data).to_dicts():
        value = row["growth_ratio"]
        if value is not None and growth_verdict(data, conditions, row, row["growth_to"]) == Verdict.yes:
            subject = f"The RMS error of {row['tracker']} in {row['coordinate']}"
            messages.append((value, f"{subject} becomes {ratio(value)} times as large {_up_to(conditions, row)}"))
    return max(messages)[1] if messages else ""


def behaviour(data: RunData, tracker: str) -> str | None:
    """How the error of a tracker grows, where this is established and the same in u and in v; otherwise None."""
    rows = _fits(data).filter(tracker=tracker).to_dicts()
    conditions = data.conditions()
    behaviours = {(row["verdict"], growth_verdict(data, conditions, row, row["growth_to"])) for row in rows}
    if len(rows) < 2 or len(behaviours) > 1:
        return None
    kind, verdict = behaviours.pop()
    return str(kind) if kind in _KNOWN and verdict != Verdict.undecided else None


def _fits(data: RunData) -> pl.DataFrame:
    return data.nominal(data["time_structure"]).filter(pl.col("tracker").is_in(data.trackers), trimming=data.trimming)


_NO_GROWTH = 1.0
IN_WORDS: Mapping[str, str] = {Behaviour.white: "constant", Behaviour.none: "no model fits"}
"""Verdicts on growth that are clearer in other words."""


def growth_measure(subject: Subject) -> Measure | None:
    """RMS at the reference age over that at the first, in the coordinate of the run, and how errors grow."""
    rows, axis = _fits_of(subject), shown_size(subject.data)[1]
    row = rows.get(axis)
    factor = None if row is None else growth_ratio(row)
    if row is None or factor is None:
        return None
    verdict = growth_verdict(subject.data, subject.conditions, row, subject.at)
    shown, errors = card_number(replace(factor, unit="times")), f"errors of {subject.tracker}"
    note = f"RMS in {axis} of the same tracks {_from_to(subject.conditions, row)}; {_kinds(rows.values())}"
    change = f"their RMS in {axis} becomes {with_interval(shown)} as large"
    sentence = {
        Verdict.yes: f"{sentence_case(errors)} grow with age; {change}.",
        Verdict.no: f"No growth of {errors} was found; {change}.",
        Verdict.undecided: f"Whether {errors} grow with age is undecided; {change}.",
    }[verdict]
    answered = answer("grows", verdict, wished=Verdict.no)
    return Measure("growth", "times", shown, _NO_GROWTH, answered, note, sentence, "time-structure")


def _fits_of(subject: Subject) -> dict[str, dict[str, Any]]:
    """Rows of `TIME_STRUCTURE` by coordinate."""
    rows = subject.of("time_structure").filter(trimming=subject.conditions.trimming).sort("coordinate")
    return {row["coordinate"]: row for row in rows.to_dicts()}


def _growth_cell(subject: Subject, coordinate: str) -> str:
    row = _fits_of(subject).get(coordinate)
    factor = None if row is None else growth_ratio(row)
    return DASH if row is None or factor is None else f"{format_estimate(factor)} times; {_kind_of_growth(row)}"


def _from_to(conditions: ReportedConditions, row: Mapping[str, Any]) -> str:
    """The ages that are compared, in a few words."""
    first, last = row["growth_from"], row["growth_to"]
    if conditions.axis == Axis.age:
        return f"from age {first} to {last}"
    return f"from {first} to {count(last, 'frame')} from the key frame"


def _kind_of_growth(row: Mapping[str, Any]) -> str:
    """How errors grow, in a few words. `row`: of `TIME_STRUCTURE`."""
    if row["verdict"] == Behaviour.undecided:
        return "kind undecided" if _grows(row) == Verdict.yes else "undecided"
    return IN_WORDS.get(row["verdict"], row["verdict"])


def _up_to(conditions: ReportedConditions, row: Mapping[str, Any]) -> str:
    """The last age that is compared, in a few words."""
    last = row["growth_to"]
    return f"by age {last}" if conditions.axis == Axis.age else f"within {count(last, 'frame')}"


def _kinds(rows: Iterable[Mapping[str, Any]]) -> str:
    axes_of_kind: dict[str, list[str]] = {}
    for row in rows:
        axes_of_kind.setdefault(_kind_of_growth(row), []).append(row["coordinate"])
    if len(axes_of_kind) == 1:
        return next(iter(axes_of_kind))
    return ", ".join(f"{kind} in {listing(axes)}" for kind, axes in axes_of_kind.items())


def _aspect_curves(inputs: RunInputs) -> list[pl.DataFrame]:
    tables = inputs.run.stacked_tables("aspects", inputs.keys, only=ASPECT_COLUMNS)
    return [aspect_curves(tables, min_features=inputs.min_features)]


def _increments(inputs: RunInputs) -> Iterator[pl.DataFrame]:
    return in_chunks(inputs.run.stacked_tables("increments", inputs.keys), INCREMENTS, "increments")


def _time_structure(inputs: RunInputs) -> list[pl.DataFrame]:
    structure = time_structure(
        inputs.moments,
        (lagged(table, inputs.few) for table in _increments(inputs)),
        blocks=inputs.blocks,
        aspects=inputs.aspects(LONG_LIVED),
        aspect_blocks=inputs.aspect_blocks,
        margin=inputs.margin,
        key_frames=inputs.key_frames,
        min_features=inputs.min_features,
        **inputs.intervals,
    )
    return [structure]


GROWTH = Topic(
    "growth",
    (
        Analysis((ASPECT_CURVES,), _aspect_curves),
        Analysis((CHANGES,), lambda inputs: [change_curves(_increments(inputs))]),
        Analysis((TIME_STRUCTURE,), _time_structure, if_fitted=NO_ROWS),
    ),
    headline=growth,
    measure=growth_measure,
    columns=lambda _: [Column(f"in {axis}", partial(_growth_cell, coordinate=axis), "growth") for axis in "uv"],
    rows_of_card=("growth",),
    compared=(
        Estimand(
            "growth",
            "Factor by which the second moment grows from the youngest to the oldest age, by a straight line through "
            f"logarithms: {OVER_SCENES} and both coordinates.",
            RoleValues("growth", axes=(Axis.age,)),
            Wording("has errors that grow less", "squared errors grow", "more", "less", "much", is_secondary=True),
            of_errors=True,
        ),
    ),
)
