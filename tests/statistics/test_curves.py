from functools import partial

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError, SettingsError
from tracknoise.statistics import curves as module
from tracknoise.statistics.curves import curves
from tracknoise.statistics.definitions import NAMES, UNITS
from tracknoise.statistics.grouping import in_chunks
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations
from tracknoise.tables.findings_schema import CURVES
from tracknoise.tables.schema import MOMENTS, empty


def select(table: pl.DataFrame, **values: object) -> pl.DataFrame:
    chosen = {"population": "visible", "trimming": "untrimmed", "weighting": "features"} | values
    return table.filter(**chosen)


@pytest.fixture(scope="module")
def two_scenes(observations) -> pl.DataFrame:
    """Scene a: 3 features, scene b: 1 feature, at age 0."""
    return scene_moments(
        prepare_observations(
            observations(scene=["a", "a", "a", "b"], du_px=[1.0, 2.0, -3.0, 4.0], dv_px=[0.0, 1.0, -1.0, 2.0])
        )
    )


def test_pooled_features_agree_with_numpy(observations) -> None:
    rng = np.random.default_rng(6)
    u, v = rng.normal(0.3, size=500), rng.normal(-0.2, size=500)
    table = select(curves(scene_moments(prepare_observations(observations(du_px=u.tolist(), dv_px=v.tolist())))))
    row = {statistic: table.filter(statistic=statistic).row(0, named=True) for statistic in NAMES["age"].values()}
    assert [row["nu"][axis] for axis in "uv"] == pytest.approx([u.mean(), v.mean()])
    assert [row["eta"][axis] for axis in "uv"] == pytest.approx([np.abs(u).mean(), np.abs(v).mean()])
    covariance, second = np.cov(u, v), np.array([[u @ u, u @ v], [u @ v, v @ v]]) / 500
    central = [row["central"][name] for name in ("u", "v", "uv")]
    about_zero = [row["Phi"][name] for name in ("u", "v", "uv")]
    assert central == pytest.approx([covariance[0, 0], covariance[1, 1], covariance[0, 1]])
    assert about_zero == pytest.approx([second[0, 0], second[1, 1], second[0, 1]])
    assert row["nu"]["uv"] is None
    assert row["eta"]["uv"] is None
    assert {role: row[name]["unit"] for role, name in NAMES["age"].items()} == UNITS


def test_features_pools_and_scenes_averages(two_scenes) -> None:
    table = curves(two_scenes)
    pooled = select(table, statistic="nu").row(0, named=True)
    averaged = select(table, statistic="nu", weighting="scenes").row(0, named=True)
    assert (pooled["u"], pooled["v"], pooled["n"], pooled["n_scenes"]) == (1.0, 0.5, 4, 2)
    assert (averaged["u"], averaged["v"], averaged["n"], averaged["n_scenes"]) == (2.0, 1.0, 4, 2)


def test_a_scene_with_one_feature_has_no_covariance_to_average(two_scenes) -> None:
    table = select(curves(two_scenes), weighting="scenes", statistic="central").row(0, named=True)
    assert table["n_scenes"] == 1


@pytest.mark.parametrize("weighting", ["features", "scenes"])
def test_one_feature_has_no_covariance(observations, weighting: str) -> None:
    table = select(curves(scene_moments(prepare_observations(observations(du_px=[2.0])))), weighting=weighting)
    assert select(table, weighting=weighting, statistic="nu")["u"].to_list() == [2.0]
    assert table.filter(statistic="Phi")["u"].to_list() == [4.0]
    assert table.filter(statistic="central").select("u", "v", "uv").row(0) == (None, None, None)
    assert table.select(pl.sum_horizontal(pl.col("u", "v", "uv").is_nan().sum())).item() == 0


def test_curves_are_cut_from_the_first_thin_age_on(observations) -> None:
    ages = [0] * 5 + [4] * 3 + [8] * 2 + [12] * 4  # 12 has enough again, but stays cut
    table = select(curves(scene_moments(prepare_observations(observations(age=ages))), min_features=3), statistic="nu")
    assert table["at"].to_list() == [0, 4, 8, 12]
    assert table["cut"].to_list() == [False, False, True, True]


def test_the_cut_counts_all_scenes_together_and_each_condition_alone(observations) -> None:
    moments = scene_moments(
        prepare_observations(observations(scene=["a", "b", "a", "a"], speed=[1, 1, 2, 2], age=[0, 0, 0, 2]))
    )
    table = curves(moments, min_features=2).filter(statistic="eta", population="visible", trimming="trimmed")
    found = {(row["weighting"], row["speed"], row["at"]): row["cut"] for row in table.iter_rows(named=True)}
    expected = {(1, 0): False, (2, 0): True, (2, 2): True}
    assert found == {(weight, *key): cut for weight in ("features", "scenes") for key, cut in expected.items()}


