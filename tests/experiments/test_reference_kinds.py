"""A truth that favours one kind of tracks decides no comparison of trackers."""

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation
from tests.lean import only_topics, with_findings, without_audit

import tracknoise
from tracknoise.analysis.factors import DEPENDENCE
from tracknoise.analysis.paired_tests import DISAGREE
from tracknoise.experiments.compare_runs import compare
from tracknoise.experiments.execute import execute
from tracknoise.experiments.reference_kinds import kind_tables
from tracknoise.experiments.settings import parse_experiment
from tracknoise.measurement import refined_poses
from tracknoise.measurement.reference_tracks import FOLLOWED, MATCHED
from tracknoise.measurement.refined_poses import RefinedPoses
from tracknoise.report.report_data import ReportData
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.enumerations import Verdict
from tracknoise.tables.manifest import PoseFit
from tracknoise.tables.store import RunFolder
from tracknoise.topics.factor_topic import EFFECTS_OF_FACTORS, accuracy
from tracknoise.topics.interval_topic import NUMBERS

TEXT = """
name = "kinds"
[dataset]
reader = "simulated"
[dataset.options]
motions = ["arvr", "forward", "sideways"]
worlds = 2
frames = 6
width = 120
height = 90
supersampling = 1
[[trackers]]
kind = "oracle"
name = "small"
options = {n_features = 60, covariance_px2 = [[0.04, 0.0], [0.0, 0.04]]}
[[trackers]]
kind = "oracle"
name = "large"
options = {n_features = 60, covariance_px2 = [[0.25, 0.0], [0.0, 0.25]]}
[statistics]
min_features = 2
"""


class Silent:
    """Listens to a run and says nothing."""

    def __getattr__(self, name):
        return lambda *arguments: None


def turned(poses: np.ndarray, degrees: float) -> np.ndarray:
    """Poses with an error of each rotation of its own."""
    noise = np.tile(np.eye(4), (len(poses), 1, 1))
    angles = np.deg2rad(degrees) * np.random.default_rng(0).standard_normal((len(poses), 3))
    noise[:, :3, :3] = Rotation.from_rotvec(angles).as_matrix()
    return poses @ noise


def finished(path, monkeypatch, degrees: float) -> RunFolder:
    """A run whose poses were refined, to the exact ones; those of matched references are wrong by some degrees."""

    def refined(sequence, *_, **__):
        poses = sequence.world_from_camera
        by_kind = {FOLLOWED: poses, MATCHED: turned(poses, degrees)}
        return RefinedPoses.of(sequence, poses, pose_halves=(poses, poses), by_kind=by_kind), PoseFit(True, 100.0)

    monkeypatch.setattr(refined_poses, "refined", refined)
    run = RunFolder(path)
    with with_findings(), only_topics(EFFECTS_OF_FACTORS, NUMBERS), without_audit():
        execute(parse_experiment(TEXT, place="kinds.toml"), run, listener=Silent(), workers=1)
    return run


def core_of(run: RunFolder) -> dict[str, object]:
    return run.statistics(DEPENDENCE).filter(factor="tracker", statistic="core").row(0, named=True)


def test_errors_by_one_kind_are_those_by_its_poses():
    sequence = open_sequence("simulated", motions=("arvr",), frames=6, width=160, height=120, supersampling=1)
    other = turned(sequence.world_from_camera, 0.3)
    tracker = tracknoise.LucasKanade(min_features=50, max_features=80)
    one = tracknoise.measure(RefinedPoses.of(sequence, sequence.world_from_camera), tracker, truth="birth")
    expected = tracknoise.measure(RefinedPoses.of(sequence, other), tracker, truth="birth").moments
    view = RefinedPoses.of(sequence, sequence.world_from_camera, by_kind={FOLLOWED: other})
    found = kind_tables(view, one.prepared, "projected")["kind_moments"].drop("references")
    alike = expected.filter(pl.col("n") > 0, population="projected", trimming="untrimmed")
    joined = found.join(alike, on=["trimming", "at", "n"], suffix="_expected").filter(pl.col("at") > 0)
    assert joined.height >= 3
    for name in ("mean_u", "mean_v", "m_uu", "m_vv"):
        assert joined[name].to_numpy() == pytest.approx(joined[f"{name}_expected"].to_numpy(), rel=1e-6)


def test_where_kinds_disagree_a_comparison_is_undecided_and_this_is_said(tmp_path, monkeypatch):
    run = finished(tmp_path / "run", monkeypatch, 3.0)
    row = core_of(run)
    assert row["verdict"] == "undecided"
    assert row["why"] == f"{DISAGREE} small and large" or row["why"] == f"{DISAGREE} large and small"
    found = accuracy(ReportData.of(run), {})
    assert found.answer.verdict == Verdict.undecided
    assert "References of the two kinds disagree about" in found.text


def test_where_kinds_agree_it_is_decided(tmp_path, monkeypatch):
    run = finished(tmp_path / "run", monkeypatch, 0.001)
    row = core_of(run)
    assert (row["verdict"], row["better"]) == ("yes", "small")
    same = compare(run.path, run.path, trackers=("small", "large"))
    assert {row.verdict for row in same.rows if row.statistic == "core"} == {"worse"}


def test_runs_are_compared_by_each_kind_too(tmp_path, monkeypatch):
    run = finished(tmp_path / "run", monkeypatch, 3.0)
    (core,) = (row for row in compare(run.path, run.path, trackers=("small", "large")).rows if row.statistic == "core")
    assert core.verdict == "undecided"
    assert core.why == f"{DISAGREE} small and large"
