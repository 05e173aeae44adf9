"""The table of poses holds the camera path as the sequence has it."""

import numpy as np
import pytest

from tracknoise.api.finished_run import open_run
from tracknoise.experiments.execute import execute
from tracknoise.experiments.plan import open_batch, plan
from tracknoise.experiments.settings import parse_experiment
from tracknoise.geometry.pose import from_quaternion
from tracknoise.sequences.folder import write_folder
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.findings_schema import COUNTS
from tracknoise.tables.store import RunFolder

TEXT = """
name = "poses"
[dataset]
reader = "simulated"
[dataset.options]
motions = ["arvr"]
frames = 6
width = 80
height = 60
[[views]]
rotation = 90
direction = "backward"
[[trackers]]
kind = "lucas-kanade"
[statistics]
min_features = 2
"""


class Silent:
    """Listens to a run and says nothing."""

    def __getattr__(self, name):
        return lambda *arguments: None


def test_poses_come_back(tmp_path) -> None:
    experiment = parse_experiment(TEXT, place="poses.toml")
    run = RunFolder(tmp_path / "run")
    execute(experiment, run, listener=Silent())
    tasks = plan(experiment)
    (sequence,) = open_batch(tasks)
    table = run.sequence_table("poses", tasks[0].key)
    assert table["frame"].to_list() == list(range(6))
    assert table.select("rotation", "direction").unique().rows() == [(90, "backward")]
    assert table["qw"].min() >= 0
    quaternions = table.select("qx", "qy", "qz", "qw").to_numpy()
    found = from_quaternion(table.select("x_m", "y_m", "z_m").to_numpy(), quaternions)
    np.testing.assert_allclose(found, sequence.world_from_camera, atol=1e-12)
    assert np.linalg.norm(quaternions, axis=1) == pytest.approx(1)


def test_frames_without_a_pose_are_missing_in_tables_and_counted(tmp_path) -> None:
    scene = tmp_path / "data" / "scene"
    write_folder(
        open_sequence("simulated", motions=["sideways"], frames=6, width=80, height=60, supersampling=1), scene
    )
    lines = (scene / "poses.txt").read_text().splitlines()
    lines[3] = " ".join(["nan"] * 7)
    (scene / "poses.txt").write_text("\n".join(lines))
    text = f'name = "gap"\n[dataset]\nreader = "folder"\nroot = "{scene}"\n[[trackers]]\nkind = "lucas-kanade"'
    run = RunFolder(tmp_path / "run")
    execute(parse_experiment(text, place="gap.toml"), run, listener=Silent())
    ((key, entry),) = run.manifest().sequences.items()
    assert "1 of 6 frames has no pose: its observations have no true position" in entry.notes
    poses = run.sequence_table("poses", key)
    assert poses["x_m"].is_null().to_list() == poses["qw"].is_null().to_list() == [False, False, True] + [False] * 3
    observations = run.sequence_table("observations", key)
    counted = run.statistics(COUNTS).filter(kind="truth", name="no_pose")["n"].sum()
    assert counted == observations.filter(truth="no_pose").height > 0
    figures = open_run(run.path).figures()
    assert figures.filter(figure="trajectory")["absent"].to_list() == [None]
