import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.moments import KEYS, merge, scene_moments
from tracknoise.statistics.prepared import prepare_observations
from tracknoise.tables.schema import MOMENTS, OBSERVATIONS, ORIGIN, empty

STATUSES = ["valid", "occluded", "out_of_image", "no_depth", "edge", "behind_camera"]
SUMS = [name for name in MOMENTS if name.startswith("m_") and "abs" not in name]
POOL = [name for name in KEYS if name != "scene"]


@pytest.fixture(scope="module")
def many(observations) -> pl.DataFrame:
    """Two scenes, two trackers, three ages, every truth status, some tracks dropped."""
    rng, n = np.random.default_rng(5), 3000
    return observations(
        scene=rng.choice(["a", "b"], n).tolist(),
        tracker=rng.choice(["lk", "match"], n).tolist(),
        age=rng.integers(0, 3, n).tolist(),
        truth=rng.choice(STATUSES, n, p=[0.6, 0.15, 0.1, 0.05, 0.05, 0.05]).tolist(),
        kept=(rng.random(n) < 0.8).tolist(),
        du_px=(rng.normal(size=n) + 0.5).tolist(),
        dv_px=(rng.normal(size=n) ** 3).tolist(),
    )


def direct(table: pl.DataFrame) -> dict[str, float]:
    """Every moment of a table's errors, one plain NumPy sum each."""
    u, v = table["du_px"].to_numpy(), table["dv_px"].to_numpy()
    x, y, a, b = u - u.mean(), v - v.mean(), np.abs(u), np.abs(v)
    values = {"n": len(u), "mean_u": u.mean(), "mean_v": v.mean(), "mean_abs_u": a.mean(), "mean_abs_v": b.mean()}
    values |= {"m_abs_uu": ((a - a.mean()) ** 2).sum(), "m_abs_vv": ((b - b.mean()) ** 2).sum()}
    return values | {name: (x ** name.count("u") * y ** name.count("v")).sum() for name in SUMS}


def selected(table: pl.DataFrame, population: str, trimming: str) -> pl.DataFrame:
    statuses = STATUSES[:1] if population == "visible" else STATUSES[:3]
    chosen = table.filter(pl.col("truth").is_in(statuses))
    return chosen.filter("kept") if trimming == "trimmed" else chosen


def test_every_group_has_the_moments_of_its_observations(many) -> None:
    moments = scene_moments(prepare_observations(many))
    assert moments.height == 2 * 2 * 3 * 4
    for row in moments.iter_rows(named=True):
        key = {name: row[name] for name in ORIGIN} | {"age": row["at"]}
        group = selected(many.filter(**key), row["population"], row["trimming"])
        expected = direct(group)
        assert row["n"] == expected["n"]
        for name, value in expected.items():
            assert row[name] == pytest.approx(value, rel=1e-9, abs=1e-9 * row["n"]), name


def test_rows_are_sorted_and_unique(many) -> None:
    moments = scene_moments(prepare_observations(many))
    assert_frame_equal(moments, moments.sort(KEYS))
    assert not moments.select(KEYS).is_duplicated().any()


def test_pooling_scenes_equals_measuring_them_as_one(many) -> None:
    pooled = merge(scene_moments(prepare_observations(many)), by=POOL)
    as_one = scene_moments(prepare_observations(many.with_columns(scene=pl.lit("all")))).drop("scene")
    assert_frame_equal(pooled.select(as_one.columns), as_one, rel_tol=1e-9, abs_tol=1e-6)


def test_pooling_in_two_steps_equals_one(many) -> None:
    moments = scene_moments(prepare_observations(many))
    by_age = merge(moments, by=["tracker", "population", "trimming", "at"])
    twice = merge(by_age, by=["tracker", "population", "trimming"])
    once = merge(moments, by=["tracker", "population", "trimming"])
    assert_frame_equal(twice, once, rel_tol=1e-9, abs_tol=1e-6)


