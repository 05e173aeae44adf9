"""The sentences say what the tables say: numbers, intervals, conditions, and no more than the data allow."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import polars as pl
import pytest
from tests.topics.short import long_in_findings

from tracknoise.analysis.factors import DEPENDENCE
from tracknoise.analysis.gaussianity import GAUSSIANITY
from tracknoise.analysis.time_structure import TIME_STRUCTURE
from tracknoise.analysis.truth_shares import TRACKER_DIFFERENCES, TRIANGULATED_NOISE
from tracknoise.analysis.zero_mean import ZERO_MEAN
from tracknoise.inference.units import SceneGroups
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.findings_schema import CURVES, FINDINGS, FLOOR, INTERVALS, SUMMARY
from tracknoise.tables.schema import Schema, check, empty
from tracknoise.tables.trust import TRUST
from tracknoise.tables.truth_audit import AUDIT_CURVES
from tracknoise.topics.catalogue import RUN_TABLES
from tracknoise.topics.headline import ReportedConditions
from tracknoise.topics.headlines import findings_json, headline_table
from tracknoise.truth_faults.pose_accuracy import POSE_SHARE

CONDITION = {
    "dataset": "d",
    "lighting": "l",
    "rotation": 0,
    "direction": "forward",
    "camera": "",
    "tracker": "lk",
    "speed": 1,
}
SCOPE = ReportedConditions(ReferenceCondition("l"), ("lk",), percentile=90.0, trimming=Trimming.trimmed)


def table(schema: Schema, *rows: Mapping[str, Any]) -> pl.DataFrame:
    """Rows of the one condition; what is not given is null."""
    return pl.DataFrame([{**CONDITION, **row} for row in rows], schema=dict(schema))


def trust(verdict: str, text: str, step: str | None = None) -> pl.DataFrame:
    row = {"dataset": "d", "cause": "every", "verdict": verdict, "text": text, "step": step}
    return pl.DataFrame([row], schema=dict(TRUST))


SUMMED = {
    "n_scenes": 8, "n_tracks": 900, "mean_lifetime": 8.0, "median_lifetime": 7, "outlier_ratio": 0.0482, "at": 10,
    "axis": "age", "trimmed_rms_u_px": 0.41, "trimmed_rms_v_px": 0.3, "untrimmed_rms_u_px": 1.2,
    "untrimmed_rms_v_px": 0.9,
}  # fmt: skip
BASE = {"aspect": "all", "level": 0.95, "resampled": "scenes", "n_units": 8, "n_scenes": 8, "kind": "bca"}
POINT = {**BASE, "population": "visible", "trimming": "trimmed", "weighting": "features", "statistic": "Phi"}
POINT |= {"axis": "age", "at": 10, "coordinate": "u", "unit": "px^2"}


def read(scope: ReportedConditions = SCOPE, **tables: pl.DataFrame) -> dict[str, dict[str, Any]]:
    """Headlines by topic; tables that are not given are empty, but for the summary, and the truth is trusted."""
    given = {"summary": table(SUMMARY, SUMMED), "trust": trust("trusted", "No fault was found."), **tables}
    found = headline_table({name: given.get(name, empty(schema)) for name, schema in RUN_TABLES.items()}, scope)
    check(found, FINDINGS, "findings")
    assert found["rank"].to_list() == list(range(1, found.height + 1))
    assert long_in_findings(found.to_dicts(), scope.trackers) == []
    return {row["topic"]: {**row, "text": row["text"].replace("\N{NO-BREAK SPACE}", " ")} for row in found.to_dicts()}


def test_nothing_measured_says_nothing() -> None:
    assert read(summary=empty(SUMMARY)) == {}
    nothing = {"n_scenes": 8, "n_tracks": 0}
    assert read(summary=table(SUMMARY, nothing)) == {}


def test_noise_is_the_root_of_the_second_moment_with_its_interval() -> None:
    point = {**POINT, "value": 0.1681, "low": 0.1444, "high": 0.2025}
    noise = read(intervals=table(INTERVALS, point))["noise"]
    assert noise["text"].startswith(
        "Error size at speed 1, as root mean square of the paper's trimmed errors. Numbers are at age 10. After "
        "trimming, the error of lk in u is 0.410 px (0.380 to 0.450). In v it is 0.300 px. Without trimming, the error "
        "in u is 1.200 px. In v it is 0.900 px."
    )
    assert "above the 90th percentile" in noise["text"]
    assert noise["text"].endswith("Brackets hold 95 % intervals over 8 scenes.")
    assert (noise["value"], noise["low"], noise["high"]) == pytest.approx((0.41, 0.38, 0.45))
    assert (noise["figure"], noise["table"], noise["unit"]) == ("error-by-tracker", "intervals", "px")


def test_intervals_of_another_place_or_trimming_are_not_taken() -> None:
    others = [{**POINT, "at": 9}, {**POINT, "coordinate": "uv"}, {**POINT, "weighting": "scenes"}]
    others += [{**POINT, "population": "projected"}, {**POINT, "aspect": "motion"}, {**POINT, "speed": 2}]
    rows = [{**row, "value": 0.2, "low": 0.1, "high": 0.3} for row in others]
    text = read(intervals=table(INTERVALS, *rows))["noise"]["text"]
    assert "(" not in text


def test_an_untrimmed_run_speaks_of_no_trimming() -> None:
    noise = read(ReportedConditions(ReferenceCondition("l"), ("lk",)))["noise"]
    assert "trimmed" not in noise["text"].lower()
    assert "in u is 1.200 px." in noise["text"]


UNTRIMMED = ReportedConditions(ReferenceCondition("l"), ("lk", "sift"), percentile=90.0)
CORES = {
    "untrimmed_core_u_px": 0.08,
    "untrimmed_core_v_px": 0.09,
    "untrimmed_beyond_u": 0.032,
    "untrimmed_beyond_v": 0.041,
}


def test_the_size_of_untrimmed_errors_leads_with_the_core_and_names_the_weighting() -> None:
    scale = {**POINT, "trimming": "untrimmed", "weighting": "geometric"}
    rows = [
        {**scale, "statistic": statistic, "coordinate": axis, "value": value, "low": value / 2, "high": 2 * value}
        for statistic, axis, value in (("core", "u", 0.08), ("core", "v", 0.09), ("Phi", "u", 0.04), ("Phi", "v", 0.09))
    ]
    noise = read(UNTRIMMED, summary=table(SUMMARY, {**SUMMED, **CORES}), intervals=table(INTERVALS, *rows))["noise"]
    assert noise["text"].startswith(
        "Error size at speed 1, of all tracks. Numbers are at age 10. The core of lk in u is 0.080 px (0.040 to "
        "0.160). In v the core is 0.090 px (0.045 to 0.180). Its RMS of a typical scene in u is 0.200 px (0.141 "
        "to 0.283). In v it is 0.300 px"
    )
    assert "3.2 % of its errors in u and 4.1 % in v exceed three cores." in noise["text"]
    assert "Core and RMS of a typical scene are geometric means over scenes." in noise["text"]


def test_the_error_of_a_single_scene_is_one_number_wherever_it_stands() -> None:
    """The RMS of a typical scene is raised by 1/(2n) for n features; of one scene there is no typical one."""
    scale = {**POINT, "trimming": "untrimmed", "n_scenes": 1, "resampled": "blocks"}
    rows = [
        {**scale, "weighting": weighting, "statistic": statistic, "coordinate": "u", "value": value}
        for weighting, statistic, value in (
            ("geometric", "core", 0.08), ("geometric", "Phi", 1.2**2 * 1.01), ("features", "Phi", 1.2**2),
        )
    ]  # fmt: skip
    text = read(UNTRIMMED, summary=table(SUMMARY, {**SUMMED, **CORES}), intervals=table(INTERVALS, *rows))["noise"][
        "text"
    ]
    assert "Its RMS over all tracks in u is 1.200 px." in text
    assert "typical scene" not in text


def test_the_spread_between_scenes_and_the_next_scene_stand_beside_the_core() -> None:
    scale = {**POINT, "trimming": "untrimmed", "weighting": "geometric", "statistic": "core", "value": 0.08}
    scale |= {"low": 0.04, "high": 0.16, "spread": 0.642, "next_low": 0.02, "next_high": 0.31, "unit": "px"}
    summary = table(SUMMARY, {**SUMMED, **CORES})
    text = read(UNTRIMMED, summary=summary, intervals=table(INTERVALS, scale))["noise"]["text"]
    assert (
        "This number varies between scenes by a factor of 1.9; 0.020 to 0.310 px are expected in the next scene."
        in text
    )
    assert "can cover" not in text
    outside = read(UNTRIMMED, summary=summary, intervals=table(INTERVALS, {**scale, "coverage": 0.884}))["noise"][
        "text"
    ]
    assert "For this number, a 95 % interval can cover as little as 88 % in data like yours." in outside


def test_a_core_of_fewer_scenes_says_so() -> None:
    scale = {**POINT, "trimming": "untrimmed", "weighting": "geometric", "statistic": "core", "value": 0.08}
    rows = [{**scale, "coordinate": "u", "n_scenes": 8}, {**scale, "coordinate": "v", "n_scenes": 6}]
    summary = table(SUMMARY, {**SUMMED, **CORES})
    text = read(UNTRIMMED, summary=summary, intervals=table(INTERVALS, *rows))["noise"]["text"]
    assert "In v the core is 0.090 px. This core is of 6 scenes; other scenes have few errors, or mostly" in text


@pytest.mark.parametrize(("axis", "other", "core"), [("u", "v", "0.080"), ("v", "u", "0.090")])
def test_a_core_in_one_coordinate_only_is_told(axis: str, other: str, core: str) -> None:
    """As of a stereo tracker, whose errors across the epipolar line are mostly 0."""
    missing = {f"untrimmed_core_{other}_px": None, f"untrimmed_beyond_{other}": None}
    text = read(UNTRIMMED, summary=table(SUMMARY, {**SUMMED, **CORES, **missing}))["noise"]["text"]
    assert (
        f"at age 10. The core of lk in {axis} is {core} px. In {other} it has no core: most errors are exactly zero."
        in text
    )
    assert f"% of its errors in {axis} exceed three cores." in text


def test_a_tracker_without_a_core_is_named() -> None:
    text = read(UNTRIMMED, summary=table(SUMMARY, SUMMED))["noise"]["text"]
    assert "at age 10. lk has no core: its errors are few, or mostly exactly zero. Its RMS over all tracks in u" in text


def test_errors_on_a_grid_have_a_core_of_few_values() -> None:
    shape = {"trimming": "untrimmed", "age_low": 10, "age_high": 19, "verdict": "undecided"}
    shape |= {"why": "errors lie on a grid of 1/4 px: a density cannot be fitted to them"}
    summary = table(SUMMARY, {**SUMMED, **CORES})
    text = read(UNTRIMMED, summary=summary, gaussianity=table(GAUSSIANITY, shape))["noise"]["text"]
    assert "Its errors lie on a grid of 1/4 px, so that its core takes few values; its RMS says more." in text
    assert "grid" not in read(UNTRIMMED, summary=summary)["noise"]["text"]


def second_moments(at: int, **rms: tuple[float, float]) -> list[dict[str, Any]]:
    """Rows in u of each tracker, untrimmed and trimmed."""
    return [
        {**POINT, "tracker": tracker, "statistic": "Phi", "at": at, "trimming": trimming, "value": size**2}
        for tracker, sizes in rms.items()
        for trimming, size in zip(("untrimmed", "trimmed"), sizes, strict=True)
    ]


def test_where_trimming_turns_a_ranking_around_the_reader_is_told() -> None:
    both = table(SUMMARY, SUMMED, {**SUMMED, "tracker": "sift"})
    turned = table(INTERVALS, *second_moments(10, lk=(1.5, 0.41), sift=(1.0, 0.8)))
    text = read(UNTRIMMED, summary=both, intervals=turned)["trimming"]["text"]
    assert text == (
        "A few tracks decide the RMS ranking in u: sift is first with them, lk without them. sift has the smallest RMS "
        "over all tracks at age 10, 1.000 px. lk has the smallest RMS over the kept tracks at age 10, 0.410 px. "
        "Whether this ranking holds in other scenes was not tested."
    )
    agreed = table(INTERVALS, *second_moments(10, lk=(1.5, 0.41), sift=(2.0, 0.8)))
    assert "trimming" not in read(UNTRIMMED, summary=both, intervals=agreed)
    nothing_dropped = ReportedConditions(ReferenceCondition("l"), ("lk", "sift"))
    assert "trimming" not in read(nothing_dropped, summary=both, intervals=turned)


def test_trackers_are_ranked_at_one_age() -> None:
    """A tracker that loses its tracks early is described at a younger age, at which errors are smaller."""
    summary = table(SUMMARY, SUMMED, {**SUMMED, "tracker": "sift", "at": 4})
    later, alike = second_moments(10, lk=(0.3, 0.1)), second_moments(4, lk=(0.14, 0.08), sift=(0.2, 0.09))
    assert "trimming" not in read(UNTRIMMED, summary=summary, intervals=table(INTERVALS, *later, *alike))
    turned = second_moments(4, lk=(0.14, 0.12), sift=(0.2, 0.09))
    text = read(UNTRIMMED, summary=summary, intervals=table(INTERVALS, *later, *turned))["trimming"]["text"]
    assert text.startswith("A few tracks decide the RMS ranking in u: lk is first with them, sift without them. ")
    assert "lk has the smallest RMS over all tracks at age 4, 0.140 px." in text


def test_a_verdict_that_trimming_changes_is_named() -> None:
    found = growing(
        {"trimming": "untrimmed", "coordinate": "u", "verdict": "drift"},
        {"trimming": "trimmed", "coordinate": "u", "verdict": "white"},
        {"trimming": "untrimmed", "coordinate": "v", "verdict": "drift"},
        {"trimming": "trimmed", "coordinate": "v", "verdict": "drift"},
    )
    text = read(UNTRIMMED, time_structure=table(TIME_STRUCTURE, *found))["trimming"]["text"]
    assert text == (
        "Trimming the tracks with the largest errors changes 1 answer. The verdict on growth of the error of "
        "lk in u is 'drift' before trimming and 'constant' after it."
    )
    assert "in v" not in text


def test_errors_by_frame_are_placed_from_the_key_frame() -> None:
    scope = ReportedConditions(
        ReferenceCondition("l", key_frames={"forward": 24}), ("lk",), percentile=90.0, trimming=Trimming.trimmed
    )
    point = {**POINT, "statistic": "Sigma", "axis": "frame", "at": 34, "value": 0.1681, "low": 0.1444, "high": 0.2025}
    noise = read(
        scope, summary=table(SUMMARY, {**SUMMED, "axis": "frame", "at": 34}), intervals=table(INTERVALS, point)
    )
    assert "Numbers are 10 frames after the key frame." in noise["noise"]["text"]
    assert "the error of lk in u is 0.410 px (0.380 to 0.450)." in noise["noise"]["text"]


@pytest.mark.parametrize(
    ("n_scenes", "expected"),
    [
        (8, None),
        (7, "less reliable"),
        (6, "less reliable"),
        (5, "hold for these scenes only"),
        (1, "Every condition has only 1 scene."),
    ],
)
def test_few_scenes_come_first(n_scenes: int, expected: str | None) -> None:
    found = read(summary=table(SUMMARY, {**SUMMED, "n_scenes": n_scenes}))
    if expected is None:
        assert "scenes" not in found
    else:
        assert found["scenes"]["rank"] == 1
        assert expected in found["scenes"]["text"]
        assert found["scenes"]["value"] == n_scenes


def test_enough_scenes_in_too_few_groups_hold_for_these_scenes_only() -> None:
    summed = table(SUMMARY, {**SUMMED, "n_scenes": 7})
    by_block = table(INTERVALS, {**POINT, "resampled": "blocks", "value": 1.0})
    text = read(summary=summed, intervals=by_block)["scenes"]["text"]
    assert text.startswith("Every condition has only 7 scenes. The scenes form too few groups to be resampled")
    assert "Intervals hold for these scenes only." in text
    assert "less reliable" not in text


def test_a_number_of_few_scenes_does_not_say_that_scenes_form_few_groups() -> None:
    summed = table(SUMMARY, {**SUMMED, "n_scenes": 7})
    rare = {**POINT, "statistic": "autocorrelation", "resampled": "blocks", "n_scenes": 1, "value": 0.1}
    intervals = table(INTERVALS, {**POINT, "n_scenes": 7, "value": 1.0}, rare)
    text = read(summary=summed, intervals=intervals)["scenes"]["text"]
    assert text == ("Every condition has only 7 scenes. Intervals from fewer than 8 scenes are less reliable.")


def test_fitted_noise_names_the_scenes_of_the_interval_that_it_shows() -> None:
    given = {"coordinate": "both", "n": 100, "level": 0.95, "resampled": "scenes"}
    alone = {**given, "measure": "triangulated", "sigma_px": 0.2, "n_scenes": 1}
    many = {**given, "measure": "epipolar", "sigma_px": 0.3, "low": 0.25, "high": 0.36, "n_scenes": 7}
    rows = [{**row, "trimming": trimming} for row in (alone, many) for trimming in ("untrimmed", "trimmed")]
    found = read(replace(SCOPE, fitted=True), triangulated_noise=table(TRIANGULATED_NOISE, *rows))["noise"]["text"]
    assert "lines it is 0.300 px (0.250 to 0.360)." in found
    assert found.endswith("Brackets hold 95 % intervals over 7 scenes.")


@pytest.mark.parametrize(("verdict", "most"), [("trusted", ""), ("unknown", "at most "), ("not trusted", "at most ")])
def test_fitted_noise_has_the_errors_of_a_truth_that_is_not_trusted_in_it(verdict: str, most: str) -> None:
    row = {"coordinate": "both", "n": 100, "measure": "triangulated", "sigma_px": 26.5, "n_scenes": 1}
    noise = table(TRIANGULATED_NOISE, {**row, "trimming": "trimmed"})
    found = read(replace(SCOPE, fitted=True), triangulated_noise=noise, trust=trust(verdict, "It is."))["noise"]["text"]
    assert f"the noise of lk is {most}26.5 px." in found


@pytest.mark.parametrize("verdict", ["limited", "not trusted", "unknown"])
def test_a_truth_that_is_not_trusted_comes_before_all_else(verdict: str) -> None:
    given = trust(verdict, "Poses explain 40 %.", "Use other poses.")
    found = read(trust=given)
    assert next(iter(found)) == "truth"
    assert found["truth"]["text"] == f"Truth: {verdict}. Poses explain 40 %. Next: Use other poses."
    assert "truth" not in read()
    summed = table(SUMMARY, {**SUMMED, "floor_u_px": 0.5, "floor_v_px": 1.5})
    larger = read(summary=summed, trust=given)["truth"]["text"]
    assert "smaller than stated: the truth floor is above the error of lk. In v the floor is 1.500 px" in larger


OVERALL = {"trimming": "trimmed", "axis": "age", "n": 900, "n_scenes": 8, "mean_u_px": 0.2, "mean_v_px": 0.1}
AT_TEN = {**OVERALL, "at": 10, "mean_u_px": 0.12, "mean_v_px": -0.04, "share_of_second": 0.062, "sign_flip_p": 0.004}
AT_TEN |= {"mean_u_low_px": 0.05, "mean_u_high_px": 0.19, "mean_v_low_px": -0.09, "mean_v_high_px": 0.01}
AT_TEN |= {"effect_px": 0.126, "effect_low_px": 0.06, "effect_high_px": 0.2, "level": 0.95}


def test_copies_are_named_before_the_numbers() -> None:
    groups = SceneGroups(copies={("d", "b"): "a", ("d", "c"): "a"})
    found = read(replace(SCOPE, groups=groups))
    assert next(iter(found)) == "copies"
    assert found["copies"]["text"].startswith(
        "2 scenes have the images of another scene. b has the images of a. c has the images of a. Copies"
    )


def test_a_bias_that_was_shown_is_reported_with_its_size() -> None:
    """With the bounds of its own test, not with those of a coordinate alone."""
    mean = {**POINT, "statistic": "nu", "weighting": "scenes", "value": 0.12, "low": 0.09, "high": 0.15}
    bias = read(zero_mean=table(ZERO_MEAN, WHOLE, AT_TEN), intervals=table(INTERVALS, mean))["bias"]
    assert (
        "At age 10, the mean trimmed error of lk is not zero (p = 0.004, 8 scenes). Its length is 0.126 px (0.060 "
        "to 0.200). In u the mean is 0.120 px (0.050 to 0.190). In v it is "
        "−0.040 px (−0.090 to 0.010). Over all ages and conditions together, it is not zero"
    ) in bias["text"]
    assert "The square of the mean is 6.2 % of the mean square error, u and v together." in bias["text"]
    assert (bias["value"], bias["low"], bias["high"]) == (0.126, 0.06, 0.2)


WHOLE = {**OVERALL, "verdict": "yes", "sign_flip_p_family": 0.012}


@pytest.mark.parametrize(
    ("own", "family", "verdict", "says"),
    [
        (0.03, 0.1, "undecided", "is not zero (p = 0.03, 8 scenes)"),
        (0.03, 0.1, "undecided", "Over all ages and conditions together, no bias is established (p = 0.1)."),
        (0.2, 0.01, "yes", "it is undecided whether the mean trimmed error of lk is zero (p = 0.2, 8 scenes)"),
        (0.2, 0.01, "yes", "Over all ages and conditions together, it is not zero (p = 0.01)."),
    ],
)
def test_the_verdict_at_one_age_and_that_on_all_are_told_apart(own, family, verdict, says) -> None:
    rows = {**OVERALL, "verdict": verdict, "sign_flip_p_family": family}, {**AT_TEN, "sign_flip_p": own}
    assert says in read(zero_mean=table(ZERO_MEAN, *rows))["bias"]["text"]


def test_a_mean_that_is_not_tested_has_the_interval_of_its_scenes_and_the_reason() -> None:
    why = "a test at 5 % needs at least 6 scenes; this one has 1 scene"
    mean = {**POINT, "statistic": "nu", "weighting": "scenes", "value": 0.12, "low": 0.09, "high": 0.15}
    untested = {**AT_TEN, "sign_flip_p": None, "why": why}
    rows = {**OVERALL, "verdict": "undecided", "why": why}, untested
    summary = table(SUMMARY, {**SUMMED, "n_scenes": 1})
    bias = read(summary=summary, zero_mean=table(ZERO_MEAN, *rows), intervals=table(INTERVALS, mean))["bias"]
    assert bias["text"].startswith(
        "Bias at speed 1, in this scene only. The mean trimmed error of lk in u is 0.120 px (0.090 to 0.150). In v it "
        "is −0.040 px. This mean is at age 10. Whether the mean is zero in other scenes was not tested: a test"
    )


def test_a_bias_of_trimmed_errors_stands_beside_that_of_all_tracks() -> None:
    every = {**AT_TEN, "trimming": "untrimmed", "mean_u_px": -0.611, "mean_v_px": 0.02}
    every |= {"mean_u_low_px": -0.7, "mean_u_high_px": -0.5, "mean_v_low_px": -0.1, "mean_v_high_px": 0.14}
    tables = {"zero_mean": table(ZERO_MEAN, WHOLE, AT_TEN, every)}
    expected = "Without trimming, the mean in u is −0.611 px (−0.700 to −0.500). In v it is 0.020 px (−0.100 to 0.140)."
    assert expected in read(**tables)["bias"]["text"]
    untrimmed = replace(SCOPE, trimming=Trimming.untrimmed)
    assert "Without trimming" not in read(untrimmed, **tables).get("bias", {"text": ""})["text"]


def with_floor(u: float | None, v: float | None) -> pl.DataFrame:
    return table(SUMMARY, {**SUMMED, "floor_mean_u_px": u, "floor_mean_v_px": v})


def test_a_mean_that_the_errors_of_the_truth_can_cause_is_no_bias() -> None:
    bias = read(zero_mean=table(ZERO_MEAN, WHOLE, AT_TEN), summary=with_floor(0.08, 0.03))["bias"]
    assert (
        "No bias of lk is claimed: errors of the truth can cause its mean error. At age 10, the mean error is 0.120 px "
        "in u; errors of the truth can cause 0.160 px. At age 10, the mean error is 0.040 px in v" in bias["text"]
    )
    assert "not zero" not in bias["text"]
    assert bias["value"] is None


@pytest.mark.parametrize(("floor_px", "withheld"), [(0.41, True), (1.2, True), (12.0, False)])
def test_a_floor_above_the_whole_error_withholds_no_more_than_that_error_can(floor_px, withheld) -> None:
    """It is stated too large, by 10 times here: then as much of the mean can be the truth's as the error allows."""
    summed = {**SUMMED, "floor_mean_u_px": 0.08, "floor_mean_v_px": 0.03, "floor_u_px": floor_px, "floor_v_px": 0.1}
    text = read(zero_mean=table(ZERO_MEAN, WHOLE, AT_TEN), summary=table(SUMMARY, summed))["bias"]["text"]
    assert ("No bias of lk is claimed" in text) is withheld


