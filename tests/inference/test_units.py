import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.condition_units import SUMS, additive, units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.units import BLOCKS


def scenes_of(*names: str) -> pl.DataFrame:
    """Two points in each scene, at which `n` is 1, 2, 3 ... in the order of the rows."""
    rows = [{"scene": name, "at": at} for name in names for at in (0, 5)]
    return pl.DataFrame(rows).with_columns(n=pl.int_range(1, pl.len() + 1))


def in_blocks(table: pl.DataFrame) -> pl.DataFrame:
    """The same, all of it in the third block."""
    return table.with_columns(block=pl.lit(2, dtype=pl.UInt8))


SIX, TWO = scenes_of(*"abcdef"), scenes_of("b", "a")


def test_six_scenes_are_units():
    units = units_of(SIX, in_blocks(SIX), points=["at"], columns=["n"])
    assert units.resampled == "scenes"
    assert units.scenes == tuple("abcdef")
    assert units.points["at"].to_list() == [0, 5]
    assert units.sums[..., 0].tolist() == [[1, 2], [3, 4], [5, 6], [7, 8], [9, 10], [11, 12]]


def test_of_fewer_scenes_blocks_are_units():
    units = units_of(TWO, in_blocks(TWO), points=["at"], columns=["n"])
    assert units.resampled == "blocks"
    assert units.sums.shape == (2 * BLOCKS, 2, 1)
    assert units.sums[2, :, 0].tolist() == [3, 4]  # of scene a, which comes first
    assert units.sums[BLOCKS + 2, :, 0].tolist() == [1, 2]
    assert units.sums.sum() == 10
    assert units.scene.tolist() == [0] * BLOCKS + [1] * BLOCKS


@pytest.mark.parametrize("blocks", [None, in_blocks(TWO).clear()])
def test_of_fewer_scenes_without_blocks_nothing_is_resampled(blocks):
    units = units_of(TWO, blocks, points=["at"], columns=["n"])
    assert units.resampled is None
    assert units.sums[..., 0].tolist() == [[3, 4], [1, 2]]


def test_rows_of_a_point_are_added_up_and_what_is_missing_is_0():
    table = pl.concat([SIX, SIX.head(1), pl.DataFrame({"scene": ["f"], "at": [9], "n": [7]})])
    units = units_of(table, points=["at"], columns=["n"])
    assert units.sums[..., 0].tolist()[0] == [2, 2, 0]
    assert units.sums[..., 0].tolist()[5] == [11, 12, 7]


def test_without_points_there_is_one():
    units = units_of(SIX, points=[], columns=["n"])
    assert units.sums[:, 0, 0].tolist() == [3, 7, 11, 15, 19, 23]


def test_who_takes_part():
    units = units_of(TWO, in_blocks(TWO), points=["at"], columns=["n"])
    present = np.zeros((3, len(units.scene)), dtype=np.bool_)
    present[1, [0, 4]] = True
    present[2, [0, BLOCKS, BLOCKS + 1]] = True
    n_units, n_scenes = units.contributing(present)
    assert n_units.tolist() == [0, 2, 3]
    assert n_scenes.tolist() == [0, 1, 2]


def test_a_scene_is_drawn_alike_in_every_condition_that_has_it():
    drawn = Draws([*"zyx", *"abcdef"], n_draws=30, seed=1)
    everywhere = drawn.weights(units_of(scenes_of(*"abcdefxyz"), points=["at"], columns=["n"]))
    some = drawn.weights(units_of(scenes_of(*"bcdxyz"), points=["at"], columns=["n"]))
    assert everywhere.shape == (30, 9)
    assert np.array_equal(some, everywhere[:, [1, 2, 3, 6, 7, 8]])
    assert (everywhere.sum(axis=1) == 9).all()


def test_blocks_are_drawn_within_their_scene_and_alike_in_every_condition():
    drawn = Draws(["a", "b", "c"], n_draws=30)
    both = drawn.weights(units_of(TWO, in_blocks(TWO), points=["at"], columns=["n"]))
    one = scenes_of("b")
    alone = drawn.weights(units_of(one, in_blocks(one), points=["at"], columns=["n"]))
    assert (both.reshape(30, 2, BLOCKS).sum(axis=2) == BLOCKS).all()
    assert np.array_equal(alone, both[:, BLOCKS:])


def test_sums_are_those_of_the_errors_that_moments_were_measured_on():
    u, v = np.random.default_rng(0).normal(1.0, 2.0, size=(2, 30))
    deviation_u, deviation_v = u - u.mean(), v - v.mean()
    values = {
        "n": 30,
        "mean_u": u.mean(),
        "mean_v": v.mean(),
        "m_uu": (deviation_u**2).sum(),
        "m_uv": (deviation_u * deviation_v).sum(),
        "m_vv": (deviation_v**2).sum(),
        "mean_abs_u": np.abs(u).mean(),
        "mean_abs_v": np.abs(v).mean(),
    }
    found = additive(pl.DataFrame([{"scene": "a", **values}]))
    assert found.columns == ["scene", *SUMS]
    expected = [30, u.sum(), v.sum(), u @ u, u @ v, v @ v, np.abs(u).sum(), np.abs(v).sum()]
    assert found.select(SUMS).row(0) == pytest.approx(expected)
