"""The first experiment file of a recording can be loaded, and reads the recording that it is about."""

import dataclasses
import re

import numpy as np
import pytest
from tests.contract.test_sequences import LAYOUTS
from tests.experiments.test_execute import Silent
from tests.writers.euroc import BODY_FROM_CAMERA, write_euroc, write_images, write_sensor

from tracknoise.cli.moved import moved
from tracknoise.experiments.execute import execute
from tracknoise.experiments.load import load_experiment, resolve
from tracknoise.experiments.template import experiment_template, name_of
from tracknoise.sequences.reader_registry import READERS, make_reader
from tracknoise.sequences.recognise import recognise
from tracknoise.tables.store import RunFolder


def chosen_options(reader):
    """Options of a reader that differ from the defaults."""
    fields = [one for one in dataclasses.fields(reader) if one.init and one.name != "root"]
    return {
        one.name: getattr(reader, one.name)
        for one in fields
        if one.default is dataclasses.MISSING or getattr(reader, one.name) != one.default
    }


@pytest.mark.parametrize("name", sorted(READERS.built_in))
def test_every_reader_has_one_that_opens_the_recording(name, tmp_path):
    written = LAYOUTS[name](tmp_path / "data", 3).reader
    root = getattr(written, "root", None)
    assert root is None or recognise(root) == name
    file = tmp_path / "first.toml"
    text = experiment_template(written, root, chosen_options(written))
    file.write_text(text)
    named = re.findall(r"tracknoise ([a-z]+[^;.,\n]*)", text)
    assert named
    assert not [command for command in named if moved(command.split())]  # which are no commands any more
    dataset = resolve(load_experiment(file)).dataset
    made = make_reader(dataset.reader, dataset.root, dataset.options)
    assert made.sequences() == written.sequences()
    assert len(made.open(made.sequences()[0])) == len(written.open(written.sequences()[0]))


def test_relative_paths_of_options_are_those_of_the_current_folder(tmp_path, monkeypatch):
    """In an experiment file they would start from the folder of this file."""
    written = LAYOUTS["tum"](tmp_path / "data", 3).reader
    (tmp_path / "mine.yaml").write_text("width: 80\nheight: 60\nfx: 70\nfy: 70\ncx: 40\ncy: 30\n")
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "elsewhere" / "first.toml"
    file.parent.mkdir()
    file.write_text(experiment_template(written, written.root, {"camera_file": "mine.yaml"}))
    dataset = resolve(load_experiment(file)).dataset
    assert make_reader(dataset.reader, dataset.root, dataset.options).camera_file == tmp_path / "mine.yaml"


def test_without_depth_it_says_how_truth_is_computed_and_can_be_run(sample, tmp_path):
    reader = make_reader("kitti-odometry", sample("kitti_odometry"))
    text = experiment_template(reader, sample("kitti_odometry"), {})
    assert '# kind = "swept"  # there is no depth' in text
    file = tmp_path / "first.toml"
    file.write_text(text)
    short = load_experiment(file, frames=4, trackers=["lucas-kanade"])
    assert execute(short, RunFolder(tmp_path / "run"), listener=Silent()).failures == {}


def test_with_depth_the_default_is_named(sample):
    reader = make_reader("tartanair", sample("tartanair_v2"))
    assert '# kind = "birth"' in experiment_template(reader, sample("tartanair_v2"), {})


def test_it_says_how_outliers_are_rejected_and_how_to_choose_the_other_way(tmp_path):
    """The choice is valid as it is written, and what is said of the default is the default."""
    written = LAYOUTS["tum"](tmp_path / "data", 3).reader
    file = tmp_path / "first.toml"
    file.write_text(experiment_template(written, written.root, {}))
    text = file.read_text()
    rejections = [tracker.options["rejection"] for tracker in load_experiment(file).trackers]
    assert {(one["model"], one["reference"]) for one in rejections} == {("homography", "previous")}
    said = " ".join(text.replace("#", " ").split())
    for one in rejections:
        assert f"reject outliers by a {one['model']}: matches that are more than {one['threshold_px']:g} px off" in said
    choice = '# options = { rejection = { model = "fundamental" } }'
    assert text.count(choice) == 2
    file.write_text(text.replace(choice, choice.removeprefix("# ")))
    chosen = load_experiment(file).trackers
    assert [(one.kind, one.options["rejection"]["model"]) for one in chosen] == [
        ("lucas-kanade", "fundamental"),
        ("correspondence", "fundamental"),
    ]


def test_a_second_camera_does_not_replace_depth():
    reader = make_reader("simulated", None, {"motions": ["sideways"], "frames": 3, "baseline_m": 0.1})
    assert "depth =" not in experiment_template(reader, None, {})


@pytest.mark.parametrize("step_m", [0.001, 0.1])
def test_depth_is_from_both_cameras_however_far_they_move(tmp_path, step_m):
    poses, images = np.tile(np.eye(4), (20, 1, 1)), [np.zeros((60, 80), np.uint8)] * 20
    poses[:, 0, 3] = step_m * np.arange(20)
    intrinsics, beside = (70.0, 70.0, 39.5, 29.5), BODY_FROM_CAMERA.copy()
    beside[:3, 3] += 0.1 * BODY_FROM_CAMERA[:3, 0]
    times_ns = write_euroc(tmp_path, images, poses, intrinsics=intrinsics).tolist()
    write_images(tmp_path / "mav0", "cam1", times_ns, images)
    write_sensor(tmp_path / "mav0" / "cam1" / "sensor.yaml", (80, 60), intrinsics, body_from_camera=beside)
    text = experiment_template(make_reader("euroc", tmp_path), tmp_path, {})
    assert 'depth = "stereo"' not in text
    assert '# kind = "swept"  # there is no depth' in text
    assert "from the images of other frames and of the second camera" in text


def test_an_estimator_and_tracks_of_ones_own_are_chosen_by_removing_marks_of_comments(tmp_path):
    written = LAYOUTS["tum"](tmp_path / "data", 3).reader
    lines = experiment_template(written, written.root, {}).splitlines()
    wanted = ('# name = "openvins"', '# name = "my front end"', '# kind = "imported"', '# preset = "openvins"')
    for line in (*wanted, *(line for line in lines if line.startswith(("# [", "# options = { path")))):
        lines[lines.index(line)] = line.removeprefix("# ")
    file = tmp_path / "first.toml"
    file.write_text("\n".join(lines))
    experiment = load_experiment(file)
    assert experiment.estimator.name == "openvins"
    *_, system, mine = experiment.trackers
    assert (system.kind, system.name) == ("lucas-kanade", "openvins")
    assert (mine.kind, mine.name) == ("imported", "my front end")
    assert mine.options["path"] == str(tmp_path / "tracks" / "{scene}.csv")


def test_a_folder_gives_its_name_and_a_file_its_name_without_the_ending(tmp_path):
    (tmp_path / "office.bag").touch()
    (tmp_path / "room.2").mkdir()
    assert name_of(tmp_path / "office.bag") == "office"
    assert name_of(tmp_path / "room.2") == "room.2"
