"""What an estimator gains from a noise model, as a user asks for it."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from benchmarks.noise import prove as program
from benchmarks.noise.proof import prove
from benchmarks.noise.windows import Cut, divided, errors_of, recorded_problems
from tests.estimators.models import TRAINING, made
from tests.lean import measured_only, only_topics

from tracknoise.exceptions import SettingsError, StoreError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.settings import parse_experiment
from tracknoise.tables.store import RunFolder

TOML = """
name = "small"
keep = "{keep}"
[dataset]
reader = "simulated"
[dataset.options]
motions = {motions}
worlds = {worlds}
frames = {frames}
width = 200
height = 150
supersampling = 1
[[trackers]]
kind = "lucas-kanade"
"""


class _Silent:
    def __getattr__(self, name):
        return lambda *arguments: None


def _run(out: Path, **options: object) -> Path:
    text = TOML.format(**options)
    with only_topics():
        execute(parse_experiment(text, place="small.toml"), RunFolder(out), workers=1, listener=_Silent())
    return out


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("proof") / "run"
    return _run(out, keep="observations", motions=["sideways", "forward"], worlds=2, frames=8)


def _model(*scenes: str):
    training = replace(TRAINING, dataset="simulated", tracker="lucas-kanade", scenes=scenes)
    return made(first=0.05, white=0.05, walk=0.05, training=training)


def test_windows_have_the_true_positions_of_the_run(run: Path) -> None:
    folder = RunFolder(run)
    cut = Cut(tracker="lucas-kanade", speed=1, length=6, most_px=3.0)
    found = recorded_problems(folder, cut)
    assert {problem.scene for problem in found} == {"sideways-00", "sideways-01", "forward-00", "forward-01"}
    errors = np.concatenate([part.reshape(-1, 2) for problem in found for part in errors_of(problem)])
    tables = [table.select("du_px", "dv_px").drop_nulls() for table in folder.sequence_tables("observations")]
    stated = pl.concat(tables).to_numpy()
    assert np.linalg.norm(errors, axis=1).max() <= 3.0
    nearest = np.abs(errors[:50, None] - stated[None]).max(axis=2).min(axis=1)
    assert nearest.max() < 1e-6


def test_windows_hold_no_more_tracks_than_asked_for(run: Path) -> None:
    cut = Cut(tracker="lucas-kanade", speed=1, length=6, most_tracks=25)
    assert all(problem.n_tracks <= 25 for problem in recorded_problems(RunFolder(run), cut))


def test_prints_the_answer_and_writes_it_beside_the_model(run: Path, tmp_path: Path, capsys) -> None:
    file = tmp_path / "lk.noise.json"
    _model("sideways-00", "forward-00").write(file)
    code = program.main([str(run), str(file), "--window", "6", "--tracks", "30"])
    printed, told = capsys.readouterr()
    assert code == 0, told
    assert "Whole tracks: position errors are" in printed
    assert "one sigma, tuned for the newest pose" in printed
    document = json.loads((tmp_path / "lk.noise.proof.json").read_text())
    assert document["format"] == "tracknoise.proof/1"
    assert document["training_scenes"] == ["forward-00", "sideways-00"]
    assert document["tested_scenes"] == ["forward-01", "sideways-01"]
    assert {row["arm"] for row in document["poses"]} >= {"0", "1", "6", "8d"}
    assert all(0.0 <= row["value"] <= 1.0 for row in document["distances"] if row["quantity"] == "coverage_95")


def test_the_model_is_not_replaced_by_its_proof(run: Path, tmp_path: Path, capsys) -> None:
    file = tmp_path / "lk.noise.json"
    _model("sideways-00").write(file)
    written = file.read_bytes()
    assert program.main([str(run), str(file), "--out", str(file)]) == 1
    assert "found an input of this command" in capsys.readouterr().err
    assert file.read_bytes() == written


def test_says_so_if_the_model_has_seen_all_scenes(run: Path) -> None:
    scenes = ("sideways-00", "sideways-01", "forward-00", "forward-01")
    found = prove(RunFolder(run), _model(*scenes), length=6, most_tracks=25)
    assert any("was fitted to all scenes" in sentence for sentence in found.sentences)
    assert not set(found.training) & set(found.tested)


def test_scenes_of_another_data_set_are_not_those_of_the_model(run: Path) -> None:
    model = _model("sideways-00", "sideways-01", "forward-00", "forward-01")
    other = replace(model, training=replace(model.training, dataset="tum"))
    windows = recorded_problems(RunFolder(run), Cut(tracker="lucas-kanade", speed=1, length=6, most_tracks=25))
    for training, is_said in ((model.training, True), (other.training, False)):
        limits = divided(RunFolder(run), windows, training).limits
        assert any("was fitted to" in sentence for sentence in limits) == is_said


def test_windows_whose_tracks_do_not_determine_all_poses_are_left_out(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where a tracker lost all features in a blurred frame."""
    cut = Cut(tracker="lucas-kanade", speed=1, length=6)
    assert len(recorded_problems(RunFolder(run), cut)) == 4
    read = RunFolder.sequence_table

    def with_a_gap(self: RunFolder, name: str, key: str) -> pl.DataFrame:
        table = read(self, name, key)
        blurred = name == "observations" and key.startswith("sideways-00")
        return table.filter(pl.col("frame") != 3) if blurred else table

    monkeypatch.setattr(RunFolder, "sequence_table", with_a_gap)
    found = recorded_problems(RunFolder(run), cut)
    assert {problem.scene for problem in found} == {"sideways-01", "forward-00", "forward-01"}


