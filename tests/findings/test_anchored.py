import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.findings.anchored import anchored
from tracknoise.statistics.moments import scene_moments
from tracknoise.tables.schema import MOMENTS


@pytest.fixture(scope="module")
def observations(see_errors) -> pl.DataFrame:
    return see_errors([np.random.default_rng(0).normal(size=(5, 4, 2))]).observations


def test_ages_count_from_birth_which_is_left_out(observations) -> None:
    found = anchored(scene_moments(observations), MOMENTS, "moments", {})
    assert found["since"].unique().sort().to_list() == [1, 2, 3]
    assert found["population"].unique().to_list() == ["visible"]


def test_frames_count_from_the_key_frame_of_their_direction(observations) -> None:
    found = anchored(scene_moments(observations, axis="frame"), MOMENTS, "moments", {"forward": 2, "backward": 1})
    assert found["since"].unique().sort().to_list() == [-2, -1, 1]


def test_several_tables_are_stacked_and_wrong_ones_refused(observations) -> None:
    moments = scene_moments(observations)
    assert anchored([moments, moments], MOMENTS, "moments", {}).height == 2 * 3 * 2
    with pytest.raises(SchemaError, match="moments: column 0"):
        anchored(moments.drop("dataset"), MOMENTS, "moments", {})
