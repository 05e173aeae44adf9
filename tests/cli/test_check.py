"""The commands `check` and `init`, as a user types them."""

import json
import shutil
import tomllib

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.lean import of_reader
from tests.writers import euroc, kitti_odometry

from tracknoise.experiments.load import load_experiment
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.truth_faults import clock_check

SMALL = ["--motion", "arvr", "--frames", "16", *of_reader("width=200", "height=150", "supersampling=1"), "--quiet"]


@pytest.fixture
def without_clock(monkeypatch):
    """Clocks are not compared, which takes half the time of a check."""
    monkeypatch.setattr(clock_check, "measured_offset", lambda _: None)


@pytest.fixture(scope="session")
def recording(made_once):
    def write(folder):
        from tracknoise.cli.app import main

        with pytest.raises(SystemExit):
            main(["simulate", "--out", str(folder / "walk"), *SMALL])

    return made_once("check-recording", write)


@pytest.fixture(scope="session")
def checked(made_once, recording):
    """The document of the recording as it is, without clocks."""

    def write(folder):
        from tracknoise.cli.app import main

        folder.mkdir()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(clock_check, "measured_offset", lambda _: None)
            with pytest.raises(SystemExit):
                main(["check", "--json", str(recording), "--quiet", "--out", str(folder / "check.json")])

    return made_once("check-document", write) / "check.json"


def inverted(recording, folder):
    (folder / "walk").mkdir()
    for part in (recording / "walk").iterdir():
        if part.name != "poses.txt":
            (folder / "walk" / part.name).symlink_to(part)
    rows = np.loadtxt(recording / "walk" / "poses.txt").reshape(16, -1)
    turned = Rotation.from_quat(rows[:, -4:]).inv()
    rows[:, -7:-4] = -turned.apply(rows[:, -7:-4])
    rows[:, -4:] = turned.as_quat()
    np.savetxt(folder / "walk" / "poses.txt", rows)
    return folder


def test_a_recording_that_is_right_is_not_refused(tracknoise, recording):
    code, out, err = tracknoise("check", str(recording))
    assert code == 0
    assert err.startswith("reader: folder\n")
    assert "--quick" in err
    assert out.startswith(("Truth: trusted.", "Truth: limited."))


def test_one_image_is_not_usable(tracknoise, tmp_path):
    one = ["1" if before == "--frames" else word for before, word in zip(["", *SMALL], SMALL, strict=False)]
    tracknoise("simulate", "--out", str(tmp_path / "walk"), *one)
    code, out, _ = tracknoise("check", str(tmp_path), "--quiet")
    assert code == 4
    assert "1 image of 200x150 px, with a pose. At least 2 poses are needed." in out


@pytest.mark.usefixtures("without_clock")
def test_inverted_poses_are_not_usable_and_all_outputs_say_why(tracknoise, recording, tmp_path):
    wrong = inverted(recording, tmp_path)
    page, document = tmp_path / "check.html", tmp_path / "check.json"
    code, out, _ = tracknoise("check", "folder", str(wrong), "-o", str(page), "-o", str(document), "--quiet")
    assert code == 4
    assert out.startswith("Truth: not trusted. ")
    found = json.loads(document.read_text())
    assert found["verdict"] == "not trusted"
    assert "poses are inverted" in found["reasons"][0]
    html = page.read_text()
    assert "poses are inverted" in html
    assert "data:image/png;base64," in html
    assert "http" not in html.replace("http-equiv", "")


def table_of(tracknoise, folder):
    """Exit status, verdict, and the items of the one sequence by topic, as the command prints and writes them."""
    code, out, err = tracknoise("check", str(folder), "--json", "--quiet")
    assert err == ""
    return code, *_read(out)


def _read(document):
    (sequence,) = json.loads(document)["sequences"]
    return sequence["truth"], {item["topic"]: item for item in sequence["items"]}


@pytest.mark.usefixtures("without_clock")
def test_the_table_has_what_decided_the_verdict(tracknoise, recording, checked, tmp_path):
    shutil.copytree(recording / "walk", tmp_path / "walk")
    rows = np.loadtxt(tmp_path / "walk/poses.txt").reshape(16, -1)
    step_m = np.median(np.linalg.norm(np.diff(rows[:, -7:-4], axis=0), axis=1))
    rows[:, -7:-4] += np.random.default_rng(1).normal(0.0, step_m, (16, 3))
    np.savetxt(tmp_path / "walk/poses.txt", rows)
    severities = {"trusted": "ok", "limited": "caveat", "unknown": "unknown", "not trusted": "fatal"}
    for truth, items in (table_of(tracknoise, tmp_path)[1:], _read(checked.read_text())):
        deciding = [one for one in items.values() if one["text"] in truth["text"]]
        assert severities[truth["verdict"]] in {one["severity"] for one in deciding}
        assert "corrections that `tracknoise check`" not in truth["step"], "a check prints no corrections"


