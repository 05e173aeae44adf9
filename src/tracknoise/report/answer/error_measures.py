"""Rows of a card about errors: their size, bias, tails and growth."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.headlines.error_size import first
from tracknoise.findings.headlines.error_topics import band_text, rises
from tracknoise.findings.headlines.reported_conditions import curve_bounds, scale_estimate
from tracknoise.findings.headlines.withheld import audited_bias, bias_covers, withheld_bias
from tracknoise.findings.wording import SHAPES, count, listing, percent, sentence_case
from tracknoise.report.answer.subject import Subject, answer, larger, number, with_interval
from tracknoise.report.answer.summary import Answer, Measure
from tracknoise.report.growth import growth_verdict
from tracknoise.tables.enumerations import Axis, Behaviour, FittedMeasure, Shape, Verdict, Weighting

_CURVES, _SHAPE, _GROWTH = "error-by-tracker", "gaussianity", "time-structure"
_GAUSSIAN_KURTOSIS = 8.0
"""Of two coordinates."""
_SIZES = {"core": "core error", "rms": "RMS error"}
_HEAVY = (Shape.heavy_tailed, Shape.contaminated)
_WORDS: Mapping[str, str] = {Behaviour.white: "constant", Behaviour.none: "no model fits"}


def size_name(subjects: Sequence[Subject]) -> str:
    """Which size of the error all trackers can be compared by: the core, or the RMS where one has no core."""
    known = [subject for subject in subjects if subject.at is not None]
    return "core" if all(larger(_sizes(subject, "core")) for subject in known) else "rms"


def error(subject: Subject, smallest: Answer | None, *, name: str) -> Measure | None:
    """Size of the error at the reference age, in the coordinate where it is larger.

    Parameters
    ----------
    subject
        Which tracker.
    smallest
        Whether it has the smallest core.
    name
        From `size_name`.
    """
    if subject.data.truth_is_fitted:
        return _fitted(subject, smallest)
    found = _sizes(subject, name)
    largest = larger(found)
    if largest is None or subject.at is None:
        return None
    axis, estimate = largest
    shown, place = number(estimate), subject.conditions.place(subject.at)
    other = number(found["v" if axis == "u" else "u"])
    note = f"{_SIZES[name]} in {axis} {place}; in {'v' if axis == 'u' else 'u'} {other.text}"
    sentence = f"The {_SIZES[name]} of {subject.tracker} in {axis} is {with_interval(shown)}."
    return Measure("error", "px", shown, None, None, smallest, note, sentence, _CURVES)


def _sizes(subject: Subject, name: str) -> dict[str, Estimate | None]:
    return {axis: _size(subject, name, axis) for axis in "uv"}


def _size(subject: Subject, name: str, axis: str) -> Estimate | None:
    """Core or RMS at the reference age, in one coordinate."""
    row, at, trimming = subject.row, subject.at, subject.conditions.trimming
    value = None if row is None else row[f"{trimming}_{name}_{axis}_px"]
    if value is None or at is None:
        return None
    if name == "core":
        bounds = scale_estimate(subject.intervals, subject.conditions, "core", at, axis)
    else:
        bounds = curve_bounds(subject.intervals, subject.conditions, "second", at, axis)
    return Estimate.of(value, bounds, "px")


def _fitted(subject: Subject, smallest: Answer | None) -> Measure | None:
    """Noise of one coordinate, where true positions are fitted to the tracks."""
    whole = pl.col("length_low").is_null()
    trimming = subject.conditions.trimming
    rows = subject.of("triangulated_noise").filter(whole, trimming=trimming, coordinate="both")
    found = {row["measure"]: row for row in rows.to_dicts()}
    row = next((found[measure] for measure in FittedMeasure if measure in found), None)
    if row is None:
        return None
    shown = number(Estimate.of_row(row, "sigma_px", "low", "high", "px"))
    note = "standard deviation of one coordinate, corrected for the fit"
    sentence = f"The noise of {subject.tracker} in one coordinate is {with_interval(shown)}."
    return Measure("noise", "px", shown, None, None, smallest, note, sentence, "findings")


def bias(subject: Subject) -> Measure | None:
    """Mean error at the reference age in the coordinate where it is larger, and the test of all ages."""
    rows = subject.of("zero_mean").filter(trimming=subject.conditions.trimming, axis=subject.conditions.axis)
    overall, there = (first(rows.filter(at)) for at in (pl.col("at").is_null(), pl.col("at").eq_missing(subject.at)))
    if overall is None or there is None or subject.at is None or subject.row is None:
        return None
    found = larger({axis: _mean(subject, there, axis) for axis in "uv"})
    if found is None:
        return None
    axis, shown = found[0], number(found[1])
    place = subject.conditions.place(subject.at)
    by_floor = withheld_bias(subject.tracker, place, bias_covers(subject.row, there)) is not None
    curves = {"audit_curves": subject.data.audit_curves}
    covered = by_floor or audited_bias(curves, subject.conditions, subject.tracker, subject.at) is not None
    verdict = Verdict.undecided if covered and overall["verdict"] == Verdict.yes else Verdict(overall["verdict"])
    note = f"mean error in {axis} {place}" + ("; errors of the truth can cause it" if covered else "")
    size = f"its mean error in {axis} is {with_interval(shown)}"
    sentence = _asked(verdict, f"{subject.tracker} is biased", f"No bias of {subject.tracker} was found", size)
    found_answer = answer("biased", verdict, wished=Verdict.no)
    return Measure("bias", "px", shown, None, 0.0, found_answer, note, sentence, _CURVES)


def _mean(subject: Subject, row: Mapping[str, Any], axis: str) -> Estimate | None:
    """Mean over scenes, as it is tested."""
    if row[f"mean_{axis}_px"] is None:
        return None
    bounds = curve_bounds(subject.intervals, subject.conditions, "mean", row["at"], axis, weighting=Weighting.scenes)
    return Estimate.of(row[f"mean_{axis}_px"], bounds, "px")


def tails(subject: Subject) -> Measure | None:
    """Kurtosis within scenes at ages around the reference age, and whether tails are heavier than a Gaussian's."""
    rows = subject.of("gaussianity").filter(trimming=subject.conditions.trimming).sort("age_low")
    since = 1 if subject.at is None else abs(subject.conditions.since(subject.at))
    holding = rows.filter(pl.col("age_low") <= since, pl.col("age_high").fill_null(since) >= since)
    row = first(holding) or first(rows)
    if row is None:
        return None
    pooled = row["kurtosis_within"] is None
    part, part_name = ("kurtosis", "pooled kurtosis") if pooled else ("kurtosis_within", "kurtosis")
    shown = number(Estimate.of_row(row, part, f"{part}_low", f"{part}_high"))
    heavy = {Shape.undecided: Verdict.undecided, **dict.fromkeys(_HEAVY, Verdict.yes)}.get(row["verdict"], Verdict.no)
    found = answer("heavy tails", heavy, wished=Verdict.no)
    sentence = (
        f"Errors of {subject.tracker} are {SHAPES[row['verdict']].partition(' (')[0]}: "
        f"their kurtosis is {with_interval(shown)}."
    )
    ages = band_text(subject.conditions.axis, row["age_low"], row["age_high"])
    note = f"{part_name}, {ages} (Gaussian: {_GAUSSIAN_KURTOSIS:g}){_beyond(subject)}"
    return Measure("tails", "", shown, None, _GAUSSIAN_KURTOSIS, found, note, sentence, _SHAPE)


