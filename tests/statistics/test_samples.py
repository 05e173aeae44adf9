from itertools import pairwise

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.statistics.samples import BANDS, first_tracks, samples
from tracknoise.tables.schema import OBSERVATIONS, SAMPLES, TRACKS, empty

AGES = 25


@pytest.fixture(scope="module")
def many(observations, tracks) -> tuple[pl.DataFrame, pl.DataFrame]:
    """300 tracks that are seen at 25 ages; the error is the track's number, and in v the age."""
    n = 300
    age = np.tile(range(AGES), n)
    track = np.repeat(range(n), AGES)
    table = observations(
        track=track.tolist(),
        age=age.tolist(),
        frame=(age + track % 7).tolist(),
        du_px=track.astype(float).tolist(),
        dv_px=age.astype(float).tolist(),
        kept=(track % 3 != 0).tolist(),
    )
    return table, tracks(track=list(range(n)))


def test_bands_follow_one_another() -> None:
    assert BANDS[0][0] == 1
    assert all(low == high + 1 for (_, high), (low, _) in pairwise(BANDS))


def test_a_track_is_at_most_once_in_a_band_and_never_at_birth(many) -> None:
    found = samples(prepare_sequence(*many))
    assert found.height == 300 * 4
    assert found["age_low"].unique().sort().to_list() == [1, 5, 10, 20]
    assert not found.select("age_low", "track").is_duplicated().any()
    assert found.select((pl.col("at") >= pl.col("age_low")) & (pl.col("at") <= pl.col("age_high"))).to_series().all()
    assert found["du_px"].to_list() == found["track"].to_list()
    assert found["dv_px"].to_list() == found["at"].to_list()


def test_every_age_of_a_band_is_chosen_about_as_often(many) -> None:
    counts = samples(prepare_sequence(*many)).filter(age_low=10).group_by("at").agg(pl.len()).sort("at")
    assert counts["at"].to_list() == list(range(10, 20))
    assert counts["len"].is_between(10, 50).all()  # 30 expected; beyond four standard errors (5.2) either way


def test_the_cap_takes_tracks_from_everywhere_and_a_smaller_cap_takes_some_of_them(many) -> None:
    hundred, fifty = (samples(prepare_sequence(*many), max_tracks=cap) for cap in (100, 50))
    assert hundred.group_by("age_low").agg(pl.len())["len"].to_list() == [100] * 4
    assert hundred.filter(age_low=1)["block"].n_unique() == 16
    assert fifty.equals(first_tracks(hundred, 50))


def test_the_choice_does_not_depend_on_trimming_nor_on_the_order_of_rows(many) -> None:
    table, tracks = many
    found = samples(prepare_sequence(table, tracks), max_tracks=100)
    assert found["kept"].to_list() == (found["track"] % 3 != 0).to_list()
    all_kept = samples(prepare_sequence(table.with_columns(kept=pl.lit(value=True)), tracks), max_tracks=100)
    assert found.drop("kept").equals(all_kept.drop("kept"))
    shuffled = table.sample(fraction=1.0, shuffle=True, seed=1)
    assert found.equals(samples(prepare_sequence(shuffled, tracks), max_tracks=100))


def test_with_a_key_frame_bands_are_of_the_distance_from_it_before_and_after(observations, tracks) -> None:
    table = observations(frame=[4, 9, 10, 11, 15], age=[0, 5, 6, 7, 11], track=[0, 1, 2, 3, 4])
    found = samples(prepare_sequence(table, tracks(track=list(range(5))), key_frame=10))
    assert found.select("age_low", "track", "at").rows() == [(1, 1, 9), (1, 3, 11), (5, 0, 4), (5, 4, 15)]


def test_only_visible_errors_count(observations, tracks) -> None:
    table = observations(track=[0, 1], age=1, truth=["occluded", "valid"])
    assert samples(prepare_sequence(table, tracks(track=[0, 1])))["track"].to_list() == [1]


def test_scenes_and_conditions_have_caps_of_their_own(observations, tracks) -> None:
    table = observations(scene=["a"] * 20 + ["b"] * 5, track=[*range(20), *range(5)], age=1)
    lives = tracks(scene=["a"] * 20 + ["b"] * 5, track=[*range(20), *range(5)])
    found = samples(prepare_sequence(table, lives), max_tracks=10)
    assert found.group_by("scene").agg(pl.len()).sort("scene").rows() == [("a", 10), ("b", 5)]


def test_no_observations_give_no_samples_and_wrong_tables_are_refused() -> None:
    assert samples(prepare_sequence(empty(OBSERVATIONS), empty(TRACKS))).equals(empty(SAMPLES))
    with pytest.raises(SchemaError, match="observations: column 8"):
        prepare_sequence(empty(OBSERVATIONS).drop("track"), empty(TRACKS))
