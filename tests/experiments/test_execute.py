"""Whole runs on small simulated scenes: repeatable to the byte, resumable, and independent of how they are spread."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import polars as pl
import pytest
from tests.lean import with_findings, with_models

from tracknoise.experiments import run_findings
from tracknoise.experiments.execute import execute
from tracknoise.experiments.run_statistics import compute_statistics
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.tables.enumerations import TrimAmong
from tracknoise.tables.findings_schema import COUNTS, CURVES, ERRORS, LIFETIMES, OUTLIERS, SUMMARY, TRIMS
from tracknoise.tables.store import (
    NOISE_TABLES,
    SEQUENCE_TABLES,
    RunFolder,
)
from tracknoise.topics.catalogue import RUN_TABLES

TEXT = """
name = "small"
speeds = [1, 2]
[dataset]
reader = "simulated"
[dataset.options]
motions = ["sideways", "arvr"]
frames = 8
width = 160
height = 120
supersampling = 1
[[trackers]]
kind = "lucas-kanade"
options = { min_features = 70, max_features = 80 }
[[trackers]]
kind = "correspondence"
options = { max_features = 60 }
[statistics]
min_features = 5
"""


OF_MODELS = {Path("statistics", f"{name}.parquet") for name in ("advice", "findings")}
"""Files that say what to set in estimators, beside other things."""


class Silent:
    """Listens to a run and keeps which sequences it measured."""

    def __init__(self):
        self.keys = []

    def planned(self, keys, done):
        pass

    def frame(self, key, done, total, first):
        pass

    def measured(self, key, entry):
        self.keys.append(key)

    def failed(self, keys, cause):
        pass

    def remark(self, text):
        pass


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return parse_experiment(TEXT, place="small.toml")


@pytest.fixture(scope="module")
def finished(experiment, made_once) -> RunFolder:
    """The whole run, which no test changes."""

    def write(path: Path) -> None:
        before = cv2.getNumThreads()
        cv2.setNumThreads(1)
        with with_findings(), with_models():
            outcome = execute(experiment, RunFolder(path), listener=Silent())
        cv2.setNumThreads(before)
        assert outcome.measured == ["arvr-00@default", "sideways-00@default"]

    return RunFolder(made_once("small-run", write))


def tables(run: RunFolder) -> dict[Path, bytes]:
    return {path.relative_to(run.path): path.read_bytes() for path in sorted(run.path.rglob("*.parquet"))}


def test_a_second_run_is_identical_to_the_byte_with_other_counts_of_threads(finished, tmp_path):
    """Of OpenCV and of BLAS, each of which reads its count when a program starts."""
    of_sequences = 2 * len(
        [*SEQUENCE_TABLES, *NOISE_TABLES, "patches", "film", "inputs", "ratio_sums", "covariance_sums"]
    )
    assert len(tables(finished)) == of_sequences + len(RUN_TABLES)
    (tmp_path / "small.toml").write_text(TEXT)
    program = "import cv2; cv2.setNumThreads(3); from tracknoise.cli.app import main; main()"
    command = [sys.executable, "-c", program, "run", tmp_path / "small.toml", "--out", tmp_path / "run"]
    options = ["--workers", "1", "--no-report", "--quiet"]
    subprocess.run([*command, *options], check=True, env={**os.environ, "OPENBLAS_NUM_THREADS": "3"})
    assert tables(RunFolder(tmp_path / "run")) == tables(finished)


def test_findings_are_the_same_if_another_process_takes_part(finished, experiment, tmp_path, monkeypatch):
    monkeypatch.setattr(run_findings, "_MANY_FRAMES", 1)
    run = RunFolder(shutil.copytree(finished.path, tmp_path / "run"))
    with with_models():
        run_findings.compute_findings(run, experiment, compute_statistics(run, experiment), workers=2)
    assert tables(run) == tables(finished)
    assert run.manifest().statistics == finished.manifest().statistics


def test_every_condition_has_every_table(finished):
    conditions = {(tracker, speed) for tracker in ("lucas-kanade", "correspondence") for speed in (1, 2)}
    for table in (CURVES, LIFETIMES, OUTLIERS, TRIMS, ERRORS, COUNTS, SUMMARY):
        assert set(finished.statistics(table).select("tracker", "speed").iter_rows()) == conditions, table.name


def test_observations_lie_on_the_frames_their_speed_sees_and_start_without_error(finished):
    rows = pl.concat(finished.sequence_tables("observations"))
    assert rows.filter(pl.col("speed") == 2)["frame"].unique().sort().to_list() == [0, 2, 4, 6]
    assert rows["age"].max() == 7
    first = rows.filter((pl.col("age") == 0) & (pl.col("truth") == "valid"))
    assert len(first) > 100
    assert first.select(pl.max_horizontal(pl.col("du_px", "dv_px").abs())).to_series().max() < 1e-9


def test_errors_are_observed_minus_true_and_null_where_truth_is_unknown(finished):
    rows = pl.concat(finished.sequence_tables("observations"))
    known = rows.filter(pl.col("u_true_px").is_not_null())
    for axis in "uv":  # smaller differences are rounding, and 0
        assert (known[f"{axis}_px"] - known[f"{axis}_true_px"] - known[f"d{axis}_px"]).abs().max() < 1e-9
    unknown = rows.filter(pl.col("truth").is_in(["no_depth", "edge", "behind_camera"]))
    assert unknown["du_px"].null_count() == len(unknown)
    assert not rows["du_px"].is_nan().any()


def test_tables_of_one_condition_agree_with_each_other(finished):
    keys = ["scene", "tracker", "speed"]
    frames = pl.concat(finished.sequence_tables("frames")).sort(*keys, "frame")
    tracks = pl.concat(finished.sequence_tables("tracks"))
    rows = pl.concat(finished.sequence_tables("observations"))
    seen = rows.group_by(*keys, "frame").len().sort(*keys, "frame")
    assert frames.filter(pl.col("alive") > 0)["alive"].to_list() == seen["len"].to_list()
    assert frames["new"].sum() == len(tracks)
    assert frames["outliers"].sum() == (tracks["end"] == "outlier").sum()
    assert tracks["lifetime"].sum() == len(rows)
    previous = frames.with_columns(pl.col("alive").shift(1).over(keys).fill_null(0))
    assert frames["offered"].to_list() == previous["alive"].to_list()


def test_the_percentile_of_trimming_may_be_of_the_tracks_that_were_followed(experiment, finished):
    assert experiment.statistics.trim_among == TrimAmong.followed
    keys = ["scene", "tracker", "speed"]
    rows = pl.concat(finished.sequence_tables("observations")).filter(pl.col("age") > 0, truth="valid")
    followed = rows.select(*keys, "track").unique()
    tracks = pl.concat(finished.sequence_tables("tracks")).join(followed, on=[*keys, "track"])
    expected = tracks.group_by(keys).agg(cut=pl.col("max_error_px").quantile(0.9, "linear"), n=pl.len())
    for row in finished.statistics(TRIMS).join(expected, on=keys).iter_rows(named=True):
        assert row["among"] == "followed"
        assert row["threshold_px"] == pytest.approx(row["cut"])
        assert row["n_measured"] - row["n_anchor_only"] == row["n"]
    assert expected.height == finished.statistics(TRIMS).height == 8


@pytest.mark.usefixtures("found")
def test_a_run_that_lost_a_sequence_is_completed_by_workers_with_the_settings_that_it_recorded(finished, tmp_path):
    recorded = parse_experiment(finished.experiment_toml(), place="recorded")
    assert recorded.trackers[0].options["window_px"] == 15
    assert recorded.trackers[0].options["rejection"]["consensus"] == "refined"
    assert recorded.dataset.options["noise_sigma"] == 2.0
    run = RunFolder(shutil.copytree(finished.path, tmp_path / "run"))
    manifest = run.manifest()
    del manifest.sequences["arvr-00@default"]
    run.write_manifest(manifest)
    listener = Silent()
    execute(recorded, run, listener=listener, workers=2)  # without models, whose fits take half the time
    assert listener.keys == ["arvr-00@default"]
    assert run.manifest().settings_hash == finished.manifest().settings_hash
    for path, content in tables(finished).items():
        assert path in OF_MODELS or (run.path / path).read_bytes() == content, path