def test_results_are_byte_identical_and_rows_may_come_in_any_order(many) -> None:
    moments = scene_moments(prepare_observations(many))
    assert moments.equals(scene_moments(prepare_observations(many)))
    shuffled = moments.sample(fraction=1.0, shuffle=True, seed=1)
    assert merge(shuffled, by=POOL).equals(merge(moments, by=POOL))


def test_a_scene_drawn_twice_counts_twice(observations) -> None:
    moments = scene_moments(prepare_observations(observations(du_px=[1.0, 3.0])))
    doubled = merge(pl.concat([moments, moments]), by=POOL).row(0, named=True)
    assert (doubled["n"], doubled["mean_u"], doubled["m_uu"]) == (4, 2.0, 4.0)


def test_a_row_without_observations_changes_nothing_and_alone_has_no_mean(observations) -> None:
    moments = scene_moments(prepare_observations(observations(du_px=[1.0, 3.0])))
    sums = [name for name in MOMENTS if name.startswith("m_")]
    nothing = moments.with_columns(n=pl.lit(0, dtype=pl.Int64), mean_u=None, mean_v=None, mean_abs_u=None)
    nothing = nothing.with_columns(mean_abs_v=None).with_columns(pl.lit(0.0).alias(name) for name in sums)
    nothing = nothing.cast(dict(MOMENTS))
    assert merge(pl.concat([nothing, moments]), by=POOL).equals(merge(moments, by=POOL))
    alone = merge(nothing, by=POOL).row(0, named=True)
    assert (alone["n"], alone["mean_u"], alone["mean_abs_v"], alone["m_uu"]) == (0, None, None, 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_known_gaussian_comes_back_within_four_standard_errors(observations, seed: int) -> None:
    mean, covariance, n = np.array([0.3, -0.1]), np.array([[1.0, 0.6], [0.6, 2.0]]), 20_000
    errors = np.random.default_rng(seed).multivariate_normal(mean, covariance, n)
    row = merge(
        scene_moments(prepare_observations(observations(du_px=errors[:, 0].tolist(), dv_px=errors[:, 1].tolist()))),
        by=["population", "trimming"],
    ).row(0, named=True)
    variances = covariance.diagonal()
    assert np.all(np.abs([row["mean_u"], row["mean_v"]] - mean) < 4 * np.sqrt(variances / n))
    found = np.array([row["m_uu"], row["m_vv"], row["m_uv"]]) / (n - 1)
    spread = np.sqrt(np.array([*(2 * variances**2), variances.prod() + covariance[0, 1] ** 2]) / n)
    assert np.all(np.abs(found - [*variances, covariance[0, 1]]) < 4 * spread)
    third, fourth = row["m_uuu"] / n, row["m_uuuu"] / n  # 0 and 3 for a standard Gaussian
    assert abs(third) < 4 * np.sqrt(15 / n)
    assert abs(fourth - 3) < 4 * np.sqrt(96 / n)


def test_no_observations_give_no_moments() -> None:
    moments = scene_moments(prepare_observations(empty(OBSERVATIONS)))
    assert moments.equals(empty(MOMENTS))
    assert merge(moments, by=["at"]).height == 0


def test_observations_without_known_truth_give_no_moments(observations) -> None:
    assert scene_moments(prepare_observations(observations(truth=["no_depth"], du_px=[None], dv_px=[None]))).height == 0


def test_occluded_observations_alone_make_no_visible_rows(observations) -> None:
    moments = scene_moments(prepare_observations(observations(truth=["occluded"])))
    assert moments["population"].unique().to_list() == ["projected"]


def test_the_wrong_tables_are_refused(many) -> None:
    with pytest.raises(SchemaError, match="observations: column 8"):
        scene_moments(prepare_observations(many.drop("track")))
    with pytest.raises(SchemaError, match="moments: column 0 is mean_u"):
        merge(scene_moments(prepare_observations(many)).drop("n"), by=["at"])


def test_the_input_stays_as_it_was(many) -> None:
    before = many.clone()
    scene_moments(prepare_observations(many))
    assert many.equals(before)