def test_points_that_are_fitted_to_the_tracks_prove_nothing(run: Path, tmp_path: Path) -> None:
    folder = RunFolder(shutil.copytree(run, tmp_path / "run"))
    manifest = folder.manifest()
    manifest.sequences = {key: replace(entry, truth="triangulated") for key, entry in manifest.sequences.items()}
    folder.write_manifest(manifest)
    with pytest.raises(SettingsError, match="found true positions that are fitted to the tracks"):
        prove(folder, _model("sideways-00"), length=6)


SHUTTER = """
name = "turned"
keep = "observations"
[[views]]
rotation = 0
[[views]]
rotation = 90
[dataset]
reader = "simulated"
[dataset.options]
motions = ["fixating"]
worlds = 1
frames = 6
width = 160
height = 100
supersampling = 1
[dataset.options.imaging]
rate_hz = 20.0
readout_s = 0.04
[[trackers]]
kind = "lucas-kanade"
options = { max_features = 40, min_features = 30 }
"""


@pytest.fixture(scope="module")
def turned(tmp_path_factory) -> RunFolder:
    """A scene upright and turned, with a rolling shutter that the truth knows."""
    folder = RunFolder(tmp_path_factory.mktemp("turned") / "run")
    with measured_only():
        execute(parse_experiment(SHUTTER, place="turned.toml"), folder, workers=1, listener=_Silent())
    return folder


def test_turned_views_are_left_out(turned: RunFolder) -> None:
    """Their noise has other axes than that of a model."""
    assert len(turned.manifest().sequences) == 2
    found = recorded_problems(turned, Cut(tracker="lucas-kanade", speed=1, length=6))
    assert [(problem.camera.width, problem.camera.height) for problem in found] == [(160, 100)]


def test_errors_are_those_of_the_run_under_a_rolling_shutter(turned: RunFolder) -> None:
    cut = Cut(tracker="lucas-kanade", speed=1, length=6, most_px=3.0)
    errors = np.concatenate([part.reshape(-1, 2) for own in recorded_problems(turned, cut) for part in errors_of(own)])
    stated = (
        turned.sequence_table("observations", "fixating-00@default").select("du_px", "dv_px").drop_nulls().to_numpy()
    )
    nearest = [np.abs(stated - error).max(axis=1).min() for error in errors]
    assert max(nearest) < 1e-9


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tracker": "correspondence"}, "found no observation of correspondence at speed 1"),
        ({"speed": 2.0}, "found no observation of lucas-kanade at speed 2"),
    ],
)
def test_tracks_that_the_run_does_not_have(run: Path, changes: dict, message: str) -> None:
    model = _model("sideways-00")
    with pytest.raises(SettingsError, match=message):
        prove(RunFolder(run), replace(model, training=replace(model.training, **changes)), length=6)


def test_a_model_without_noise_is_refused(run: Path) -> None:
    with pytest.raises(SettingsError, match="found a model whose components are all 0"):
        prove(RunFolder(run), made(training=_model("sideways-00").training), length=6)


def test_a_tracker_without_errors_is_refused(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = RunFolder.sequence_table

    def exact(self: RunFolder, name: str, key: str) -> pl.DataFrame:
        table = read(self, name, key)
        return table.with_columns(pl.col("du_px", "dv_px") * 0.0) if name == "observations" else table

    monkeypatch.setattr(RunFolder, "sequence_table", exact)
    with pytest.raises(SettingsError, match="found no errors of lucas-kanade, expected a tracker that errs"):
        prove(RunFolder(run), _model("sideways-00"), length=6)


def test_windows_longer_than_the_recording_are_refused(run: Path) -> None:
    with pytest.raises(SettingsError, match="found usable windows at no times in no scenes, expected two times"):
        prove(RunFolder(run), _model("sideways-00"), length=20)


def test_a_run_without_observations_is_refused(tmp_path: Path) -> None:
    out = _run(tmp_path / "run", keep="statistics", motions=["arvr"], worlds=1, frames=2)
    with pytest.raises(StoreError, match="keeps no observations"):
        prove(RunFolder(out), _model("sideways-00"), length=6)
