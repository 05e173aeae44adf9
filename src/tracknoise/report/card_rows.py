"""The cards of the first screen: sizes of errors, tracks, noise, and which tracker is better.

- One tracker in the condition that a card is about, and its tables.
- Rows of a card about errors: their size, bias, tails and growth.
- Rows of a card about tracks: outlier ratio and median lifetime.
- Which tracker is better: verdicts of the paired comparison of trackers.
- The noise to give to an estimator, from windows of tracks: sentences of one tracker.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import polars as pl

from tracknoise.analysis.factors import ROLES
from tracknoise.inference.estimates import Estimate
from tracknoise.phrases.error_headlines import band_text, first, rises
from tracknoise.phrases.headline import ReportedConditions, curve_bounds, scalar_bounds, scale_estimate
from tracknoise.phrases.noise_headlines import LEAST_WINDOWS, window_floor_px
from tracknoise.phrases.withheld import audited_bias, bias_covers, withheld_bias
from tracknoise.report.answer_summary import Answer, Judgement, Measure, Number
from tracknoise.report.headline_conditions import growth_verdict, reported_conditions
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Axis, Behaviour, FittedMeasure, Shape, Verdict, Weighting
from tracknoise.text import counted
from tracknoise.words import (
    SHAPES,
    bound_text,
    count,
    format_estimate,
    listing,
    number,
    percent,
    pixels,
    ratio,
    sentence_case,
)


@dataclass(frozen=True)
class Subject:
    """A tracker of a run at the lowest speed.

    Attributes
    ----------
    data
        The run.
    tracker
        Its name.
    """

    data: ReportData
    tracker: str

    @cached_property
    def conditions(self) -> ReportedConditions:
        """Which condition."""
        return reported_conditions(self.data, self.data.slowest)

    @cached_property
    def row(self) -> dict[str, Any] | None:
        """Row of the summary; None where the tracker was not measured."""
        return self.first("summary")

    @cached_property
    def intervals(self) -> pl.DataFrame:
        """Intervals of the condition."""
        return self.of("intervals")

    @property
    def at(self) -> int | None:
        """The reference age or frame; None where no age has enough features."""
        return None if self.row is None else self.row["at"]

    def of(self, table: str) -> pl.DataFrame:
        """Rows of the condition in a table of the run."""
        return self.conditions.of(getattr(self.data, table), self.tracker)

    def first(self, table: str, *filters: pl.Expr, **values: object) -> dict[str, Any] | None:
        """First row of the condition that has some values; None where there is none."""
        rows = self.of(table).filter(*filters, **values)
        return rows.row(0, named=True) if rows.height else None


def card_number(estimate: Estimate | None) -> Number:
    """An estimate as plain data."""
    value = None if estimate is None else _finite(estimate.value)
    if estimate is None or value is None:
        return Number(None, None, None, "unknown", "")
    low, high = _finite(estimate.low), _finite(estimate.high)
    text, _, interval = format_estimate(replace(estimate, low=low, high=high)).partition(" (")
    return Number(value, low, high, text, interval.removesuffix(")"))


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def with_interval(found: Number) -> str:
    """A number as part of a sentence."""
    return f"{found.text} ({found.interval})" if found.interval else found.text


def answer(question: str, verdict: str, *, wished: Verdict) -> Answer:
    """Answer a question, and say whether the answer is the one that is wished for."""
    found = Verdict(verdict)
    return Answer(question, found, None if found == Verdict.undecided else found == wished)


def larger(found: dict[str, Estimate | None]) -> tuple[str, Estimate] | None:
    """The coordinate whose estimate is the farthest from zero, and the estimate; None where none is known."""
    known = {name: one for name, one in found.items() if one is not None and one.value is not None}
    if not known:
        return None
    name = max(known, key=lambda each: abs(known[each].value or 0.0))
    return name, known[name]


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
    """Size of the error at the reference age, in the coordinate where it is larger."""
    if subject.data.truth_is_fitted:
        return _fitted(subject, smallest)
    found = _sizes(subject, name)
    largest = larger(found)
    if largest is None or subject.at is None:
        return None
    axis, estimate = largest
    shown, place = card_number(estimate), subject.conditions.place(subject.at)
    other = card_number(found["v" if axis == "u" else "u"])
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
    shown = card_number(Estimate.of_row(row, "sigma_px", "low", "high", "px"))
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
    axis, shown = found[0], card_number(found[1])
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
    shown = card_number(Estimate.of_row(row, part, f"{part}_low", f"{part}_high"))
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
    first, shown = card_number(_rms(subject, ages[0], axis)), card_number(last)
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


def outliers(subject: Subject, fewest: Answer | None) -> Measure | None:
    """Share of features that the tracker rejects."""
    value = None if subject.row is None else subject.row["outlier_ratio"]
    if value is None:
        return None
    shown = card_number(Estimate.of(value, scalar_bounds(subject.intervals, "outlier_ratio"), "share"))
    sentence = f"{subject.tracker} rejects {with_interval(shown)} of the features carried into a frame."
    note = "share of features carried into a frame that is rejected"
    return Measure("outliers", "share", shown, None, None, fewest, note, sentence, "outlier-ratio")


def lifetime(subject: Subject, longest: Answer | None) -> Measure | None:
    """Median lifetime, or the mean up to a horizon where more than half of the tracks are alive at the end."""
    if subject.row is None or not subject.row["n_tracks"]:
        return None
    if subject.row["median_lifetime"] is not None:
        return _of(subject, longest, "median_lifetime", "Kaplan-Meier median", "The median lifetime of tracks of")
    if subject.row["restricted_mean_lifetime"] is None:
        return None
    horizon = f"up to {counted(subject.row['restricted_to'], 'frame')}"
    note = f"mean {horizon}; over half are alive at the end"
    return _of(subject, longest, "restricted_mean_lifetime", note, f"The mean lifetime {horizon} of tracks of")


def _of(subject: Subject, longest: Answer | None, statistic: str, note: str, opening: str) -> Measure:
    value = None if subject.row is None else subject.row[statistic]
    shown = card_number(Estimate.of(value, scalar_bounds(subject.intervals, statistic), "frames"))
    bounds = f" ({shown.interval})" if shown.interval and statistic == "median_lifetime" else ""
    sentence = f"{opening} {subject.tracker} is {shown.text}{bounds}."
    return Measure("lifetime", "frames", shown, None, None, longest, note, sentence, "lifetimes")


_SECTION = "factor-effects"
_QUESTION = "shown"


def compared(data: ReportData, role: str) -> dict[str, Any] | None:
    """Row of the comparison of trackers at the lowest speed by one statistic; None where there is none."""
    names = [name for name, of in ROLES.items() if of == role]
    rows = data.dependence.filter(pl.col("statistic").is_in(names), pl.col("n_levels") > 1, factor="tracker")
    rows = rows.filter(pl.col("speed").is_null() | (pl.col("speed") == data.slowest))
    return rows.row(0, named=True) if rows.height else None


def best(data: ReportData, tracker: str, role: str, question: str) -> Answer | None:
    """Whether a tracker is the best by a statistic; None where trackers are not compared.

    The comparison is of the two trackers that differ most. Of others it is not known. Nor is it where they differ at a
    single age (or frame) only.
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
    """Which tracker is more accurate, and by how much."""
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


