"""Blocks of errors seen in other ways: they add up to the scene, and each holds what its own tracks did."""

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.aspects import aspect_blocks, aspects
from tracknoise.statistics.changes import increments
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.tables.enumerations import Aspect
from tracknoise.tables.schema import ASPECT_BLOCKS, OBSERVATIONS, TRACKS, empty

N_TRACKS, AGES = 40, 8


@pytest.fixture
def scene(observations, tracks) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Tracks that move and err at random, two ages to eight long, one in five dropped, some occluded in between."""
    rng = np.random.default_rng(0)
    length = rng.integers(2, AGES + 1, N_TRACKS)
    track = np.repeat(np.arange(N_TRACKS), length)
    age = np.concatenate([np.arange(n) for n in length])
    place, error = (rng.normal(size=(len(track), 2)).cumsum(axis=0) for _ in range(2))
    hidden = (rng.random(len(track)) < 0.1) & (age > 0)
    seen = observations(
        track=track.tolist(), frame=(5 + age).tolist(), age=age.tolist(),
        truth=np.where(hidden, "occluded", "valid").tolist(), kept=(track % 5 > 0).tolist(),
        u_true_px=place[:, 0].tolist(), v_true_px=place[:, 1].tolist(),
        du_px=error[:, 0].tolist(), dv_px=error[:, 1].tolist(),
    )  # fmt: skip
    numbers = np.arange(N_TRACKS)
    angle = np.where(numbers % 3 > 0, numbers * 0.1, None).tolist()
    lived = tracks(
        track=numbers.tolist(), lifetime=length.tolist(), kept=(numbers % 5 > 0).tolist(), gradient_rad=angle
    )
    return seen, lived


def sums(table: pl.DataFrame, *extra: str) -> pl.DataFrame:
    """What adds up, over everything but aspect, trimming and place."""
    n, u, v = (pl.col(name) for name in ("n", "mean_u", "mean_v"))
    second = {"uu": pl.col("m_uu") + n * u**2, "uv": pl.col("m_uv") + n * u * v, "vv": pl.col("m_vv") + n * v**2}
    columns = {"n": n, "u": n * u, "v": n * v, **second, **{name: n * pl.col(name) for name in extra}}
    keys = ["aspect", "at_least", "trimming", "axis", "at"]
    return table.group_by(keys).agg(value.sum().alias(name) for name, value in columns.items()).sort(keys)


@pytest.mark.parametrize("axis", ["age", "frame"])
def test_blocks_pooled_are_the_aspects_of_the_scene(scene, axis: str) -> None:
    blocks = aspect_blocks(prepare_sequence(*scene, axis=axis)).filter(pl.col("aspect") != Aspect.change)
    whole = aspects(prepare_sequence(*scene, axis=axis))
    assert {Aspect.motion, Aspect.gradient, Aspect.long_lived} == set(blocks["aspect"])
    assert blocks["block"].n_unique() == 16
    found, expected = (sums(table, "mean_abs_u", "mean_abs_v") for table in (blocks, whole))
    assert found.select(pl.exclude(pl.Float64)).equals(expected.select(pl.exclude(pl.Float64)))
    numbers = pl.selectors.float()
    np.testing.assert_allclose(found.select(numbers), expected.select(numbers), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("axis", ["age", "frame"])
def test_blocks_of_changes_pooled_are_the_increments_by_age(scene, axis: str) -> None:
    whole = increments(prepare_sequence(*scene)).filter(lag=0).select(
        pl.lit(Aspect.change).alias("aspect"), pl.lit(None).alias("at_least"), "trimming",
        pl.lit("age").alias("axis"), pl.col("age").alias("at"), "n", "mean_u", "mean_v", "m_uu", "m_uv", "m_vv",
    )  # fmt: skip
    found, expected = sums(aspect_blocks(prepare_sequence(*scene, axis=axis)).filter(aspect=Aspect.change)), sums(whole)
    assert found["at"].to_list() == expected["at"].to_list()
    assert found["n"].to_list() == expected["n"].to_list()
    np.testing.assert_allclose(found.select("u", "v", "uu", "uv", "vv"), expected.select("u", "v", "uu", "uv", "vv"))


def test_a_block_holds_the_changes_of_its_own_tracks(observations, tracks) -> None:
    seen = observations(
        track=[0, 0, 15, 15], frame=[0, 1] * 2, age=[0, 1] * 2, du_px=[0.0, 3.0, 0.0, -1.0], dv_px=[0.0] * 4
    )
    found = aspect_blocks(prepare_sequence(seen, tracks(track=list(range(16))))).filter(
        aspect=Aspect.change, trimming="untrimmed"
    )
    assert found.select("block", "at", "n", "mean_u").rows() == [(0, 1, 1, 3.0), (15, 1, 1, -1.0)]


def test_tracks_that_are_not_there_are_refused_and_nothing_makes_nothing(observations, tracks) -> None:
    with pytest.raises(SchemaError, match="track number"):
        aspect_blocks(prepare_sequence(observations(track=[7], du_px=[0.0], dv_px=[0.0]), tracks(track=[0])))
    assert aspect_blocks(prepare_sequence(empty(OBSERVATIONS), empty(TRACKS))).equals(empty(ASPECT_BLOCKS))
