"""Groups of scenes: what is resampled, and how often intervals hold the true value."""

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.condition_units import units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, averaged, geometric, pooled
from tracknoise.inference.units import Resampled, SceneGroups, Units, scheme

RUNS, TRACKS = 2000, 100


@pytest.mark.parametrize(
    ("group", "expected"),
    [
        (range(6), Resampled.scenes),
        (range(5), None),
        ([0, 0, 1, 1, 2, 2, 3, 3], Resampled.within),
        ([0, 0, 1, 1, 2, 3], None),  # two degrees of freedom
        ([0, 1, 2, 3, 4, 5, 5], Resampled.groups),
    ],
)
def test_what_is_resampled_depends_on_how_many_groups_there_are(group, expected) -> None:
    assert scheme(np.array(group)) == expected


def test_scenes_that_are_not_named_are_groups_of_their_own_and_one_group_is_none() -> None:
    groups = SceneGroups({("d", "a"): "x", ("d", "c"): "x", ("other", "b"): "x"})
    assert groups.of("d", ["a", "b", "c"]).tolist() == [0, 1, 0]
    assert groups.of("d", ["a", "c"]).tolist() == [0, 1]


def named(n_scenes: int, n_groups: int) -> tuple[list[str], SceneGroups]:
    scenes = [f"s{place:02d}" for place in range(n_scenes)]
    return scenes, SceneGroups({("d", scene): f"g{place % n_groups}" for place, scene in enumerate(scenes)})


@pytest.mark.parametrize(("n_groups", "resampled"), [(6, "groups"), (4, "within")])
def test_units_know_their_groups(n_groups: int, resampled: str) -> None:
    scenes, groups = named(12, n_groups)
    table = pl.DataFrame({"dataset": "d", "scene": scenes, "n": range(12)})
    units = units_of(table, points=[], columns=["n"], groups=groups)
    assert units.resampled == resampled
    n_units, n_scenes = units.contributing(np.arange(12) < 7)
    assert (n_units, n_scenes) == (6 if resampled == "groups" else 7, 7)
    joined = units.joined(units.sums)[:, 0, 0].tolist()
    assert joined == [place + place + 6 for place in range(6)] if resampled == "groups" else joined == list(range(12))


@pytest.mark.parametrize(("n_groups", "whole"), [(6, True), (4, False)])
def test_draws_keep_groups_together_or_stay_within_them(n_groups: int, whole: bool) -> None:
    scenes, groups = named(12, n_groups)
    table = pl.DataFrame({"dataset": "d", "scene": scenes, "n": 1})
    units = units_of(table, points=[], columns=["n"], groups=groups)
    weights = Draws(scenes, n_draws=50, dataset="d", groups=groups).weights(units)
    by_group = weights.reshape(50, -1, n_groups)
    assert (weights.sum(axis=1) == 12).all()
    if whole:
        assert (by_group[:, 0] == by_group[:, 1]).all()
    else:
        assert (by_group.sum(axis=1) == 3).all()
    assert weights.std() > 0.5


def simulated(n_scenes: int, n_groups: int, correlation: float) -> tuple[Units, np.ndarray, float]:
    """Sums n, u, uu of scenes whose log scale and mean are alike in groups; effects of groups, and what is own."""
    rng, group = np.random.default_rng(n_scenes), np.arange(n_scenes) % n_groups
    effect = np.sqrt(correlation) * rng.normal(size=(n_groups, RUNS))
    own = np.sqrt(1 - correlation)
    value = effect[group] + own * rng.normal(size=(n_scenes, RUNS))
    n = np.rint(TRACKS * np.exp(0.2 * rng.normal(size=value.shape)))
    second = np.exp(1.4 * value) * rng.chisquare(n) / n
    sums = n[..., None] * np.stack([np.ones_like(n), value, second], axis=-1)
    scenes = tuple(f"s{place:02d}" for place in range(n_scenes))
    points = pl.DataFrame({"run": range(RUNS)})
    return Units(sums, points, scenes, np.arange(n_scenes), scheme(group), group), effect, own


def statistics(sums: np.ndarray) -> np.ndarray:
    return sums[1:] / np.where(sums[0] > 0, sums[0], np.nan)


def log_second(sums: np.ndarray) -> np.ndarray:
    return np.log(statistics(sums)[1:])


@pytest.mark.parametrize("kind", ["student", "percentile"])
@pytest.mark.parametrize(("n_scenes", "n_groups"), [(8, 4), (28, 14)])
def test_intervals_of_grouped_scenes_hold_what_they_are_about(n_scenes: int, n_groups: int, kind: str) -> None:
    units, effect, own = simulated(n_scenes, n_groups, 0.9)
    within = units.resampled == Resampled.within
    mean = effect.mean(axis=0) if within else 0.0
    second = np.exp(1.4 * effect).mean(axis=0) * np.exp((1.4 * own) ** 2 / 2) if within else np.exp(0.98)
    groups = SceneGroups({("d", scene): str(place) for scene, place in zip(units.scenes, units.group, strict=True)})
    n_draws = 0 if kind == "student" else 400
    weights = Draws(units.scenes, n_draws=n_draws, dataset="d", groups=groups).weights(units)
    method = Method(kind)
    alike = averaged(units, weights, statistics, method, scales=["linear", "log"])
    held = {"mean": ((alike.low[0] <= mean) & (mean <= alike.high[0])).mean()}
    size = geometric(units, weights, log_second, method)
    true = np.exp(1.4 * np.asarray(mean))
    held["geometric"] = ((size.low[0] <= true) & (true <= size.high[0])).mean()
    if kind == "student":
        counted = pooled(units, weights, statistics, method, scales=["linear", "log"])
        held["mean, features"] = ((counted.low[0] <= mean) & (mean <= counted.high[0])).mean()
        held["second"] = ((alike.low[1] <= second) & (second <= alike.high[1])).mean()
        held["second, features"] = ((counted.low[1] <= second) & (second <= counted.high[1])).mean()
    for name, share in held.items():
        assert 0.92 < share < 0.985, (name, share)


def test_scenes_taken_for_independent_are_held_too_rarely() -> None:
    units, *_ = simulated(28, 14, 0.9)
    ignored = Units(units.sums, units.points, units.scenes, units.scene, Resampled.scenes)
    found = averaged(ignored, np.empty((0, 28)), statistics, Method())
    assert ((found.low[0] <= 0) & (found.high[0] >= 0)).mean() < 0.9