@pytest.mark.usefixtures("without_clock")
def test_without_depth_the_verdict_says_how_well_poses_fit_the_images(tracknoise, recording, tmp_path):
    shutil.copytree(recording / "walk", tmp_path / "walk")
    shutil.rmtree(tmp_path / "walk/depth")
    code, truth, items = table_of(tracknoise, tmp_path)
    assert (code, truth["verdict"], items["truth"]["severity"]) == (4, "unknown", "unknown")
    assert items["warping"]["text"] in truth["text"]
    rows = np.loadtxt(tmp_path / "walk/poses.txt").reshape(16, -1)
    turned = Rotation.from_rotvec(np.random.default_rng(1).normal(0.0, np.radians(2.0), (16, 3)))
    rows[:, -4:] = (Rotation.from_quat(rows[:, -4:]) * turned).as_quat()
    np.savetxt(tmp_path / "walk/poses.txt", rows)
    code, truth, items = table_of(tracknoise, tmp_path)
    assert (code, truth["verdict"], items["warping"]["severity"]) == (4, "not trusted", "fatal")
    assert items["warping"]["text"] in truth["text"]


@pytest.mark.usefixtures("without_clock")
def test_json_is_all_that_is_printed(tracknoise, recording, checked, tmp_path):
    code, out, err = tracknoise("check", str(recording), "--json", "--out", str(tmp_path / "x.json"))
    assert (code, err) == (0, f"reader: folder\nwritten: {tmp_path / 'x.json'}\n")
    assert json.loads(out)["verdict"] in ("trusted", "limited")
    assert (tmp_path / "x.json").read_text() == checked.read_text() == out


@pytest.mark.usefixtures("without_clock")
@pytest.mark.parametrize(("missing", "has_depth"), [([0], True), ([7], False), (range(1, 15), True)])
def test_frames_without_a_pose_are_a_caveat(tracknoise, recording, tmp_path, missing, has_depth):
    shutil.copytree(recording / "walk", tmp_path / "walk")
    rows = np.loadtxt(tmp_path / "walk/poses.txt")
    rows[missing] = np.nan
    np.savetxt(tmp_path / "walk/poses.txt", rows)
    if not has_depth:
        shutil.rmtree(tmp_path / "walk/depth")
    code, out, err = tracknoise("check", str(tmp_path))
    assert code in (0, 4)
    assert err.startswith("reader: folder\n")
    assert (code == 0) == out.startswith(("Truth: trusted.", "Truth: limited."))
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
    assert "docs/data.md" in err


def test_options_of_the_reader_are_checked(tracknoise, recording):
    code, _, err = tracknoise("check", str(recording), "--option", "colour=3")
    assert code == 1
    assert "colour" in err
    code, _, err = tracknoise("check", str(recording), "--option", "colour")
    assert (code, "NAME=VALUE" in err) == (1, True)


def pair_of_euroc(folder):
    simulated = open_sequence(
        "simulated", motions=["fixating"], frames=12, width=240, height=180, supersampling=1, baseline_m=0.2
    )
    camera = simulated.camera
    intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
    images = [simulated.image(index) for index in range(12)]
    times_ns = euroc.write_euroc(folder, images, simulated.world_from_camera, intrinsics=intrinsics)
    second = [simulated.second.images(index) for index in range(12)]
    euroc.write_images(folder / "mav0", "cam1", times_ns.tolist(), second)
    body_from_second = euroc.BODY_FROM_CAMERA @ simulated.second.first_from_second
    sensor = folder / "mav0/cam1/sensor.yaml"
    euroc.write_sensor(sensor, (camera.width, camera.height), intrinsics, body_from_camera=body_from_second)
    return simulated


