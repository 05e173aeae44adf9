"""Verdicts and gates of made-up paired values."""

from dataclasses import replace

import numpy as np
import pytest

from tracknoise.analysis.gate import Gate, judge
from tracknoise.analysis.run_changes import Asked, Compared, verdicts
from tracknoise.inference.paired_differences import NO_PLACES, Differences, differences
from tracknoise.tables.enumerations import ComparedAges
from tracknoise.topics.catalogue import ESTIMANDS

OF = Compared("after", "lk", "lk", "simulated", "default", 0, "forward", "", 1)


def paired(change, places=NO_PLACES, *, n_coordinates=1, **columns) -> Differences:
    """Scenes whose values changed so."""
    levels = np.stack([change, np.zeros_like(change)], axis=1)
    measured = np.ones(levels.shape[:2], bool)
    found = differences(levels, measured, logarithms=False, places=places, n_coordinates=n_coordinates)
    return replace(found, **columns)


def asked(statistic, change, *, scenes=10, spread=0.01, of=OF, seed=0, **columns):
    values = change + spread * np.random.default_rng(seed).standard_normal((scenes, 1))
    return Asked(
        of, ESTIMANDS[statistic], paired(values, **columns), [f"s{i}" for i in range(scenes)], np.arange(scenes)
    )


@pytest.mark.parametrize(
    ("statistic", "change", "verdict"),
    [
        ("core", np.log(1.5), "worse"),
        ("core", np.log(0.7), "better"),
        ("core", 0.0, "no difference"),
        ("core", np.log(1.1), "undecided"),
        ("lifetime", np.log(1.5), "better"),
        ("lifetime", np.log(0.7), "worse"),
        ("tap_delta_avg", -0.1, "worse"),
        ("outlier_ratio", 1.0, "worse"),
    ],
)
def test_each_direction_is_worse_or_better_as_the_statistic_says(statistic, change, verdict):
    (row,) = verdicts([asked(statistic, change)])
    assert row.verdict == verdict
    assert (row.why is None) == (verdict != "undecided")


def test_effects_are_in_the_unit_of_the_statistic():
    ratio, share = verdicts([asked("core", np.log(1.5)), asked("tap_delta_avg", -0.1)])
    assert ratio.low < 1.5 < ratio.high
    assert ratio.margin == pytest.approx(1.1)
    assert share.low < -0.1 < share.high
    assert share.margin == pytest.approx(0.02)
    assert ratio.scenes["s3"] == pytest.approx(1.5, rel=0.05)


def test_with_two_scenes_everything_is_undecided():
    (row,) = verdicts([asked("core", np.log(9.0), scenes=2)])
    assert (row.verdict, row.low, row.high) == ("undecided", None, None)
    assert row.effect == pytest.approx(9.0, rel=0.05)
    assert "only 2 scenes" in row.why


def test_many_questions_make_a_weak_answer_undecided():
    weak = asked("core", np.log(1.5), spread=0.3, seed=2)
    (alone,) = verdicts([weak])
    among = verdicts([weak, *(asked("core", 0.0, seed=number) for number in range(30))])[0]
    assert alone.verdict == "worse"
    assert among.verdict == "undecided"
    assert among.p_change == alone.p_change
    assert "multiple tests" in among.why


def test_what_else_is_compared_leaves_the_answers_about_sizes_and_lifetimes_as_they_are():
    main = [asked(name, np.log(1.5), spread=0.3, seed=seed) for seed, name in enumerate(("core", "lifetime"))]
    names = ("bias", "tails", "growth", "residual_sigma", "overconfidence", "feature_count", "tap_delta_avg")
    more = [asked(name, 0.0, seed=place, scale_px=1.0) for place, name in enumerate(names)]
    alone, among = verdicts(main), verdicts([*main, *more])[: len(main)]
    assert [(row.verdict, row.p_adjusted) for row in among] == [(row.verdict, row.p_adjusted) for row in alone]


def test_a_zero_in_one_run_alone_cannot_be_within_the_margin():
    pair = paired(np.zeros((10, 1)), unlike=np.ones((1, 1), bool))
    (row,) = verdicts([Asked(OF, ESTIMANDS["core"], pair, [f"s{i}" for i in range(10)], np.arange(10))])
    assert row.verdict == "undecided"
    assert "value of 0" in row.why


def test_lifetimes_that_most_tracks_outlive_are_never_shown_to_be_alike():
    same, outlived = asked("lifetime", 0.0), asked("lifetime", 0.0, gap="more than half of the tracks live on")
    assert [row.verdict for row in verdicts([same])] == ["no difference"]
    (row,) = verdicts([outlived])
    assert (row.verdict, row.why) == ("undecided", "more than half of the tracks live on")


def test_the_margin_of_a_bias_is_a_share_of_the_core():
    total = np.random.default_rng(1).standard_normal((10, 2)) * 0.01
    pair = paired(total + 0.3, np.array([4]), n_coordinates=2, total=(total + 0.5)[:, None], scale_px=0.4)
    (row,) = verdicts([Asked(OF, ESTIMANDS["bias"], pair, [f"s{i}" for i in range(10)], np.arange(10), "age")])
    assert row.margin == pytest.approx(0.04)
    assert (row.verdict, row.at) == ("worse", 4)


