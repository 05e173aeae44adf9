import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.error_shape import MIN_OTHERS, ties, within_scenes
from tracknoise.analysis.gaussianity import gaussianity
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import prepare_observations, prepare_sequence
from tracknoise.statistics.samples import samples

SUMS = ["n", "z_u", "z_v", "z_uu", "z_uv", "z_vv"]


def tables(z: np.ndarray, n_known: int) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Errors (scenes, n, 2) at one age, and their sums by scene as if `n_known` of them had been seen at that age."""
    scenes, n, _ = z.shape
    labels = {"trimming": "untrimmed", "at": 3, "age_low": 1}
    scene = np.repeat([f"{place:03}" for place in range(scenes)], n)
    singles = pl.DataFrame({"scene": scene, "z_u": z[..., 0].ravel(), "z_v": z[..., 1].ravel()})
    u, v = z[:, :n_known, 0], z[:, :n_known, 1]
    powers = zip(SUMS, (np.ones_like(u), u, v, u * u, u * v, v * v), strict=True)
    sums = pl.DataFrame({"scene": [f"{place:03}" for place in range(scenes)], **{k: x.sum(axis=1) for k, x in powers}})
    return tuple(table.with_columns(**{k: pl.lit(x) for k, x in labels.items()}) for table in (singles, sums))


@pytest.mark.parametrize("n_known", [40, 10])
def test_gaussian_errors_of_small_scenes_stay_gaussian(n_known: int) -> None:
    rng = np.random.default_rng(0)
    z = rng.standard_normal((1500, 40, 2)) * np.exp(rng.standard_normal((1500, 1, 1))) + 2
    squared = np.square(within_scenes(*tables(z, n_known))).sum(axis=1)
    assert np.mean(squared > 9.21) == pytest.approx(0.01, abs=0.0015)
    assert np.mean(squared) == pytest.approx(2.0, abs=0.03)
    assert np.mean(squared**2) == pytest.approx(8.0, abs=0.25)


def test_too_few_others_and_others_on_a_line_give_nothing() -> None:
    rng = np.random.default_rng(0)
    few = rng.standard_normal((3, MIN_OTHERS, 2))
    assert np.isnan(within_scenes(*tables(few, MIN_OTHERS))).all()
    line = rng.standard_normal((3, 2 * MIN_OTHERS, 1)) * np.ones(2)
    assert np.isnan(within_scenes(*tables(line, 2 * MIN_OTHERS))).all()


def test_ties_are_found_and_named() -> None:
    rng = np.random.default_rng(1)
    free = 0.2 * rng.standard_normal((500, 2))
    assert ties(free) is None
    assert ties(np.empty((0, 2))) is None
    assert "grid of 1/16 px" in str(ties(np.round(16 * free) / 16))
    assert ties(np.round(1024 * 100 * free) / 1024) is None
    zero = np.where(rng.random((500, 1)) < 0.1, 0.0, free)
    assert "of errors are exactly zero" in str(ties(zero))
    assert "of errors are equal" in str(ties(np.where(rng.random((500, 1)) < 0.1, 0.37, free)))


def verdicts(see_errors, errors: list[np.ndarray]) -> pl.DataFrame:
    seen = see_errors(errors)
    moments = scene_moments(prepare_observations(seen.observations))
    singles = samples(prepare_sequence(seen.observations, seen.tracks))
    return gaussianity(moments, singles, n_draws=300).gaussianity.filter(trimming="untrimmed")


def test_gaussian_scenes_of_different_scales_are_gaussian(see_errors) -> None:
    rng = np.random.default_rng(2)
    scales = np.exp(0.7 * rng.standard_normal(8))
    found = verdicts(see_errors, [scale * rng.standard_normal((300, 8, 2)) for scale in scales])
    assert found["verdict"].to_list() == ["Gaussian", "Gaussian"]
    for row in found.iter_rows(named=True):
        assert abs(row["gain_student_within_nats"]) < 0.01 < row["gain_scales_nats"]
        assert row["kurtosis_within"] == pytest.approx(8.0, abs=0.8)
        assert row["kurtosis"] > 10
        assert row["tail_99_within"] == pytest.approx(1.0, abs=0.5)


def test_errors_on_a_grid_have_no_shape(see_errors) -> None:
    rng = np.random.default_rng(3)
    found = verdicts(see_errors, [np.round(16 * 0.2 * rng.standard_normal((300, 8, 2))) / 16 for _ in range(8)])
    assert found["verdict"].to_list() == ["undecided", "undecided"]
    assert found["why"].str.contains("1/16 px").all()
    assert found["gain_student_nats"].null_count() == found.height
