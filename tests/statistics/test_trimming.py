import math

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.trimming import RMS_PX, sizes
from hypothesis import given, settings
from hypothesis import strategies as st

from tracknoise.exceptions import SchemaError, SettingsError, UnknownNameError
from tracknoise.statistics.trimming import trim
from tracknoise.tables.findings_schema import TRIMS
from tracknoise.tables.schema import OBSERVATIONS, TRACKS, empty


def test_the_largest_error_is_the_l2_norm_over_the_observations_of_the_population(observations, tracks) -> None:
    table = observations(
        track=[0, 0, 0, 1],
        truth=["valid", "valid", "occluded", "no_depth"],
        du_px=[3.0, -1.0, 6.0, None],
        dv_px=[-4.0, 0.0, 8.0, None],
    )
    visible = trim(table, tracks(track=[0, 1]), percentile=None)
    projected = trim(table, tracks(track=[0, 1]), percentile=None, population="projected")
    assert visible.tracks["max_error_px"].to_list() == [5.0, None]
    assert projected.tracks["max_error_px"].to_list() == [10.0, None]


def test_tracks_above_the_percentile_are_dropped_with_all_their_observations(observations, tracks) -> None:
    errors = [float(value) for value in range(11)]  # the 90th percentile of 0..10 is 9: only 10 exceeds it
    table = observations(track=[*range(11), 10], du_px=[*errors, 0.0], frame=[0] * 11 + [1])
    result = trim(table, tracks(track=list(range(11))), percentile=90, among="all")
    assert result.tracks["kept"].to_list() == [True] * 10 + [False]
    assert result.observations["kept"].to_list() == [True] * 10 + [False, False]
    row = result.trims.row(0, named=True)
    assert {name: row[name] for name in ("percentile", "threshold_px")} == {"percentile": 90.0, "threshold_px": 9.0}
    assert (row["n_tracks"], row["n_measured"], row["n_dropped"], row["dropped_share"]) == (11, 11, 1, 1 / 11)


def test_each_scene_and_condition_has_its_own_threshold(observations, tracks) -> None:
    # The same track numbers everywhere: only the whole key tells the tracks apart.
    key = {"scene": ["a", "a", "b", "b", "a", "a"], "speed": [1, 1, 1, 1, 2, 2], "track": [0, 1] * 3}
    result = trim(
        observations(**key, du_px=[1.0, 2.0, 30.0, 20.0, 0.1, 0.2]), tracks(**key), percentile=50, among="all"
    )
    assert result.tracks["kept"].to_list() == [True, False, False, True, True, False]
    assert result.trims["threshold_px"].to_list() == pytest.approx([1.5, 0.15, 25.0])
    assert result.trims.select("scene", "speed").rows() == [("a", 1), ("a", 2), ("b", 1)]


def test_no_percentile_keeps_everything_and_still_measures(observations, tracks) -> None:
    result = trim(observations(du_px=[5.0], kept=[False]), tracks(track=[0], kept=[False]), percentile=None)
    assert result.tracks["kept"].to_list() == [True]
    assert result.observations["kept"].to_list() == [True]
    assert result.tracks["max_error_px"].to_list() == [5.0]
    row = result.trims.row(0, named=True)
    assert (row["percentile"], row["threshold_px"], row["n_dropped"], row["dropped_share"]) == (None, None, 0, 0.0)


def test_a_track_without_a_measured_error_is_kept_and_does_not_move_the_threshold(observations, tracks) -> None:
    table = observations(track=[0, 1, 2], truth=["valid", "valid", "edge"], du_px=[1.0, 3.0, None], dv_px=[0, 0, None])
    result = trim(table, tracks(track=[0, 1, 2, 3]), percentile=50, among="all")
    assert result.tracks["kept"].to_list() == [True, False, True, True]
    row = result.trims.row(0, named=True)
    assert (row["threshold_px"], row["n_tracks"], row["n_measured"], row["dropped_share"]) == (2.0, 4, 2, 0.5)


def test_a_condition_without_any_measured_track_has_no_threshold_and_no_share(tracks) -> None:
    row = trim(empty(OBSERVATIONS), tracks(track=[0, 1]), percentile=90).trims.row(0, named=True)
    assert (row["threshold_px"], row["n_measured"], row["n_dropped"], row["dropped_share"]) == (None, 0, 0, None)


def test_tracks_seen_once_lower_the_threshold_as_in_the_paper(observations, tracks) -> None:
    long_lived = [float(value) for value in range(1, 11)]
    alone = trim(
        observations(track=list(range(10)), du_px=long_lived), tracks(track=list(range(10))), percentile=90, among="all"
    )
    errors = [*long_lived, *[0.0] * 90]
    among = trim(
        observations(track=list(range(100)), du_px=errors), tracks(track=list(range(100))), percentile=90, among="all"
    )
    assert alone.trims["threshold_px"][0] == pytest.approx(9.1)
    assert among.trims["threshold_px"][0] == pytest.approx(0.1)


def test_the_percentile_may_be_of_the_tracks_that_were_followed(observations, tracks) -> None:
    """Ten tracks that go on with errors of 1 to 10 px, among ninety that were seen once."""
    track = [number for number in range(100) for _ in range(2 if number < 10 else 1)]
    age = [step for number in range(100) for step in range(2 if number < 10 else 1)]
    du_px = [float(number + 1) if step else 0.0 for number, step in zip(track, age, strict=True)]
    table, lived = observations(track=track, age=age, du_px=du_px), tracks(track=list(range(100)))
    every, followed = (trim(table, lived, percentile=80, among=among) for among in ("all", "followed"))
    counted = ("threshold_px", "n_measured", "n_anchor_only", "n_dropped", "n_followed_dropped", "dropped_share")
    assert every.trims.select("among", *counted).row(0) == ("all", 0.0, 100, 90, 10, 10, 0.1)
    row = followed.trims.select("among", *counted).row(0)
    assert row == ("followed", pytest.approx(8.2), 100, 90, 2, 2, 0.02)
    assert followed.tracks["kept"].to_list() == [True] * 8 + [False] * 2 + [True] * 90


