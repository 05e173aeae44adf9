"""Robust losses that are tried on tracks of a run: the sigma that belongs to each, and which of them is chosen."""

from functools import cache

import numpy as np
import polars as pl
import pytest

from tracknoise.estimators.kernels import KNEES, LENGTH, drawn_windows, tried_kernels
from tracknoise.estimators.losses import Loss, LossKind, expected_nees
from tracknoise.estimators.model import Equivalent, Interval, Kernel, Landmark, Purpose
from tracknoise.estimators.training import windows
from tracknoise.inference.units import NO_GROUPS
from tracknoise.tables.schema import NOISE_TRACKS

SIGMA = 0.3
WINDOWS = windows([], speed=1, length=LENGTH, lifetimes=np.full(50, 12))


def tracks(scales: np.ndarray, *, scenes: int = 12, walk: float = 0.0, seed: int = 0) -> pl.DataFrame:
    """White errors of tracks with these standard deviations in each scene, px, and a walk."""
    random, length = np.random.default_rng(seed), 15
    parts = []
    for scene in range(scenes):
        errors = scales[:, None, None] * random.standard_normal((len(scales), length, 2))
        errors += np.cumsum(walk * random.standard_normal(errors.shape), axis=1)
        rows = {
            "dataset": "d",
            "scene": f"s{scene:02}",
            "lighting": "default",
            "camera": "",
            "track": np.repeat(np.arange(len(scales)), length),
            "stands_for": 1.0,
            "age": np.tile(np.arange(length), len(scales)),
            "du_px": errors[..., 0].ravel(),
            "dv_px": errors[..., 1].ravel(),
        }
        parts.append(pl.DataFrame(rows))
    names = pl.concat(parts).columns
    return pl.concat(parts).cast({name: NOISE_TRACKS[name] for name in names})


def sigma(purpose: Purpose) -> Equivalent:
    interval = Interval(value=SIGMA)
    return Equivalent(landmark=Landmark.FREE, purpose=purpose, window=LENGTH, sigma=interval, gate_95=1.0, gate_99=1.0)


def tried(table: pl.DataFrame, most_px: float = np.inf) -> dict[tuple[str, float], Kernel]:
    """By kind, and knee over the sigma of innovations."""
    found = tried_kernels(
        list(drawn_windows(table, WINDOWS, most_px)),
        dataset="d",
        innovations=sigma(Purpose.INNOVATIONS),
        newest=sigma(Purpose.NEWEST_POSE),
        every=sigma(Purpose.ALL_POSES),
        groups=NO_GROUPS,
        level=0.95,
    )
    return {(str(one.kind), round(one.knee_px / SIGMA, 6)): one for one in found}


@cache
def of_one_scale() -> dict[tuple[str, float], Kernel]:
    return tried(tracks(np.full(80, SIGMA)))


def test_gaussian_noise_needs_the_sigma_that_theory_says() -> None:
    found = of_one_scale()
    assert set(found) == {(kind, knee) for kind in ("cauchy", "huber") for knee in KNEES}
    for (kind, knee), one in found.items():
        if knee >= 1.0:  # the points absorb a part of the residuals, which matters for small knees
            expected = expected_nees(Loss(LossKind(kind), knee)) ** 0.5
            assert one.sigma_ratio.value == pytest.approx(expected, rel=0.15)
            assert one.sigma_ratio.low < one.sigma_ratio.value < one.sigma_ratio.high
            assert one.all_poses_ratio.value == pytest.approx(expected, rel=0.15)
    assert found["huber", 3.0].error_ratio.value == pytest.approx(1.0, abs=0.02)
    assert found["cauchy", 0.3].error_ratio.value > 1.05


def test_tracks_of_different_scales_make_a_loss_worth_it() -> None:
    scales = SIGMA * np.exp(np.random.default_rng(1).standard_normal(80))
    found = tried(tracks(scales))
    assert found["cauchy", 1.0].error_ratio.high < 0.9
    assert found["cauchy", 1.0].sigma_ratio.value < found["huber", 3.0].sigma_ratio.value


def test_errors_that_an_outlier_test_rejects_do_not_count() -> None:
    table = tracks(np.full(80, SIGMA))
    wild = table.with_columns(
        du_px=pl.when(pl.col("track") < 8, pl.col("age") > 5).then(50.0).otherwise("du_px").cast(pl.Float32)
    )
    clean, kept = of_one_scale(), tried(wild, most_px=10.0)
    assert kept["huber", 3.0].sigma_ratio.value == pytest.approx(clean["huber", 3.0].sigma_ratio.value, rel=0.2)
    assert tried(wild)["huber", 3.0].sigma_ratio.low > clean["huber", 3.0].sigma_ratio.high


def test_one_scene_is_enough() -> None:
    """More errors are drawn for each of its windows. Without other scenes there is no interval."""
    found, every = tried(tracks(np.full(200, SIGMA), scenes=1)), of_one_scale()
    assert all(one.windows == 24 and one.sigma_ratio.low is None for one in found.values())
    for name, one in found.items():
        assert one.sigma_ratio.value == pytest.approx(every[name].sigma_ratio.value, rel=0.25)


def test_without_tracks_or_errors_nothing_is_tried() -> None:
    assert tried(tracks(np.full(80, SIGMA)).clear()) == {}
    assert tried(tracks(np.full(30, SIGMA))) == {}
    assert tried(tracks(np.zeros(80))) == {}
