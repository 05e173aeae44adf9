from collections.abc import Iterator

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import CensoredData, ecdf

from tracknoise.exceptions import SchemaError
from tracknoise.inference.survival import follow_up, restricted_mean
from tracknoise.statistics.lifetimes import (
    COUNTS,
    MEAN_LIFETIMES,
    MEDIAN_SURVIVALS,
    SURVIVING,
    count_ends,
    lifetimes,
    lifetimes_of_ends,
    mean_lifetime,
    median_survival,
    surviving,
)
from tracknoise.tables.findings_schema import LIFETIMES
from tracknoise.tables.schema import CAUSES, ENDS, TRACKS, TrackEnd, empty

LIVES = st.lists(st.tuples(st.integers(1, 8), st.booleans()), min_size=1, max_size=40)


@pytest.fixture(scope="session")
def lived(tracks):
    def build(lives: list[tuple[int, bool]], **columns: object) -> pl.DataFrame:
        """A tracks table from (lifetime, censored) pairs."""
        ends = ["sequence_end" if censored else "lost" for _, censored in lives]
        return tracks(track=list(range(len(lives))), lifetime=[length for length, _ in lives], end=ends, **columns)

    return build


def test_by_hand(lived) -> None:
    # Ended at 1, 2, 2, 4; censored at 2, 3.
    #   lifetime 1: all 6 at risk, 1 ends                    S = 5/6
    #   lifetime 2: 5 reached it, 1 censored there: 4, 2 end S = 5/6 * 2/4 = 5/12
    #   lifetime 3: 2 reached it, 1 censored there: 1, 0 end S = 5/12
    #   lifetime 4: 1 at risk, 1 ends                        S = 0
    table = lifetimes(lived([(1, False), (2, False), (2, False), (4, False), (2, True), (3, True)]))
    assert table["lifetime"].to_list() == [1, 2, 3, 4]
    assert table["n_ended"].to_list() == [1, 2, 0, 1]
    assert table["n_censored"].to_list() == [0, 1, 1, 0]
    assert table["at_risk"].to_list() == [6, 4, 1, 1]
    assert table["survival"].to_list() == pytest.approx([5 / 6, 5 / 12, 5 / 12, 0.0])
    assert table["n_scenes"].to_list() == [1] * 4


@settings(max_examples=50)
@given(LIVES)
def test_survival_is_that_of_scipy(lived, lives: list[tuple[int, bool]]) -> None:
    # An end at L is an event at L. A censored track was not searched for after its last frame: it is censored at L - 1.
    table = lifetimes(lived(lives)).filter(pl.col("survival").is_not_null())
    ended = [float(length) for length, censored in lives if not censored]
    censored = [length - 1.0 for length, censored in lives if censored]
    expected = ecdf(CensoredData(uncensored=ended, right=censored)).sf
    np.testing.assert_allclose(table["survival"], expected.evaluate(table["lifetime"].to_numpy()), atol=1e-12)


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(1, 8), st.sampled_from([end.name for end in TrackEnd])), min_size=1, max_size=40))
def test_survival_until_failure_is_that_of_scipy(tracks, lives: list[tuple[int, str]]) -> None:
    # Displaced and masked tracks were searched for once more and did not fail: they are censored at L.
    lengths, ends = zip(*lives, strict=True)
    table = lifetimes(tracks(track=list(range(len(lives))), lifetime=list(lengths), end=list(ends)))
    table = table.filter(pl.col("survival_until_failure").is_not_null())
    failed = [float(length) for length, end in lives if end in ("lost", "outlier")]
    censored = [float(length - (end == "sequence_end")) for length, end in lives if end not in ("lost", "outlier")]
    expected = ecdf(CensoredData(uncensored=failed, right=censored)).sf.evaluate(table["lifetime"].to_numpy())
    np.testing.assert_allclose(table["survival_until_failure"], expected, atol=1e-12)


