"""The first screen: its numbers are those of the tables, its verdicts follow theirs, and its sentences are short."""

import dataclasses
import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import jsonschema
import polars as pl
import pytest
from tests.lean import without_figure_files
from tests.report import made_up_findings
from tests.report.synthetic import DEGENERATE
from tests.report.test_truth_section import with_floor

from tracknoise.inference.estimates import Estimate
from tracknoise.report import small_plots
from tracknoise.report.answer import certainty, limit_text, summarise
from tracknoise.report.contents import OPENINGS
from tracknoise.report.figures.families import FAMILIES, Family
from tracknoise.report.page import write_report
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.topics.answer_summary import Card, Measure, Number, Summary, summary_json, summary_schema
from tracknoise.topics.measures import card_number as plain_number
from tracknoise.topics.measures import shown_size
from tracknoise.words import SPACE, TIMES

MOST_WORDS, MOST_NUMBERS = 25, 3
SCHEMA = Path(__file__).parents[2] / "docs" / "report-summary.schema.json"
WORLDS: dict[str, dict[str, object]] = {
    "ordinary": {},
    "recorded": {"dataset": "tum", "truth": "birth", "scenes": ("only",)},
    **{name: DEGENERATE[name] for name in ("a light stage", "no depth", "no feature found", "a perfect tracker")},
}


@pytest.fixture(scope="module")
def data(run: RunFolder) -> ReportData:
    return ReportData.of(run)


def compared(data: ReportData, verdict: str) -> ReportData:
    """The run with eight scenes, of which the paired comparison has a verdict, and in which all RMS are the same."""
    alike = with_rms(data, **dict.fromkeys(data.trackers, 1.0))
    return alike.with_tables(dependence=made_up_findings.dependence(data["effects"], verdict=verdict, n_scenes=8))


def with_rms(data: ReportData, **sizes: float) -> ReportData:
    """The run with other RMS over its tracks."""
    rms = pl.col("tracker").replace_strict(sizes, return_dtype=pl.Float64)
    return data.with_tables(summary=data["summary"].with_columns(rms.alias(f"trimmed_rms_{axis}_px") for axis in "uv"))


def card(summary: Summary, tracker: str) -> Card:
    return next(one for one in summary.cards if one.tracker == tracker)


def measure(summary: Summary, tracker: str, name: str) -> Measure:
    return next(one for one in card(summary, tracker).measures if one.name == name)


def test_every_tracker_has_a_card_with_every_measure(data: ReportData) -> None:
    cards = summarise(data).cards
    assert [one.tracker for one in cards] == data.trackers
    for one in cards:
        names = [found.name for found in one.measures]
        assert names == ["error", "bias", "tails", "growth", "outliers", "lifetime"]
        assert one.colour == data.colour[one.tracker]


@pytest.mark.parametrize("axis", ["u", "v"])
def test_errors_of_all_trackers_are_those_of_one_coordinate(data: ReportData, axis: str) -> None:
    """The larger one of the first tracker, whichever is the larger one of the others."""
    first = pl.col("tracker") == data.trackers[0]
    own, other = (pl.when(first).then(size).otherwise(3.0 - size) for size in (2.0, 1.0))
    rest = "v" if axis == "u" else "u"
    sizes = {f"trimmed_core_{axis}_px": own, f"trimmed_core_{rest}_px": other}
    cards = summarise(data.with_tables(summary=data["summary"].with_columns(**sizes))).cards
    assert [one.measures[0].number.value for one in cards] == [2.0, 1.0]
    assert {one.measures[0].note.partition(" at age")[0] for one in cards} == {f"core error in {axis}"}


def test_a_tracker_without_errors_at_the_shared_age_says_so(data: ReportData) -> None:
    gone = pl.col("tracker") == "correspondence"
    nothing = {name: pl.when(~gone).then(pl.col(name)).alias(name) for name in data["summary"].columns if name == "at"}
    found = summarise(data.with_tables(summary=data["summary"].with_columns(**nothing)))
    assert measure(found, "correspondence", "error").sentence.endswith(
        "the error of correspondence is unknown at age 10: too few features."
    )
    assert measure(found, "lucas-kanade", "error").number.value is not None


