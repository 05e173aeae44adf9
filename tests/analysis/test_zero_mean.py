import numpy as np
import polars as pl
import pytest
from scipy import stats

from tracknoise.analysis.zero_mean import verdict_at, zero_mean
from tracknoise.inference.units import SceneGroups
from tracknoise.statistics.curves import curves
from tracknoise.tables.schema import MOMENTS

CONDITION = {
    "dataset": "d",
    "lighting": "nominal",
    "rotation": 0,
    "direction": "forward",
    "camera": "",
    "tracker": "a",
    "speed": 1,
    "population": "visible",
    "trimming": "trimmed",
    "axis": "age",
}


def moments_of(means: np.ndarray, **columns: object) -> pl.DataFrame:
    """Moments of scenes whose mean error (scenes, ages, 2) is given, NaN where there is none; age 0 comes first."""
    rows = [
        CONDITION | {"scene": f"s{scene:02}", "at": at, "n": 50, "mean_u": u, "mean_v": v} | columns
        for scene, ages in enumerate(means.tolist())
        for at, (u, v) in enumerate(ages)
        if not np.isnan(u)
    ]
    sums = {name: 50.0 for name in MOMENTS if name.startswith("m_")} | {"m_uv": 0.0}
    values = {"mean_abs_u": 1.0, "mean_abs_v": 1.0} | sums
    table = pl.DataFrame(rows).with_columns(pl.lit(value).alias(name) for name, value in values.items())
    return table.select(pl.col(name).cast(kind) for name, kind in MOMENTS.items())


def found_in(means: np.ndarray, *, min_features: int = 100, **options: object) -> pl.DataFrame:
    moments = moments_of(means)
    return zero_mean(moments, curves(moments, min_features=min_features), **options)


def scene_means(rng: np.random.Generator, n_scenes: int, n_ages: int, *, bias: float = 0.0) -> np.ndarray:
    """Scene means of standard deviation 1 that walk from age to age, after zeros at age 0."""
    walk = rng.normal(size=(n_scenes, n_ages, 2)).cumsum(axis=1) / np.sqrt(np.arange(1, n_ages + 1))[:, None]
    return np.concatenate([np.zeros((n_scenes, 1, 2)), walk + bias], axis=1)


def test_a_bias_is_found_at_its_ages_and_overall():
    means = scene_means(np.random.default_rng(5), 20, 6)
    means[:, 4:] += 3.0
    found = found_in(means)
    ages = found.drop_nulls("at")
    assert ages["at"].to_list() == [1, 2, 3, 4, 5, 6]
    assert ages["verdict"].to_list() == [*["undecided"] * 3, *["yes"] * 3]
    overall = found.row(by_predicate=pl.col("at").is_null(), named=True)
    assert overall["verdict"] == "yes"
    assert overall["why"].startswith("strongest evidence at age ")
    strongest = ages.row(by_predicate=pl.col("at") == int(overall["why"].split()[-1]), named=True)
    assert strongest["effect_px"] == overall["effect_px"]


def test_bounds_of_an_age_exclude_zero_where_its_own_test_does_and_an_undecided_row_says_why():
    """The verdict of a row allows for all ages and conditions, which is a wider claim than the bounds are about."""
    means = scene_means(np.random.default_rng(5), 20, 12, bias=0.6)
    rows = found_in(means).to_dicts()
    assert rows[0]["at"] is None
    assert rows[0]["effect_low_px"] is None
    excluded = [row for row in rows[1:] if row["effect_low_px"] > 0]
    assert excluded
    for row in rows[1:]:
        assert (row["effect_low_px"] > 0) is (row["sign_flip_p"] <= 0.05) is (verdict_at(row) == "yes")
        assert row["mean_u_low_px"] < row["mean_u_px"] < row["mean_u_high_px"]
    undecided = [row["why"] for row in excluded if row["verdict"] == "undecided"]
    assert undecided
    assert all(why.endswith("that were asked") for why in undecided)


