import numpy as np
import pytest

from tracknoise.geometry.accuracy import AccuracyKind, GrowthLaw, TruthAccuracy
from tracknoise.geometry.growth import accuracy_of_growth

LAG = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])


@pytest.mark.parametrize("law", [(0.1, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.05), (0.1, 0.2, 0.01), (0.0, 0.0, 0.0)])
def test_a_law_is_found_from_its_own_errors(law) -> None:
    errors = np.sqrt(GrowthLaw(*law).variance(LAG))
    found = accuracy_of_growth(LAG, errors, errors / 10.0, source="here")
    np.testing.assert_allclose(
        [found.rotation_white_deg, found.rotation_deg_per_sqrt_frame, found.rotation_deg_per_frame], law, atol=1e-6
    )
    np.testing.assert_allclose(
        [found.translation.white, found.translation.walk, found.translation.drift], np.divide(law, 10.0), atol=1e-7
    )
    assert (found.source, found.kind) == ("here", AccuracyKind.measured)


def test_a_law_comes_close_to_errors_that_follow_none() -> None:
    lag = np.array([1.0, 8.0, 24.0])
    errors = np.array([0.089, 0.088, 0.106]) * np.sqrt(lag)
    found = accuracy_of_growth(lag, errors, np.full(3, np.nan), source="two truths")
    assert found.topics == {"rotation"}
    np.testing.assert_allclose(np.degrees(np.sqrt(found.rotation.variance(lag))), errors, rtol=0.05)


def test_without_any_error_nothing_is_known() -> None:
    unknown = np.full(6, np.nan)
    assert accuracy_of_growth(LAG, unknown, unknown, source="") == TruthAccuracy(kind=AccuracyKind.measured)