def test_lifetimes_are_all_medians_or_all_means(data: ReportData) -> None:
    alive = pl.when(pl.col("tracker") != "lucas-kanade").then(pl.col("median_lifetime"))
    mean = (
        data["summary"]
        .with_columns(
            median_lifetime=alive, restricted_mean_lifetime=pl.lit(7.5), restricted_to=pl.lit(20, dtype=pl.Int32)
        )
        .cast(data["summary"].schema)
    )
    found = summarise(data.with_tables(summary=mean))
    notes = [measure(found, tracker, "lifetime").note for tracker in data.trackers]
    assert all(note.startswith("mean up to 20 frames") for note in notes)
    assert measure(found, "lucas-kanade", "lifetime").number.value == 7.5


def test_all_trackers_are_compared_by_the_same_size(data: ReportData) -> None:
    """One tracker without a core makes all errors root mean squares: a core and an RMS are not comparable."""
    one = pl.col("tracker") == "correspondence"
    without = [pl.when(~one).then(pl.col(f"trimmed_core_{axis}_px")).alias(f"trimmed_core_{axis}_px") for axis in "uv"]
    turned = data.with_tables(summary=data["summary"].with_columns(without))
    notes = [measure(summarise(turned), tracker, "error").note for tracker in data.trackers]
    assert all(note.startswith("RMS over the kept tracks") for note in notes)


def test_intervals_are_those_of_the_table(data: ReportData) -> None:
    found = measure(summarise(data), "lucas-kanade", "outliers").number
    row = data.nominal(data["intervals"]).filter(tracker="lucas-kanade", statistic="outlier_ratio").row(0, named=True)
    assert (found.low, found.high) == (row["low"], row["high"])


@pytest.mark.parametrize("world", WORLDS, ids=str)
def test_findings_are_short_sentences_with_evidence(make_run: Callable[..., RunFolder], world: str) -> None:
    data = ReportData.of(make_run(told=True, **WORLDS[world]))
    found = summarise(data).findings
    assert [one.topic for one in found] == data["findings"].sort("rank")["topic"].to_list()
    sections = {*OPENINGS, "findings", "factor-effects", "summary", "measured", "limits", *(one.id for one in FAMILIES)}
    for statement in (one for finding in found for one in finding.statements):
        text = statement.text
        for tracker in data.trackers:
            text = text.replace(tracker, "it")
        assert len(text.replace("\N{NO-BREAK SPACE}", " ").split()) <= MOST_WORDS, text
        assert len(re.findall(r"\d[\d.,]*", text)) <= MOST_NUMBERS, text
        assert statement.section in sections


@pytest.mark.parametrize(("n_scenes", "opening"), [(1, "In this scene, "), (5, "In these scenes, "), (8, "")])
def test_sentences_on_few_scenes_say_that_they_hold_for_these(data: ReportData, n_scenes: int, opening: str) -> None:
    """So do notes beside intervals, which are then from blocks of tracks."""
    summary = data["summary"].with_columns(n_scenes=pl.lit(n_scenes, dtype=data["summary"].schema["n_scenes"]))
    kind = pl.lit("blocks" if n_scenes < 6 else "scenes", dtype=data["intervals"].schema["resampled"])
    few = data.with_tables(summary=summary, intervals=data["intervals"].with_columns(resampled=kind))
    for one in (one for found in summarise(few).cards for one in found.measures):
        assert one.sentence.startswith(opening or "In th") is bool(opening)
        assert ("blocks of tracks in th" in one.note) is (bool(opening) and bool(one.number.interval))
    named = {one.topic: one.statements[0].text for one in summarise(few).findings}
    assert all(named[topic].startswith("In th") is bool(opening) for topic in ("ratios", "pose errors", "noise"))


