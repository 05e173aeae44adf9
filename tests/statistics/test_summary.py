import math

import polars as pl
import pytest

from tracknoise.exceptions import SchemaError, SettingsError, UnknownNameError
from tracknoise.statistics.curves import curves
from tracknoise.statistics.lifetimes import lifetimes
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations
from tracknoise.statistics.summary import summary
from tracknoise.statistics.track_counts import outlier_ratios
from tracknoise.tables.findings_schema import CURVES, LIFETIMES, OUTLIERS, SUMMARY
from tracknoise.tables.schema import empty


@pytest.fixture(scope="module")
def by_age(observations):
    def build(ages: list[int], *, min_features: int = 1, **columns: object) -> pl.DataFrame:
        return curves(scene_moments(prepare_observations(observations(age=ages, **columns))), min_features=min_features)

    return build


def summarise(table: pl.DataFrame, **options: object) -> dict[str, object]:
    return summary(table, empty(LIFETIMES), empty(OUTLIERS), **options).row(0, named=True)


def test_one_row_says_it_all(observations, tracks, frames) -> None:
    seen = observations(age=[8, 8, 8], kept=[True, True, False], du_px=[1.0, 3.0, -10.0], dv_px=[0.0, 0.0, 2.0])
    lived = tracks(lifetime=[1, 2, 9], end=["lost", "outlier", "lost"])
    row = summary(
        curves(scene_moments(prepare_observations(seen)), min_features=2),
        lifetimes(lived),
        outlier_ratios(frames(offered=[10, 30], outliers=[1, 3])),
    ).row(0, named=True)
    assert (row["dataset"], row["tracker"], row["speed"], row["n_scenes"], row["n_tracks"]) == ("d", "lk", 1, 1, 3)
    assert (row["mean_lifetime"], row["median_lifetime"], row["outlier_ratio"]) == (4.0, 2, 0.1)
    assert (row["at"], row["untrimmed_n"], row["trimmed_n"]) == (8, 3, 2)
    expected = {
        "trimmed_nu_u_px": 2.0, "trimmed_eta_u_px": 2.0, "trimmed_rms_u_px": math.sqrt(5),
        "trimmed_nu_v_px": 0.0, "trimmed_eta_v_px": 0.0, "trimmed_rms_v_px": 0.0,
        "untrimmed_nu_u_px": -2.0, "untrimmed_eta_u_px": 14 / 3, "untrimmed_rms_u_px": math.sqrt(110 / 3),
        "untrimmed_nu_v_px": 2 / 3, "untrimmed_eta_v_px": 2 / 3, "untrimmed_rms_v_px": math.sqrt(4 / 3),
    }  # fmt: skip
    assert {name: row[name] for name in expected} == pytest.approx(expected)


def test_the_reference_age_is_the_last_one_up_to_the_limit(by_age) -> None:
    assert summarise(by_age([0, 4, 8, 12]))["at"] == 8
    assert summarise(by_age([0, 4, 8, 12]), age=12)["at"] == 12
    assert summarise(by_age([0, 4, 8, 12]), age=3)["at"] is None  # at age 0 there is no error to speak of


def test_the_reference_age_is_not_cut_trimmed_or_untrimmed(by_age) -> None:
    ages, kept = [1] * 3 + [2] * 3 + [3] * 2, [True] * 3 + [True, True, False] + [True] * 2
    assert summarise(by_age(ages, kept=kept, min_features=2))["at"] == 3
    assert summarise(by_age(ages, kept=kept, min_features=3))["at"] == 1


def test_the_reference_age_is_one_that_all_trackers_have(by_age) -> None:
    long, short, none = (by_age(ages, tracker=name) for name, ages in (("a", [1, 2, 3, 4]), ("b", [1, 2]), ("c", [9])))
    rows = summary(pl.concat([long, short]), empty(LIFETIMES), empty(OUTLIERS)).to_dicts()
    assert [row["at"] for row in rows] == [2, 2]
    faster = long.with_columns(speed=pl.lit(2, dtype=CURVES["speed"]))
    rows = summary(pl.concat([long, short, faster]), empty(LIFETIMES), empty(OUTLIERS)).to_dicts()
    assert [(row["tracker"], row["speed"], row["at"]) for row in rows] == [("a", 1, 2), ("a", 2, 4), ("b", 1, 2)]
    rows = summary(pl.concat([long, short, none]), empty(LIFETIMES), empty(OUTLIERS)).to_dicts()
    assert [row["at"] for row in rows] == [2, 2, None]  # the third is not compared