def pair_of_kitti(folder):
    baseline_m = kitti_odometry.BASELINES_M[1]
    simulated = open_sequence(
        "simulated", motions=["forward"], frames=12, width=240, height=180, supersampling=1, baseline_m=baseline_m
    )
    camera = simulated.camera
    intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
    images = [simulated.image(index) for index in range(12)]
    poses = simulated.world_from_camera
    written = kitti_odometry.write_kitti_odometry(folder, images, poses, intrinsics=intrinsics)
    (written / "image_1").mkdir()
    for index in range(12):
        assert cv2.imwrite(str(written / "image_1" / f"{index:06d}.png"), simulated.second.images(index))
    return simulated


@pytest.mark.usefixtures("without_clock")
@pytest.mark.parametrize("write", [pair_of_euroc, pair_of_kitti])
def test_depth_from_stereo_is_checked(tracknoise, tmp_path, write):
    simulated = write(tmp_path / "walk")
    code, out, err = tracknoise("check", str(tmp_path), "--option", "depth=stereo", "--json", "--quiet")
    assert (code in (0, 4), err) == (True, "")  # whether depths from so few pixels are good enough is close
    (depth,) = [item for item in items(out) if item["topic"] == "depth"]
    exact_m = simulated.depth(6).depth_m
    true_m = np.median(exact_m[(exact_m > 0.0) & (exact_m < 25.0)])  # disparities of 4 px and more
    assert 0.5 * true_m < depth["values"]["median_m"] < 2.0 * true_m
    assert any("semi-global matching" in item["text"] for item in items(out))
    warping = next(item for item in items(out) if item["topic"] == "warping")
    assert warping["values"]["depth_disagreement"] < 0.1


def items(printed):
    (sequence,) = json.loads(printed)["sequences"]
    return sequence["items"]


@pytest.mark.usefixtures("without_clock")
def test_depth_from_stereo_is_not_computed_unless_it_is_asked_for(tracknoise, tmp_path):
    pair_of_euroc(tmp_path / "walk")
    without = tracknoise("check", str(tmp_path), "--json", "--quiet")[1]
    assert "median_m" not in {name for item in items(without) for name in item["values"]}
    file = tmp_path / "first.toml"
    assert tracknoise("init", str(tmp_path), "-o", str(file))[0] == 0
    assert load_experiment(file).truth.depth == "recorded"
    written = file.read_text()
    above, stanza = written.split("# [[trackers]]  # the features of the first one")
    file.write_text(f"{above}[[trackers]]  # {stanza.replace('# kind', 'kind').replace('# options', 'options')}")
    assert load_experiment(file).trackers[-1].kind == "second-view"


@pytest.mark.usefixtures("without_clock")
def test_depth_from_stereo_needs_a_second_camera(tracknoise, recording):
    code, out, _ = tracknoise("check", str(recording), "--option", "depth=stereo")
    assert code == 4
    assert "no second camera, expected one" in " ".join(out.split())
    code, _, err = tracknoise("check", str(recording), "--option", "depth=lidar")
    assert (code, err) == (1, "tracknoise: error: --option depth=lidar: expected recorded or stereo\n")
    assert tracknoise("datasets", str(recording), "--option", "depth=recorded")[0] == 0


def test_depth_from_stereo_in_the_other_commands_that_take_options(tracknoise, tmp_path):
    pair_of_euroc(tmp_path / "walk")
    assert "% of pixels" in tracknoise("datasets", str(tmp_path), "--option", "depth=stereo")[1]
    file = tmp_path / "first.toml"
    assert tracknoise("init", str(tmp_path), "-o", str(file), "--option", "depth=stereo")[0] == 0
    assert load_experiment(file).truth.depth == "stereo"


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


def test_an_experiment_file_is_checked_as_it_corrects_its_recordings(tracknoise, recording, tmp_path):
    file = tmp_path / "mine.toml"
    late = json.loads((recording / "walk" / "camera.json").read_text())
    wrong = tmp_path / "data" / "walk"
    shutil.copytree(recording / "walk", wrong)
    (wrong / "camera.json").write_text(json.dumps({**late, "fx": 1.25 * late["fx"], "fy": 1.25 * late["fy"]}))
    corrected = f"[truth.corrections]\nfocal_scale = {1 / 1.25}\n"
    dataset = '[dataset]\nreader = "folder"\nroot = "data"\nmax_frames = 12\n'
    text = f'name = "mine"\n{dataset}{{}}[[trackers]]\nkind = "patch"\n'
    file.write_text(text.format(""))
    said = tracknoise("check", str(file), "--json", "--quiet")
    file.write_text(text.format(corrected))
    mended = tracknoise("check", str(file), "--json", "--quiet")
    lengths = [
        next(item["text"] for item in json.loads(out)["sequences"][0]["items"] if item["topic"] == "intrinsics")
        for _, out, _ in (said, mended)
    ]
    assert f"{1.25 * late['fx']:.1f} px" in lengths[0]
    assert f"{late['fx']:.1f} px" in lengths[1]
    assert "12 images" in mended[1]
    code, _, err = tracknoise("check", str(file), "--trajectory", "other.txt")
    assert (code, "--trajectory" in err) == (1, True)