def test_findings_about_one_tracker_name_it(data: ReportData) -> None:
    """Their number is that of one row of a table, which says of which tracker, and of which coordinate."""
    found = {one.topic: one.statements[0].text for one in summarise(data).findings}
    first, _ = data.trackers
    assert found["pose errors"].endswith(f" of the squared errors of {first}.")
    pairs = data.nominal(data["tracker_differences"]).filter("established")
    row = data.in_order(pairs).row(0, named=True)
    expected = f"at the same corners, the mean position of {row['tracker']} minus that of {row['other']} is 0.100"
    assert found["differences"].startswith(f"In these scenes, {expected}")
    assert found["differences"].endswith(" in u.")


def test_one_age_alone_does_not_say_how_errors_grow(data: ReportData) -> None:
    young = data
    for axis in "uv":
        young = fitted(young, axis, growth_ratio=None, growth_ratio_low=None, growth_ratio_high=None)
    with pytest.raises(StopIteration):
        measure(summarise(young), "lucas-kanade", "growth")


def test_the_better_tracker_is_named_only_where_the_comparison_says_so(data: ReportData) -> None:
    row = compared(data, "yes")["dependence"].filter(factor="tracker", statistic="core").row(0, named=True)
    worse = next(name for name in data.trackers if name != row["better"])
    yes = summarise(compared(data, "yes"))
    assert yes.accuracy.text.startswith(
        f"{row['better']} is more accurate: typical errors (core) of {worse} are 1.50 times"
    )
    assert measure(yes, row["better"], "error").answer.verdict == "yes"
    assert measure(yes, worse, "error").answer.verdict == "no"
    undecided = summarise(compared(data, "undecided"))
    assert undecided.accuracy.text.startswith("It is undecided which is more accurate")
    assert measure(undecided, row["better"], "error").answer.verdict == "undecided"
    assert "equally accurate" in summarise(compared(data, "no")).accuracy.text


@pytest.mark.parametrize(
    ("verdict", "expected"),
    [
        (
            "yes",
            "Typical errors (core) of {b} are 1.50 times (1.20 to 1.90) those of {a}; large errors give {a} the ",
        ),
        (
            "undecided",
            "Undecided: typical errors (core) of {b} are 1.50 times (1.20 to 1.90) those of {a}, but large errors ",
        ),
        ("no", "Typical errors of {x} and {y} are equal within a factor of 1.10; large errors make the "),
    ],
)
def test_where_core_and_rms_disagree_both_are_named(data: ReportData, verdict: str, expected: str) -> None:
    row = compared(data, "yes")["dependence"].filter(factor="tracker", statistic="core").row(0, named=True)
    names = {"a": row["better"], "b": next(name for name in data.trackers if name != row["better"])}
    names |= {"x": row["level_a"], "y": row["level_b"]}
    turned = with_rms(compared(data, verdict), **{names["a"]: 2.0, names["b"]: 1.0})
    text = summarise(turned).accuracy.text
    assert text.startswith(expected.format(**names))
    ends = {"yes": "", "undecided": "", "no": "of {a} 2.0 times as large"}
    end = f"RMS over the kept tracks {ends[verdict].format(**names)}".rstrip()
    assert text.endswith(f"{end}.")


def test_a_difference_that_rounds_to_nothing_is_not_contrasted(data: ReportData) -> None:
    undecided = compared(data, "undecided")
    row = undecided["dependence"].filter(factor="tracker", statistic="core").row(0, named=True)
    larger, smaller = row["larger"], next(name for name in data.trackers if name != row["larger"])
    alike = undecided["dependence"].with_columns(effect=pl.lit(1.0001))
    turned = with_rms(undecided.with_tables(dependence=alike), **{smaller: 2.0, larger: 1.0})
    assert "1.00 times" in summarise(turned).accuracy.text.replace(SPACE, " ")
    assert "smaller" not in summarise(turned).accuracy.text
    nearly = with_rms(undecided, **{smaller: 1.0001, larger: 1.0})
    assert "smaller" not in summarise(nearly).accuracy.text


