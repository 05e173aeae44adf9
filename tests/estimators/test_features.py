"""Sigma for the number of features of a frame, where these have errors in common."""

from dataclasses import replace

import pytest
from tests.estimators.exports.models import interval, lucas_kanade

from tracknoise.estimators.advice import Gate
from tracknoise.estimators.exports import Target
from tracknoise.estimators.model import Interval, Kernel, KnownPoints, LossKind
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.trust import TruthVerdict

SHARE = Interval(value=0.05, low=0.02, high=0.08)
from_here = 0
PER_FEATURE = Interval(value=0.0004, low=0.0002, high=0.0006)


def with_common(share: Interval | None = SHARE, **more: object) -> NoiseModel:
    model = lucas_kanade(common_share=share, **more)
    return replace(model, equivalents=tuple(replace(one, per_feature=PER_FEATURE) for one in model.equivalents))


def test_sigma_squared_grows_with_the_number_of_features() -> None:
    plain, found = (model.advise("filterpy") for model in (with_common(None), with_common()))
    assert found.features == 200
    assert found.sigma.value**2 == pytest.approx(plain.sigma.value**2 + 200 * PER_FEATURE.value)
    assert with_common().advise("filterpy", features=20).sigma.value < found.sigma.value
    square = found.sigma.value**2
    assert square - found.sigma.low**2 < (plain.sigma.value**2 - plain.sigma.low**2) + 200 * 0.0002
    assert square - found.sigma.low**2 > 200 * 0.0002


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"share": None}, "whether they have errors in common is unknown"),
        ({"share": Interval(value=0.05, low=0.0, high=0.1)}, "a share above 0 is not established"),
        ({"truth": TruthVerdict(Trust.limited, "It is limited.", "")}, "errors in common may be errors of the truth"),
    ],
)
def test_sigma_stays_and_says_why_where_errors_in_common_are_not_known(changes: dict[str, object], why: str) -> None:
    model = with_common(**changes)
    found = model.advise("gtsam")
    assert found.features is None
    assert found.sigma == with_common(None).advise("gtsam").sigma
    assert f"Sigma takes features as independent: {why}" in model.export("gtsam").text


def test_with_an_inertial_sensor_features_count_only_where_their_number_is_stated() -> None:
    model = with_common()
    assert model.advise("openvins").features is None
    assert "with an inertial sensor" in model.export("openvins").text
    stated = model.advise("openvins", features=100)
    assert stated.sigma.value > model.advise("openvins").sigma.value
    assert stated.state is not None
    assert stated.state.features == 100


def test_gates_stay_as_large_in_px() -> None:
    model = with_common()
    alone, together = model.advise("filter"), model.advise("filter", features=100)
    for gate in Gate:
        if alone.gates[gate] < 1.0:
            sizes = [one.gates[gate] * one.sigma.value**2 for one in (alone, together)]
            assert sizes[1] == pytest.approx(sizes[0])


def test_a_loss_makes_independent_errors_smaller_and_not_those_in_common() -> None:
    kernel = Kernel(kind=LossKind.CAUCHY, knee_px=0.3, sigma_ratio=interval(0.6), error_ratio=interval(0.8), windows=24)
    plain, found = (with_common(share, kernels=(kernel,)).advise("gtsam") for share in (None, SHARE))
    added = 200 * PER_FEATURE.value * (0.6 / 0.8) ** 2
    assert found.sigma.value**2 == pytest.approx(plain.sigma.value**2 + added)
    assert found.knee_px == plain.knee_px


def test_a_fixed_knee_is_that_of_the_larger_sigma() -> None:
    kernels = tuple(
        Kernel(kind=LossKind.HUBER, knee_px=knee, sigma_ratio=interval(ratio), error_ratio=interval(0.9), windows=24)
        for knee, ratio in ((0.9, 1.0), (0.3, 0.8), (0.1, 0.6))
    )
    plain, found = (with_common(share, kernels=kernels).advise("orbslam3") for share in (None, SHARE))
    assert found.sigma.value > plain.sigma.value
    assert found.knee == pytest.approx(plain.knee)


def test_known_points_count_features_too() -> None:
    points = KnownPoints(window=10, kernel=LossKind.CAUCHY, knee_px=0.3, sigma=interval(0.2), per_feature=PER_FEATURE)
    found = with_common(known_points=(points,)).advise("pnp", features=50)
    assert found.sigma.value**2 == pytest.approx(0.2**2 + 50 * PER_FEATURE.value)
    assert "with 50 features per frame" in "".join(
        with_common(known_points=(points,)).export("pnp", target=Target(features=50)).files.values()
    )