def test_effects_are_lengths_of_the_mean_over_scenes():
    means = scene_means(np.random.default_rng(6), 10, 2, bias=1.0)
    row = found_in(means).row(by_predicate=pl.col("at") == 2, named=True)
    u, v = means[:, 2].mean(axis=0)
    second = (1 + means[:, 2] ** 2).mean(axis=0).sum()
    assert (row["mean_u_px"], row["mean_v_px"]) == pytest.approx((u, v))
    assert row["effect_px"] == pytest.approx(np.hypot(u, v))
    assert row["share_of_second"] == pytest.approx((u**2 + v**2) / second)
    assert (row["n"], row["n_scenes"]) == (500, 10)


def test_features_taken_for_independent_reject_what_scenes_do_not():
    found = found_in(scene_means(np.random.default_rng(7), 12, 5)).drop_nulls("at")
    assert (found["iid_p"] < 1e-6).all()
    assert (found["sign_flip_p"] > 0.01).all()


def test_the_iid_test_is_hotelling_over_features():
    means = np.zeros((7, 2, 2))
    means[:, 1] = [0.05, -0.02]
    row = found_in(means).row(by_predicate=pl.col("at") == 1, named=True)
    n, covariance = 350, 350 / 349  # 7 scenes of 50 features, each with a sum of squares of 50
    t2 = n * (0.05**2 + 0.02**2) / covariance
    assert row["iid_p"] == pytest.approx(stats.f.sf(t2 * (n - 2) / (2 * (n - 1)), 2, n - 2))


def test_p_values_are_adjusted_over_the_ages():
    found = found_in(scene_means(np.random.default_rng(8), 16, 5, bias=0.4))
    ages = found.drop_nulls("at")
    assert (ages["sign_flip_p_adjusted"] >= ages["sign_flip_p"]).all()
    assert (ages["hotelling_p_adjusted"] >= ages["hotelling_p"]).all()
    assert (
        ages["sign_flip_p_adjusted"].min() == found.row(by_predicate=pl.col("at").is_null(), named=True)["sign_flip_p"]
    )


@pytest.mark.parametrize("n_scenes", [1, 2, 5])
def test_under_six_scenes_there_is_no_test(n_scenes):
    found = found_in(scene_means(np.random.default_rng(9), n_scenes, 3, bias=50.0), min_features=1)
    assert found["verdict"].unique().to_list() == ["undecided"]
    scenes = "1 scene" if n_scenes == 1 else f"{n_scenes} scenes"
    assert found["why"].unique().to_list() == [f"a test at 5 % needs at least 6 scenes; this one has {scenes}"]
    assert found["sign_flip_p"].null_count() == found["hotelling_p"].null_count() == found.height
    assert found.drop_nulls("at")["effect_px"].min() > 10


def test_ages_that_few_scenes_reach_are_not_tested_and_do_not_count_in_the_adjustment():
    means = scene_means(np.random.default_rng(10), 8, 4, bias=0.5)
    means[3:, 4] = np.nan
    found = found_in(means).drop_nulls("at")
    last = found.row(by_predicate=pl.col("at") == 4, named=True)
    assert last["sign_flip_p"] is None
    assert last["sign_flip_p_adjusted"] is None
    assert last["why"] == "a test at 5 % needs at least 6 scenes; this one has 3 scenes"
    without = found_in(means[:, :4]).drop_nulls("at")
    assert found.head(3)["sign_flip_p_adjusted"].equals(without["sign_flip_p_adjusted"])
    assert found.head(3)["hotelling_p_adjusted"].equals(without["hotelling_p_adjusted"])


def test_six_scenes_that_agree_tell_of_single_ages_however_many():
    found = found_in(scene_means(np.random.default_rng(15), 6, 10, bias=20.0))
    assert found["verdict"].unique().to_list() == ["yes"]
    assert found["sign_flip_p_adjusted"].unique().to_list() == [2 / 64]


def test_errors_along_one_direction_alone_are_tested_by_flips():
    means = scene_means(np.random.default_rng(11), 10, 2)
    means[..., 1] = 0.0
    means[:, 1:, 0] += 5.0
    row = found_in(means).row(by_predicate=pl.col("at") == 1, named=True)
    assert row["hotelling_p"] is None
    assert row["sign_flip_p"] == pytest.approx(2 / 1024)
    assert row["verdict"] == "yes"