def test_of_one_scene_the_disagreement_is_told_too(data: ReportData) -> None:
    bare = data.with_tables(dependence=data["dependence"].clear())
    sizes = {one.tracker: one.measures[0].number.value for one in summarise(bare).cards}
    low = min(sizes, key=sizes.__getitem__)
    turned = with_rms(bare, **{name: 2.0 if name == low else 1.0 for name in sizes})
    assert summarise(turned).accuracy.text.endswith(
        f" that of {low}, but large errors give {low} the larger RMS over the kept tracks."
    )
    agreed = with_rms(bare, **{name: 1.0 if name == low else 2.0 for name in sizes})
    assert "RMS" not in summarise(agreed).accuracy.text


def test_an_rms_is_not_contrasted_with_itself(data: ReportData) -> None:
    """Without a core, the cards show the RMS of one coordinate, whose order may be another one than that of both."""
    first, *others = data.trackers
    sizes = {"u": {first: 1.0, **dict.fromkeys(others, 2.0)}, "v": {first: 1.1, **dict.fromkeys(others, 1.0)}}
    name = pl.col("tracker")
    columns = [pl.lit(None, pl.Float64).alias(f"{data.trimming}_core_{axis}_px") for axis in sizes]
    columns += [
        name.replace_strict(of, return_dtype=pl.Float64).alias(f"{data.trimming}_rms_{axis}_px")
        for axis, of in sizes.items()
    ]
    bare = data.with_tables(dependence=data["dependence"].clear(), summary=data["summary"].with_columns(columns))
    text = summarise(bare).accuracy.text
    assert f"the RMS over the kept tracks in v of {first} is 1.10 times that of " in text.replace(SPACE, " ")
    assert "smaller" not in text


def test_a_tracker_that_is_better_at_one_age_is_not_more_accurate(data: ReportData) -> None:
    """Only the comparison at that age and in that coordinate is established, which the sentence names."""
    everywhere = compared(data, "yes")
    assert summarise(everywhere).accuracy.text.endswith(" over shared ages.")
    at_one_age = everywhere["dependence"].with_columns(coordinate=pl.lit("v"), at=pl.lit(7, dtype=pl.Int64))
    row = at_one_age.filter(factor="tracker", statistic="core").row(0, named=True)
    worse = next(name for name in data.trackers if name != row["better"])
    found = summarise(everywhere.with_tables(dependence=at_one_age))
    assert found.accuracy.answer.verdict == "undecided"
    expected = f"Undecided overall; in v at age 7, typical errors (core) of {worse} are 1.50 times ("
    assert found.accuracy.text.startswith(expected)
    assert len(re.findall(r"\d[\d.,]*", found.accuracy.text)) <= MOST_NUMBERS
    assert {one.measures[0].answer.verdict for one in found.cards} == {"undecided"}


def test_of_three_trackers_the_comparison_of_two_makes_none_the_best(data: ReportData) -> None:
    three = compared(data, "yes")
    three = three.with_tables(dependence=three["dependence"].with_columns(n_levels=pl.lit(3, pl.Int32)))
    verdicts = {one.tracker: one.measures[0].answer.verdict for one in summarise(three).cards}
    assert sorted(verdicts.values()) == ["no", "undecided"]


def test_one_tracker_is_compared_with_nothing(make_run: Callable[..., RunFolder]) -> None:
    found = summarise(ReportData.of(make_run(scenes=("only",), trackers=("one",), speeds=(1,), n_frames=14)))
    assert measure(found, "one", "error").answer is None
    assert found.accuracy.text == measure(found, "one", "error").sentence


def test_a_bias_is_undecided_with_two_scenes(data: ReportData) -> None:
    found = measure(summarise(data), "lucas-kanade", "bias")
    assert found.answer.verdict == "undecided"
    assert found.reference == 0.0
    assert found.sentence.startswith("In these scenes, the mean error of lucas-kanade is ")
    assert found.sentence.endswith("px at age 10; a bias in other scenes was not tested.")
    assert found.number.interval == ""


