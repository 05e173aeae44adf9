"""Intervals of changes from frame to frame: against the curves of the same changes, and against what made them."""

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.curve_intervals import correlated, interval_table
from tracknoise.inference.intervals import Method
from tracknoise.inference.units import Units
from tracknoise.statistics.aspects import aspect_blocks
from tracknoise.statistics.changes import change_curves, increments
from tracknoise.statistics.lifetimes import count_ends
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations, prepare_sequence
from tracknoise.tables.schema import FRAME_COUNTS, empty

TRACKS, STEPS, RUNS = 40, 12, 400
SHARE = 0.4
"""Each change is this share of the one before, and something of its own."""


def changes_of(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Changes (..., steps) whose correlation is `SHARE` to the power of the lag."""
    own = rng.normal(size=(*shape, STEPS))
    own[..., 0] /= np.sqrt(1 - SHARE**2)
    for step in range(1, STEPS):
        own[..., step] += SHARE * own[..., step - 1]
    return own


def found_of(see_errors, n_scenes: int, **options: object) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Intervals and curves of the same changes."""
    rng = np.random.default_rng(n_scenes)
    walks = [0.1 * changes_of(rng, (TRACKS, 2)).cumsum(axis=-1).swapaxes(1, 2) for _ in range(n_scenes)]
    seen = see_errors([np.concatenate([np.zeros((TRACKS, 1, 2)), walk], axis=1) for walk in walks])
    moved = increments(prepare_sequence(seen.observations, seen.tracks))
    tables = scene_moments(prepare_observations(seen.observations)), count_ends(seen.tracks), empty(FRAME_COUNTS)
    blocks = aspect_blocks(prepare_sequence(seen.observations, seen.tracks))
    found = interval_table(*tables, changes=moved, aspect_blocks=blocks, **options)
    return found.filter(aspect="change"), change_curves(moved)


@pytest.mark.parametrize("n_scenes", [3, 8])
def test_values_are_those_of_the_curves(see_errors, n_scenes: int) -> None:
    found, curves = found_of(see_errors, n_scenes)
    for statistic, column in {"nu": "mean_{}_px", "central": "covariance_{0}{0}", "autocorrelation": None}.items():
        for axis in "uv":
            name = (column or "autocorrelation_{}").format(axis)
            at = "lag" if column is None else "age"
            expected = curves.drop_nulls(name).sort("trimming", at)
            rows = found.filter(statistic=statistic, coordinate=axis)
            rows = rows.filter(pl.col("weighting").is_null() | (pl.col("weighting") == "features")).sort(
                "trimming", "at"
            )
            assert rows["at"].to_list() == expected[at].to_list()
            np.testing.assert_allclose(rows["value"], expected[name], rtol=1e-9, atol=1e-15)
    assert found.filter(statistic="autocorrelation")["axis"].unique().to_list() == ["lag"]
    assert not found["statistic"].is_in(["eta"]).any()  # absolute changes are not kept


@pytest.mark.parametrize(("n_scenes", "resampled"), [(8, "scenes"), (3, "blocks")])
def test_all_have_bounds_that_hold_them(see_errors, n_scenes: int, resampled: str) -> None:
    found, _ = found_of(see_errors, n_scenes)
    assert found["resampled"].unique().to_list() == [resampled]
    assert ((found["low"] < found["value"]) & (found["value"] < found["high"])).all()


@pytest.mark.parametrize("n_scenes", [8, 3])
def test_the_kind_that_is_asked_for_changes_bounds_alone_and_is_named(see_errors, n_scenes: int) -> None:
    (usual, _), (asked, _) = found_of(see_errors, n_scenes), found_of(see_errors, n_scenes, kind="percentile")
    assert (usual["kind"].unique().to_list(), asked["kind"].unique().to_list()) == (["student"], ["percentile"])
    assert usual["value"].equals(asked["value"])
    for statistic in ("nu", "autocorrelation"):
        of_one = usual["statistic"] == statistic
        assert (usual.filter(of_one)["low"] != asked.filter(of_one)["low"]).all()


@pytest.mark.parametrize("n_scenes", [8, 28])
def test_autocorrelation_is_held_as_often_as_it_says(n_scenes: int) -> None:
    rng = np.random.default_rng(n_scenes)
    scale = np.exp(0.3 * rng.normal(size=(n_scenes, RUNS, 1, 1)))
    there = np.arange(TRACKS)[:, None] < rng.integers(TRACKS // 3, TRACKS + 1, (n_scenes, RUNS, 1, 1))
    changes = scale * there * changes_of(rng, (n_scenes, RUNS, TRACKS))
    for lag in (1, 2):
        one, other = changes[..., lag:], changes[..., :-lag]
        lagged, squares = (one * other).sum(axis=(2, 3)), ((one**2 + other**2) / 2).sum(axis=(2, 3))
        n = (STEPS - lag) * there.sum(axis=(2, 3))
        scenes = tuple(map(str, range(n_scenes)))
        sums = np.stack([n, lagged, squares, lagged, squares], axis=-1).astype(np.float64)
        units = Units(sums, pl.DataFrame(), scenes, np.arange(n_scenes), "scenes")
        bounds = correlated(units, np.empty((0, n_scenes)), Method("student"))
        held = np.mean((bounds.low[0] <= SHARE**lag) & (SHARE**lag <= bounds.high[0]))
        assert 0.92 - 0.03 < held < 0.97 + 0.015


def test_scenes_without_changes_tell_nothing_of_their_correlation() -> None:
    squares = np.where(np.arange(8) < 7, 0.0, 10.0)[:, None]
    sums = np.stack([np.full((8, 1), 50.0), -0.3 * squares, squares, -0.3 * squares, squares], axis=-1)
    units = Units(sums, pl.DataFrame(), tuple(map(str, range(8))), np.arange(8), "scenes")
    bounds = correlated(units, np.empty((0, 8)), Method("student"))
    assert bounds.value[0, 0] == pytest.approx(-0.3)
    assert np.isnan(bounds.low[0, 0])
    assert bounds.n_scenes[0, 0] == 1
