import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.error_shape import POWER_SUMS, mardia, standard_sums, standardised, standards
from tracknoise.analysis.truth_shares import anchored
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations, prepare_sequence
from tracknoise.statistics.samples import samples, with_bands


@pytest.fixture(scope="module")
def walking(see_errors):
    """Random walks with a small mean, along turned axes, of two scenes."""
    rng = np.random.default_rng(0)
    steps = rng.standard_normal((2, 1500, 5, 2)) @ np.array([[0.3, 0.1], [0.0, 0.1]]) + [0.02, -0.01]
    steps[:, :, 0] = 0
    return see_errors(list(steps.cumsum(axis=2)))


@pytest.fixture(scope="module")
def moments(walking) -> pl.DataFrame:
    return with_bands(anchored(scene_moments(prepare_observations(walking.observations)), {}), pl.col("since"))


def test_errors_that_grow_have_a_gaussian_kurtosis_in_units_of_their_age(walking, moments) -> None:
    sums = standard_sums(moments, standards(moments, min_features=100)).filter(trimming="untrimmed")
    _, kurtosis = mardia(sums.select(POWER_SUMS).sum().to_numpy()[0])
    errors = walking.observations.filter(pl.col("age") > 0).select("du_px", "dv_px").to_numpy()
    away = errors - errors.mean(axis=0)
    mixed = (np.einsum("ni,ij,nj->n", away, np.linalg.inv(np.cov(away.T)), away) ** 2).mean()
    assert kurtosis == pytest.approx(8.0, abs=0.4)  # four standard errors: 4 sqrt(64 / 6000); ages are not independent
    assert mixed > 9.0  # what it would be otherwise


def test_sums_of_scenes_are_those_of_their_standardised_errors(walking, moments) -> None:
    standard = standards(moments, min_features=100)
    sums = standard_sums(moments, standard).filter(trimming="untrimmed", scene="00").select(POWER_SUMS).sum().row(0)
    seen = walking.observations.filter(pl.col("age") > 0, scene="00").select("scene", "age", "du_px", "dv_px")
    rows = seen.with_columns(trimming=pl.lit("untrimmed", dtype=standard.schema["trimming"]), at="age")
    joined = rows.join(standard, on=["trimming", "at"])
    away = joined.select("du_px", "dv_px").to_numpy() - joined.select("centre_u", "centre_v").to_numpy()
    a, b, c = joined.select("root_a", "root_b", "root_c").to_numpy().T
    z_u, z_v = a * away[:, 0], b * away[:, 0] + c * away[:, 1]
    assert sums[0] == len(rows)
    assert sums[POWER_SUMS.index("z_uuv")] == pytest.approx((z_u**2 * z_v).sum(), rel=1e-6, abs=1e-6)
    assert sums[POWER_SUMS.index("z_vvvv")] == pytest.approx((z_v**4).sum(), rel=1e-9)


def test_single_errors_are_whitened_and_know_their_spread(walking, moments) -> None:
    found = standardised(
        samples(prepare_sequence(walking.observations, walking.tracks)), standards(moments, min_features=100)
    )
    every = found.filter(trimming="untrimmed")
    assert np.cov(every.select("z_u", "z_v").to_numpy().T) == pytest.approx(np.eye(2), abs=0.15)
    assert found.filter(trimming="trimmed").height < every.height
    spread = np.exp(every["log_spread"].to_numpy())
    assert spread.min() == pytest.approx(np.sqrt(0.3 * 0.1), rel=0.05)  # root of the root of the determinant, age 1
    assert spread.max() == pytest.approx(np.sqrt(4 * 0.3 * 0.1), rel=0.05)


def test_each_single_error_has_the_standard_of_its_own_age_or_is_left_out(walking, moments) -> None:
    singles = samples(prepare_sequence(walking.observations, walking.tracks))
    gap = (pl.col("trimming") == "trimmed") & (pl.col("at") == 2)
    standard = standards(moments, min_features=100).filter(~gap)
    kind = standard.schema["trimming"]
    selected = {"untrimmed": singles, "trimmed": singles.filter("kept")}
    both = [table.with_columns(trimming=pl.lit(name, dtype=kind)) for name, table in selected.items()]
    joined = pl.concat(both).join(standard, on=["trimming", "at"], maintain_order="left")
    expected = joined.sort("scene", maintain_order=True).with_columns(
        z_u=pl.col("root_a") * (pl.col("du_px") - pl.col("centre_u"))
    )
    found = standardised(singles, standard)
    assert not found.filter(gap).height
    assert found.drop("z_u", "z_v", "log_spread").equals(expected.select(found.columns[:-3]))
    assert found["z_u"].to_numpy() == pytest.approx(expected["z_u"].to_numpy(), rel=1e-12)


def test_ages_of_few_errors_or_of_none_that_differ_have_no_standard(walking, see_errors) -> None:
    alike = see_errors([np.full((200, 3, 2), 0.5)]).observations
    moments = anchored(scene_moments(prepare_observations(alike)), {})
    assert standards(moments, min_features=100).is_empty()
    many = anchored(scene_moments(prepare_observations(walking.observations)), {})
    assert standards(many, min_features=3001).is_empty()
