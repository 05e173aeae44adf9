import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.histograms import HISTOGRAM_BINS, error_histogram, merge_errors
from tracknoise.tables.findings_schema import ERRORS
from tracknoise.tables.schema import OBSERVATIONS, TRACKS, empty


def test_bins_cover_everything_once_with_ten_to_a_decade() -> None:
    low, high = HISTOGRAM_BINS["bin_low_px"].to_list(), HISTOGRAM_BINS["bin_high_px"].to_list()
    assert (low[0], low[1], low[11], low[31], low[-1], high[-1]) == (0.0, 0.001, 0.01, 1.0, 1000.0, None)
    assert high[:-1] == low[1:]
    assert len(low) == 62
    np.testing.assert_allclose(np.diff(np.log10(low[1:])), 0.1, atol=1e-5)


@pytest.mark.parametrize(
    ("error_px", "low_px"),
    [(0.0, 0.0), (9e-4, 0.0), (1e-3, 1e-3), (0.999, 0.794328), (1.0, 1.0), (999.9, 794.328), (1e3, 1e3), (1e9, 1e3)],
)
def test_a_bin_holds_its_lower_bound_and_not_its_upper(tracks, error_px: float, low_px: float) -> None:
    table = error_histogram(tracks(max_error_px=[error_px])).filter(pl.col("n") > 0)
    assert table.select("bin_low_px", "n").rows() == [(low_px, 1)]


def test_every_bin_is_there_and_tracks_without_an_error_are_not_counted(tracks) -> None:
    table = error_histogram(tracks(max_error_px=[0.5, 0.5, None], kept=[True, False, True]))
    assert table.height == HISTOGRAM_BINS.height
    assert table["n"].sum() == 2
    assert table.select("bin_low_px", "bin_high_px").equals(HISTOGRAM_BINS.select("bin_low_px", "bin_high_px"))


def test_a_condition_without_a_measured_track_has_empty_bins(tracks) -> None:
    table = error_histogram(tracks(max_error_px=[None]))
    assert table["n"].to_list() == [0] * HISTOGRAM_BINS.height


def test_histograms_of_scenes_add_up(tracks) -> None:
    errors = np.random.default_rng(9).lognormal(sigma=3, size=300).tolist()
    parts = [tracks(scene=scene, max_error_px=errors[start::3]) for start, scene in enumerate("abc")]
    together = error_histogram(pl.concat(parts))
    assert merge_errors(error_histogram(part) for part in reversed(parts)).equals(together)
    assert together["n"].to_list() == sum(error_histogram(part)["n"] for part in parts).to_list()
    bounds = [*HISTOGRAM_BINS["bin_low_px"], np.inf]
    assert together["n"].to_list() == np.histogram(errors, bounds)[0].tolist()


def test_no_tracks_give_an_empty_table() -> None:
    assert error_histogram(empty(TRACKS)).equals(empty(ERRORS))
    assert merge_errors([]).equals(empty(ERRORS))


def test_another_table_is_refused() -> None:
    with pytest.raises(SchemaError, match="tracks"):
        error_histogram(empty(OBSERVATIONS))
    with pytest.raises(SchemaError, match="errors"):
        merge_errors(empty(TRACKS))
