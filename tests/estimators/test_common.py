import numpy as np
import polars as pl
import pytest

import tracknoise as tn
from tracknoise.estimators.errors_in_common import CommonErrors
from tracknoise.estimators.training import training_tables
from tracknoise.inference.units import NO_GROUPS
from tracknoise.report.noise_cells import model_sentences
from tracknoise.tables.store import RunFolder

COMMON, WHITE = 0.2**2, (0.09 + 0.04) / 2
SHARE = COMMON / (COMMON + WHITE)


def test_a_planted_common_share_comes_back(common_run) -> None:
    model = tn.NoiseModel.fit(common_run, tracker="oracle")
    share = model.common_share
    assert share is not None
    assert share.low < _drawn(common_run) < share.high
    assert share.value == pytest.approx(SHARE, rel=0.2)
    assert "Errors in common of all features of a frame are 3" in " ".join(model_sentences(model, "filter"))


def _drawn(run) -> float:
    """The share of the common errors that were drawn: 13 frames of each scene have few."""
    errors = tn.open_run(run).observations().filter(pl.col("age") > 0).select("scene", "frame", "du_px", "dv_px")
    common = errors.select(pl.col("du_px", "dv_px").mean().over("scene", "frame")).to_numpy()
    return np.square(common).sum() / np.square(errors.select("du_px", "dv_px").to_numpy()).sum()


def test_independent_noise_has_nothing_in_common(planted_model) -> None:
    model = planted_model
    assert model.common_share is not None
    assert model.common_share.value < 0.02
    assert model.common_share.high < 0.05


def test_it_is_unknown_where_no_pose_error_was_fitted(fast_model) -> None:
    assert fast_model.common_share is None


def test_outliers_do_not_change_it(common_run) -> None:
    read = training_tables(RunFolder(common_run), tracker="oracle", speed=1)
    rigid = read["rigid"].with_columns(pl.col("error_uu", "error_vv") * 100.0)
    with_outliers, without = (
        CommonErrors.of(table, read["noise_sums"], groups=NO_GROUPS, level=0.95).share
        for table in (rigid, read["rigid"])
    )
    assert with_outliers == without


def test_errors_that_are_all_zero_have_no_common_share(common_run) -> None:
    """A perfect tracker: nothing is a share of nothing, and the model can be written."""
    read = training_tables(RunFolder(common_run), tracker="oracle", speed=1)
    rigid = read["rigid"].with_columns(pl.col("^rigid_.*$") * 0.0)
    squares = read["noise_sums"].with_columns(pl.col("uu", "uv", "vv") * 0.0)
    assert CommonErrors.of(rigid, squares, groups=NO_GROUPS, level=0.95) is None


def test_a_white_shift_is_told_from_a_walk(common_run) -> None:
    read = training_tables(RunFolder(common_run), tracker="oracle", speed=1)
    common = CommonErrors.of(read["rigid"], read["noise_sums"], groups=NO_GROUPS, level=0.95)
    white, walk, both = common.variances([1.0, 0.0, 2.0], [0.0, 1.0, 3.0])
    assert white.value == pytest.approx(COMMON, rel=0.25)
    assert white.low > 0.0
    assert walk.value < 0.1 * white.value
    assert both.value == pytest.approx(2.0 * white.value + 3.0 * walk.value)


@pytest.mark.parametrize(("white", "walk"), [(0.04, 0.0), (0.0, 0.01), (0.02, 0.005)])
def test_products_that_grow_with_age_are_a_walk(white: float, walk: float) -> None:
    """Exact means at five ages, the same in all scenes."""
    ages, scenes, n = np.array([1, 2, 4, 8, 16]), 8, 1000
    rows = [(f"{scene}", int(age), 2.0 * n * (white + walk * age)) for scene in range(scenes) for age in ages]
    table = pl.DataFrame(rows, schema=["scene", "age", "product"], orient="row")
    rigid = table.select(
        "scene", "age", dataset=pl.lit("d"), block=0, n=pl.lit(n), fitted_to=pl.lit("own"),
        rigid_uu=pl.col("product") / 2, rigid_vv=pl.col("product") / 2,
    )  # fmt: skip
    sums = table.select(
        "scene", "age", dataset=pl.lit("d"), block=0, n=pl.lit(n), product=pl.lit("error"),
        uu=pl.lit(100.0), vv=pl.lit(100.0),
    )  # fmt: skip
    common = CommonErrors.of(rigid, sums, groups=NO_GROUPS, level=0.95)
    assert [one.value for one in common.variances([1.0, 0.0], [0.0, 1.0])] == pytest.approx([white, walk], abs=1e-9)