def test_the_anchor_is_the_key_frame_where_there_is_one(observations, tracks) -> None:
    table = observations(
        track=[0, 0, 1, 2, 3], frame=[4, 5, 5, 6, 5], age=[0, 1, 0, 0, 3], truth=["valid"] * 4 + ["occluded"],
        du_px=[2.0, 0.0, 0.0, 4.0, 0.0],
    )  # fmt: skip
    result = trim(table, tracks(track=[0, 1, 2, 3]), percentile=50, among="followed", key_frame=5)
    row = result.trims.row(0, named=True)
    assert (row["n_measured"], row["n_anchor_only"], row["threshold_px"]) == (3, 1, 3.0)
    born = trim(table, tracks(track=[0, 1, 2, 3]), percentile=50, among="followed")
    assert (born.trims["n_anchor_only"][0], born.trims["threshold_px"][0]) == (2, 2.0)


def test_where_nothing_was_followed_nothing_is_dropped(observations, tracks) -> None:
    result = trim(observations(track=[0, 1], du_px=[0.0, 0.1]), tracks(track=[0, 1]), percentile=10, among="followed")
    row = result.trims.row(0, named=True)
    assert (row["threshold_px"], row["n_anchor_only"], row["n_dropped"], row["dropped_share"]) == (None, 2, 0, 0.0)


def test_an_unknown_choice_of_tracks_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="choice of tracks 'folowed' \\(did you mean 'followed'\\?\\)"):
        trim(empty(OBSERVATIONS), empty(TRACKS), percentile=90, among="folowed")


def test_rows_stay_in_the_order_given(observations, tracks) -> None:
    order = np.random.default_rng(0).permutation(200).tolist()
    table = observations(track=order, du_px=[float(value) for value in order])
    result = trim(table, tracks(track=order[::-1]), percentile=50, among="all")
    assert result.observations.drop("kept").equals(table.drop("kept"))
    assert result.tracks["track"].to_list() == order[::-1]
    assert result.observations["kept"].to_list() == [value < 100 for value in order]


@settings(max_examples=40)
@given(st.lists(st.floats(0, 1e3), min_size=1, max_size=40), st.floats(0, 100))
def test_what_is_dropped_exceeds_the_percentile_and_what_is_kept_does_not(observations, tracks, errors, q) -> None:
    numbers = list(range(len(errors)))
    result = trim(observations(track=numbers, du_px=errors), tracks(track=numbers), percentile=q, among="all")
    norms = np.sqrt(np.square(errors))
    expected = norms <= np.percentile(norms, q)
    assert result.tracks["kept"].to_list() == expected.tolist()
    assert result.trims["n_dropped"][0] == np.count_nonzero(~expected) <= math.ceil((100 - q) / 100 * len(errors))


def test_trimming_twice_is_trimming_once(observations, tracks) -> None:
    numbers = list(range(20))
    once = trim(observations(track=numbers, du_px=[float(n) for n in numbers]), tracks(track=numbers), percentile=80)
    twice = trim(once.observations, once.tracks, percentile=80)
    assert twice.observations.equals(once.observations)
    assert twice.tracks.equals(once.tracks)
    assert twice.trims.equals(once.trims)


def test_nothing_gives_nothing() -> None:
    result = trim(empty(OBSERVATIONS), empty(TRACKS), percentile=90)
    assert result.observations.equals(empty(OBSERVATIONS))
    assert result.tracks.equals(empty(TRACKS))
    assert result.trims.equals(empty(TRIMS))


@pytest.mark.parametrize("percentile", [-1, 100.5, math.nan])
def test_an_impossible_percentile_is_refused(percentile: float) -> None:
    with pytest.raises(SettingsError, match=f"trimming percentile is {percentile}, expected 0 to 100"):
        trim(empty(OBSERVATIONS), empty(TRACKS), percentile=percentile)


def test_an_unknown_population_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="population 'all'"):
        trim(empty(OBSERVATIONS), empty(TRACKS), percentile=90, population="all")


@pytest.mark.parametrize("numbers", [[1], [0, 0]])
def test_an_observation_must_belong_to_exactly_one_track(observations, tracks, numbers: list[int]) -> None:
    with pytest.raises(SchemaError, match="not in the tracks table, or several times"):
        trim(observations(track=[0]), tracks(track=numbers), percentile=90)


def test_the_inputs_stay_as_they_were(observations, tracks) -> None:
    seen, lived = observations(track=[0, 1], du_px=[1.0, 9.0]), tracks(track=[0, 1])
    before: tuple[pl.DataFrame, pl.DataFrame] = seen.clone(), lived.clone()
    trim(seen, lived, percentile=50)
    assert (seen.equals(before[0]), lived.equals(before[1])) == (True, True)


def test_trimmed_errors_depend_on_the_loss_of_tracks_and_the_core_does_not() -> None:
    few, many = (sizes(loss, frames, n_tracks=6000, seed=3) for loss, frames in ((0.02, 120), (0.25, 20)))
    assert many["trimmed: all"] < 0.85 * few["trimmed: all"]
    assert many["core"] == pytest.approx(few["core"], rel=0.1)
    assert few["untrimmed"] == pytest.approx(RMS_PX, rel=0.05)