def corrected(left: float) -> pl.DataFrame:
    """Curves of an audit that leaves this share of the mean, and of the growth in u."""
    rows = [
        {
            "correction": name, "age": age, "n": 100, "mean_u_px": 0.12 * share, "mean_v_px": 0.04 * share,
            "second_uu": 0.01 + 0.01 * age * share, "second_vv": 0.01 + 0.01 * age,
        }
        for name, share in (("measured", 1.0), ("focal_length", 0.9), ("all", left))
        for age in (1, 8, 24)
    ]  # fmt: skip
    return table(AUDIT_CURVES, *rows)


@pytest.mark.parametrize(("left", "withheld"), [(0.1, True), (0.49, True), (0.6, False)])
def test_a_mean_that_faults_of_the_truth_explain_is_no_bias(left, withheld) -> None:
    given = {"zero_mean": table(ZERO_MEAN, WHOLE, AT_TEN), "audit_curves": corrected(left)}
    text = read(**given)["bias"]["text"]
    assert ("is not zero" in text) is not withheld
    sentence = (
        "No bias of lk is claimed: faults of the truth explain most of its mean error. At age 8, the mean error is "
        f"0.126 px, and {0.1265 * left:.3f} px after these faults are corrected."
    )
    assert (sentence in text) is withheld