def _beyond(subject: Subject) -> str:
    """Share of errors larger than three cores, in the coordinate where it is larger."""
    row = subject.row or {}
    known = [row[name] for axis in "uv" if row.get(name := f"{subject.conditions.trimming}_beyond_{axis}") is not None]
    return f"; {percent(max(known))} beyond three cores" if known else ""


def growth(subject: Subject) -> Measure | None:
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
    found = larger({axis: _rms(subject, ages[-1], axis) for axis in about}) if ages else None
    if found is None:
        return None
    axis, last = found
    first, shown = number(_rms(subject, ages[0], axis)), number(last)
    change = f"the RMS in {axis} goes from {first.text} to {shown.text}"
    first = replace(first, text=first.text.removesuffix("px").strip())
    note = f"RMS in {axis}, {_places(subject, ages)}; {_behaviours(rows)}"
    errors = f"errors of {subject.tracker}"
    sentence = _asked(verdict, f"{errors} grow with age", f"No growth of {errors} was found", change)
    sentence = sentence_case(sentence) if verdict == Verdict.yes else sentence
    answered = answer("grows", verdict, wished=Verdict.no)
    return Measure("growth", "px", shown, first, None, answered, note, sentence, _GROWTH)


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


def _rms(subject: Subject, at: int, axis: str) -> Estimate | None:
    points = subject.of("points").filter(
        role="second", trimming=subject.conditions.trimming, population=subject.data.population, at=at
    )
    row = first(points)
    return None if row is None else Estimate.of_row(row, axis, f"{axis}_low", f"{axis}_high", "px")


def _behaviours(rows: list[dict[str, Any]]) -> str:
    named: dict[str, list[str]] = {}
    for row in rows:
        name = _WORDS.get(row["verdict"], row["verdict"])
        named.setdefault(f"mostly {name}" if rises(row) else name, []).append(row["coordinate"])
    if len(named) == 1:
        return next(iter(named))
    return ", ".join(f"{name} in {listing(axes)}" for name, axes in named.items())


def _asked(verdict: Verdict, yes: str, no: str, size: str) -> str:
    """A sentence by its verdict. What was found comes first, the size after it."""
    opening = {Verdict.yes: yes, Verdict.no: no, Verdict.undecided: f"It is undecided whether {yes}"}[verdict]
    return f"{opening}; {size}."
