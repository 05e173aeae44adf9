from dataclasses import replace

import pytest

from tracknoise.analysis.gaussianity import ShapeEvidence, judge
from tracknoise.inference.estimates import Estimate
from tracknoise.tables.findings_schema import SHAPE


def near(value: float, half: float = 0.002) -> Estimate:
    return Estimate(value, value - half, value + half)


GAUSSIAN = ShapeEvidence(
    n_sampled=4000,
    student=near(0.0),
    mixture=near(0.0),
    difference=near(0.0),
    skewness=near(0.01),
    kurtosis=near(8.0, 0.3),
    tail_99=1.0,
    nu=150.0,
    share=0.1,
    ratio=1.0,
)
HEAVY = replace(GAUSSIAN, student=near(0.2), mixture=near(0.18), difference=near(-0.02), kurtosis=near(20, 5), nu=4.0)


@pytest.mark.parametrize(
    ("evidence", "verdict", "said"),
    [
        (GAUSSIAN, "Gaussian", "Both are below 0.01"),
        (HEAVY, "heavy-tailed", "Student's t with 4.00 degrees of freedom gains 0.200 (0.198 to 0.202) nat"),
        (
            replace(HEAVY, difference=near(0.02), share=0.05, ratio=16.0),
            "contaminated",
            "5.00 % of errors 4.00 times as wide",
        ),
        (replace(HEAVY, difference=near(0.001)), "heavy-tailed", "a mixture gains 0.180 (0.178 to 0.182)"),
        (
            replace(HEAVY, student=near(0.012, 0.02), mixture=near(0.03), difference=near(0.02)),
            "contaminated",
            "mixture",
        ),
        (replace(GAUSSIAN, skewness=near(0.5, 0.1)), "skewed", "b1 is 0.500"),
        (
            replace(GAUSSIAN, skewness=near(2.0), kurtosis=near(60, 50), student=near(0.01, 0.1)),
            "undecided",
            "may gain",
        ),
        (replace(GAUSSIAN, kurtosis=near(6.0, 0.3), tail_99=0.1), "light-tailed", "below 6.87"),
        (replace(GAUSSIAN, kurtosis=near(6.9, 0.3), tail_99=0.6), "undecided", "kurtosis may be"),
        (replace(GAUSSIAN, student=near(0.01, 0.005)), "undecided", "may gain 0.015 nat per error, limit 0.01"),
        (replace(GAUSSIAN, student=Estimate(0.5)), "undecided", "too few"),
        (replace(GAUSSIAN, kurtosis=Estimate(8.0)), "undecided", "too few"),
    ],
)
def test_the_verdict_follows_from_effect_sizes(evidence: ShapeEvidence, verdict: str, said: str) -> None:
    found, why = judge(evidence)
    assert found == verdict
    assert found in SHAPE.categories
    assert said in why


def test_a_number_that_rounds_to_zero_has_no_sign() -> None:
    _, why = judge(replace(GAUSSIAN, mixture=Estimate(-0.0001, -0.0002, -0.00005)))
    assert "a mixture 0.000 (0.000 to 0.000)" in why


def test_a_wider_margin_calls_more_errors_gaussian() -> None:
    slight = replace(GAUSSIAN, student=near(0.03), mixture=near(0.025))
    assert judge(slight)[0] == "heavy-tailed"
    assert judge(slight, margin=0.05)[0] == "Gaussian"


def test_no_tails_are_heavy_where_fewer_errors_than_a_gaussians_are_far_out() -> None:
    mixed = replace(HEAVY, difference=near(0.02), share=0.01, ratio=100.0)
    for evidence in (HEAVY, mixed):
        for changed in ({"tail_99": 0.9}, {"pooled_tail_99": 0.9}):
            verdict, why = judge(replace(evidence, **changed))
            assert verdict == "undecided"
            assert "only 0.900 times as many errors" in why
        assert judge(replace(evidence, tail_99=None))[0] != "undecided"


def test_what_the_scales_of_scenes_add_is_told_beside_the_verdict() -> None:
    for evidence in (GAUSSIAN, HEAVY):
        added = replace(evidence, scales=near(0.3))
        assert judge(added)[0] == judge(evidence)[0]
        assert "Different scales of scenes add 0.300 (0.298 to 0.302) nat" in judge(added)[1]
        assert "scales of scenes" not in judge(evidence)[1]