def answers_counted(data: ReportData) -> str:
    """How many questions about factors have which answer, as a sentence; empty where none was asked."""
    rows = data.dependence.filter(pl.col("n_levels") > 1)
    counts = {verdict: rows.filter(verdict=verdict).height for verdict in Verdict}
    known = ", ".join(f"{n} {verdict}" for verdict, n in counts.items() if n)
    return f"Does a factor change a statistic: {known}." if known else ""


WINDOW = 15
"""Length of the windows that sentences are about, in observations, or else the nearest shorter one.

At least `tracknoise.phrases.noise_headlines.LEAST_WINDOWS` of them show the depth of their point.
"""


def sigma_sentence(data: ReportData, tracker: str) -> str:
    """What an estimator should set, and what residuals look like. Empty where windows were not measured.

    It says where errors of the truth alone can be as large as what to set.
    """
    found = _at_window(data, tracker)
    if "consistent_sigma" not in found or "residual_core" not in found:
        return ""
    sigma, residual = found["consistent_sigma"], found["residual_core"]
    floor_px = window_floor_px(data.floor, reported_conditions(data, data.slowest), tracker, sigma["window"])
    covered = floor_px is not None and floor_px >= sigma["value"]
    return (
        f"Set {pixels(sigma['value'])} px for windows of {sigma['window']} frames; residuals look like "
        f"{pixels(residual['value'])} px{'; errors of the truth alone can cause this' if covered else ''}."
    )


def estimator_sentence(data: ReportData, tracker: str) -> str:
    """The same with the interval, and what follows for an estimator. Empty where windows were not measured."""
    found = _at_window(data, tracker)
    if "consistent_sigma" not in found:
        return ""
    sigma = found["consistent_sigma"]
    bounds = "" if sigma["low"] is None else f" ({pixels(sigma['low'])} to {pixels(sigma['high'])})"
    size = f"{pixels(sigma['value'])} px{bounds}"
    return f"For {tracker}, set {size} for windows of {sigma['window']} frames. {_trust(found)}".strip()


def sigma_message(data: ReportData) -> str:
    """Sigma to set over that of residuals, for the tracker whose residuals mislead most; empty if none is shown to."""
    rows = [_at_window(data, tracker).get("core_overconfidence") for tracker in data.trackers]
    shown = [row for row in rows if row is not None and row["low"] is not None and row["low"] > 1.0]
    if not shown:
        return ""
    row = max(shown, key=lambda one: one["low"])
    times = f"{ratio(row['value'])} times what residuals of {row['tracker']} look like"
    return f"In windows of {row['window']} frames, set {times}"


def _trust(found: dict[str, dict[str, Any]]) -> str:
    """What an estimator that is tuned to its residuals gets wrong."""
    row = found.get("core_overconfidence")
    if row is None or row["low"] is None or row["high"] is None:
        return ""
    size = f"{number(row['value'])} times (interval {number(row['low'])} to {number(row['high'])})"
    if row["low"] > 1.0:
        return f"Tuned to its residuals, an estimator claims depths that are more certain than they are, by {size}."
    if row["high"] < 1.0:
        return f"Tuned to its residuals, an estimator claims depths that are less certain than they are, by {size}."
    return f"Tuned to its residuals, an estimator is not shown to claim too much or too little: {size}."


def _at_window(data: ReportData, tracker: str) -> dict[str, dict[str, Any]]:
    """Quantities of the chosen window, by name; none where points are fitted to whole tracks."""
    if data.truth_is_fitted:
        return {}
    rows = data.nominal(data.window_sigmas).filter(tracker=tracker, trimming=data.trimming)
    enough = rows.filter(pl.col("n") * pl.col("value") >= LEAST_WINDOWS, quantity="depth_share")["window"]
    lengths = rows.filter(pl.col("window").is_in(enough.to_list()), quantity="consistent_sigma")["window"]
    if lengths.is_empty():
        return {}
    shorter = lengths.filter(lengths <= WINDOW)
    window = shorter.max() if shorter.len() else lengths.min()
    return {row["quantity"]: row for row in rows.filter(pl.col("window") == window).to_dicts()}
