"""The image beside the histogram of trimming."""

import io

import polars as pl
from tests.report.synthetic import DEGENERATE

from tracknoise.report.figures import distributions
from tracknoise.report.figures.frames import trimmed_frame
from tracknoise.report.report_data import ReportData


def test_the_image_has_the_features_that_trimming_kept_and_dropped(make_run):
    data = ReportData.of(make_run(**DEGENERATE["one of everything"]))
    (figure,) = distributions.trimming_figures(data)
    (entry,) = data.sequences.values()
    observed = data.run.sequence_table("observations", entry.key).filter(frame=entry.snapshot_frame)
    observed = observed.drop_nulls("du_px")
    tables = [pl.read_csv(io.StringIO(text)) for text in figure.spec["datasets"].values() if isinstance(text, str)]
    (drawn,) = [table for table in tables if "trimming" in table.columns]
    assert drawn.height == observed.height
    dropped = drawn.filter(trimming="dropped")
    assert 0 < dropped.height == observed.filter(~pl.col("kept")).height
    assert "Lines connect dropped features with their true positions." in figure.shows


def test_without_trimming_or_single_observations_there_is_no_image(make_run):
    assert trimmed_frame(ReportData.of(make_run(**DEGENERATE["nothing trimmed"]))) is None
    data = ReportData.of(make_run(**DEGENERATE["statistics alone are kept"]))
    assert trimmed_frame(data) is None
    (figure,) = distributions.trimming_figures(data)
    assert "true positions." not in figure.shows
