"""The robust scale of errors, against NumPy's own median and a Gaussian's share of far errors."""

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.simulated import tables

from tracknoise.statistics.curves import curves
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import PreparedSequence, prepare_sequence
from tracknoise.statistics.scales import LEAST_ERRORS, cores, grouped_medians, scale_blocks, scales


def sequence(errors: list[np.ndarray]) -> PreparedSequence:
    """Scenes of tracks with these errors, (tracks, ages, 2), trimmed."""
    return prepare_sequence(*tables(errors))


@pytest.fixture(scope="module")
def errors() -> list[np.ndarray]:
    rng = np.random.default_rng(5)
    made = [scale * rng.standard_normal((n, 4, 2)) for n, scale in ((400, 0.5), (201, 2.0), (9, 1.0))]
    for part in made:
        part[:, 0] = 0.0
    return made


def visible(table: pl.DataFrame, **chosen: object) -> pl.DataFrame:
    return table.filter(population="visible", trimming="untrimmed", **chosen)


def test_the_core_is_the_scaled_median_of_each_scene_and_age(errors):
    found = visible(scales(sequence(errors)))
    for scene, part in enumerate(errors[:2]):
        for age in (1, 2, 3):
            row = found.filter(scene=f"{scene:03}", at=age).row(0, named=True)
            size = np.abs(part[:, age])
            core = 1.482602218505602 * np.median(size, axis=0)
            assert row["n"] == len(part)
            np.testing.assert_allclose([row["core_u_px"], row["core_v_px"]], core, rtol=1e-12)
            assert [row["beyond_u"], row["beyond_v"]] == (size > 3 * core).sum(axis=0).tolist()


def test_few_errors_have_no_core(errors):
    assert len(errors[2]) < LEAST_ERRORS
    assert visible(scales(sequence(errors)), scene="002")["core_u_px"].null_count() == 4


def test_trimming_makes_the_core_smaller(errors):
    table = scales(sequence(errors)).filter(population="visible", scene="000", at=3)
    untrimmed, trimmed = (table.filter(trimming=name)["core_u_px"].item() for name in ("untrimmed", "trimmed"))
    assert trimmed < untrimmed


def test_a_few_large_errors_hardly_change_the_core(errors):
    wild = [part.copy() for part in errors]
    wild[0][:20, 1:] *= 100
    usual, large = (visible(scales(sequence(part)), scene="000", at=2)["core_u_px"].item() for part in (errors, wild))
    assert usual == pytest.approx(large, rel=0.1)
    assert visible(scales(sequence(wild)), scene="000", at=2)["beyond_u"].item() >= 15


def test_blocks_have_the_errors_of_their_tracks_only(errors):
    table = visible(scale_blocks(sequence(errors)), scene="000", at=2)
    assert table["n"].sum() == len(errors[0])
    first = errors[0][: table["n"][0], 2]
    assert table["core_u_px"][0] == pytest.approx(1.482602218505602 * np.median(np.abs(first[:, 0])))


def test_scenes_are_combined_by_the_geometric_mean_and_far_errors_are_pooled(errors):
    prepared = sequence(errors)
    found = visible(scales(prepared), at=2)
    pooled = visible(cores(scales(prepared), curves(scene_moments(prepared.seen), min_features=2)), at=2)
    row = pooled.row(0, named=True)
    known = found.drop_nulls("core_u_px")
    assert row["n_scenes_u"] == row["n_scenes_v"] == 2
    assert row["n_u"] == row["n_v"] == 601
    assert row["core_u_px"] == pytest.approx(np.sqrt(np.prod(known["core_u_px"].to_numpy())))
    assert row["beyond_v"] == pytest.approx(known["beyond_v"].sum() / 601)


def test_a_gaussian_has_its_sigma_as_core_and_a_quarter_of_a_percent_beyond():
    rng = np.random.default_rng(1)
    made = 0.7 * rng.standard_normal((200_000, 2, 2))
    row = visible(scales(sequence([made])), at=1).row(0, named=True)
    assert row["core_u_px"] == pytest.approx(0.7, rel=0.01)
    assert row["beyond_u"] / row["n"] == pytest.approx(0.0027, rel=0.2)


def test_medians_of_groups_of_odd_and_even_size():
    values, index = np.array([3.0, 1.0, 2.0, 7.0, 5.0]), np.array([0, 0, 0, 1, 1])
    np.testing.assert_array_equal(grouped_medians(values, index, np.array([3, 2])), [2.0, 6.0])


def test_an_axis_whose_errors_are_mostly_zero_has_no_core(errors):
    exact = [part.copy() for part in errors]
    exact[0][50:, :, 1] = 0.0
    found = visible(scales(sequence(exact)), scene="000", at=2).row(0, named=True)
    assert found["core_u_px"] is not None
    assert (found["core_v_px"], found["beyond_v"]) == (None, None)
    prepared = sequence(exact)
    row = visible(cores(scales(prepared), curves(scene_moments(prepared.seen), min_features=2)), at=2).row(
        0, named=True
    )
    assert (row["n_scenes_u"], row["n_scenes_v"]) == (2, 1)
    assert row["core_v_px"] == pytest.approx(visible(scales(prepared), scene="001", at=2)["core_v_px"].item())