def with_tests(data: ReportData, *, own: float, family: float, low: float) -> ReportData:
    """The run with tests of the mean: at each age alone, and of all conditions together."""
    kinds = data["zero_mean"].schema
    verdict = pl.lit("yes" if family <= 0.05 else "undecided", dtype=kinds["verdict"])
    values = {"effect_px": 0.3, "effect_low_px": low, "effect_high_px": 0.6, "sign_flip_p": own}
    table = data["zero_mean"].with_columns(verdict=verdict, sign_flip_p_family=pl.lit(family), why=None, **values)
    return data.with_tables(zero_mean=table.cast(dict(kinds)))


@pytest.mark.parametrize(
    ("own", "family", "verdict", "sentence"),
    [
        (0.01, 0.02, "yes", "lucas-kanade is biased; its mean error is 0.300 px (0.100 to 0.600)."),
        (
            0.01,
            0.2,
            "yes",
            "at age 10, lucas-kanade is biased by 0.300 px; over all ages and conditions together, no bias is "
            "established (p = 0.2).",
        ),
        (0.2, 0.3, "undecided", "no bias of lucas-kanade is established; its mean error is 0.300 px (0 to 0.6"),
        (
            0.2,
            0.02,
            "undecided",
            "at age 10 alone, no bias of lucas-kanade is established; over all ages and conditions together, the mean "
            "is not zero (p = 0.02).",
        ),
    ],
)
def test_the_interval_of_a_bias_is_that_of_its_verdict(
    data: ReportData, own: float, family: float, verdict: str, sentence: str
) -> None:
    low = 0.1 if own <= 0.05 else 0.0
    found = measure(summarise(with_tests(data, own=own, family=family, low=low)), "lucas-kanade", "bias")
    assert found.answer.verdict == verdict
    assert (found.number.low, found.number.high) == (low, 0.6)
    assert found.sentence.replace(SPACE, " ").removeprefix("In these scenes, ").startswith(sentence)
    assert ("conditions together" in found.note) is ("conditions together" in sentence)


def test_a_bias_that_errors_of_the_truth_can_cause_is_undecided_and_says_why(data: ReportData) -> None:
    shown = with_tests(data, own=0.01, family=0.02, low=0.1)
    floor = {f"floor_mean_{axis}_px": pl.lit(9.0) for axis in "uv"}
    covered = shown.with_tables(summary=shown["summary"].with_columns(**floor))
    found = measure(summarise(covered), "lucas-kanade", "bias")
    assert found.answer.verdict == "undecided"
    assert found.sentence.endswith(" (0.100 to 0.600), which errors of the truth can cause.")
    assert "errors of the truth can cause it" in found.note


def fitted(data: ReportData, coordinate: str, **columns: object) -> ReportData:
    """The run with other values in the fitted growth of one coordinate."""
    kinds = data["time_structure"].schema
    values = {name: pl.lit(value, dtype=kinds[name]) for name, value in columns.items()}
    changed = [
        pl.when(coordinate=coordinate).then(value).otherwise(pl.col(name)).alias(name) for name, value in values.items()
    ]
    return data.with_tables(time_structure=data["time_structure"].with_columns(changed))


def test_growth_is_told_of_the_coordinate_that_all_cards_show(data: ReportData) -> None:
    found = measure(summarise(fitted(data, "u", growth_ratio=9.0)), "lucas-kanade", "growth")
    assert shown_size(data)[1] == "v"
    assert found.answer.verdict == "yes"
    assert "their RMS in v becomes 1.50 times (1.48 to 1.52) as large" in found.sentence.replace(SPACE, " ")
    assert found.note.startswith("RMS in v of the same tracks from age 1 to 10; ")


