import numpy as np
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.histograms import box_summary
from tracknoise.statistics.track_counts import outlier_ratios
from tracknoise.tables.findings_schema import OUTLIERS
from tracknoise.tables.schema import FRAME_COUNTS, TRACKS, empty


def test_by_hand(frames) -> None:
    # 1/10, 0/20, 2/20, 8/40; frame 0 had nothing to track. Sorted 0, .1, .1, .2: quartiles .075, .1, .125, reach
    # .075: from 0 to .2, all within.
    table = frames(frame=[0, 1, 2, 3, 4], offered=[0, 10, 20, 20, 40], outliers=[0, 1, 0, 2, 8])
    row = outlier_ratios(table).row(0, named=True)
    assert (row["n_frames"], row["n_scenes"], row["offered"], row["outliers"]) == (4, 1, 90, 11)
    assert row["pooled_ratio"] == pytest.approx(11 / 90)
    assert [row[name] for name in ("mean", "median", "lower_quartile", "upper_quartile")] == pytest.approx(
        [0.1, 0.1, 0.075, 0.125]
    )


def test_whiskers_stop_at_the_last_value_in_reach(frames) -> None:
    outliers = [10, 11, 12, 13, 14, 15, 16, 17, 90]
    row = outlier_ratios(frames(frame=list(range(9)), offered=100, outliers=outliers)).row(0, named=True)
    assert (row["lower_whisker"], row["upper_whisker"]) == (0.10, 0.17)


def test_frames_of_all_scenes_stand_together(frames) -> None:
    one = frames(scene="a", frame=[1, 2], offered=[10, 10], outliers=[1, 3])
    two = frames(scene="b", frame=[1], offered=[10], outliers=[2])
    table = outlier_ratios(iter([one, two]))
    assert table.select("n_frames", "n_scenes", "median").rows() == [(3, 2, 0.2)]
    assert outlier_ratios([two, one]).equals(table)


def test_a_tracker_that_never_had_a_feature_has_counts_of_zero_and_no_ratio(frames) -> None:
    table = outlier_ratios(frames(frame=[0, 1, 0], offered=[0, 0, 5], tracker=["black", "black", "seeing"]))
    assert table["tracker"].to_list() == ["black", "seeing"]
    row = table.row(0, named=True)
    counted = ("n_frames", "n_scenes", "offered", "outliers")
    assert [row[name] for name in counted] == [0, 0, 0, 0]
    measured = list(OUTLIERS)[list(OUTLIERS).index("pooled_ratio") :]
    assert [row[name] for name in measured] == [None] * 7


def test_a_scene_that_never_had_a_feature_does_not_count(frames) -> None:
    table = outlier_ratios(frames(scene=["a", "b"], offered=[0, 4], outliers=[0, 1]))
    assert table.select("n_frames", "n_scenes", "pooled_ratio").rows() == [(1, 1, 0.25)]


def test_sums_do_not_overflow_the_type_of_a_frame(frames) -> None:
    most = np.iinfo(np.uint32).max
    row = outlier_ratios(frames(frame=[0, 1], offered=[most, most], outliers=[most, most])).row(0, named=True)
    assert (row["offered"], row["outliers"], row["pooled_ratio"]) == (2 * int(most), 2 * int(most), 1.0)


def test_pooled_ratios_have_the_box_of_all_frames(frames) -> None:
    rng = np.random.default_rng(19)
    offered = rng.integers(1, 40, (3, 100))
    outliers = rng.binomial(offered, 0.3)
    parts = [
        frames(scene=name, offered=offered[row].tolist(), outliers=outliers[row].tolist())
        for row, name in enumerate("abc")
    ]
    row = outlier_ratios(iter(parts)).row(0, named=True)
    expected = box_summary(np.concatenate([(part["outliers"] / part["offered"]).to_numpy() for part in parts]))
    for name in ("mean", "median", "lower_quartile", "upper_quartile", "lower_whisker", "upper_whisker"):
        assert row[name] == pytest.approx(getattr(expected, name), rel=1e-12), name


def test_no_frames_give_empty_tables() -> None:
    assert outlier_ratios(empty(FRAME_COUNTS)).equals(empty(OUTLIERS))
    assert outlier_ratios([]).equals(empty(OUTLIERS))


def test_another_table_is_refused() -> None:
    with pytest.raises(SchemaError, match="frames"):
        outlier_ratios(empty(TRACKS))