@settings(max_examples=30)
@given(st.lists(st.integers(1, 9), min_size=1, max_size=50))
def test_without_censoring_everything_is_the_plain_sample(lived, lengths: list[int]) -> None:
    table = lifetimes(lived([(length, False) for length in lengths]))
    for length, survival in table.select("lifetime", "survival").rows():
        assert survival == pytest.approx(np.mean(np.array(lengths) > length))
    means = mean_lifetime(table).row(0, named=True)
    assert means["mean_lifetime"] == pytest.approx(np.mean(lengths))
    assert means["restricted_mean_lifetime"] == pytest.approx(np.mean(lengths))
    median = median_survival(table)["median_lifetime"].item()
    assert median == np.sort(lengths)[(len(lengths) - 1) // 2]


def test_a_constant_hazard_comes_back_although_most_tracks_are_censored(lived) -> None:
    # Features are born in each of 6 frames and found again with probability 0.7, so that many are alive at the end.
    rng = np.random.default_rng(8)
    life = rng.geometric(0.3, 60_000)
    most = 6 - rng.integers(0, 6, len(life))
    pairs = [(int(min(a, b)), bool(a >= b)) for a, b in zip(life, most, strict=True)]
    table = lifetimes(lived(pairs)).filter(pl.col("at_risk") > 0)
    expected = 0.7 ** table["lifetime"].to_numpy()
    assert table["n_censored"].sum() > len(life) / 3
    np.testing.assert_allclose(table["survival"], expected, atol=4 * 0.5 / np.sqrt(5000))


def test_where_nobody_was_at_risk_survival_is_unknown(lived) -> None:
    table = lifetimes(lived([(2, False), (5, True), (5, True)]))
    assert table["at_risk"].to_list() == [3, 0]
    assert table["survival"].to_list() == [pytest.approx(2 / 3), None]


def test_scenes_are_pooled_and_conditions_are_not(lived) -> None:
    one = lived([(1, False), (3, True)], scene="a")
    two = lived([(1, False)], scene="b")
    other = lived([(7, False)], scene="a", speed=2)
    table = lifetimes([one, two, other])
    assert table.select("speed", "lifetime", "n_ended", "n_scenes").rows() == [(1, 1, 2, 2), (1, 3, 0, 2), (2, 7, 1, 1)]
    assert lifetimes(pl.concat([other, two, one])).equals(table)


def test_the_same_scene_name_in_two_datasets_is_two_scenes(lived) -> None:
    table = lifetimes([lived([(1, False)], dataset="x"), lived([(1, False)], dataset="y")])
    assert table.select("dataset", "n_scenes").rows() == [("x", 1), ("y", 1)]


def test_tables_may_be_streamed(lived) -> None:
    def read() -> Iterator[pl.DataFrame]:
        for scene in "ab":
            yield lived([(2, False)], scene=scene)

    assert lifetimes(read()).select("n_ended", "n_scenes").rows() == [(2, 2)]


def test_ends_are_counted_by_block_lifetime_and_kind(lived) -> None:
    # Of 32 tracks two make a block: 0 and 1 the first, 30 and 31 the last.
    lives = [(3, False), (3, True), *[(1, False)] * 28, (5, False), (7, True)]
    table = count_ends(lived(lives))
    columns = ["block", "lifetime", "n_ended", "n_censored"]
    assert table.select(columns).rows()[:2] == [(0, 3, 1, 1), (1, 1, 2, 0)]
    assert table.select(columns).rows()[-2:] == [(15, 5, 1, 0), (15, 7, 0, 1)]
    assert table.select(pl.col("n_ended", "n_censored").sum()).row(0) == (30, 2)


def test_ends_are_counted_by_cause(tracks) -> None:
    ends = ["lost", "outlier", "outlier", "displaced", "masked", "sequence_end"]
    table = count_ends(tracks(track=list(range(6)), lifetime=[2] * 6, end=ends))
    totals = table.select(pl.col(COUNTS).sum()).row(0, named=True)
    assert totals == {"n_ended": 5, "n_censored": 1, "n_lost": 1, "n_outlier": 2, "n_displaced": 1, "n_masked": 1}
    assert list(totals)[2:] == [f"n_{cause}" for cause in CAUSES]


def test_scenes_limit_the_horizon_of_restricted_means(tracks) -> None:
    def scene(name: str, lives: dict[str, int], speed: int = 1) -> pl.DataFrame:
        columns = {"lifetime": list(lives.values()), "end": list(lives), "scene": name, "speed": speed}
        return tracks(track=list(range(len(lives))), **columns)

    censored = scene("a", {"lost": 3, "sequence_end": 9})
    masked = scene("b", {"lost": 3, "masked": 6})  # searched for once more: known to have lived until 7 without failure
    failed = scene("c", {"lost": 2, "outlier": 4})  # both curves reach 0
    other = scene("a", {"outlier": 5}, speed=2)
    found = {
        "a": ([censored], 9),
        "ab": ([censored, masked], 7),
        "ac": ([censored, failed], 9),
        "c": ([failed], None),
    }
    for scenes, (parts, followed) in found.items():
        table = lifetimes(parts)
        assert table["followed_to"].unique().to_list() == [followed], scenes
        assert lifetimes([pl.concat([part.head(1) for part in parts]), *(part.tail(1) for part in parts)]).equals(table)
    every = mean_lifetime(lifetimes([censored, masked, failed, other]))
    assert every.select("speed", "restricted_to").rows() == [(1, 7), (2, 5)]


def test_a_lifetime_until_failure_by_hand(tracks) -> None:
    # At risk at 1, 2, 4: 4, 3, 1. One is lost at 1, one masked at 2, one an outlier at 4; one is censored at 4.
    table = lifetimes(
        tracks(track=[0, 1, 2, 3], lifetime=[1, 2, 4, 4], end=["lost", "masked", "outlier", "sequence_end"])
    )
    assert table["survival_until_failure"].to_list() == pytest.approx([3 / 4, 3 / 4, 0])
    assert table["survival"].to_list() == pytest.approx([3 / 4, 1 / 2, 0])
    row = mean_lifetime(table).row(0, named=True)
    assert row["restricted_mean_until_failure"] == pytest.approx(1 + 3 * 3 / 4)
    assert row["restricted_mean_lifetime"] == pytest.approx(1 + 3 / 4 + 2 / 2)
    medians = median_survival(table).row(0, named=True)
    assert (medians["median_lifetime"], medians["median_until_failure"]) == (2, 4)


def test_what_pooling_needs_is_in_the_counts_alone(lived) -> None:
    rng = np.random.default_rng(18)
    lives = [(int(length), bool(end)) for length, end in zip(rng.geometric(0.2, 90), rng.random(90) < 0.2, strict=True)]
    parts = [lived(lives[:50], scene="a"), lived(lives[50:70], scene="b"), lived(lives[70:], scene="b", speed=2)]
    expected = lifetimes(pl.concat(parts))
    assert lifetimes_of_ends(count_ends(part) for part in parts).equals(expected)
    assert lifetimes_of_ends(pl.concat([count_ends(part) for part in reversed(parts)])).equals(expected)
    assert lifetimes_of_ends(count_ends(pl.concat(parts))).equals(expected)


def test_mean_lifetime_by_hand(lived) -> None:
    # As in test_by_hand: 14 frames over 6 tracks. Area under S up to 4: 1 + 5/6 + 5/12 + 5/12.
    table = lifetimes(lived([(1, False), (2, False), (2, False), (4, False), (2, True), (3, True)]))
    row = mean_lifetime(table).row(0, named=True)
    assert (row["n_tracks"], row["n_censored"], row["restricted_to"]) == (6, 2, 4)
    assert row["mean_lifetime"] == pytest.approx(14 / 6)
    assert row["frames_per_end"] == pytest.approx((14 - 2) / 4)
    assert row["restricted_mean_lifetime"] == pytest.approx(1 + 5 / 6 + 5 / 12 + 5 / 12)


def test_frames_per_end_does_not_depend_on_where_sequences_end(lived) -> None:
    # One track in ten ends in each step; after two steps the data end, or after nine.
    ending = [round(1000 * 0.9**step) - round(1000 * 0.9 ** (step + 1)) for step in range(9)]
    for steps in (2, 9):
        ended = [(step + 1, False) for step in range(steps) for _ in range(ending[step])]
        alive = [(steps + 1, True)] * (1000 - len(ended))
        row = mean_lifetime(lifetimes(lived([*ended, *alive]))).row(0, named=True)
        assert row["frames_per_end"] == pytest.approx(10, rel=0.01)


def test_frames_per_end_is_missing_where_no_track_ended(lived) -> None:
    assert mean_lifetime(lifetimes(lived([(3, True)])))["frames_per_end"].to_list() == [None]


def test_gaps_between_lifetimes_count_with_their_width(lived) -> None:
    # S is 1 up to 3, 1/2 up to 10, where the last track is censored: 3 + 7/2.
    row = mean_lifetime(lifetimes(lived([(3, False), (10, True)]))).row(0, named=True)
    assert row["restricted_mean_lifetime"] == pytest.approx(6.5)
    assert row["restricted_to"] == 10


def test_the_restricted_mean_by_hand() -> None:
    # As in test_by_hand: S is 1, 5/6, 5/12, 5/12, and 0 from lifetime 4.
    ended, censored = [1, 2, 0, 1], [0, 1, 1, 0]
    expected = [1, 1 + 5 / 6, 1 + 5 / 6 + 5 / 12, 1 + 5 / 6 + 5 / 6, 1 + 5 / 6 + 5 / 6]
    assert restricted_mean(ended, censored, [1, 2, 3, 4, 9]).tolist() == pytest.approx(expected)
    assert restricted_mean(ended, censored, 2.5) == pytest.approx(1 + 5 / 6 + 5 / 24)
    assert follow_up(ended, censored) == np.inf


def test_a_restricted_mean_beyond_the_follow_up_is_unknown() -> None:
    ended, censored = [[0, 1, 0, 0], [0, 2, 0, 0], [0, 0, 0, 0]], [[0, 0, 1, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    assert follow_up(ended, censored).tolist() == pytest.approx([3, np.inf, np.nan], nan_ok=True)
    assert restricted_mean(ended, censored, 3).tolist() == pytest.approx([2.5, 2, np.nan], nan_ok=True)
    assert restricted_mean(ended, censored, 4).tolist() == pytest.approx([np.nan, 2, np.nan], nan_ok=True)


@settings(max_examples=50)
@given(LIVES)
def test_a_restricted_mean_is_the_same_from_few_lifetimes(lived, lives: list[tuple[int, bool]]) -> None:
    table = lifetimes(lived(lives))
    expected = mean_lifetime(table).row(0, named=True)
    ended, censored, lengths = (table[name].to_numpy() for name in ("n_ended", "n_censored", "lifetime"))
    most = expected["restricted_to"]
    found = restricted_mean(ended[None], censored[None], most, lifetimes=lengths)
    assert found.tolist() == pytest.approx([expected["restricted_mean_lifetime"]])
    dense = np.zeros((2, most))
    dense[:, lengths - 1] = ended, censored
    np.testing.assert_allclose(restricted_mean(*dense, [most, 1]), [*found, 1.0])
    assert follow_up(*dense) == follow_up(ended, censored, lifetimes=lengths)


def test_a_mixture_of_hazards_has_one_restricted_mean_in_sequences_of_any_length() -> None:
    # Half of the tracks have a hazard of 0.3, half of 0.02. Frames per end depend on the length of sequences.
    rng = np.random.default_rng(13)
    life = rng.geometric(np.where(rng.random(200_000) < 0.5, 0.3, 0.02))
    expected = np.mean(np.minimum(life, 15))
    for length in (120, 60, 30, 15):
        counts = [
            np.bincount(np.minimum(life, length)[part], minlength=length + 1)[1:]
            for part in (life < length, life >= length)
        ]
        assert restricted_mean(*counts, 15) == pytest.approx(expected, rel=1e-12)


def test_conditions_do_not_leak_into_one_another(lived) -> None:
    slow, fast = lived([(2, False), (5, True)]), lived([(3, False), (4, False)], speed=2)
    both = lifetimes([slow, fast])
    for part in (slow, fast):
        speed = part["speed"][0]
        for function in (mean_lifetime, median_survival, surviving):
            assert function(both).filter(speed=speed).equals(function(lifetimes(part)))


def test_median_survival(lived) -> None:
    # S: 3/4, 1/2, 1/4, 0: at most half exceed 2.
    four = lifetimes(lived([(length, False) for length in (1, 2, 3, 4)]))
    assert median_survival(four)["median_lifetime"].to_list() == [2]


@pytest.mark.parametrize("count", [6, 10, 22, 94])
def test_a_survival_of_exactly_a_half_is_not_lost_to_rounding(lived, count: int) -> None:
    table = lifetimes(lived([(length, False) for length in range(1, count + 1)]))
    assert median_survival(table)["median_lifetime"].to_list() == [count // 2]


def test_a_curve_that_stays_above_a_half_has_no_median(lived) -> None:
    assert median_survival(lifetimes(lived([(1, False), (9, True), (9, True)])))["median_lifetime"].to_list() == [None]


def test_surviving_counts_tracks_by_age_without_gaps(lived) -> None:
    table = surviving(lifetimes(lived([(1, False), (1, True), (4, False)], speed=3)))
    assert table.select("lifetime", "age", "n").rows() == [(1, 0, 3), (2, 3, 1), (3, 6, 1), (4, 9, 1)]


def test_no_tracks_give_empty_tables() -> None:
    table = lifetimes(empty(TRACKS))
    assert table.equals(empty(LIFETIMES))
    assert lifetimes([]).equals(table)
    assert count_ends(empty(TRACKS)).equals(empty(ENDS))
    assert lifetimes_of_ends([]).equals(table)
    assert mean_lifetime(table).equals(empty(MEAN_LIFETIMES))
    assert median_survival(table).equals(empty(MEDIAN_SURVIVALS))
    assert surviving(table).equals(empty(SURVIVING))


def test_another_table_is_refused() -> None:
    with pytest.raises(SchemaError, match="tracks"):
        lifetimes(empty(LIFETIMES))
    with pytest.raises(SchemaError, match="tracks: found NoneType, expected a table"):
        lifetimes(None)
    with pytest.raises(SchemaError, match="ends"):
        lifetimes_of_ends(empty(TRACKS))
    for function in (mean_lifetime, median_survival, surviving):
        with pytest.raises(SchemaError, match="lifetimes"):
            function(empty(TRACKS))
