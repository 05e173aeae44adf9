import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.blocks import BLOCKS, with_blocks


def test_blocks_are_of_one_size_and_follow_births(tracks):
    table = tracks(track=list(range(40)))
    found = with_blocks(table, table)
    assert found.drop("block").equals(table)
    assert found["block"].to_list() == sorted(found["block"])
    assert set(found["block"].value_counts()["count"]) == {2, 3}
    assert found["block"].n_unique() == BLOCKS
    assert found.schema["block"] == pl.UInt8


def test_few_tracks_make_few_blocks(tracks):
    table = tracks(track=[0, 1, 2])
    assert with_blocks(table, table)["block"].n_unique() == 3


def test_each_sequence_and_condition_has_its_own_blocks(tracks, observations):
    few, many = tracks(track=list(range(4)), tracker="few"), tracks(track=list(range(400)), tracker="many")
    seen = pl.concat([observations(track=[3, 3, 0], tracker="few"), observations(track=[3, 399], tracker="many")])
    assert with_blocks(seen, pl.concat([many, few]))["block"].to_list() == [12, 12, 0, 0, 15]


@pytest.mark.parametrize("stray", [{"track": [4]}, {"track": [0], "tracker": "another"}])
def test_a_row_of_no_track_is_refused(tracks, observations, stray):
    with pytest.raises(SchemaError, match="a track number is not in the tracks table"):
        with_blocks(observations(**stray), tracks(track=[0, 1, 2, 3]))
