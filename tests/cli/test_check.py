"""The commands `check` and `init`, as a user types them."""

import json
import shutil
import tomllib

import numpy as np
import pytest

from tracknoise.experiments.load import load_experiment

SMALL = ["--motion", "arvr", "--frames", "16", "--width", "200", "--height", "150", "--supersampling", "1", "--quiet"]


@pytest.fixture(scope="session")
def recording(made_once):
    def write(folder):
        from tracknoise.cli.app import main

        with pytest.raises(SystemExit):
            main(["simulate", "--out", str(folder / "walk"), *SMALL])

    return made_once("check-recording", write)


def inverted(recording, folder):
    (folder / "walk").mkdir()
    for part in (recording / "walk").iterdir():
        if part.name != "poses.txt":
            (folder / "walk" / part.name).symlink_to(part)
    rows = np.loadtxt(recording / "walk" / "poses.txt").reshape(16, -1)
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_quat(rows[:, -4:]).inv()
    rows[:, -7:-4] = -turned.apply(rows[:, -7:-4])
    rows[:, -4:] = turned.as_quat()
    np.savetxt(folder / "walk" / "poses.txt", rows)
    return folder


def test_a_recording_that_is_right_is_ready(tracknoise, recording):
    code, out, err = tracknoise("check", str(recording))
    assert (code, err) == (0, "reader: folder\n")
    assert out.endswith("\nready.\n")


def test_one_image_is_not_usable(tracknoise, tmp_path):
    one = ["1" if before == "--frames" else word for before, word in zip(["", *SMALL], SMALL, strict=False)]
    tracknoise("simulate", "--out", str(tmp_path / "walk"), *one)
    code, out, _ = tracknoise("check", str(tmp_path), "--quiet")
    assert code == 4
    assert "1 image of 200x150 px, with a pose. At least 2 poses are needed." in out


def test_inverted_poses_are_not_usable_and_all_outputs_say_why(tracknoise, recording, tmp_path):
    wrong = inverted(recording, tmp_path)
    page, document = tmp_path / "check.html", tmp_path / "check.json"
    code, out, _ = tracknoise("check", "folder", str(wrong), "--html", str(page), "--json", str(document), "--quiet")
    assert code == 4
    assert "not usable, because:" in out
    found = json.loads(document.read_text())
    assert found["verdict"] == "unusable"
    assert "poses are inverted" in found["reasons"][0]
    html = page.read_text()
    assert "poses are inverted" in html
    assert "data:image/png;base64," in html
    assert "http" not in html.replace("http-equiv", "")


@pytest.mark.parametrize("missing", [[0], [7], [15], range(1, 15)])
@pytest.mark.parametrize("has_depth", [True, False])
def test_frames_without_a_pose_are_a_caveat(tracknoise, recording, tmp_path, missing, has_depth):
    shutil.copytree(recording / "walk", tmp_path / "walk")
    rows = np.loadtxt(tmp_path / "walk/poses.txt")
    rows[missing] = np.nan
    np.savetxt(tmp_path / "walk/poses.txt", rows)
    if not has_depth:
        shutil.rmtree(tmp_path / "walk/depth")
    code, out, err = tracknoise("check", str(tmp_path))
    assert (code, err) == (3, "reader: folder\n")
    assert f"{16 - len(missing)} of them have a pose. The other frames have no truth." in out


def test_a_damaged_recording_is_not_usable(tracknoise, recording, tmp_path):
    wrong = inverted(recording, tmp_path)
    (wrong / "walk" / "poses.txt").write_text("1 2 3\n")
    code, out, _ = tracknoise("check", str(wrong))
    assert code == 4
    assert "poses.txt" in out


def test_what_is_no_recording_is_a_user_error(tracknoise, tmp_path):
    code, _, err = tracknoise("check", str(tmp_path))
    assert code == 1
    assert "docs/folder-layout.md" in err


def test_options_of_the_reader_are_checked(tracknoise, recording):
    code, _, err = tracknoise("check", str(recording), "--option", "colour=3")
    assert code == 1
    assert "colour" in err
    code, _, err = tracknoise("check", str(recording), "--option", "colour")
    assert (code, "NAME=VALUE" in err) == (1, True)


def test_init_writes_an_experiment_that_can_be_loaded(tracknoise, recording, tmp_path):
    file = tmp_path / "first.toml"
    code, out, _ = tracknoise("init", str(recording), "--out", str(file))
    assert code == 0
    assert "reader folder" in out
    assert tomllib.loads(file.read_text())["dataset"] == {"reader": "folder", "root": str(recording), "options": {}}
    assert [choice.kind for choice in load_experiment(file).trackers] == ["lucas-kanade", "correspondence"]


def test_init_replaces_no_file_unless_it_is_told_to(tracknoise, recording, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("mine")
    code, _, err = tracknoise("init", str(recording), "--out", str(file))
    assert (code, file.read_text()) == (1, "mine")
    assert "--force" in err
    assert tracknoise("init", str(recording), "--out", str(file), "--force")[0] == 0
