import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.truth_shares import anchored
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations


@pytest.fixture(scope="module")
def observations(see_errors) -> pl.DataFrame:
    return see_errors([np.random.default_rng(0).normal(size=(5, 4, 2))]).observations


def test_ages_count_from_birth_which_is_left_out(observations) -> None:
    found = anchored(scene_moments(prepare_observations(observations)), {})
    assert found["since"].unique().sort().to_list() == [1, 2, 3]
    assert found["population"].unique().to_list() == ["visible"]


def test_frames_count_from_the_key_frame_of_their_direction(observations) -> None:
    found = anchored(scene_moments(prepare_observations(observations, axis="frame")), {"forward": 2, "backward": 1})
    assert found["since"].unique().sort().to_list() == [-2, -1, 1]
