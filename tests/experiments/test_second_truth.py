"""An experiment with a second truth, from its file to the run folder."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.writers.sevenscenes import colour_poses, write_sevenscenes, write_sfm

from tracknoise.api.finished_run import open_run
from tracknoise.exceptions import SettingsError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.load import load_experiment, option_paths
from tracknoise.experiments.plan import plan
from tracknoise.experiments.resume import due
from tracknoise.tables.store import RunFolder

TEXT = """
name = "two"
keep = "KEEP"
[dataset]
reader = "sevenscenes"
root = "data"
[[trackers]]
kind = "oracle"
options = { n_features = 40 }
[statistics]
min_features = 2
[truth.second]
"""
FRAMES, SHIFT_M = 3, 0.02


def shifted() -> np.ndarray:
    """The colour camera's poses, each moved to the right by one more step."""
    poses = colour_poses(FRAMES)
    for index, pose in enumerate(poses):
        pose[:3, 3] += pose[:3, 0] * SHIFT_M * index
    return poses


@pytest.fixture
def experiment(tmp_path):
    """Writes a recording and an experiment with a second truth, and loads it."""

    def written(second: str, keep: str = "observations"):
        write_sevenscenes(tmp_path / "data" / "chess" / "seq-01", FRAMES)
        poses = shifted()
        names = (f"seq-01/frame-{index:06d}.color.png" for index in range(FRAMES))
        write_sfm(tmp_path / "sfm" / "chess_train.txt", dict(zip(names, poses, strict=True)), 525.0)
        quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
        (tmp_path / "poses/chess").mkdir(parents=True)
        np.savetxt(
            tmp_path / "poses/chess/seq-01.txt",
            np.column_stack([np.arange(FRAMES) / 30, poses[:, :3, 3], quaternions]),
            fmt="%.12g",
        )
        (tmp_path / "x.toml").write_text(TEXT.replace("KEEP", keep) + second)
        return load_experiment(tmp_path / "x.toml")

    return written


@pytest.mark.usefixtures("found")
@pytest.mark.parametrize(
    ("second", "keep"),
    [
        ('trajectory = "poses/{scene}.txt"', "observations"),
        ('options = { poses = "sfm", sfm_file = "sfm" }', "statistics"),
    ],
    ids=["trajectory", "options of the reader"],
)
def test_the_disagreement_is_that_of_the_poses(experiment, tmp_path, told, second, keep):
    loaded, folder = experiment(second, keep), RunFolder(tmp_path / "run")
    outcome = execute(loaded, folder, listener=told())
    assert not outcome.failures
    run = open_run(tmp_path / "run")
    found = run.table("two_truths", trimming="untrimmed", quantity="disagreement", statistic="mean", coordinate="u")
    by_age = dict(found.select("age", "value").rows())
    # at 2 m, 2 cm to the right move points by about 525 * 0.02 / 2 px to the left with every frame
    assert by_age[0] == pytest.approx(0.0, abs=1e-9)
    assert by_age[1] == pytest.approx(-525 * SHIFT_M / 2.1, rel=0.15)
    assert by_age[2] == pytest.approx(2 * by_age[1], rel=0.1)
    poses = run.table("pose_disagreement", quantity="translation", lag=1)
    assert poses["value"].item() == pytest.approx(SHIFT_M / np.sqrt(3), rel=0.05)
    (entry,) = folder.manifest().sequences.values()
    assert any(note.startswith("second truth: ") for note in entry.notes)
    assert any(str(path).startswith(str(tmp_path)) for path in option_paths(loaded))


@pytest.mark.usefixtures("lean")
def test_a_change_of_the_second_poses_makes_a_measurement_outdated(experiment, tmp_path, told):
    loaded, folder = experiment('trajectory = "poses/{scene}.txt"'), RunFolder(tmp_path / "run")
    execute(loaded, folder, listener=told())
    assert due(plan(loaded), folder, folder.manifest(), verify=False, remark=pytest.fail) == []
    file = tmp_path / "poses/chess/seq-01.txt"
    file.write_text(file.read_text().replace("0.03 ", "0.031 "))
    file.write_text("# changed\n" + file.read_text())
    again = told()
    execute(loaded, folder, listener=again)
    assert len(again.keys) == 1


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ("time_shift_s = 1.0", "truth.second: .*expected either trajectory or options"),
        ('trajectory = "{place}.txt"', r"truth.second.trajectory: .*\{place\} is not a placeholder"),
        ('options = { poses = "sfm" }', "truth.second.options: .*sfm_file is None"),
        ('trajectory = "a.txt"\noptions = { calibration = "raw" }', "expected either trajectory or options"),
    ],
)
def test_settings_that_cannot_be_used(experiment, second, message):
    with pytest.raises(SettingsError, match=message):
        experiment(second)
