"""Whether the mean error is zero."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.phrases.answer_summary import Measure
from tracknoise.phrases.headline import (
    Headline,
    Part,
    ReportedConditions,
    RunTables,
    by_tracker,
    curve_bounds,
    curve_scenes,
)
from tracknoise.phrases.measures import (
    Subject,
    answer,
    asked_sentence,
    card_number,
    first,
    larger,
    trimmed_word,
    with_interval,
)
from tracknoise.phrases.size_topic import in_u_and_v
from tracknoise.phrases.withheld import (
    audited_bias,
    bias_covers,
    covered_coordinates,
    withheld_bias,
)
from tracknoise.tables.enumerations import Trimming, Verdict, Weighting
from tracknoise.words import (
    chance,
    count,
    format_estimate,
    percent,
    sentence_case,
)


def bias(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether the mean error is zero."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _bias_of(tables, conditions, tracker),
        opening=f"Bias {conditions.where(tables['summary'])}.",
        closing=f"The test takes all {conditions.axis}s together and weights scenes equally.",
        topic="bias",
        figure="error-by-tracker",
        table="zero_mean",
    )


def _bias_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(tables["zero_mean"], tracker).filter(trimming=conditions.trimmings[0], axis=conditions.axis)
    overall, summary = first(rows.filter(pl.col("at").is_null())), first(conditions.of(tables["summary"], tracker))
    if overall is None:
        return None
    at = None if summary is None else summary["at"]
    there = None if at is None else first(rows.filter(at=at))
    covers = {} if summary is None or there is None else bias_covers(summary, there)
    withheld = None if there is None else withheld_bias(tracker, conditions.opening_place(there["at"]), covers)
    if withheld is None and there is not None:
        withheld = audited_bias(tables, conditions, tracker, there["at"])
    if withheld is not None and overall["verdict"] == Verdict.yes:
        return Part(withheld, [Estimate.verdict(overall, "effect_px")])
    trimming = conditions.trimmings[0]
    estimates = [] if there is None else _means(tables, conditions, tracker, there, trimming)
    text = _zero_or_not(f"the mean {trimmed_word(conditions)}error of {tracker}", overall)
    if there is not None and len(estimates) == 2:
        u, v = map(format_estimate, estimates)
        text += f" {conditions.opening_place(there['at'])}, the mean in u is {u}. In v it is {v}."
        intervals = conditions.of(tables["intervals"], tracker)
        scenes = curve_scenes(intervals, conditions, "mean", there["at"], "u", weighting=Weighting.scenes, of="In u")
        text += f" {scenes}" if scenes else ""
        if there["share_of_second"] is not None:
            share = percent(there["share_of_second"])
            text += f" The square of the mean is {share} of the second moment, u and v together."
        text += covered_coordinates(covers)
        untrimmed = _untrimmed_means(tables, conditions, tracker, there["at"])
        text += f" Without trimming, the mean is {in_u_and_v(untrimmed)}." if len(untrimmed) == 2 else ""
        estimates += untrimmed
    return Part(text, [*estimates, Estimate.verdict(overall, "effect_px")])


def _untrimmed_means(tables: RunTables, conditions: ReportedConditions, tracker: str, at: int) -> list[Estimate]:
    """Mean errors of all tracks, where the verdict is about those that trimming kept."""
    if conditions.percentile is None or conditions.trimming == Trimming.untrimmed:
        return []
    rows = conditions.of(tables["zero_mean"], tracker)
    there = first(rows.filter(trimming=Trimming.untrimmed, axis=conditions.axis, at=at))
    return [] if there is None else _means(tables, conditions, tracker, there, Trimming.untrimmed)


def _zero_or_not(mean: str, overall: Mapping[str, Any]) -> str:
    p = overall["sign_flip_p_family"]
    test = "" if p is None else f" ({chance(p)}, {count(overall['n_scenes'], 'scene')})"
    if overall["verdict"] == Verdict.yes:
        return f"{sentence_case(mean)} is not zero{test}."
    why = f": {overall['why']}" if overall["why"] and p is None else ""
    return f"It is undecided whether {mean} is zero{test}{why}."


def _means(
    tables: RunTables, conditions: ReportedConditions, tracker: str, row: Mapping[str, Any], trimming: Trimming
) -> list[Estimate]:
    found = []
    intervals, scenes = conditions.of(tables["intervals"], tracker), Weighting.scenes
    for coordinate in "uv":
        value = row[f"mean_{coordinate}_px"]
        bounds = curve_bounds(intervals, conditions, "mean", row["at"], coordinate, trimming=trimming, weighting=scenes)
        found += [] if value is None else [Estimate.of(value, bounds, "px")]
    return found


def bias_measure(subject: Subject) -> Measure | None:
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
    sentence = asked_sentence(verdict, f"{subject.tracker} is biased", f"No bias of {subject.tracker} was found", size)
    found_answer = answer("biased", verdict, wished=Verdict.no)
    return Measure("bias", "px", shown, None, 0.0, found_answer, note, sentence, "error-by-tracker")


def _mean(subject: Subject, row: Mapping[str, Any], axis: str) -> Estimate | None:
    """Mean over scenes, as it is tested."""
    if row[f"mean_{axis}_px"] is None:
        return None
    bounds = curve_bounds(subject.intervals, subject.conditions, "mean", row["at"], axis, weighting=Weighting.scenes)
    return Estimate.of(row[f"mean_{axis}_px"], bounds, "px")