def test_errors_that_are_zero_in_every_scene_do_not_differ_from_zero():
    found = found_in(np.zeros((8, 3, 2)))
    assert found["verdict"].unique().to_list() == ["undecided"]
    assert found.drop_nulls("at")["sign_flip_p"].to_list() == [1.0, 1.0]
    assert found.drop_nulls("at")["effect_px"].to_list() == [0.0, 0.0]


def test_neither_the_key_frame_nor_what_is_cut_is_tested():
    means = scene_means(np.random.default_rng(12), 8, 4)
    moments = moments_of(means, axis="frame").with_columns(n=pl.when(pl.col("at") == 4).then(2).otherwise(pl.col("n")))
    found = zero_mean(moments, curves(moments), key_frames={"forward": 2})
    assert found.drop_nulls("at")["at"].to_list() == [0, 1, 3]


def test_a_condition_that_is_cut_everywhere_says_so():
    found = found_in(scene_means(np.random.default_rng(13), 8, 4), min_features=10_000)
    assert found["why"].to_list() == ["no age or frame has enough features"]
    assert found["verdict"].to_list() == ["undecided"]


def test_the_order_of_rows_changes_nothing_and_the_seed_decides_which_flips():
    means = scene_means(np.random.default_rng(14), 20, 6, bias=0.2)
    moments = moments_of(means)
    shuffled = moments.sample(fraction=1.0, shuffle=True, seed=1)
    expected = zero_mean(moments, curves(moments))
    assert zero_mean(shuffled, curves(shuffled)).equals(expected)
    other = zero_mean(moments, curves(moments), seed=1)
    assert not other["sign_flip_p"].equals(expected["sign_flip_p"])
    assert other["hotelling_p"].equals(expected["hotelling_p"])


def test_nothing_in_nothing_out():
    moments = moments_of(np.zeros((1, 1, 2))).clear()
    assert zero_mean(moments, curves(moments)).is_empty()


def test_a_condition_that_differs_by_chance_is_not_called_so_among_many():
    rng = np.random.default_rng(11)
    tables = [moments_of(scene_means(rng, 8, 3), tracker=f"t{place}") for place in range(12)]
    moments = pl.concat(tables)
    found = zero_mean(moments, curves(moments))
    whole = found.filter(pl.col("at").is_null())
    assert (whole["sign_flip_p"] <= 0.05).any()
    assert (whole["verdict"] == "undecided").all()
    assert (whole["sign_flip_p_family"] >= whole["sign_flip_p_adjusted"]).all()
    chance = found.filter(pl.col("at").is_not_null(), pl.col("sign_flip_p_adjusted") <= 0.05)
    assert set(chance["why"]) == {"a mean error of this size may be chance in one of the conditions that were asked"}
    unremarkable = found.filter(pl.col("at").is_not_null(), pl.col("sign_flip_p") > 0.05)
    assert set(unremarkable["why"]) == {"a mean error of this size may be chance"}


def test_groups_of_scenes_are_the_units():
    rng = np.random.default_rng(12)
    means = scene_means(rng, 4, 2, bias=2.0)[np.repeat(np.arange(4), 3)] + 0.1 * scene_means(rng, 12, 2)
    names = {("d", f"s{scene:02}"): f"place {scene // 3}" for scene in range(12)}
    alike = found_in(means, groups=SceneGroups(names)).filter(pl.col("at").is_null())
    assert "for these groups of scenes only" in alike["why"][0]
    lone = {("d", f"s{scene:02}"): f"place {min(scene, 4)}" for scene in range(7)}  # 3 of the same place
    few = found_in(means[:7], groups=SceneGroups(lone))
    assert few["why"].str.contains("too few groups of scenes").all()
    assert few["sign_flip_p"].null_count() == few.height
    assert few["verdict"].unique().to_list() == ["undecided"]