@pytest.mark.usefixtures("without_clock")
def test_a_run_says_what_it_changed_in_the_verdict_of_a_check(tracknoise, recording, checked, tmp_path):
    document = tmp_path / "check.json"
    shutil.copy(checked, document)
    tracknoise("init", str(recording), "--out", str(tmp_path / "x.toml"), "--quiet")
    run = ["run", str(tmp_path / "x.toml"), "--out", str(tmp_path / "run"), "--workers", "1", "--quiet", "--no-report"]
    run += ["--trackers", "lucas-kanade"]
    settings = (tmp_path / "x.toml").read_text()
    (tmp_path / "x.toml").write_text(f'check = "check.json"\n{settings}')
    code, out, _ = tracknoise(*run)
    verdict = json.loads(document.read_text())["verdict"]
    assert code == 0
    assert f"`tracknoise check` said {verdict}" in " ".join(out.split())
    assert "Truth: " in out
    assert tracknoise(*run)[1] == out
    document.unlink()
    code, _, err = tracknoise(*run)
    assert (code, "check.json" in err) == (1, True)
    (tmp_path / "x.toml").write_text(settings)
    code, out, err = tracknoise(*(word for word in run if word != "--quiet"))
    assert code == 0
    assert "resuming: 1 of 1 sequence already measured" in err
    assert "`tracknoise check` said" not in out


def spoilt(recording, folder):
    shutil.copytree(recording / "walk", folder / "walk")
    path = folder / "walk" / "poses.txt"
    rows = np.loadtxt(path).reshape(16, -1)
    walk = np.cumsum(np.random.default_rng(6).normal(0.0, np.radians(0.3), (16, 3)), axis=0)
    rows[:, -4:] = (Rotation.from_quat(rows[:, -4:]) * Rotation.from_rotvec(walk)).as_quat()
    np.savetxt(path, rows)
    return folder


@pytest.mark.usefixtures("without_clock")
def test_the_stated_poses_have_a_verdict_of_their_own_and_refined_ones_are_written(tracknoise, recording, tmp_path):
    wrong, page, written = spoilt(recording, tmp_path / "data"), tmp_path / "check.html", tmp_path / "walk.txt"
    arguments = ["check", str(wrong), "-o", str(page), "-o", str(tmp_path / "{scene}.txt")]
    _, out, err = tracknoise(*arguments)
    text = " ".join(out.split())
    assert text.count("The stated poses would add") == 1
    assert text.count("Stated poses: ") == 1
    assert "Stated poses: " in page.read_text()
    assert f"written: {written}" in err
    exact, stated, found = (
        Rotation.from_quat(np.loadtxt(path)[:, -4:])
        for path in (recording / "walk/poses.txt", wrong / "walk/poses.txt", written)
    )
    moved = [
        np.mean((one[:-3].inv() * one[3:] * (exact[:-3].inv() * exact[3:]).inv()).magnitude())
        for one in (stated, found)
    ]
    assert moved[1] < 0.5 * moved[0]


def test_a_trajectory_replaces_no_other_file_and_several_scenes_need_several_files(tracknoise, recording, tmp_path):
    other = tmp_path / "notes.txt"
    other.write_text("0 0 0 0 0 0 0 1\n")
    code, out, err = tracknoise("check", str(recording), "--out", str(other))
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert "found a file of another kind, expected a new file or an earlier trajectory" in err
    for name in ("one", "two"):
        shutil.copytree(recording / "walk", tmp_path / "several" / name)
    code, out, err = tracknoise("check", str(tmp_path / "several"), "--out", str(tmp_path / "x.txt"))
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert "one file for 2 sequences, expected {scene} or {lighting} in its name" in err
    code, _, err = tracknoise("check", str(recording), "--out", str(tmp_path / "{place}.txt"))
    assert (code, "{place} is not a placeholder" in err) == (1, True)