def test_growth_that_faults_of_the_truth_explain_is_withheld() -> None:
    rows = growing({"coordinate": "u", "verdict": "random walk"}, {"coordinate": "v", "verdict": "drift"})
    text = read(time_structure=table(TIME_STRUCTURE, *rows), audit_curves=corrected(0.25))["growth"]["text"]
    assert (
        "No growth of lk in u is claimed: faults of the truth explain most of it. At age 8, the growth of the" in text
    )
    assert "error is 0.265 px, and 0.132 px after these faults are corrected." in text
    assert "lk in u: the RMS grows" not in text
    assert "lk in v: the RMS grows" in text


@pytest.mark.parametrize("floor", [(None, None), (0.0, 0.0), (0.01, 0.01)])
def test_a_mean_beyond_the_floor_is_a_bias(floor) -> None:
    bias = read(zero_mean=table(ZERO_MEAN, WHOLE, AT_TEN), summary=with_floor(*floor))["bias"]
    assert "is not zero (p = 0.004, 8 scenes)" in bias["text"]
    assert "errors of the truth" not in bias["text"]


def test_a_bias_is_kept_where_the_floor_covers_one_coordinate_only() -> None:
    bias = read(zero_mean=table(ZERO_MEAN, WHOLE, AT_TEN), summary=with_floor(0.01, 0.03))["bias"]
    assert "is not zero (p = 0.004, 8 scenes)" in bias["text"]
    assert (
        "Errors of the truth can cause the mean in v. The mean is 0.040 px in v; errors of the truth can"
        in bias["text"]
    )