def test_a_scene_drawn_twice_counts_twice(two_scenes) -> None:
    drawn = pl.concat([two_scenes, two_scenes.filter(scene="b")])
    table = select(curves(drawn), weighting="scenes", statistic="nu").row(0, named=True)
    assert table["u"] == pytest.approx((0.0 + 4.0 + 4.0) / 3)
    assert table["n_scenes"] == 3


def test_lightings_and_rotations_are_never_pooled(observations) -> None:
    moments = scene_moments(
        prepare_observations(observations(lighting=["x", "y", "x"], rotation=[0, 0, 90], du_px=[1.0, 2.0, 3.0]))
    )
    table = select(curves(moments), statistic="nu")
    assert table.select("lighting", "rotation", "u").rows() == [("x", 0, 1.0), ("x", 90, 3.0), ("y", 0, 2.0)]


def test_rows_without_observations_are_left_out(two_scenes) -> None:
    nothing = two_scenes.with_columns(n=pl.lit(0, dtype=pl.Int64), scene=pl.lit("c"))
    assert curves(pl.concat([two_scenes, nothing])).equals(curves(two_scenes))


def test_rows_are_sorted_and_do_not_depend_on_the_order_of_the_input(observations) -> None:
    rng = np.random.default_rng(7)
    moments = scene_moments(
        prepare_observations(
            observations(
                scene=rng.choice(["a", "b", "c"], 300).tolist(),
                age=rng.integers(0, 4, 300).tolist(),
                du_px=rng.normal(size=300).tolist(),
            )
        )
    )
    table = curves(moments)
    keys = ["population", "trimming", "weighting", "statistic", "at"]
    assert table.select(keys).equals(table.select(keys).sort(keys))
    assert curves(moments.sample(fraction=1.0, shuffle=True, seed=2)).equals(table)


@pytest.mark.parametrize("rows", [1, 40, 10_000])
def test_scenes_that_come_one_by_one_are_pooled_as_all_at_once(observations, monkeypatch, rows: int) -> None:
    rng = np.random.default_rng(17)
    scene = rng.choice(["a", "b", "c", "d", "e"], 400, p=[0.4, 0.3, 0.2, 0.09, 0.01])
    moments = scene_moments(
        prepare_observations(
            observations(
                scene=scene.tolist(),
                age=rng.geometric(0.3, 400).tolist(),
                du_px=rng.normal(3.0, size=400).tolist(),
                dv_px=rng.standard_cauchy(size=400).tolist(),
            )
        )
    )
    together = curves(moments, min_features=3)
    parts = [moments.filter(scene=name) for name in "abcde"]
    monkeypatch.setattr(module, "in_chunks", partial(in_chunks, rows=rows))
    streamed = curves(iter(parts), min_features=3)
    values = ["u", "v", "uv"]
    assert streamed.drop(values).equals(together.drop(values))
    for name in values:
        assert streamed[name].is_null().equals(together[name].is_null())
        np.testing.assert_allclose(streamed[name].drop_nulls(), together[name].drop_nulls(), rtol=1e-11, atol=1e-11)
    assert curves(iter(parts), min_features=3).equals(streamed)


def test_no_moments_give_no_curves() -> None:
    assert curves([]).equals(empty(CURVES))
    assert curves(empty(MOMENTS)).equals(empty(CURVES))


def test_another_table_is_refused() -> None:
    with pytest.raises(SchemaError, match="moments"):
        curves(empty(CURVES))
    for wrong in (None, "moments", [None]):
        with pytest.raises(SchemaError, match=r"moments: found (str|NoneType), expected a table"):
            curves(wrong)


@pytest.mark.parametrize("least", [None, 0, 1.5, "20"])
def test_a_cut_needs_a_number_of_features(least) -> None:
    with pytest.raises(SettingsError, match=r"min_features is .*, expected a whole number of at least 1"):
        curves(empty(MOMENTS), min_features=least)


def test_along_frames_curves_have_the_names_of_time(observations) -> None:
    seen = observations(frame=[3, 3], age=[1, 2], du_px=[1.0, 3.0])
    table = select(curves(scene_moments(prepare_observations(seen, axis="frame")), min_features=1))
    assert set(table["axis"]) == {"frame"}
    assert table.sort("statistic").select("statistic", "at", "u").rows() == [
        ("Sigma", 3, 5.0), ("central", 3, 2.0), ("kappa", 3, 2.0), ("mu", 3, 2.0),
    ]  # fmt: skip


def test_along_frames_curves_are_cut_on_both_sides_of_the_fullest(observations) -> None:
    frames = [0] * 3 + [1] * 2 + [2] * 4 + [3] * 6 + [4] * 3 + [5] * 1 + [6] * 5
    table = select(
        curves(scene_moments(prepare_observations(observations(frame=frames), axis="frame")), min_features=3),
        statistic="mu",
    )
    assert table["cut"].to_list() == [True, True, False, False, False, True, True]
