"""Whether the mean error is zero."""

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.analysis.estimand import Estimand, RoleValues, Wording
from tracknoise.analysis.paired_tests import Unit
from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.analysis.scene_values import SIGNED
from tracknoise.analysis.zero_mean import ZERO_MEAN, verdict_at, zero_mean
from tracknoise.inference.estimates import Estimate
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.enumerations import Trimming, Verdict, Weighting
from tracknoise.tables.findings_schema import CURVES
from tracknoise.topics.answer_summary import Measure, Number
from tracknoise.topics.headline import (
    Headline,
    Part,
    ReportedConditions,
    RunTables,
    curve_estimate,
    curve_rows,
    curve_scenes,
)
from tracknoise.topics.measures import Subject, answer, card_number, first, trimmed_word, with_interval
from tracknoise.topics.run_data import RunData
from tracknoise.topics.sentences import because, each_axis, joined
from tracknoise.topics.topic import NO_ROWS, Analysis, Column, Topic
from tracknoise.topics.withheld import audited_bias, bias_covers, covered_coordinates, withheld_bias
from tracknoise.words import DASH, chance, count, format_estimate, intervals_at, listing, percent, px, sentence_case


def bias(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether the mean error is zero at the reference age, and at any age."""
    return conditions.headline(
        lambda tracker: _bias_of(tables, conditions, tracker),
        opening=f"Bias {conditions.where(tables)}.",
        closing=_closing(conditions.reported(tables["zero_mean"])),
        figure="error-by-tracker",
        table="zero_mean",
    )


def _closing(rows: pl.DataFrame) -> str:
    """What intervals and tests are about."""
    levels = rows["level"].drop_nulls()
    if levels.is_empty():
        return "Intervals are for one coordinate alone; all scenes have equal weight."
    return f"Tests and their {intervals_at(levels[0])} are for u and v together; all scenes have equal weight."


def _bias_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    overall, summary = _test(tables, conditions, tracker, None), first(conditions.of(tables["summary"], tracker))
    if overall is None:
        return None
    verdict = Estimate.verdict(overall, "effect_px")
    mean = f"the mean {trimmed_word(conditions)}error of {tracker}"
    row = None if summary is None or summary["at"] is None else _test(tables, conditions, tracker, summary["at"])
    if row is None or summary is None:
        return Part(_at_all_ages(mean, overall), [verdict])
    covers = bias_covers(summary, row)
    withheld = withheld_bias(tracker, conditions.opening_place(row["at"]), covers)
    withheld = withheld or audited_bias(tables, conditions, tracker, row["at"])
    if withheld is not None and Verdict.yes in (verdict_at(row), overall["verdict"]):
        return Part(withheld, [verdict])
    means = _means(tables, conditions, tracker, row, conditions.trimmings[0])
    length = [] if row["effect_low_px"] is None else [_length(row)]
    sentences = _at_one_age(mean, conditions, row, length, means)
    sentences += [_wider_claim(conditions, row, overall)]
    intervals = conditions.intervals(tables, tracker)
    sentences += [
        curve_scenes(intervals, conditions, "mean", row["at"], "u", weighting=Weighting.scenes, of="The mean in u")
    ]
    if row["share_of_second"] is not None:
        share = percent(row["share_of_second"])
        sentences += [f"The square of the mean is {share} of the mean square error, u and v together."]
    sentences += [covered_coordinates(covers)]
    untrimmed = _untrimmed_means(tables, conditions, tracker, row["at"])
    sentences += _in_each(untrimmed, "Without trimming, the mean in u is")
    return Part(joined(sentences), [*length, *means, *untrimmed, verdict])


def _test(
    tables: RunTables, conditions: ReportedConditions, tracker: str, at: int | None, trimming: Trimming | None = None
) -> dict[str, Any] | None:
    """The test at an age or frame, or of all together; by default of the errors that verdicts are about."""
    rows = conditions.of(tables["zero_mean"], tracker).filter(pl.col("at").eq_missing(at), axis=conditions.axis)
    return first(rows.filter(trimming=trimming or conditions.trimming))


def verdict_on_bias(
    tables: RunTables, conditions: ReportedConditions, tracker: str, at: int | None, trimming: Trimming
) -> Verdict | None:
    """Whether the mean error is not zero at an age or frame alone, or at all together; None without a test."""
    row = _test(tables, conditions, tracker, at, trimming)
    return None if row is None else Verdict(row["verdict"]) if at is None else verdict_at(row)


def has_bias(data: RunData, tracker: str) -> bool:
    """Whether the mean error is shown not to be zero at any age or frame."""
    tests = data.nominal(data["zero_mean"]).filter(pl.col("at").is_null(), tracker=tracker, trimming=data.trimming)
    return Verdict.yes in tests["verdict"]


def mean_errors(data: RunData) -> pl.DataFrame:
    """Mean errors by age or frame, in which scenes weigh equally: columns `POOLED`, at, mean_u_px and mean_v_px."""
    tests = data["zero_mean"].filter(pl.col("at").is_not_null(), trimming=data.trimming, axis=data.axis.name)
    return tests.select(*POOLED, "at", "mean_u_px", "mean_v_px")


def _in_each(means: Sequence[Estimate], opening: str = "In u the mean is") -> list[str]:
    """A sentence for each coordinate; none where a mean is unknown."""
    return each_axis([format_estimate(mean) for mean in means], opening) if len(means) == 2 else []


def _untrimmed_means(tables: RunTables, conditions: ReportedConditions, tracker: str, at: int) -> list[Estimate]:
    """Mean errors of all tracks, where the verdict is about those that trimming kept."""
    if conditions.percentile is None or conditions.trimming == Trimming.untrimmed:
        return []
    row = _test(tables, conditions, tracker, at, Trimming.untrimmed)
    return [] if row is None else _means(tables, conditions, tracker, row, Trimming.untrimmed)


def _at_all_ages(mean: str, overall: Mapping[str, Any]) -> str:
    """Where nothing is known at the reference age."""
    p = overall["sign_flip_p_family"]
    test = "" if p is None else f" ({chance(p)}, {count(overall['n_scenes'], 'scene')})"
    if overall["verdict"] == Verdict.yes:
        return f"{sentence_case(mean)} is not zero{test}."
    return because(f"It is undecided whether {mean} is zero{test}", overall["why"] if p is None else "")


def _length(row: Mapping[str, Any]) -> Estimate:
    """Length of the mean error at one age, with the bounds of the test."""
    return Estimate.of_row(row, "effect_px", "effect_low_px", "effect_high_px", "px")


def _at_one_age(
    mean: str,
    conditions: ReportedConditions,
    row: Mapping[str, Any],
    length: Sequence[Estimate],
    means: Sequence[Estimate],
) -> list[str]:
    """The verdict at one age alone, with the length of the mean, whose interval agrees with it, and its parts."""
    p = row["sign_flip_p"]
    if p is None:
        sizes = _in_each(means, f"{sentence_case(mean)} in u is") or [f"{sentence_case(mean)} is unknown."]
        where = f"This mean is {conditions.place(row['at'])}."
        return [*sizes, where, because("Whether the mean is zero in other scenes was not tested", row["why"])]
    test = f"({chance(p)}, {count(row['n_scenes'], 'scene')})"
    is_zero = f"{mean} is not zero" if verdict_at(row) == Verdict.yes else f"it is undecided whether {mean} is zero"
    lengths = [f"Its length is {format_estimate(estimate)}." for estimate in length]
    return [f"{conditions.opening_place(row['at'])}, {is_zero} {test}.", *lengths, *_in_each(means)]


def _wider_claim(conditions: ReportedConditions, row: Mapping[str, Any], overall: Mapping[str, Any]) -> str:
    """What the test of all ages and conditions together says; empty where there is none."""
    p = overall["sign_flip_p_family"]
    if p is None:
        return ""
    if overall["verdict"] == Verdict.yes:
        claim = "it is not zero"
    else:
        claim = "no bias is established" if verdict_at(row) == Verdict.yes else "it is undecided, too"
    return f"Over all {conditions.axis}s and conditions together, {claim} ({chance(p)})."


def _means(
    tables: RunTables, conditions: ReportedConditions, tracker: str, row: Mapping[str, Any], trimming: Trimming
) -> list[Estimate]:
    """Mean errors in u and in v: with the bounds of the test, or where there is none those of these scenes."""
    means = []
    intervals, scenes = conditions.intervals(tables, tracker), Weighting.scenes
    for coordinate in "uv":
        name = f"mean_{coordinate}"
        value = row[f"{name}_px"]
        mean = Estimate.of_row(row, f"{name}_px", f"{name}_low_px", f"{name}_high_px", "px")
        if row["sign_flip_p"] is None:
            rows = curve_rows(intervals, conditions, "mean", row["at"], coordinate, trimming=trimming, weighting=scenes)
            mean = Estimate.of(value, curve_estimate(rows), "px")
        means += [] if value is None else [mean]
    return means


def bias_measure(subject: Subject) -> Measure | None:
    """Length of the mean error at the reference age, and whether it is zero there, u and v together."""
    overall, row = (_test(subject.data.tables, subject.conditions, subject.tracker, at) for at in (None, subject.at))
    if overall is None or row is None or subject.at is None or subject.row is None or row["effect_px"] is None:
        return None
    shown = card_number(_length(row))
    covered = _is_covered(subject, row)
    verdict = Verdict.undecided if covered else verdict_at(row)
    place = subject.conditions.place(subject.at)
    means = listing(f"{px(row[f'mean_{axis}_px'])} in {axis}" for axis in "uv")
    notes = [f"length of the mean error {place}: {means}"]
    notes += ["errors of the truth can cause it"] if covered else []
    why = str(row["why"] or "").partition(";")[0]
    notes += [f"not tested: {why}"] if row["sign_flip_p"] is None and why else []
    wider = "" if covered else _wider(subject, verdict, overall)
    notes += [wider] if wider else []
    sentence = _bias_sentence(subject, row, verdict, shown, covered=covered, wider=wider)
    answered = answer("biased", verdict, wished=Verdict.no)
    return Measure("bias", "px", shown, 0.0, answered, "; ".join(notes), sentence, "error-by-tracker")


_ZERO = {Verdict.yes: "no", Verdict.no: "yes", Verdict.undecided: "undecided"}
"""Whether the mean error is zero, by the verdict on whether it differs from zero."""


def zero_columns(data: RunData) -> list[Column]:
    """The verdict at the reference age alone."""
    note = f"Whether the mean is zero: at this {data.axis.name} alone, u and v together."
    return [Column("is zero?", _zero_cell, "mean", note)]


def _zero_cell(subject: Subject) -> str:
    row = _test(subject.data.tables, subject.conditions, subject.tracker, subject.at)
    if subject.at is None or row is None:
        return DASH
    p = row["sign_flip_p"]
    return _ZERO[verdict_at(row)] + ("" if p is None else f" ({chance(p)})")


def _is_covered(subject: Subject, row: Mapping[str, Any]) -> bool:
    """Whether errors of the truth can cause the mean error at the reference age."""
    conditions, tracker, at = subject.conditions, subject.tracker, row["at"]
    covers = bias_covers(subject.row or {}, row)
    tables = subject.data.tables
    return (withheld_bias(tracker, "", covers) or audited_bias(tables, conditions, tracker, at)) is not None


def _wider(subject: Subject, verdict: Verdict, overall: Mapping[str, Any]) -> str:
    """The verdict on all ages and conditions together, where it is another one; else empty."""
    p = overall["sign_flip_p_family"]
    if p is None or overall["verdict"] == verdict:
        return ""
    where = f"over all {subject.conditions.axis}s and conditions together"
    claim = "the mean is not zero" if overall["verdict"] == Verdict.yes else "no bias is established"
    return f"{where}, {claim} ({chance(p)})"


def _bias_sentence(
    subject: Subject, row: Mapping[str, Any], verdict: Verdict, shown: Number, *, covered: bool, wider: str
) -> str:
    """The verdict at the reference age with the length of the mean; why it is undecided where zero is excluded."""
    tracker, place = subject.tracker, subject.conditions.place(row["at"])
    size = f"its mean error is {with_interval(shown)}"
    if row["sign_flip_p"] is None:
        caveat = "errors of the truth can cause it" if covered else "a bias in other scenes was not tested"
        return f"The mean error of {tracker} is {shown.text} {place}; {caveat}."
    if covered:
        return f"No bias of {tracker} is established; {size}, which errors of the truth can cause."
    if wider and verdict == Verdict.yes:
        return f"{subject.conditions.opening_place(row['at'])}, {tracker} is biased by {shown.text}; {wider}."
    if wider:
        return f"{sentence_case(place)} alone, no bias of {tracker} is established; {wider}."
    opening = f"{tracker} is biased" if verdict == Verdict.yes else f"No bias of {tracker} is established"
    return f"{opening}; {size}."


def _zero_means(inputs: RunInputs) -> list[pl.DataFrame]:
    table = zero_mean(
        inputs.moments,
        inputs[CURVES],
        groups=inputs.sampling.groups,
        key_frames=inputs.key_frames,
        population=inputs.population,
    )
    return [table]


BIAS = Topic(
    "bias",
    (Analysis((ZERO_MEAN,), _zero_means, needs=(CURVES,), if_fitted=NO_ROWS),),
    headline=bias,
    measure=bias_measure,
    columns=zero_columns,
    rows_of_card=("bias",),
    compared=(
        Estimand(
            "bias",
            "Size of the mean error in u or v, mean over scenes, at the age (or frame) that changed most clearly.",
            RoleValues(SIGNED),
            Wording("has a smaller mean error", "the mean error (bias) is"),
            Unit.px,
            of_errors=True,
        ),
    ),
)