def test_an_age_that_trimming_emptied_is_not_used(by_age) -> None:
    assert summarise(by_age([1, 2], kept=[True, False]))["at"] == 1


def test_too_few_features_everywhere_leave_the_errors_null(by_age) -> None:
    row = summarise(by_age([1, 2], min_features=100))
    errors = [name for name in row if name.startswith(("trimmed", "untrimmed"))]
    assert [row[name] for name in ["at", *errors]] == [None] * (1 + len(errors))


def test_the_reference_frame_is_the_last_one_up_to_ten_after_the_key_frame(observations) -> None:
    seen = observations(frame=[0, 24, 30, 34, 35], du_px=[9.0, 0.0, 1.0, 2.0, 9.0])
    table = curves(scene_moments(prepare_observations(seen, axis="frame")), min_features=1)
    row = summarise(table, key_frame=24)
    assert (row["axis"], row["at"], row["untrimmed_nu_u_px"], row["untrimmed_eta_u_px"]) == ("frame", 34, 2.0, 2.0)
    assert summarise(table.filter(pl.col("at") <= 24), key_frame=24)["at"] is None


def test_each_direction_has_the_key_frame_of_its_own(observations) -> None:
    seen = pl.concat(
        observations(frame=frames, du_px=errors, direction=direction)
        for direction, frames, errors in (
            ("backward", [12, 16, 44], [5.0, 6.0, 3.0]),
            ("forward", [12, 16], [1.0, 2.0]),
        )
    )
    table = curves(scene_moments(prepare_observations(seen, axis="frame")), min_features=1)
    found = summary(table, empty(LIFETIMES), empty(OUTLIERS), key_frame={"forward": 10, "backward": 38})
    assert found.select("direction", "at", "untrimmed_nu_u_px").rows() == [("backward", 44, 3.0), ("forward", 16, 2.0)]


def test_the_population_is_chosen(by_age) -> None:
    table = by_age([1, 1], truth=["valid", "occluded"], du_px=[1.0, 3.0])
    assert summarise(table)["untrimmed_nu_u_px"] == 1.0
    assert summarise(table, population="projected")["untrimmed_nu_u_px"] == 2.0


def test_an_unknown_population_is_refused(by_age) -> None:
    with pytest.raises(UnknownNameError, match="population 'all'"):
        summarise(by_age([0]), population="all")


def test_every_condition_of_any_table_has_one_row(by_age, tracks, frames) -> None:
    table = summary(
        by_age([0], tracker="seen"),
        lifetimes(tracks(tracker=["lived", "seen"])),
        outlier_ratios(frames(tracker=["offered"], offered=[1])),
    )
    assert table["tracker"].to_list() == ["lived", "offered", "seen"]
    assert table["n_tracks"].to_list() == [1, 0, 1]
    assert table["outlier_ratio"].to_list() == [None, 0.0, None]


def test_a_condition_without_a_feature_has_no_tracks_and_nothing_else(frames) -> None:
    offered = outlier_ratios(frames(frame=[0, 1], offered=[0, 0], tracker="blind"))
    row = summary(empty(CURVES), empty(LIFETIMES), offered).row(0, named=True)
    assert {name: row[name] for name in row if row[name] is not None} == {
        "dataset": "d", "lighting": "nominal", "rotation": 0, "direction": "forward", "camera": "",
        "tracker": "blind", "speed": 1, "n_tracks": 0,
    }  # fmt: skip


def test_nothing_gives_nothing() -> None:
    assert summary(empty(CURVES), empty(LIFETIMES), empty(OUTLIERS)).equals(empty(SUMMARY))


@pytest.mark.parametrize(("name", "value"), [("age", "20"), ("age", 0), ("key_frame", None)])
def test_the_reference_has_a_number(name: str, value: object) -> None:
    with pytest.raises(SettingsError, match=f"{name} is {value!r}, expected a"):
        summary(empty(CURVES), empty(LIFETIMES), empty(OUTLIERS), **{name: value})


def test_the_wrong_tables_are_refused() -> None:
    with pytest.raises(SchemaError, match="curves"):
        summary(empty(LIFETIMES), empty(LIFETIMES), empty(OUTLIERS))
    with pytest.raises(SchemaError, match="lifetimes"):
        summary(empty(CURVES), empty(CURVES), empty(OUTLIERS))
    with pytest.raises(SchemaError, match="outliers"):
        summary(empty(CURVES), empty(LIFETIMES), empty(CURVES))
    with pytest.raises(SchemaError, match="outliers: found NoneType, expected a table"):
        summary(empty(CURVES), empty(LIFETIMES), None)
