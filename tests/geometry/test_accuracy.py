import numpy as np
import pytest

from tracknoise.geometry.accuracy import AccuracyKind, DepthAccuracy, GrowthLaw, PoseAccuracy, TruthAccuracy


def test_relative_error_of_a_law_is_the_spread_of_differences_of_such_poses() -> None:
    rng, lag = np.random.default_rng(1), np.array([0.0, 1.0, 9.0])
    shape = (200000, 10)
    white = 0.3 * rng.standard_normal(shape)
    walk = np.cumsum(0.2 * rng.standard_normal(shape), axis=1)
    drift = 0.1 * rng.standard_normal((shape[0], 1)) * np.arange(10)
    poses = white + walk + drift
    measured = [np.var(poses[:, int(k)] - poses[:, 0]) for k in lag]
    assert np.allclose(GrowthLaw(0.3, 0.2, 0.1).variance(lag), measured, rtol=0.02)


def test_single_poses_count_as_independent_from_frame_to_frame() -> None:
    found = TruthAccuracy.of(PoseAccuracy(0.01, np.radians(0.5)), DepthAccuracy(0.001, 0.02, 0.003), source="me")
    assert (found.translation_white_m, found.rotation_white_deg) == (0.01, pytest.approx(0.5))
    assert found.depth == DepthAccuracy(0.001, 0.02, 0.003)
    assert found.rotation.white == pytest.approx(np.radians(0.5))
    assert found.topics == {"rotation", "translation", "depth"}


def test_what_is_unknown_is_no_topic_and_what_is_exact_is() -> None:
    assert TruthAccuracy.of(PoseAccuracy(0.01, None), None, source="").topics == {"translation"}
    assert TruthAccuracy(clock_ms=0.0).topics == {"clock"}
    assert TruthAccuracy().topics == frozenset()


def test_a_law_is_replaced_as_a_whole_and_other_topics_are_kept() -> None:
    mine = TruthAccuracy(rotation_white_deg=0.1, source="mine")
    shipped = TruthAccuracy(
        rotation_deg_per_sqrt_frame=0.2, clock_ms=4.0, source="shipped", kind=AccuracyKind.disagreement
    )
    assert mine.over(shipped) == TruthAccuracy(rotation_white_deg=0.1, clock_ms=4.0, source="mine")


@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_impossible_figures_are_refused(value: float) -> None:
    with pytest.raises(ValueError, match=r"clock_ms = .*expected a finite number of at least 0"):
        TruthAccuracy(clock_ms=value)
