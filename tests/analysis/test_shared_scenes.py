"""Trackers that were measured apart are ranked by what single scenes measured."""

import numpy as np
import pytest

from tracknoise.analysis.shared_scenes import LAST_AGE, SHOWN_AGE, SceneNumbers, ranks, typical
from tracknoise.inference.survival import restricted_mean

N = 8
GROUP = np.arange(N)
ROLES = ("core", "second", "lifetime", "outlier_ratio")


def scene(core=0.1, *, ended=(0, 40, 60), censored=(0, 0, 0), outliers=20, ages=LAST_AGE):
    sizes = [core * (1 + 0.1 * age) if age < ages else None for age in range(LAST_AGE)]
    squares = [None if size is None else size**2 for size in sizes]
    return SceneNumbers(tuple(sizes), tuple(squares), ended, censored, 1000, outliers)


def scenes(core, seed, **other):
    spread = np.exp(0.03 * np.random.default_rng(seed).standard_normal(N))
    return {f"scene-{number}": scene(core * factor, **other) for number, factor in enumerate(spread)}


def test_trackers_that_differ_are_ranked_and_others_share_a_rank():
    trackers = {"a": scenes(0.1, 1), "b": scenes(0.1, 2), "worse": scenes(0.2, 3)}
    found = ranks(trackers, GROUP, margin=0.1, level=0.95)
    for role in ("core", "second"):
        assert [found[name, role] for name in trackers] == [(1, 2), (1, 2), (3, 3)]
    for role in ("lifetime", "outlier_ratio"):
        assert {found[name, role] for name in trackers} == {(1, 3)}


def test_longer_tracks_and_fewer_outliers_rank_first():
    trackers = {
        "short": scenes(0.1, 1, ended=(50, 50, 0), outliers=50),
        "long": scenes(0.1, 2, ended=(0, 0, 100), outliers=20),
    }
    found = ranks(trackers, GROUP, margin=0.1, level=0.95)
    for role in ("lifetime", "outlier_ratio"):
        assert (found["long", role], found["short", role]) == ((1, 1), (2, 2))


def test_errors_are_compared_at_the_ages_that_both_have():
    """Errors grow with age: a tracker that is known at small ages alone would look better."""
    trackers = {"short": scenes(0.1, 1, ages=3), "long": scenes(0.1, 2)}
    found = ranks(trackers, GROUP, margin=0.1, level=0.95)
    assert found["short", "core"] == found["long", "core"] == (1, 2)


def test_a_typical_scene_is_a_geometric_mean_with_an_interval():
    found = typical({f"s{k}": scene(core) for k, core in enumerate([0.1, 0.2, 0.4, 0.1, 0.2, 0.4])}, np.arange(6), 0.95)
    at_age = 1 + 0.1 * (SHOWN_AGE - 1)
    assert found["core"].value == pytest.approx(0.2 * at_age)
    half = 2.5705818 * np.std(np.log([1, 2, 4, 1, 2, 4]), ddof=1) / np.sqrt(6)
    assert found["core"].high / found["core"].value == pytest.approx(np.exp(half))
    assert found["second"].value == pytest.approx(found["core"].value)
    assert found["lifetime"].value == pytest.approx(float(restricted_mean([0, 40, 60], [0, 0, 0], 3.0)))
    assert found["outlier_ratio"].value == pytest.approx(20.5 / 1001)


def test_few_scenes_have_no_interval_and_no_ranks():
    trackers = {name: {"only": scene()} for name in ("a", "b")}
    found = typical(trackers["a"], np.arange(1), 0.95)
    assert found["core"].value > 0
    assert np.isnan(found["core"].low)
    assert ranks(trackers, np.arange(1), margin=0.1, level=0.95) == {}


def test_what_is_unknown_is_left_out():
    empty = SceneNumbers((None,) * LAST_AGE, (None,) * LAST_AGE, (), (), None, None)
    assert typical({"one": empty}, np.arange(1), 0.95) == {}
