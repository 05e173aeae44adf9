from collections import Counter

import numpy as np
import pytest

from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.oracle import Oracle
from tracknoise.trackers.tracker import Frame, SequenceContext, Step

SIZE = (320, 240)


def run(settings: Oracle, setting: SequenceContext, indices: range) -> list[Step]:
    tracker = settings.start(setting)
    return [tracker.step(Frame(k, np.zeros((SIZE[1], SIZE[0]), np.uint8))) for k in indices]


def errors(steps: list[Step], indices: range, setting: SequenceContext) -> tuple[np.ndarray, np.ndarray]:
    """Ages and errors of all observations, the true positions from the first, exact ones."""
    born: dict[int, tuple[int, np.ndarray]] = {}
    ages, rows = [], []
    for index, step in zip(indices, steps, strict=True):
        for identity, uv, new in zip(step.ids.tolist(), step.uv, step.born, strict=True):
            if new:
                born[identity] = (index, uv)
            start, first = born[identity]
            ages.append(index - start)
            rows.append(uv - first - (index - start) * setting.truth.velocity)
    return np.array(ages), np.array(rows)


def test_bias_covariance_and_drift_come_back(setting):
    settings = Oracle(
        n_features=400, bias_px=(0.3, -0.2), covariance_px2=((0.5, 0.2), (0.2, 0.3)), drift_px_per_frame=(0.02, -0.01)
    )
    here = setting()
    indices = range(0, 60, 2)
    ages, error = errors(run(settings, here, indices), indices, here)
    assert np.abs(error[ages == 0]).max() < 1e-9
    later = ages > 0
    design = np.column_stack([np.ones(later.sum()), ages[later]])
    (bias, drift), *_ = np.linalg.lstsq(design, error[later], rcond=None)
    residual = error[later] - design @ np.stack([bias, drift])
    n = later.sum()
    assert n > 5000
    assert np.abs(bias - settings.bias_px).max() < 6 * 0.7 * 2 / np.sqrt(n)
    assert np.abs(drift - settings.drift_px_per_frame).max() < 6 * 0.7 / (np.std(ages[later]) * np.sqrt(n))
    assert np.abs(np.cov(residual.T) - settings.covariance_px2).max() < 6 * 0.7 / np.sqrt(n)


def test_both_rates_come_back_for_the_features_offered(setting):
    steps = run(Oracle(n_features=500, outlier_rate=0.06, loss_rate=0.1), setting(), range(80))
    offered = sum(step.offered for step in steps)
    ends = Counter(np.concatenate([step.ended for step in steps]).tolist())
    for rate, count in ((0.06, sum(step.outliers for step in steps)), (0.1, ends[TrackEnd.lost])):
        assert abs(count / offered - rate) < 5 * np.sqrt(rate * (1 - rate) / offered)
    assert ends[TrackEnd.outlier] == sum(step.outliers for step in steps)
    assert all(step.matched + np.count_nonzero(step.ended != TrackEnd.outlier) == step.offered for step in steps)


def test_features_that_leave_the_image_are_masked_and_replaced(setting):
    here = setting()
    steps = run(Oracle(n_features=100, covariance_px2=((0, 0), (0, 0))), here, range(40))
    ends = Counter(np.concatenate([step.ended for step in steps]).tolist())
    assert set(ends) == {TrackEnd.masked}
    assert ends[TrackEnd.masked] > 5
    assert all(step.alive == 100 for step in steps)
    uv = np.concatenate([step.uv for step in steps])
    assert (uv < np.array(SIZE) - 0.5).all()


def test_features_begin_inside_the_margin_and_only_where_truth_is_valid(setting):
    here = setting()
    here.truth.hole_px = 200.0
    (step,) = run(Oracle(n_features=300, margin_px=20), here, range(1))
    assert step.new == 300
    assert step.uv[:, 0].min() >= 200
    assert step.uv[:, 0].max() <= 319 - 20
    assert 20 <= step.uv[:, 1].min() <= step.uv[:, 1].max() <= 239 - 20
    here.truth.hole_px = 1000.0
    (none,) = run(Oracle(), here, range(1))
    assert none.alive == 0


def test_scenes_speeds_and_seeds_are_independent_and_each_is_repeatable(setting):
    def first(settings: Oracle, **where: object) -> bytes:
        return run(settings, setting(**where), range(1))[0].uv.tobytes()

    assert first(Oracle()) == first(Oracle())
    assert len({first(Oracle()), first(Oracle(seed=1)), first(Oracle(), scene="b"), first(Oracle(), speed=2)}) == 4
    assert len({first(Oracle(), camera=name) for name in ("", "left", "right")}) == 3


@pytest.mark.parametrize("covariance", [((1.0, 0.0), (0.0, 0.0)), ((0.0, 0.0), (0.0, 1.0)), ((4.0, 2.0), (2.0, 1.0))])
def test_singular_covariances_are_fine(covariance, setting):
    here = setting()
    ages, error = errors(run(Oracle(covariance_px2=covariance), here, range(20)), range(20), here)
    assert np.abs(np.cov(error[ages > 0].T) - covariance).max() < 0.3


@pytest.mark.parametrize(
    "wrong",
    [
        {"n_features": 0},
        {"bias_px": (np.nan, 0.0)},
        {"covariance_px2": ((1.0, 2.0), (2.0, 1.0))},
        {"covariance_px2": ((1.0, 0.1), (0.2, 1.0))},
        {"outlier_rate": 1.1},
        {"loss_rate": -0.1},
        {"outlier_rate": 0.6, "loss_rate": 0.5},
    ],
)
def test_impossible_settings_are_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Oracle(**wrong)