def test_an_undecided_mean_stays_undecided_below_the_floor() -> None:
    rows = {**OVERALL, "verdict": "undecided", "why": "few"}, {**AT_TEN, "sign_flip_p": 0.3}
    bias = read(zero_mean=table(ZERO_MEAN, *rows), summary=with_floor(0.08, 0.03))["bias"]
    assert "it is undecided whether" in bias["text"]


def test_too_few_scenes_decide_no_bias() -> None:
    why = "a test at 5 % needs at least 6 scenes; this one has 4 scenes"
    bias = read(zero_mean=table(ZERO_MEAN, {**OVERALL, "verdict": "undecided", "why": why}))["bias"]
    assert "It is undecided whether the mean trimmed error of lk is zero: a test at 5 % needs" in bias["text"]
    assert "is not zero" not in bias["text"]


def test_the_shape_is_that_of_the_band_which_holds_the_reference_age() -> None:
    bands = [(1, 4, "Gaussian"), (10, 19, "heavy-tailed"), (20, 49, "skewed")]
    rows = [
        {"trimming": trimming, "age_low": low, "age_high": high, "verdict": "light-tailed" if trimmed else verdict}
        for trimmed, trimming in enumerate(("untrimmed", "trimmed"))
        for low, high, verdict in bands
    ]
    text = read(gaussianity=table(GAUSSIANITY, *rows))["shape"]["text"]
    assert "Untrimmed errors of lk at ages 10 to 19 are heavy-tailed." in text
    assert "Trimmed errors of lk at ages 10 to 19 are light-tailed." in text