@pytest.mark.parametrize(
    ("grows", "kind", "word"),
    [("yes", "undecided", "kind undecided"), ("undecided", "undecided", "undecided"), ("no", "white", "constant")],
)
def test_whether_errors_grow_and_how_are_two_answers(data: ReportData, grows: str, kind: str, word: str) -> None:
    turned = data
    for axis in "uv":
        turned = fitted(turned, axis, grows=grows, verdict=kind)
    found = measure(summarise(turned), "lucas-kanade", "growth")
    assert found.answer.verdict == grows
    assert f"; {word}; blocks of tracks in these scenes" in found.note


def test_growth_within_the_errors_of_the_truth_is_undecided(data: ReportData) -> None:
    assert measure(summarise(data), "lucas-kanade", "growth").answer.verdict == "yes"
    covered = summarise(with_floor(data, 1.0))
    assert measure(covered, "lucas-kanade", "growth").answer.verdict == "undecided"


def test_growth_that_a_fault_of_the_truth_explains_is_undecided(data: ReportData) -> None:
    small = pl.when(pl.col("correction") == "measured").then(1.0).otherwise(0.01)
    explained = data["audit_curves"].with_columns(pl.col("second_uu", "second_vv") * small)
    found = summarise(data.with_tables(audit_curves=explained))
    assert measure(found, "lucas-kanade", "growth").answer.verdict == "undecided"


def test_tails_are_asked_of_the_errors_that_the_run_is_about(data: ReportData) -> None:
    assert measure(summarise(data), "lucas-kanade", "tails").answer.verdict == "no"  # light-tailed when trimmed
    untrimmed = {**data.settings, "findings": {"trimming": "untrimmed"}}
    found = measure(summarise(dataclasses.replace(data, settings=untrimmed)), "lucas-kanade", "tails")
    assert found.answer.verdict == "yes"
    assert (found.number.value, found.reference) == (31.0, 8.0)
    assert found.note.startswith("pooled kurtosis (Mardia's: 8 for a Gaussian), ages 10 to 19")


def with_truth(data: ReportData, verdict: str, **numbers: float) -> ReportData:
    """The run with another verdict on its truth."""
    row = {"cause": "every", "verdict": verdict, "text": "A sentence.", "step": "Another one."}
    bounds = [{"cause": "every", "tracker": name, "high": high} for name, high in numbers.items()]
    return data.with_tables(trust=pl.DataFrame([row, *bounds], schema=data["trust"].schema))


@pytest.mark.parametrize(
    ("verdict", "is_good"), [("trusted", True), ("limited", None), ("not trusted", False), ("unknown", None)]
)
def test_the_verdict_on_the_truth_is_that_of_the_run_with_the_next_step(
    data: ReportData, verdict: str, is_good: bool | None
) -> None:
    found = summarise(with_truth(data, verdict)).truth
    assert (found.answer.verdict, found.answer.is_good) == (verdict, is_good)
    assert found.text.startswith("A sentence.")
    assert found.text.endswith("Next: Another one.")


def test_a_run_that_was_not_assessed_has_an_unknown_truth(data: ReportData) -> None:
    found = summarise(data.with_tables(trust=data["trust"].clear())).truth
    assert (found.answer.verdict, found.answer.is_good) == ("unknown", None)


def test_trackers_are_compared_although_the_truth_is_not_trusted(data: ReportData) -> None:
    """What the truth adds is the same for all trackers, and cancels in differences at the same corners."""
    usual = summarise(data).accuracy.text
    found = summarise(with_truth(data, "not trusted")).accuracy.text
    assert found.startswith(usual)
    assert "Errors of the truth" in found
    assert re.search(r"At the same corners, .+ px apart \(RMS\)\.$", found)
    assert "Errors of the truth" not in usual


