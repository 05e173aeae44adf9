import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.inference.units import BLOCKS
from tracknoise.statistics.prepared import blocks_of, prepare_sequence


def of_one_condition(table: pl.DataFrame) -> pl.Series:
    return blocks_of(table, pl.Series([0] * table.height))


def test_blocks_are_of_one_size_and_follow_births(tracks):
    found = of_one_condition(tracks(track=list(range(40))))
    assert found.to_list() == sorted(found)
    assert set(found.value_counts()["count"]) == {2, 3}
    assert found.n_unique() == BLOCKS
    assert found.dtype == pl.UInt8


def test_few_tracks_make_few_blocks(tracks):
    assert of_one_condition(tracks(track=[0, 1, 2])).n_unique() == 3


def test_each_sequence_and_condition_has_its_own_blocks(tracks, observations):
    few, many = tracks(track=list(range(4)), tracker="few"), tracks(track=list(range(400)), tracker="many")
    seen = pl.concat([observations(track=[3, 3, 0], tracker="few"), observations(track=[3, 399], tracker="many")])
    assert prepare_sequence(seen, pl.concat([many, few])).block.tolist() == [12, 12, 0, 0, 15]


@pytest.mark.parametrize("stray", [{"track": [4]}, {"track": [0], "tracker": "another"}])
def test_a_row_of_no_track_is_refused(tracks, observations, stray):
    with pytest.raises(SchemaError, match="a track number is not in the tracks table"):
        prepare_sequence(observations(**stray), tracks(track=[0, 1, 2, 3]))