def growing(*rows: dict[str, object]) -> list[dict[str, object]]:
    """Rows of trimmed errors that are shown to grow from age 1 to 10."""
    ratio = {"growth_ratio": 1.5, "growth_ratio_low": 1.4, "growth_ratio_high": 1.6}
    return [{"trimming": "trimmed", "grows": "yes", "growth_from": 1, "growth_to": 10, **ratio, **row} for row in rows]


def test_growth_says_by_how_much_and_which_parts_are_established() -> None:
    parts = {"walk_px_per_sqrt_frame_geometric": (0.09, 0.08, 0.1), "white_px_geometric": (0.2, 0.19, 0.21)}
    parts |= {"drift_px_per_frame_geometric": (0.01, 0.0, 0.02)}
    ends = ("", "_low", "_high")
    sizes = {f"{name}{end}": value for name, found in parts.items() for end, value in zip(ends, found, strict=True)}
    few = {"growth_ratio": None, "growth_ratio_low": None, "growth_ratio_high": None}
    other = {"coordinate": "v", "verdict": "undecided", "grows": "undecided", "why": "too few ages", **few}
    rows = growing({"coordinate": "u", "verdict": "random walk", **sizes}, other)
    growth = read(time_structure=table(TIME_STRUCTURE, *rows))["growth"]
    assert growth["text"] == (
        "Growth of trimmed errors of the same tracks at speed 1. Growth is from age 1 to 10. lk in u: the RMS grows; "
        "it becomes 1.50 times (1.40 to 1.60) as large. Constant part is established: 0.200 px (0.190 to 0.210). "
        "Random walk is established: 0.0900 px "
        "per sqrt(frame) (0.0800 to 0.100). lk in v: growth is undecided. How it grows is undecided: too few ages. "
        "All scenes have equal weight. Growth by less than the margin counts as none."
    )
    assert growth["value"] == 1.5