@pytest.mark.parametrize(
    ("failed", "text"),
    [
        (["gone@default"], " 1 of {n_scenes} scenes could not be measured. Truth:"),
        (["a@default", "a@default@r90", "b@default"], " 2 of {n_scenes} scenes could not be measured. Truth:"),
        (["{first}@default@r45"], " 1 of {n_sequences} sequences could not be measured. Truth:"),
    ],
)
def test_the_first_screen_says_what_could_not_be_measured(data: ReportData, failed: list[str], text: str) -> None:
    known = data.manifest.sequences
    scenes = {entry.sequence.scene for entry in known.values()}
    failures = {key.format(first=min(scenes)): "damaged" for key in failed}
    found = summarise(dataclasses.replace(data, manifest=dataclasses.replace(data.manifest, failures=failures)))
    n_scenes = len(scenes | {key.partition("@")[0] for key in failures})
    assert text.format(n_scenes=n_scenes, n_sequences=len(known) + len(failed)) in found.measured
    assert "could not be measured" not in summarise(data).measured


@pytest.mark.parametrize(
    ("resampled", "verdict"), [("scenes", "yes"), ("within", "undecided"), ("blocks", "undecided")]
)
def test_how_sure_it_is_depends_on_what_was_resampled(data: ReportData, resampled: str, verdict: str) -> None:
    kind = pl.lit(resampled, dtype=data["intervals"].schema["resampled"])
    found = summarise(data.with_tables(intervals=data["intervals"].with_columns(resampled=kind))).certainty
    assert found.answer.verdict == verdict


def test_how_sure_it_is_does_not_depend_on_the_order_of_rows(data: ReportData) -> None:
    """Where two kinds of intervals are equally frequent, each report of a run names the same one."""
    nominal = data.nominal(data["intervals"]).drop_nulls(["level", "resampled", "n_scenes"])
    even = nominal.head(nominal.height // 2 * 2).with_row_index()
    named = pl.when(pl.col("index") % 2 == 0).then(pl.lit("scenes")).otherwise(pl.lit("blocks"))
    halves = even.with_columns(resampled=named.cast(data["intervals"].schema["resampled"])).drop("index")
    shuffled = (halves.sample(fraction=1.0, shuffle=True, seed=seed) for seed in range(12))
    assert len({certainty(data.with_tables(intervals=rows)).text for rows in shuffled}) == 1


def test_without_intervals_numbers_hold_for_their_scenes_only(data: ReportData) -> None:
    found = summarise(data.with_tables(intervals=data["intervals"].clear()))
    assert found.certainty.text == "No intervals were computed: the numbers hold for these scenes only."
    assert measure(found, "lucas-kanade", "error").number.interval == ""


def test_the_sigma_to_set_is_that_of_the_estimator_of_the_experiment(data: ReportData) -> None:
    expected = (
        "In these scenes, set 0.200 px and a track gate of 0.300 in a filter; innovations suggest 0.100 px. "
        "These settings are for windows of 11 frames."
    )
    assert card(summarise(data), "lucas-kanade").sigma == expected
    none = data.with_tables(advice=data["advice"].clear())
    assert card(summarise(none), "lucas-kanade").sigma == ""


def test_what_to_set_is_an_upper_bound_where_the_truth_is_not_trusted(data: ReportData) -> None:
    found = with_truth(data, "not trusted", **{"lucas-kanade": 0.75})
    assert card(summarise(found), "lucas-kanade").sigma == (
        "In these scenes, set at most 0.200 px in a filter; innovations suggest 0.100 px. These settings are for "
        "windows of 11 frames. The truth is not trusted. The noise of the tracker "
        f"alone may be as small as 0.100{SPACE}px."
    )


def test_the_finding_about_estimators_names_each_tracker_and_leads_to_its_section(data: ReportData) -> None:
    (found,) = (one for one in summarise(data).findings if one.topic == "estimator")
    assert [one.section for one in found.statements] == ["estimator"] * len(data.trackers)
    advice = "set 0.200 px and a track gate of 0.300 in a filter; innovations suggest 0.100 px."
    expected = f"lucas-kanade: in these scenes, {advice}"
    assert expected in [one.text for one in found.statements]


def test_the_file_keeps_to_its_schema(data: ReportData, run: RunFolder) -> None:
    document = json.loads(summary_json(summarise(data)))
    jsonschema.validate(document, summary_schema())
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**document, "cards": [{"tracker": 1}]}, summary_schema())
    with without_figure_files():
        written = write_report(run).parent / "summary.json"
    assert json.loads(written.read_text(encoding="utf-8")) == document


