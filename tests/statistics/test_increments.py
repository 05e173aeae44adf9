import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.changes import increments
from tracknoise.statistics.definitions import LAGS
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.tables.schema import INCREMENTS, OBSERVATIONS, TRACKS, empty


def one_track(observations, tracks, errors: list[float], *, frames: list[int] | None = None, **columns) -> pl.DataFrame:
    """Increments of a single track whose error in v is minus that in u."""
    seen = list(range(len(errors))) if frames is None else frames
    negative = [-error for error in errors]
    table = observations(frame=seen, age=seen, du_px=errors, dv_px=negative, **columns)
    return increments(prepare_sequence(table, tracks(track=[0]))).filter(trimming="untrimmed")


def test_changes_by_age_and_products_by_lag_of_a_track_by_hand(observations, tracks) -> None:
    found = one_track(observations, tracks, [0.0, 1.0, 3.0, 2.0])  # changes 1, 2, -1
    by_age = found.filter(lag=0)
    assert by_age.select("age", "n", "mean_u", "mean_v", "m_uu").rows() == [
        (1, 1, 1.0, -1.0, 0.0),
        (2, 1, 2.0, -2.0, 0.0),
        (3, 1, -1.0, 1.0, 0.0),
    ]
    pairs = found.filter(pl.col("lag") > 0).select("lag", "age", "n", "lagged_uu", "lagged_vv", "squares_uu")
    assert pairs.rows() == [(1, None, 2, 2.0 - 2.0, 2.0 - 2.0, 2.5 + 2.5), (2, None, 1, -1.0, -1.0, 1.0)]


def test_there_is_no_change_across_a_gap(observations, tracks) -> None:
    found = one_track(observations, tracks, [0.0, 1.0, 5.0, 6.0], frames=[0, 1, 3, 4])
    assert found.filter(lag=0)["age"].to_list() == [1, 4]
    assert found.filter(pl.col("lag") > 0).is_empty()  # frames 1 and 4 are no whole number of seen steps apart


def test_an_unseen_truth_is_a_gap(observations, tracks) -> None:
    found = one_track(observations, tracks, [0.0, 1.0, 2.0, 3.0], truth=["valid", "valid", "occluded", "valid"])
    assert found.filter(lag=0)["age"].to_list() == [1]


def test_a_step_is_a_frame_that_the_tracker_saw(observations, tracks) -> None:
    table = observations(speed=4, frame=[0, 4, 8], age=[0, 4, 8], du_px=[0.0, 1.0, 1.5], dv_px=[0.0] * 3)
    found = increments(prepare_sequence(table, tracks(track=[0], speed=4))).filter(trimming="untrimmed")
    assert found.select("lag", "age", "n", "mean_u").rows() == [(0, 4, 1, 1.0), (0, 8, 1, 0.5), (1, None, 1, None)]


def test_products_are_pooled_by_block_changes_over_all_and_trimmed_tracks_left_out(observations, tracks) -> None:
    n = 32  # two tracks a block
    table = observations(
        track=np.repeat(range(n), 3).tolist(),
        age=[0, 1, 2] * n,
        frame=[0, 1, 2] * n,
        du_px=[value for track in range(n) for value in (0.0, float(track), 2.0 * track)],
        kept=[track % 2 == 0 for track in range(n) for _ in range(3)],
    )
    found = increments(prepare_sequence(table, tracks(track=list(range(n)))))
    pairs = found.filter(lag=1)
    for trimming, count, mean in (("untrimmed", 32, 15.5), ("trimmed", 16, 15.0)):
        by_age = found.filter(lag=0, trimming=trimming).select("block", "age", "n", "mean_u")
        assert by_age.rows() == [(None, 1, count, mean), (None, 2, count, mean)]
    every, kept = (pairs.filter(trimming=name).select("block", "n", "lagged_uu") for name in ("untrimmed", "trimmed"))
    assert every.rows() == [(block, 2, 4.0 * block**2 + (2.0 * block + 1) ** 2) for block in range(16)]
    assert kept.rows() == [(block, 1, 4.0 * block**2) for block in range(16)]


@pytest.mark.parametrize(("kind", "expected"), [("white", -0.5), ("walk", 0.0), ("drift", 1.0)])
def test_autocorrelation_tells_kinds_of_error_apart(observations, tracks, kind: str, expected: float) -> None:
    rng, n, ages = np.random.default_rng(2), 400, 12
    noise = rng.normal(size=(n, ages))
    drifts = rng.normal(size=(n, 1)) * np.arange(ages)
    errors = {"white": noise - noise[:, :1], "walk": noise.cumsum(axis=1), "drift": drifts}[kind]
    age = np.tile(range(ages), n).tolist()
    table = observations(track=np.repeat(range(n), ages).tolist(), age=age, frame=age, du_px=errors.ravel().tolist())
    found = increments(prepare_sequence(table, tracks(track=list(range(n))))).filter(lag=1, trimming="untrimmed")
    assert found["lagged_uu"].sum() / found["squares_uu"].sum() == pytest.approx(expected, abs=0.05)


def test_there_are_lags_up_to_the_largest_and_rows_may_come_in_any_order(observations, tracks) -> None:
    rng, n, ages = np.random.default_rng(3), 20, LAGS + 4
    age = np.tile(range(ages), n).tolist()
    table = observations(
        scene=["a"] * (n // 2 * ages) + ["b"] * (n // 2 * ages),
        track=np.repeat([*range(n // 2), *range(n // 2)], ages).tolist(),
        age=age,
        frame=age,
        du_px=rng.normal(size=n * ages).tolist(),
    )
    lives = tracks(scene=["a"] * (n // 2) + ["b"] * (n // 2), track=[*range(n // 2), *range(n // 2)])
    found = increments(prepare_sequence(table, lives))
    assert found["lag"].unique().sort().to_list() == list(range(LAGS + 1))
    assert found.equals(increments(prepare_sequence(table.sample(fraction=1.0, shuffle=True, seed=1), lives)))
    assert not found.select(list(INCREMENTS)[: list(INCREMENTS).index("n")]).is_duplicated().any()


def test_no_observations_give_no_rows_and_wrong_tables_are_refused(observations, tracks) -> None:
    assert increments(prepare_sequence(empty(OBSERVATIONS), empty(TRACKS))).equals(empty(INCREMENTS))
    with pytest.raises(SchemaError, match="observations: column 8"):
        increments(prepare_sequence(empty(OBSERVATIONS).drop("track"), empty(TRACKS)))
    with pytest.raises(SchemaError, match="not in the tracks table"):
        increments(prepare_sequence(observations(track=[3]), tracks(track=[0])))