def test_growth_whose_interval_spans_all_sizes_is_unknown() -> None:
    row = {"grows": "undecided", "growth_ratio": 2.1, "growth_ratio_low": 5.7e-4, "growth_ratio_high": 4e4}
    rows = growing({"coordinate": "u", "verdict": "undecided", "why": "there are 2 blocks", **row})
    text = read(time_structure=table(TIME_STRUCTURE, *rows))["growth"]["text"]
    assert "lk in u: growth is undecided. How it grows is undecided: there are 2 blocks." in text
    assert "more than" not in text


def test_growth_of_all_errors_is_told_from_components_of_a_noise_model() -> None:
    rows = [{**row, "trimming": "untrimmed"} for row in growing({"coordinate": "u", "verdict": "drift"})]
    text = read(UNTRIMMED, time_structure=table(TIME_STRUCTURE, *rows))["growth"]["text"]
    assert "a noise model excludes them" in text


def test_growth_is_not_denied_beside_a_wide_interval() -> None:
    row = {"grows": "undecided", "growth_ratio": 1.05, "growth_ratio_low": 0.9, "growth_ratio_high": 1.2}
    rows = growing({"coordinate": "u", "verdict": "undecided", **row})
    text = read(time_structure=table(TIME_STRUCTURE, *rows))["growth"]["text"]
    assert "lk in u: growth of the RMS is undecided; it becomes 1.05 times (0.900 to 1.20) as large." in text


@pytest.mark.parametrize(("floor_uu", "withheld"), [(0.05, True), (0.03, False), (0.0, False), (None, False)])
def test_growth_that_the_errors_of_the_truth_can_cause_is_withheld(floor_uu, withheld) -> None:
    rows = growing({"coordinate": "u", "verdict": "random walk"}, {"coordinate": "v", "verdict": "drift"})
    at = [{"axis": "age", "at": age} for age in (1, 10)]
    curve = {"population": "visible", "trimming": "trimmed", "weighting": "features", "statistic": "Phi"}
    curves = [{**curve, **place, "u": second, "v": second} for place, second in zip(at, (0.01, 0.1), strict=True)]
    grown = [None, None] if floor_uu is None else [0.01 * floor_uu, floor_uu]
    floor = [{**place, "source": "all", "floor_uu": uu, "floor_vv": 1e-3} for place, uu in zip(at, grown, strict=True)]
    given = {"curves": table(CURVES, *curves), "floor": table(FLOOR, *floor)}
    text = read(time_structure=table(TIME_STRUCTURE, *rows), **given)["growth"]["text"]
    assert ("lk in u: the RMS grows" in text) is not withheld
    too_large = {**SUMMED, "floor_u_px": 10.0, "floor_v_px": 0.1}
    other = read(time_structure=table(TIME_STRUCTURE, *rows), summary=table(SUMMARY, too_large), **given)["growth"]
    assert "lk in u: the RMS grows" in other["text"], "a floor above the whole error says less"
    sentence = (
        "No growth of lk in u is claimed: errors of the truth can cause it. At age 10, the error has grown by 0.300 px "
        "in u; errors of the truth can cause 0.315 px."
    )
    assert (sentence in text) is withheld
    assert "lk in v: the RMS grows" in text


def test_of_two_coordinates_that_differ_each_has_its_own_words() -> None:
    rows = [
        *growing({"coordinate": "u", "verdict": "white", "grows": "no"}, {"coordinate": "v", "verdict": "drift"}),
        {"trimming": "untrimmed", "coordinate": "v", "verdict": "none"},
    ]
    text = read(time_structure=table(TIME_STRUCTURE, *rows))["growth"]["text"]
    assert "lk in u: the RMS does not grow; it becomes" in text
    assert "lk in v: the RMS grows" in text
    assert "neither" not in text


def factor_row(statistic: str, verdict: str, **values: object) -> dict[str, Any]:
    """A row about the speed, of which the larger value is at speed 4."""
    row = {"factor": "speed", "speed": None, "statistic": statistic, "axis": "age", "verdict": verdict, "n_levels": 2}
    row |= {"unit": "ratio", "level_a": "1", "level_b": "4", "larger": "4", "better": "1", "margin": 1.1, "why": None}
    return row | {"effect": 1.2, "low": 1.15, "high": 1.3, "most": 1.4} | values


def factor_rows(*verdicts: str) -> dict[str, pl.DataFrame]:
    """The dependence of as many statistics on the speed."""
    mean = {"unit": "px", "better": None, "margin": 0.02, "effect": 0.12, "low": 0.05, "high": 0.19, "most": 0.2}
    rows = [
        factor_row("outlier_ratio", "yes", effect=13.2, low=9.04, high=19.3, most=19.3),
        factor_row("eta", "no", effect=1.01, low=0.99, high=1.03, most=1.043),
        factor_row("nu", "undecided", **mean, coordinate="u", at=10),
        factor_row("lifetime", "yes", better="4"),
        factor_row("core", "no", most=1.05),
    ]
    chosen = [{**row, "verdict": verdict} for row, verdict in zip(rows, verdicts, strict=False)]
    return {"dependence": table(DEPENDENCE, *chosen)}


def test_trackers_that_differ_in_one_option_are_compared_by_it_alone() -> None:
    pair = {"level_a": "gftt", "level_b": "fast", "larger": "fast", "better": "gftt", "speed": 1}
    option = factor_row("core", "yes", **pair, factor="detection.detector", tracker="lucas-kanade", effect=1.4, low=1.2)
    names = {"level_a": "lk", "level_b": "lk-fast", "larger": "lk-fast", "better": "lk"}
    trackers = factor_row("core", "yes", **names, speed=1, factor="tracker", tracker=None, effect=1.4, low=1.2)
    text = read(dependence=table(DEPENDENCE, option, trackers))["factors"]["text"]
    assert text.startswith("Verdicts on whether the detector changes a statistic: 1 yes.")
    assert "with detector fast as with detector gftt; detector gftt is better." in text
    three = {**trackers, "n_levels": 3, "effect": 1.5}
    text = read(dependence=table(DEPENDENCE, option, three))["factors"]["text"]
    assert text.startswith("Verdicts on whether the tracker or the detector changes a statistic: 2 yes.")
    same = {**trackers, "n_levels": 3}
    text = read(dependence=table(DEPENDENCE, option, same))["factors"]["text"]
    assert text.startswith("Verdicts on whether the detector changes a statistic: 1 yes.")


