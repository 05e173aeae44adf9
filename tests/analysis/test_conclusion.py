"""Conclusions of made-up verdicts."""

from dataclasses import replace

import pytest

from tracknoise.analysis.conclusion import conclusion
from tracknoise.analysis.run_changes import Compared, Row
from tracknoise.tables.enumerations import ChangeVerdict
from tracknoise.topics.catalogue import ESTIMANDS

OF = Compared("after", "lk", "lk", "simulated", "default", 0, "forward", "", 1)
BETTER, WORSE, SAME, OPEN = (
    ChangeVerdict.better, ChangeVerdict.worse, ChangeVerdict.none, ChangeVerdict.undecided,
)  # fmt: skip


def row(statistic, verdict, *, why=None, at=None, **of):
    return Row(
        replace(OF, **of), ESTIMANDS[statistic], verdict, why, effect=1.0, low=None, high=None, margin=1.1, at=at,
        coordinate=None, at_low=1, at_high=9, axis="age", horizon=None, p_change=None, p_adjusted=None, p_none=None,
        n_scenes=8, resampled="scenes", scenes={},
    )  # fmt: skip


def said(*rows):
    return conclusion(("before", "after"), rows)


def speeds(statistic, *verdicts, **columns):
    """One row per speed."""
    return [row(statistic, verdict, speed=place + 1, **columns) for place, verdict in enumerate(verdicts)]


@pytest.mark.parametrize(
    ("verdicts", "sentence"),
    [
        ({"consistent_sigma": BETTER, "residual_sigma": WORSE},
         "after is better for depths; before has only smaller residuals."),
        ({"consistent_sigma": WORSE, "core": WORSE, "lifetime": BETTER},
         "before is better for depths and has smaller typical errors; after has longer tracks."),
        ({"consistent_sigma": BETTER, "overconfidence": BETTER}, "after is better for depths."),
        ({"overconfidence": BETTER}, "after has less overconfident residuals."),
        ({"consistent_sigma": BETTER, "core": SAME},
         "after is better for depths; all else is equal within the margin."),
        ({"consistent_sigma": BETTER, "core": SAME, "bias": OPEN},
         "after is better for depths; 1 of 3 statistics is undecided."),
        ({"core": SAME, "bias": SAME}, "before and after are equal within the margin in 2 statistics."),
        ({"core": OPEN, "bias": OPEN, "tails": SAME},
         "Neither before nor after is shown to be better: 2 of 3 statistics are undecided, the others are equal within "
         "the margin."),
        ({"core": OPEN, "bias": OPEN},
         "Undecided: neither before nor after is shown to be better, nor are they shown to be equal."),
        ({}, "before and after have nothing in common that can be compared."),
    ],
)  # fmt: skip
def test_the_sentence_follows_from_the_verdicts(verdicts, sentence):
    assert said(*(row(name, verdict) for name, verdict in verdicts.items())) == sentence


@pytest.mark.parametrize("verdict", [BETTER, WORSE])
def test_both_directions_name_the_run_that_is_better(verdict):
    winner = "after" if verdict == BETTER else "before"
    assert all(said(row(name, verdict)).startswith(f"{winner} ") for name in ESTIMANDS)


def test_every_statistic_has_words_for_the_better_run():
    assert all(said(row(name, BETTER)) == f"after {one.wording.better}." for name, one in ESTIMANDS.items())


def test_what_is_undecided_is_never_called_equal():
    rows = [row(name, OPEN if name == "core" else SAME) for name in ESTIMANDS]
    assert said(*rows).startswith("Neither ")
    assert "all else" not in said(*rows, row("core", BETTER, speed=2))


def test_why_all_is_undecided_is_said_once():
    assert said(*(row(name, OPEN, why="only 2 scenes") for name in ("core", "bias"))).endswith("equal: only 2 scenes.")


def test_conditions_are_named_only_where_conclusions_differ():
    both = speeds("lifetime", BETTER, BETTER)
    assert said(*both) == "after has longer tracks."
    assert said(*both, *speeds("consistent_sigma", SAME, WORSE)) == (
        "after has longer tracks; before at speed 2 is better for depths; all else is equal within the margin."
    )
    assert said(*both, *speeds("consistent_sigma", OPEN, BETTER)) == (
        "after has longer tracks, and at speed 2 is better for depths; 1 of 4 comparisons is undecided."
    )
    assert said(*speeds("core", BETTER, WORSE)) == (
        "after at speed 1 has smaller typical errors; before at speed 2 has smaller typical errors."
    )


def test_a_statistic_that_one_condition_lacks_is_named_with_the_other():
    assert said(*speeds("lifetime", BETTER, BETTER), row("core", BETTER)) == (
        "after has longer tracks, and at speed 1 has smaller typical errors."
    )


def test_many_trackers_are_counted_and_few_are_named():
    names = [f"tracker-{number}" for number in range(15)]

    def better(n):
        rows = [
            row("core", BETTER if place < n else OPEN, tracker=name, other_tracker=name)
            for place, name in enumerate(names)
        ]
        return said(*rows)

    assert better(2).startswith("after with tracker-0 and with tracker-1 has smaller typical errors; 13 of 15 ")
    assert better(7).startswith("after in 7 of 15 conditions has smaller typical errors; 8 of 15 comparisons ")


def test_a_condition_of_several_factors_is_named_by_all_of_them():
    rows = [
        row("core", BETTER if (name, speed) == ("b", 2) else SAME, tracker=name, other_tracker=name, speed=speed)
        for name in "ab"
        for speed in (1, 2)
    ]
    assert said(*rows).startswith("after with b at speed 2 has smaller typical errors")


def test_a_change_at_one_age_alone_is_not_said_of_all():
    assert said(row("core", BETTER, at=7)) == "after at single ages has smaller typical errors."


def test_the_sentence_stays_short_where_all_is_better_or_conditions_differ_much():
    everything = said(*(row(name, BETTER) for name in ESTIMANDS))
    assert len(everything.split()) < 30
    assert everything.endswith("and 3 more advantages.")
    names = ("core", "bias", "lifetime", "outlier_ratio", "feature_count", "consistent_sigma")
    apart = [
        one for place, name in enumerate(names)
        for one in speeds(name, *(BETTER if place == speed else SAME for speed in range(len(names))))
    ]  # fmt: skip
    assert said(*apart).count(" at speed ") == 3
    assert "and more in other conditions; all else" in said(*apart)
