"""Coverage that is stated where heavy tails are not excluded."""

import numpy as np
import pytest

from tracknoise.inference.coverage import are_heavy, coverage_of_heavy_errors, coverage_of_heavy_scales

SCENES, POINTS = 28, 60


def scales(rng: np.random.Generator, kind: str) -> np.ndarray:
    """Second moments of scenes, (points, scenes)."""
    shape = (POINTS, SCENES)
    if kind == "heavy":
        return 3 / rng.chisquare(3, shape)
    spread = {"alike": 0.1, "left": 0.97}[kind]
    return np.exp(-rng.gamma(1.0, spread, shape)) if kind == "left" else np.exp(spread * rng.normal(size=shape))


@pytest.mark.parametrize(("kind", "stated"), [("heavy", 0.9), ("alike", 0.0), ("left", 0.1)])
def test_the_coverage_of_heavy_scales_is_stated_unless_the_tail_is_excluded(kind: str, stated: float) -> None:
    own = scales(np.random.default_rng(1), kind)
    found = coverage_of_heavy_scales(own, np.full(POINTS, SCENES), power=1.0, level=0.95)
    share = np.isfinite(found).mean()
    assert share >= stated if kind == "heavy" else share <= stated
    if kind == "heavy":
        assert 0.7 < np.nanmean(found) < 0.9  # measured in planted scenes: .78


def test_few_scenes_have_no_stated_coverage() -> None:
    own = scales(np.random.default_rng(2), "heavy")[:, :3]
    assert np.isnan(coverage_of_heavy_scales(own, np.full(POINTS, 3), power=1.0, level=0.95)).all()


@pytest.mark.parametrize(("freedom", "is_heavy"), [(3.0, True), (np.inf, False)])
def test_the_coverage_of_heavy_errors_is_stated_where_errors_are_heavy(freedom: float, is_heavy: bool) -> None:
    rng, n = np.random.default_rng(3), 64
    shape = (20, 8, n)
    errors = rng.normal(size=shape) if np.isinf(freedom) else rng.standard_t(freedom, size=shape)
    second, absolute = (errors**2).mean(axis=-1), np.abs(errors).mean(axis=-1)
    counts = np.full(second.shape, float(n))
    pooled, typical = coverage_of_heavy_errors(second, absolute, counts, level=0.95)
    if is_heavy:
        assert np.isfinite(typical).mean() > 0.8
        assert np.nanmean(typical) < np.nanmean(pooled) < 0.93
    else:
        assert np.isnan([pooled, typical]).all()


def test_errors_are_heavy_where_their_second_moment_says_so_and_not_where_they_are_few() -> None:
    rng, n = np.random.default_rng(4), 100
    shape = (8, n)
    errors = np.stack([rng.normal(size=shape), rng.standard_t(3, size=shape), rng.standard_t(3, size=shape)])
    second, absolute = (errors**2).mean(axis=-1), np.abs(errors).mean(axis=-1)
    counts = np.full(second.shape, float(n))
    counts[2, 3:] = 0.0  # three scenes are too few
    assert are_heavy(second, absolute, counts, level=0.95).tolist() == [False, True, False]
