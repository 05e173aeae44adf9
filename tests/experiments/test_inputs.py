"""Input files of options: tracks of other front ends, Gazebo models and networks, of each sequence its own."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from tests.contract.test_sequences import rosbag
from tests.trackers.imports.test_bags import cloud, context, written
from tests.trackers.networks import keypoint_network, match_network, require_onnx, with_external_data
from tests.writers.bags import Format

from tracknoise.experiments.inputs import InputCheck, digest_of, input_tables, recording
from tracknoise.experiments.plan import Task, make_trackers, open_batch, plan
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.tracker import SequenceContext

TEXT = """
name = "x"
[dataset]
reader = "simulated"
options = { motions = ["sideways", "arvr"], world = "objects", models = "MODELS", frames = 2, width = 48, height = 32 }
[[trackers]]
kind = "imported"
options = { path = "TRACKS/{scene}.csv" }
"""
BOX = """<sdf version="1.6"><model name="box"><link name="l"><visual name="v">
<geometry><box><size>1 1 1</size></box></geometry></visual></link></model></sdf>"""


NETWORKS = """
name = "x"
[dataset]
reader = "simulated"
options = { motions = ["sideways"], frames = 2, width = 48, height = 32 }
[[trackers]]
kind = "correspondence"
options = { descriptor = "network", matcher = "matches.onnx", detection = { network = "keypoints.onnx" } }
"""


@pytest.fixture
def experiment(tmp_path) -> Experiment:
    models, tracks = tmp_path / "models", tmp_path / "tracks"
    for folder in (models / "box", tracks):
        folder.mkdir(parents=True)
    (models / "box" / "model.config").write_text("<model><name>box</name><sdf>model.sdf</sdf></model>")
    (models / "box" / "model.sdf").write_text(BOX)
    for scene in ("sideways-00", "arvr-00"):
        (tracks / f"{scene}.csv").write_text("track,frame,u_px,v_px\n0,0,6,2\n0,1,5,2\n")
    return parse_experiment(TEXT.replace("MODELS", str(models)).replace("TRACKS", str(tracks)), place="x.toml")


def measured(
    task: Task, run: RunFolder, *, trackers: bool = True, shown: SequenceContext | None = None
) -> SequenceEntry:
    with recording([task], run) as recorder:
        (sequence,) = open_batch([task], change=recorder.recorded)
        sequence.image(0)
        for settings in make_trackers(task.experiment).values() if trackers else ():
            of_task = SequenceContext(sequence=task.sequence, size=(48, 32), n_frames=2, speed=1, seed=0, truth=None)
            settings.start(shown or of_task)
        (table,) = input_tables([task], recorder, [sequence])
    run.write_inputs(task.key, table)
    return SequenceEntry(task.sequence, 2, 48, 32, "raycast", 0, 0.0, inputs=digest_of(table))


@pytest.fixture
def changes(experiment, tmp_path):
    """What changed of each scene since it was measured, called when wanted."""
    run = RunFolder(tmp_path / "run")
    entries = [(task, measured(task, run)) for task in plan(experiment)]
    return lambda: {task.sequence.scene: InputCheck(run).change(task, entry) for task, entry in entries}


def test_tracks_count_for_the_scene_that_they_are_of(changes, tmp_path):
    assert set(changes().values()) == {None}
    file: Path = tmp_path / "tracks" / "arvr-00.csv"
    file.write_text(file.read_text().replace("5", "4"))
    assert changes() == {"sideways-00": None, "arvr-00": f"{file} changed"}


@pytest.mark.parametrize("change", ["content", "name"])
def test_models_count_for_all_scenes(changes, tmp_path, change):
    model = tmp_path / "models" / "box" / "model.sdf"
    model.write_text(BOX.replace("1 1 1", "1 1 2")) if change == "content" else model.rename(model.with_name("o.sdf"))
    expected = f"{model} {'changed' if change == 'content' else 'is missing'}"
    assert set(changes().values()) == {expected}


def test_a_record_that_is_damaged_or_of_another_measurement_proves_nothing(experiment, tmp_path):
    run = RunFolder(tmp_path / "run")
    task, other = plan(experiment)
    entry, elsewhere = measured(task, run), measured(other, run)
    table = run.inputs(other.key)
    assert InputCheck(run).change(task, entry) is None
    run.write_inputs(task.key, table)
    unknown = "the files that it was measured from are not recorded"
    assert InputCheck(run).change(task, entry) == unknown
    (tmp_path / "run" / "inputs" / f"{other.key}.parquet").write_bytes(b"PAR1")
    assert InputCheck(run).change(other, elsewhere) == unknown


@pytest.mark.parametrize("changed", ["keypoints.onnx", "matches.onnx"])
def test_networks_count_by_their_content(tmp_path, changed):
    require_onnx()
    files = {"keypoints.onnx": keypoint_network, "matches.onnx": match_network}
    for name, write in files.items():
        write(tmp_path / name)
    text = NETWORKS
    for name in files:
        text = text.replace(name, str(tmp_path / name))
    run, (task,) = RunFolder(tmp_path / "run"), plan(parse_experiment(text, place="x.toml"))
    entry = measured(task, run)
    assert InputCheck(run).change(task, entry) is None
    (tmp_path / changed).write_bytes((tmp_path / changed).read_bytes()[:-1] + b"x")
    assert InputCheck(run).change(task, entry) == f"{tmp_path / changed} changed"


BAG = """
name = "x"
[dataset]
reader = "simulated"
options = { motions = ["sideways"], frames = 4, width = 320, height = 240 }
[[trackers]]
kind = "imported"
options = { path = "PATH", format = "bag" }
"""


@pytest.mark.parametrize("kind", [Format.sqlite, Format.mcap])
def test_tracks_in_the_folder_of_a_bag_count(tmp_path, kind):
    folder = written(tmp_path, kind, {"/tracks": cloud})
    run, (task,) = RunFolder(tmp_path / "of"), plan(parse_experiment(BAG.replace("PATH", str(folder)), place="x.toml"))
    entry = measured(task, run, shown=context())
    assert InputCheck(run).change(task, entry) is None
    (file,) = folder.glob(f"*.{kind}")
    flip(file)
    assert InputCheck(run).change(task, entry) == f"{file} changed"


@pytest.mark.parametrize("name", ["run.mcap", "metadata.yaml"])
def test_a_bag_that_this_process_has_open_counts_for_each_measurement(tmp_path, name):
    rosbag(tmp_path / "data", 3)
    text = (
        f'name = "x"\n[dataset]\nreader = "rosbag"\nroot = "{tmp_path / "data"}"\n[[trackers]]\nkind = "lucas-kanade"\n'
    )
    runs, (task,) = [RunFolder(tmp_path / f"run-{n}") for n in (1, 2)], plan(parse_experiment(text, place="x.toml"))
    entries = [measured(task, run, trackers=False) for run in runs]
    assert [InputCheck(run).change(task, entry) for run, entry in zip(runs, entries, strict=True)] == [None, None]
    file = tmp_path / "data" / "run" / name
    flip(file)
    changes = [InputCheck(run).change(task, entry) for run, entry in zip(runs, entries, strict=True)]
    assert changes == [f"{file} changed"] * 2


def test_what_waits_to_be_written_into_a_database_counts(tmp_path):
    """SQLite keeps it in a file of its own until the database is closed."""
    folder = written(tmp_path, Format.sqlite, {"/tracks": cloud})
    (file,) = folder.glob("*.db3")
    run, (task,) = RunFolder(tmp_path / "of"), plan(parse_experiment(BAG.replace("PATH", str(folder)), place="x.toml"))
    writer = sqlite3.connect(file)
    try:
        writer.execute("PRAGMA journal_mode = WAL")
        writer.execute("UPDATE messages SET timestamp = timestamp + 1")
        writer.commit()
        entry = measured(task, run, shown=context())
        assert InputCheck(run).change(task, entry) is None
        writer.execute("UPDATE messages SET timestamp = timestamp + 1")
        writer.commit()
        assert InputCheck(run).change(task, entry) == f"{file}-wal changed"
    finally:
        writer.close()


def test_external_data_of_a_network_count(tmp_path):
    require_onnx()
    data = with_external_data(keypoint_network(tmp_path / "keypoints.onnx"), "weights/keypoints.data")
    match_network(tmp_path / "matches.onnx")
    text = NETWORKS
    for name in ("keypoints.onnx", "matches.onnx"):
        text = text.replace(name, str(tmp_path / name))
    run, (task,) = RunFolder(tmp_path / "run"), plan(parse_experiment(text, place="x.toml"))
    entry = measured(task, run)
    assert InputCheck(run).change(task, entry) is None
    data.write_bytes(np.float32(0.5).tobytes() + data.read_bytes()[4:])
    assert InputCheck(run).change(task, entry) == f"{data} changed"


def flip(file: Path) -> None:
    """Change a byte in the middle of a file."""
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
