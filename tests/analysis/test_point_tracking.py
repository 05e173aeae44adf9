"""Metrics of point trackers in a run: from each sequence's own to means with intervals, and the report."""

import tomllib

import numpy as np
import pytest
from tests.lean import without_audit, without_depths, without_figure_files, without_geometry

import tracknoise as tn
from tracknoise.analysis.ratio_intervals import POINT_TRACKING_METRICS
from tracknoise.cli.app import main
from tracknoise.report.page import write_report
from tracknoise.sequences.simulated import Simulated
from tracknoise.tables.store import RunFolder

TOML = """
name = "points"
[dataset]
reader = "simulated"
[dataset.options]
motions = ["sideways", "forward", "arvr"]
worlds = 2
frames = 6
width = 120
height = 90
supersampling = 1
[[trackers]]
kind = "lucas-kanade"
[statistics]
min_features = 5
tap_vid = true
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("points")
    (folder / "points.toml").write_text(TOML)
    command = [
        "run",
        str(folder / "points.toml"),
        "--out",
        str(folder / "run"),
        "--workers",
        "1",
        "--quiet",
        "--no-report",
    ]
    with without_audit(), without_depths(), without_geometry(), pytest.raises(SystemExit) as ended:
        main(command)
    assert not ended.value.code
    return folder / "run"


def test_metrics_are_means_over_sequences_with_intervals(run):
    table = RunFolder(run).statistics(POINT_TRACKING_METRICS)
    options = tomllib.loads(TOML)["dataset"]["options"]
    reader = Simulated(**{**options, "motions": tuple(options["motions"])})
    each = [tn.tap_metrics(tn.measure(reader.open(scene), tn.LucasKanade())) for scene in reader.sequences()]
    for metric in ("delta_avg_reported", "average_jaccard", "occlusion_accuracy", "expected_feature_age"):
        row = table.filter(metric=metric, raster="256x256").row(0, named=True)
        values = [one.filter(raster="256x256")[metric][0] for one in each]
        assert row["value"] == pytest.approx(np.mean(values))
        assert row["n_scenes"] == 6
        assert row["low"] < row["value"] < row["high"]


def test_the_report_shows_them_where_they_were_asked_for(run):
    with without_figure_files():
        page = write_report(RunFolder(run)).read_text()
    assert "Metrics of TAP-Vid (query mode first)" in page
    assert (run / "report" / "tables" / "point-tracking-metrics.csv").exists()
