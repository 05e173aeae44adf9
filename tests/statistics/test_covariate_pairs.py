from dataclasses import replace

import polars as pl
import pytest
from polars.testing import assert_frame_equal

import tracknoise
from tracknoise.experiments.geometry_tables import frame_geometry
from tracknoise.statistics.noise_sums import PER_OCTAVE, noise_tables
from tracknoise.tables.schema import CHANGE_TERMS


@pytest.fixture(scope="module")
def tables() -> dict[str, pl.DataFrame]:
    """Of an oracle that reports the texture."""
    sequence = tracknoise.open_sequence(
        "simulated", motions=["forward"], frames=10, width=160, height=120, worlds=1, supersampling=1
    )
    oracle = tracknoise.Oracle(n_features=60, covariance_px2=((0.04, 0.0), (0.0, 0.04)), texture_exponent=-1.0)
    measurement = tracknoise.measure(sequence, oracle, speeds=[1, 2])
    prepared = replace(measurement.prepared, slowest=1)
    return noise_tables(prepared, frame_geometry(sequence, measurement.n_frames))


def test_pairs_add_up_to_single_covariates(tables: dict[str, pl.DataFrame]) -> None:
    pairs, single = tables["noise_pairs"], tables["noise_covariates"]
    assert pairs.select("first", "second").unique().rows() == [("motion_px", "min_eigenvalue")]
    assert pairs["speed"].unique().sort().to_list() == [1, 2]
    ends = {"before": pl.col("second_before"), "now": pl.col("second_now")}
    of_pairs = pairs.select("speed", "n", *CHANGE_TERMS, **ends)
    alone = single.filter(covariate="min_eigenvalue").with_columns(pl.col("before", "now") // PER_OCTAVE)
    found, expected = (
        table.group_by("speed", "before", "now").agg(pl.col("n", *CHANGE_TERMS).sum()).sort("speed", "before", "now")
        for table in (of_pairs, alone)
    )
    assert_frame_equal(found, expected, check_column_order=False)


def test_pairs_show_what_both_have_in_common(tables: dict[str, pl.DataFrame]) -> None:
    pairs = tables["noise_pairs"]
    classes = ["first_before", "first_now", "second_before", "second_now"]
    assert not pairs.select("speed", *classes).is_duplicated().any()
    assert pairs.select(classes).n_unique() > 10
    assert (pairs["n"] > 0).all()