def test_the_schema_is_documented() -> None:
    assert json.loads(SCHEMA.read_text(encoding="utf-8")) == summary_schema(), (
        "renew it: python -c 'import json; from tracknoise.topics.answer_summary import summary_schema; "
        "print(json.dumps(summary_schema(), indent=1))' > docs/report-summary.schema.json"
    )


def test_what_to_set_is_that_of_the_advice(data: ReportData) -> None:
    settings = summarise(data).settings
    assert [one.tracker for one in settings] == data.trackers
    for one in settings:
        rows = data["advice"].filter(tracker=one.tracker)
        assert one.sigma.value == rows.filter(quantity="sigma")["value"][0]
        assert one.innovations.value == rows.filter(quantity="innovations")["value"][0]
        assert one.sigma.text == f"0.200{SPACE}px"
        assert one.limit == f"track gate 0.300{SPACE}{TIMES}{SPACE}\N{GREEK SMALL LETTER CHI}²(.95)"
        assert one.window == rows["window"][0]
        assert not one.is_bound
    untrusted = with_truth(data, "not trusted", **{"lucas-kanade": 0.75})
    assert all(one.is_bound for one in summarise(untrusted).settings)


def test_a_robust_loss_is_named_with_its_knee() -> None:
    assert limit_text("cauchy", {"knee": 1.25}) == "Cauchy loss, knee 1.25 sigma"
    assert (
        limit_text(None, {"observation_gate": 0.5})
        == f"observation gate 0.500{SPACE}{TIMES}{SPACE}\N{GREEK SMALL LETTER CHI}²(.95)"
    )
    assert limit_text(None, {}) == ""


def of(value: float, low: float | None = None, high: float | None = None) -> Measure:
    number = Number(value, low, high, str(value), "")
    return Measure("error", "px", number, None, None, "", "", "findings")


def test_numbers_that_are_not_finite_are_unknown() -> None:
    found = plain_number(Estimate(math.inf, math.nan, 2.0, "px"))
    assert (found.value, found.low, found.high) == (None, None, None)
    one_sided = plain_number(Estimate(1.0, 0.5, math.inf, "px"))
    assert (one_sided.low, one_sided.high, one_sided.interval) == (0.5, None, "0.500 or more")


def test_drawings_of_a_measure_share_an_axis() -> None:
    axis = small_plots.scale([of(1.0, 0.5, 2.0), of(4.0)])
    assert (axis.low, axis.high, axis.is_log) == (0.0, 4.0, False)
    places = [axis.place(value) for value in (0.0, 1.0, 4.0, 9.0)]
    assert places == sorted(places)
    assert places[-1] == places[-2]  # what lies outside is drawn at the edge
    assert small_plots.scale([of(0.001), of(1.0)]).is_log


def test_drawings_say_what_they_show(data: ReportData) -> None:
    summary = summarise(data)
    axes = small_plots.scales(summary.cards)
    for one in summary.cards[0].measures:
        drawn = small_plots.draw(one, axes[one.name], "#123456")
        assert f'aria-label="{one.name}: {one.number.text}'.replace("'", "&#39;") in drawn
        assert "#123456" in drawn


def test_odd_names_are_escaped_in_drawings(make_run: Callable[..., RunFolder], synthetic: ModuleType) -> None:
    with without_figure_files():
        found = write_report(make_run(told=True, **synthetic.DEGENERATE["odd names"])).read_text(encoding="utf-8")
    first = found.split('<section id="everything">')[0].split("<main>")[1]
    assert "&lt;b&gt;" in first
    assert "<b>&#34;" not in first


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.id)
def test_every_section_says_what_it_would_look_like_otherwise(family: Family) -> None:
    assert re.fullmatch(r"If [^.]*(\.\d[^.]*)?\.", family.what_if)
