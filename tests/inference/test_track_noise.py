from dataclasses import fields

import numpy as np
import pytest

from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.inference.track_noise import (
    COMPONENTS,
    NAMES,
    Reference,
    Seen,
    TrackNoise,
    change_covariances,
    error_covariances,
)

AGES = np.arange(1.0, 6.0)
STILL = Seen(AGES, np.ones(5), AGES, np.ones(5))


def test_a_component_is_known_to_models_and_exports() -> None:
    assert [one.name for one in fields(TrackNoise)] == list(NAMES)
    assert {one.name for one in fields(NoiseModel)} >= set(NAMES)


@pytest.mark.parametrize("one", COMPONENTS, ids=NAMES)
def test_an_error_grows_by_the_power_of_its_age(one) -> None:
    assert one.shared(STILL, STILL, Reference.BIRTH) == pytest.approx(AGES**one.power)


@pytest.mark.parametrize("name", NAMES)
def test_changes_are_differences_of_errors(name: str) -> None:
    noise = TrackNoise.isotropic(**{name: 0.5})
    track = noise.covariance(np.ones((1, 6)), reference=Reference.BIRTH)[0, ::2, ::2]
    change = track[4, 4] - 2.0 * track[4, 1] + track[1, 1]
    assert change_covariances(noise, np.array([3.0]), np.ones(1))[0, 0, 0] == pytest.approx(change)


@pytest.mark.parametrize("one", COMPONENTS, ids=NAMES)
def test_the_header_multiplies_by_the_same(one) -> None:
    noise = TrackNoise.isotropic(**{one.name: 1.0})
    known = {"later": 1.0, "age": 4.0, "m": 1.3, "f": 2.0, "frames": 3.0}
    age, carried, factor, frames = (np.array([known[name]]) for name in ("age", "m", "f", "frames"))
    of_error, of_change = (eval(code, {}, known) for code in (one.code.error, one.code.change))
    assert error_covariances(noise, age, carried, factor)[0, 0, 0] == pytest.approx(of_error)
    assert change_covariances(noise, frames, factor)[0, 0, 0] == pytest.approx(of_change)
