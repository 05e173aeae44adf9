"""Ranks of trackers, from scenes in which their errors have known sizes."""

from collections.abc import Mapping

import numpy as np
import polars as pl
import pytest
from tests.analysis.test_dependence import asked, moments, scales

from tracknoise.analysis.factors import RANKS, ranking


def played(sizes: Mapping[str, float], *, scenes: int = 12, own: float = 0.02, seed: int = 0) -> pl.DataFrame:
    """Scenes that all trackers have in common, at one speed; `own`: what a scene has of its own with each tracker."""
    by_speed = moments(dict(enumerate(sizes.values(), start=1)), scenes=scenes, own=own, seed=seed)
    names = dict(enumerate(sizes, start=1))
    named = by_speed.with_columns(tracker=pl.col("speed").replace_strict(names, return_dtype=pl.String))
    return named.with_columns(speed=pl.lit(1, dtype=pl.Int32)).select(by_speed.columns)


def ranks(sizes: Mapping[str, float], *, statistic: str = "core", **options: float) -> dict[str, tuple[int, int]]:
    found = ranking(asked(played(sizes, **options), pairs=True)).filter(statistic=statistic)
    return {row["tracker"]: (row["best"], row["worst"]) for row in found.to_dicts()}


@pytest.mark.parametrize("statistic", ["core", "Phi"])
def test_trackers_of_other_sizes_have_one_rank_each_and_the_best_comes_first(statistic: str) -> None:
    found = ranks({"large": 3.0, "small": 1.0, "middle": 1.7}, statistic=statistic)
    assert list(found.items()) == [("small", (1, 1)), ("middle", (2, 2)), ("large", (3, 3))]


def test_trackers_that_are_alike_share_ranks() -> None:
    found = ranks({"a": 1.0, "b": 1.03, "c": 2.0, "d": 2.0, "e": 4.0})
    assert found == {"a": (1, 2), "b": (1, 2), "c": (3, 4), "d": (3, 4), "e": (5, 5)}


def test_of_many_trackers_those_that_differ_are_told_apart() -> None:
    """A correction over all pairs together, and not over those of one statistic, would show none of these."""
    sizes = {**{f"small {n}": 1.0 for n in range(5)}, **{f"large {n}": 1.5 for n in range(5)}}
    found = ranks(sizes, own=0.12, scenes=8)
    assert {found[f"small {n}"] for n in range(5)} == {(1, 5)}
    assert {found[f"large {n}"] for n in range(5)} == {(6, 10)}


def test_trackers_that_share_no_scenes_are_not_shown_to_differ() -> None:
    every = played({"a": 1.0, "b": 2.0, "c": 4.0, "d": 8.0}, scenes=16)
    early = pl.col("scene") < "s08"
    apart = every.filter(~((pl.col("tracker") == "a") & early), ~((pl.col("tracker") == "b") & ~early))
    found = ranking(asked(apart, pairs=True)).filter(statistic="core")
    spans = {row["tracker"]: (row["best"], row["worst"]) for row in found.to_dicts()}
    assert spans == {"a": (1, 2), "b": (1, 2), "c": (3, 3), "d": (4, 4)}
    assert found["n_trackers"].unique().to_list() == [4]


def test_where_scenes_scatter_too_much_all_ranks_are_possible() -> None:
    assert set(ranks({"a": 1.0, "b": 1.1, "c": 1.2}, own=0.3, scenes=7).values()) == {(1, 3)}


@pytest.mark.parametrize("sizes", [{"a": 1.0, "b": 3.0}, {"a": 1.0}])
def test_two_trackers_are_not_ranked(sizes: Mapping[str, float]) -> None:
    found = ranking(asked(played(sizes), pairs=True))
    assert found.is_empty()
    assert found.schema == pl.Schema(RANKS)


def test_few_scenes_rank_nothing() -> None:
    assert set(ranks({"a": 1.0, "b": 3.0, "c": 9.0}, scenes=3).values()) <= {(1, 3)}


def test_trackers_that_are_alike_are_rarely_said_to_differ() -> None:
    """Of 20 tournaments of five equal trackers, at most one may rank any of them."""
    alike = dict.fromkeys("abcde", 1.0)
    wrong = sum(set(ranks(alike, own=0.2, scenes=8, seed=seed).values()) != {(1, 5)} for seed in range(20))
    assert wrong <= 1


def test_the_lowest_speed_is_ranked() -> None:
    first = played({"a": 1.0, "b": 2.0, "c": 4.0})
    later = played({"a": 4.0, "b": 2.0, "c": 1.0}).with_columns(speed=pl.lit(2, dtype=pl.Int32))
    found = ranking(asked(pl.concat([first, later]), pairs=True))
    assert found["speed"].unique().to_list() == [1]
    assert found.filter(statistic="core")["tracker"].to_list() == ["a", "b", "c"]
    assert np.all(found["best"].to_numpy() <= found["worst"].to_numpy())


def test_trackers_about_which_references_of_the_two_kinds_disagree_share_ranks() -> None:
    every = played({"a": 1.0, "b": 1.6, "c": 4.0})
    followed, matched = played({"a": 1.0, "b": 2.2, "c": 4.0}), played({"a": 1.3, "b": 1.1, "c": 4.0})
    by_kind = {
        name: {"moments": table, "scales": scales(table)} for name, table in (("one", followed), ("two", matched))
    }
    found = ranking(asked(every, pairs=True, by_kind=by_kind)).filter(statistic="core")
    assert found.select("tracker", "best", "worst").rows() == [("a", 1, 2), ("b", 1, 2), ("c", 3, 3)]
    about = "references of the two kinds disagree about"
    assert found["why"].to_list() == [f"{about} a and b", f"{about} b and a", None]