def test_factors_are_counted_and_the_clearest_are_named() -> None:
    found = read(**factor_rows("yes", "no", "undecided"))["factors"]
    assert "Verdicts on whether the speed changes a statistic: 1 yes, 1 no and 1 undecided." in found["text"]
    assert "The margin is a ratio of 1.10." in found["text"]
    assert (
        "The outlier ratio of lk is higher at speed 4 than at speed 1. It is 13 times (9.0 to 19) as high. Speed 1 is "
        "better." in found["text"]
    )
    assert (
        "smallest effects follow. The speed changes the mean absolute error of lk by at most 1.04 times."
        in found["text"]
    )
    assert (found["value"], found["low"], found["high"]) == pytest.approx((13.2, 9.04, 19.3))
    assert found["unit"] == "ratio"


def test_what_decides_at_one_age_is_said_to() -> None:
    found = read(**factor_rows("no", "no", "yes"))["factors"]
    assert (
        "The mean error of lk is more positive at speed 4 than at speed 1. It is 0.120 px (0.050 to 0.190) more "
        "positive. This difference is in u at age 10." in found["text"]
    )
    row = factor_row("eta", "yes", effect=2.0, low=1.5, high=2.7, coordinate="v", at=3, larger="1", better="4")
    text = read(dependence=table(DEPENDENCE, row))["factors"]["text"]
    assert "of lk is larger at speed 1 than at speed 4. It is 2.0 times (1.50 to 2.7) as large. Speed 4 is" in text
    assert "This difference is in v at age 3." in text


def test_the_better_of_two_trackers_is_named() -> None:
    pair = {"factor": "tracker", "tracker": None, "level_a": "lk", "level_b": "sift", "larger": "sift", "better": "lk"}
    row = factor_row("core", "yes", **pair, speed=1)
    text = read(dependence=table(DEPENDENCE, row))["factors"]["text"]
    assert "The core is 1.20 times (1.15 to 1.30) as large for sift as for lk; lk is better." in text
    unclear = factor_row("core", "undecided", **pair, speed=1) | {"low": 0.9}
    text = read(dependence=table(DEPENDENCE, unclear))["factors"]["text"]
    assert text.endswith("The core is 1.20 times (0.900 to 1.30) as large for sift as for lk.")


def test_what_is_undecided_is_called_so() -> None:
    text = read(**factor_rows("undecided", "undecided"))["factors"]["text"]
    assert "Verdicts on whether the speed changes a statistic: 2 undecided." in text
    assert "The largest measured effect may be chance. The outlier ratio of lk is higher at speed 4" in text
    assert "smallest" not in text


def test_other_speeds_and_what_was_not_varied_are_no_questions() -> None:
    tables = factor_rows("yes", "yes")
    single = tables["dependence"].with_columns(n_levels=pl.lit(1, dtype=pl.Int32))
    assert "factors" not in read(dependence=single)
    faster = {name: part.with_columns(speed=pl.lit(2, dtype=pl.Int32)) for name, part in tables.items()}
    assert "factors" not in read(**faster)


def test_outliers_and_lifetimes_have_their_intervals() -> None:
    rows = [
        {**BASE, "statistic": "outlier_ratio", "value": 0.0482, "low": 0.041, "high": 0.055},
        {**BASE, "statistic": "median_lifetime", "value": 7.0, "low": 6.0, "high": 9.0},
        {**BASE, "statistic": "restricted_mean_lifetime", "value": 8.5, "low": 8.0, "high": 9.0},
    ]
    lived = {"restricted_to": 20, "restricted_mean_lifetime": 8.5, "restricted_mean_until_failure": 12.0}
    found = read(summary=table(SUMMARY, {**SUMMED, **lived}), intervals=table(INTERVALS, *rows))
    assert "lk rejects 4.8 % (4.1 % to 5.5 %) of its features per frame." in found["outliers"]["text"]
    text = found["lifetimes"]["text"]
    opening = "Median lifetime at speed 1 (Kaplan-Meier, tracks pooled over scenes), and means restricted to 20 frames."
    assert text.startswith(f"{opening} lk: the median is 7 frames")
    assert (
        "7 frames (6 to 9). The restricted mean is 8.50 frames (8 to 9). The restricted mean until failure is 12"
        in text
    )
    assert "they are assumed to fail like the others" in text


def test_a_mean_lifetime_that_no_track_can_exceed_is_no_number_with_an_interval() -> None:
    means = {"restricted_mean_lifetime": 20.0, "restricted_mean_until_failure": 20.0}
    rows = [{**BASE, "statistic": name, "value": 20.0, "low": 20.0, "high": 20.0} for name in means]
    summed = table(SUMMARY, {**SUMMED, "restricted_to": 20, "median_lifetime": None, **means})
    text = read(summary=summed, intervals=table(INTERVALS, *rows))["lifetimes"]["text"]
    assert "No track ends before the horizon of the mean. No track fails before the horizon of the mean." in text
    assert "(20" not in text


def test_a_bound_that_lies_beyond_the_data_is_open() -> None:
    row = {**BASE, "statistic": "median_lifetime", "value": 7.0, "low": 6.0}
    assert "7 frames (6 or more)" in read(intervals=table(INTERVALS, row))["lifetimes"]["text"]


def test_tracks_that_outlive_the_data_have_no_median() -> None:
    text = read(summary=table(SUMMARY, {**SUMMED, "median_lifetime": None}))["lifetimes"]["text"]
    assert "lk: the median is unknown, because more than half of the tracks are alive at the end of the data." in text


def test_tracks_that_live_long_are_compared_with_all() -> None:
    rows = [
        {**POINT, "aspect": aspect, "at_least": age, "value": value, "low": 0.8 * value, "high": 1.2 * value}
        for aspect, age, value in (("all", None, 0.1681), ("long_lived", 5, 0.16), ("long_lived", 20, 0.09))
    ]
    text = read(intervals=table(INTERVALS, *rows))["survivorship"]["text"]
    assert "in trimmed root mean square errors, features pooled over scenes." in text
    assert "At age 10, tracks of lk that live to age 20 are compared with all." in text
    assert "The long-lived tracks have an error in u of 0.300 px (0.268 to 0.329)." in text
    assert "All tracks have 0.410 px" in text