def test_the_mean_of_all_ages_of_a_bias_is_that_of_a_coordinate():
    total = np.random.default_rng(1).standard_normal((10, 4)) * 0.01
    change = total + np.array([0.0, 0.3, 0.0, 0.3])  # places times coordinates
    pair = paired(change, np.array([4, 5]), n_coordinates=2, total=(total + 0.5)[:, None], scale_px=0.4)
    one = Asked(OF, ESTIMANDS["bias"], pair, [f"s{i}" for i in range(10)], np.arange(10), "age")
    (row,) = verdicts([one], ages=ComparedAges.mean)
    assert (row.verdict, row.at, row.coordinate) == ("worse", None, "v")
    assert row.effect == pytest.approx(0.3, abs=0.02)


@pytest.mark.parametrize(("axis", "place"), [("age", "at age 3"), ("frame", "3 frames before the key frame")])
def test_a_change_of_the_other_sign_is_placed_from_the_key_frame(axis, place):
    at = 3 if axis == "age" else -3
    values = np.array([0.6, 0.6, 0.6, -0.3]) + 0.05 * np.random.default_rng(2).standard_normal((10, 4))
    places = np.array([at - 3, at - 2, at - 1, at])
    pair = paired(values, places)
    (row,) = verdicts([Asked(OF, ESTIMANDS["core"], pair, [f"s{i}" for i in range(10)], np.arange(10), axis)])
    assert row.why == f"the change has the opposite sign {place}"


@pytest.mark.parametrize(
    ("change", "outcome"), [(0.0, "pass"), (np.log(0.5), "pass"), (np.log(1.5), "worse"), (np.log(1.2), "undecided")]
)
def test_a_gate_looks_at_changes_for_the_worse_only(change, outcome):
    found = judge(Gate({"core": 0.2}), [asked("core", change)])
    assert found.outcome == outcome
    assert [row.outcome for row in found.rows] == [outcome]
    assert (found.rows[0].why is None) == (outcome != "undecided")


def test_what_shows_no_likeness_is_no_pass():
    """Of lifetimes that most tracks outlive, a gate is about those up to the horizon, and says so."""
    heavy = asked("second_moment", 0.0, gap="tails of one of both are too heavy for so few errors")
    (row,) = judge(Gate({"second_moment": 0.2}), [heavy]).rows
    assert (row.outcome, row.why) == ("undecided", heavy.values.gap)
    outlived = asked("lifetime", 0.0, gap="most live on", horizon=np.array([20.0]))
    (row,) = judge(Gate({"lifetime": 0.2}), [outlived]).rows
    assert (row.outcome, row.why) == ("pass", "up to 20 frames; most live on")
    assert verdicts([outlived])[0].verdict == "undecided"
    few, earlier_few = (
        asked("outlier_ratio", 0.0, gap="few", scarce=np.array([scarce])) for scarce in ([True, False], [False, True])
    )
    assert judge(Gate({"outlier_ratio": 0.2}), [few]).outcome == "pass"  # the ratio of the second run is too large
    assert judge(Gate({"outlier_ratio": 0.2}), [earlier_few]).outcome == "undecided"


def test_one_worse_row_fails_and_one_undecided_row_holds_a_gate_up():
    gate = Gate({"core": 0.2, "lifetime": 0.2})
    good, bad, unsure = asked("core", 0.0), asked("lifetime", -1.0), asked("lifetime", 0.0, scenes=2)
    assert judge(gate, [good, bad]).outcome == "worse"
    assert judge(gate, [good, unsure]).outcome == "undecided"


def test_what_was_not_measured_is_no_pass():
    gate = Gate({"core": 0.2, "expected_feature_age": 0.1}, trackers=("lk", "mine"), speeds=(1, 4))
    found = judge(gate, [asked("core", 0.0)], ["after could not measure s9."])
    assert found.outcome == "undecided"
    assert len(found.missing) == 4
    assert judge(Gate({"core": 0.2}), []).outcome == "undecided"


def test_a_gate_leaves_out_other_trackers_and_speeds():
    fast = Compared("after", "lk", "lk", "simulated", "default", 0, "forward", "", 4)
    rows = [asked("core", 0.0), asked("core", 2.0, of=fast)]
    assert judge(Gate({"core": 0.2}, speeds=(1,)), rows).outcome == "pass"
    assert judge(Gate({"core": 0.2}), rows).outcome == "worse"


def test_conditions_and_statistics_of_one_run_only_are_no_pass():
    gate = Gate({"core": 0.2, "lifetime": 0.2})
    slow, fast, other = (
        Compared("after", name, name, "simulated", "default", 0, "forward", "", speed)
        for name, speed in (("lk", 1), ("lk", 4), ("sift", 1))
    )
    rows = [asked(name, 0.0, of=of) for name, of in (("core", slow), ("lifetime", slow), ("core", other))]
    found = judge(gate, rows, expected=[slow, fast, other])
    assert found.outcome == "undecided"
    assert found.missing == ("speed 4 is not in both runs", "lifetime of sift at speed 1 was not measured in both runs")
    assert judge(Gate({"core": 0.2}, speeds=(1,)), rows, expected=[slow, fast, other]).outcome == "pass"
    elsewhere = judge(
        Gate({"core": 0.2}, trackers=("lk",)), [*rows, asked("core", 0.0, of=fast)], expected=[slow, fast]
    )
    assert elsewhere.missing == ()