def test_many_trackers_are_not_all_named() -> None:
    names = [f"t{i}" for i in range(6)]
    summary = table(SUMMARY, *({**SUMMED, "tracker": name} for name in names))
    text = read(ReportedConditions(ReferenceCondition("l"), names), summary=summary)["outliers"]["text"]
    assert "t3 rejects" in text
    assert "t4" not in text
    assert "The table has 2 other trackers." in text


def test_the_lighting_is_named_where_there_are_several() -> None:
    summary = table(SUMMARY, SUMMED, {**SUMMED, "lighting": "other"})
    assert "at speed 1 under lighting l," in read(summary=summary)["noise"]["text"]


def test_the_order_of_rows_changes_nothing() -> None:
    tables = factor_rows("yes", "no", "yes", "undecided", "no")
    tables["intervals"] = table(
        INTERVALS, *({**POINT, "coordinate": axis, "value": 0.2, "low": 0.1, "high": 0.3} for axis in "uv")
    )
    turned = {name: part.reverse() for name, part in tables.items()}
    assert read(**tables) == read(**turned)


def test_the_document_is_json_even_where_numbers_are_infinite() -> None:
    import json

    tables = {**{name: empty(schema) for name, schema in RUN_TABLES.items()}, **factor_rows("yes")}
    tables["dependence"] = tables["dependence"].with_columns(horizon=pl.lit(float("inf")))
    tables["zero_mean"] = table(ZERO_MEAN, OVERALL, AT_TEN)
    tables["trust"] = trust("trusted", "No fault was found.")
    tables["findings"] = headline_table({**tables, "summary": table(SUMMARY, SUMMED)}, SCOPE)
    document = json.loads(findings_json(tables))
    assert document["dependence"][0]["horizon"] == "Infinity"
    assert [row["at"] for row in document["zero_mean"]] == [None]
    assert document["findings"][0]["text"].startswith("Error size")


@pytest.mark.parametrize(
    ("resampled", "expected"),
    [
        (
            "within",
            "Results hold only for these 4 groups of scenes: a, b, c and d. Intervals resample 8 scenes within their "
            "groups.",
        ),
        ("groups", "8 scenes come in 4 groups of scenes that may be alike. Intervals resample whole groups."),
        ("scenes", None),
    ],
)
def test_groups_of_scenes_are_counted(resampled: str, expected: str | None) -> None:
    groups = SceneGroups({("d", f"s{place}"): "abcd"[place % 4] for place in range(8)})
    scope = ReportedConditions(ReferenceCondition("l"), ("lk",), percentile=90.0, groups=groups)
    found = read(scope, intervals=table(INTERVALS, {**POINT, "resampled": resampled, "value": 1.0}))
    assert found.get("groups", {}).get("text") == expected


def shares(**by_source: tuple[float, float, float]) -> dict[str, pl.DataFrame]:
    """Shares that pose errors explain with bounds, by what these were fitted to."""
    rows = [
        {"fitted_to": source, "share": share, "low": low, "high": high, "level": 0.95}
        for source, (share, low, high) in by_source.items()
    ]
    return {"pose_share": table(POSE_SHARE, *rows)}


@pytest.mark.parametrize(
    ("others", "expected"),
    [
        (
            (0.58, 0.5, 0.66),
            "probably an error of the truth. The cause may be the poses, the clock, the calibration or",
        ),
        (
            (0.01, -0.02, 0.04),
            "The other trackers do not have this motion, so that it is probably an error of the tracker.",
        ),
        ((0.2, -0.2, 0.6), "Whether the other trackers have this motion, too, is undecided."),
    ],
)
def test_pose_errors_are_blamed_on_the_truth_only_if_other_trackers_agree(
    others: tuple[float, float, float], expected: str
) -> None:
    found = read(**shares(own=(0.62, 0.55, 0.7), others=others))["pose errors"]
    assert (
        "missing in the stated poses explains 62.0 % (55.0 % to 70.0 %) of the squared errors of lk." in found["text"]
    )
    assert expected in found["text"]
    assert (found["value"], found["figure"], found["table"]) == (0.62, "pose-errors", "pose_share")


def test_with_a_key_frame_ages_are_not_taken_for_frames() -> None:
    """Differences of trackers are by the age of both tracks."""
    keyed = replace(SCOPE, reference=ReferenceCondition("l", key_frames={"forward": 24}))
    assert "These differences are at age 10." in read(keyed, **differences(established=True))["differences"]["text"]


def test_a_single_tracker_may_have_a_motion_of_its_own() -> None:
    text = read(**shares(own=(0.62, 0.55, 0.7)))["pose errors"]["text"]
    assert "so that it may be an error of the tracker." in text
    assert "error of the truth" not in text


def test_small_or_uncertain_pose_errors_are_not_reported() -> None:
    assert "pose errors" not in read(**shares(own=(0.08, 0.06, 0.09)))
    assert "pose errors" not in read(**shares(own=(0.4, -0.1, 0.9), others=(0.4, 0.3, 0.5)))


def differences(*, established: bool) -> dict[str, pl.DataFrame]:
    rows = [
        {
            "other": other, "statistic": "mean", "age": age, "coordinate": axis, "value": value, "low": value - 0.05,
            "high": value + 0.05, "unit": "px", "established": established and other == "of",
        }
        for other in ("zz", "of")
        for age in (4, 10, 24)
        for axis, value in (("u", 0.2), ("v", 0.0))
    ]  # fmt: skip
    return {"tracker_differences": table(TRACKER_DIFFERENCES, *rows)}


@pytest.mark.parametrize("fitted", [True, False])
def test_trackers_that_differ_in_the_mean_are_named(fitted: bool) -> None:
    found = read(replace(SCOPE, fitted=fitted), **differences(established=True))["differences"]
    assert "In u, lk minus of is 0.200 px (0.150 to 0.250). In v it is 0 px (−0.050 to 0.050)." in found["text"]
    assert "zz" not in found["text"]
    assert found["text"].endswith("Errors of the truth cannot cause such differences.")
    assert (found["value"], found["low"]) == (0.2, pytest.approx(0.15))
    assert "differences" not in read(replace(SCOPE, fitted=fitted), **differences(established=False))


def test_the_number_of_a_difference_is_that_of_a_coordinate_in_which_it_is_established() -> None:
    rows = differences(established=True)["tracker_differences"]
    in_v = rows.with_columns(established=pl.col("established") & (pl.col("coordinate") == "v"))
    found = read(tracker_differences=in_v)["differences"]
    assert (found["value"], found["low"]) == (0.0, pytest.approx(-0.05))
