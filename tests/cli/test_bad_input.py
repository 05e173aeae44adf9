"""Bad input, as a user meets it: one clear line on stderr, the exit status, and no results that look whole."""

import json
import shutil

import cv2
import numpy as np
import pytest
from tests.writers.wall import N_FRAMES, SIZE

from tracknoise.cli.app import main
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.store import RunFolder

TRACKER = 'kind = "lucas-kanade"\noptions = { max_features = 12, min_features = 8 }'
IMPORTED = (TRACKER, 'kind = "imported"\noptions = { path = "tracks.csv" }')


@pytest.fixture
def start(tmp_path, capsys):
    """Run the experiment, perhaps with some of its text replaced; returns exit status, stderr and the run folder."""

    def go(*replacements):
        text = (tmp_path / "x.toml").read_text()
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "x.toml").write_text(text)
        out = tmp_path / "run"
        with pytest.raises(SystemExit) as exit_:
            main(["run", str(tmp_path / "x.toml"), "--out", str(out), "--quiet", "--no-report", "--workers", "1"])
        return exit_.value.code, capsys.readouterr().err, out

    return go


@pytest.fixture
def run(scene, start):
    """As `start`; nothing was measured yet."""
    return start


@pytest.fixture
def again(measured_scene, start):
    """As `start`; the experiment was run before."""
    return start


def assert_one_line(result, *parts):
    code, stderr, out = result
    assert code == 1
    errors = [line for line in stderr.splitlines() if line]
    assert errors[0].startswith("tracknoise: error: ")
    for part in parts:
        assert str(part) in errors[0]
    assert len(errors) == 1, stderr
    assert "Traceback" not in stderr
    assert not (out / "statistics").exists()
    if (out / "manifest.json").exists():
        assert json.loads((out / "manifest.json").read_text())["sequences"] == {}


def test_the_scene_is_fine_before_it_is_damaged(run):
    code, stderr, out = run()
    assert (code, stderr) == (0, "")
    assert (out / "statistics" / "summary.parquet").exists()


def test_a_scene_that_was_copied_is_named_first(run, scene):
    shutil.copytree(scene, scene.with_name("seq-02"))
    code, stderr, out = run()
    assert (code, stderr) == (0, "")
    assert any("seq-02 has the images of seq-01." in text for text in RunFolder(out).statistics(FINDINGS)["text"])


def test_missing_image(run, scene):
    (scene / "frame-000002.color.png").unlink()
    assert_one_line(run(), "frame-000002.color", "missing")


@pytest.mark.parametrize("kind", ["color", "depth"])
def test_truncated_image(run, scene, kind):
    path = scene / f"frame-000002.{kind}.png"
    path.write_bytes(path.read_bytes()[:-20])
    assert_one_line(run(), path.name, "truncated", "expected")


def test_depth_of_another_size(run, scene):
    cv2.imwrite(str(scene / "frame-000000.depth.png"), np.ones((48, 64), np.uint16))
    assert_one_line(run(), "frame-000000.depth.png", "64x48", "expected", "128x96")


def test_image_of_another_size(run, scene):
    cv2.imwrite(str(scene / "frame-000001.color.png"), np.zeros((48, 64), np.uint8))
    assert_one_line(run(), "frame-000001.color.png", "64x48", "expected", "128x96")


@pytest.mark.usefixtures("lean")
def test_nan_in_a_pose_is_a_frame_without_a_pose(run, scene):
    (scene / "frame-000001.pose.txt").write_text("1 0 0 nan\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    code, _, out = run()
    (entry,) = RunFolder(out).manifest().sequences.values()
    assert code == 0
    assert f"1 of {N_FRAMES} frames has no pose: its observations have no true position" in " ".join(entry.notes)


def test_pose_that_is_not_rigid(run, scene):
    (scene / "frame-000001.pose.txt").write_text("2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    assert_one_line(run(), "frame-000001.pose.txt", "rigid", "expected")


def test_fewer_poses_than_images(run, scene):
    (scene / f"frame-{N_FRAMES - 1:06d}.pose.txt").unlink()
    assert_one_line(run(), "pose", "expected")


def test_no_frames_at_all(run, scene):
    for path in scene.glob("frame-*"):
        path.unlink()
    assert_one_line(run(), "data", "expected")


def test_a_single_frame(run, scene):
    for path in scene.glob("frame-*"):
        if "000000" not in path.name:
            path.unlink()
    assert_one_line(run(), "seq-01", "1 frame", "expected at least 2")


def test_black_images(run, scene):
    for path in scene.glob("*.color.png"):
        cv2.imwrite(str(path), np.zeros(SIZE, np.uint8))
    assert_one_line(run(), "seq-01", "no tracker found a feature", "expected images with texture")


def test_a_speed_larger_than_the_sequence(run):
    assert_one_line(run(("[1]", "[1, 4]")), "seq-01", "speed 4 for a sequence of 4 frames", "expected", "at most 3")


def test_unknown_tracker(run):
    assert_one_line(
        run(("lucas-kanade", "lucas-kanda")),
        "x.toml: trackers[0]: unknown tracker 'lucas-kanda'",
        ", lucas-kanade, ",
    )


def test_unknown_reader(run):
    assert_one_line(run(("sevenscenes", "eightscenes")), "x.toml: dataset: unknown reader 'eightscenes'", "sevenscenes")


def test_misspelt_key(run):
    assert_one_line(run(("min_features", "min_feature")), "x.toml", "unknown key 'min_feature'", "min_features")


def test_wrong_type(run):
    assert_one_line(run(("[1]", '["fast"]')), "x.toml: speeds[0]: found 'fast', expected a valid integer")


def test_misspelt_tracker_option(run):
    assert_one_line(run(("{ max", "{ windw_px = 15, max")), "x.toml: trackers[0]", "windw_px", "window_px")


def test_no_such_data_folder(run):
    assert_one_line(run(('"data"', '"nowhere"')), "nowhere", "no such directory", "expected")


@pytest.mark.usefixtures("lean")
def test_one_bad_scene_of_two_leaves_the_other_and_exits_2(run, scene):
    other = scene.parent / "seq-02"
    other.mkdir()
    for path in scene.iterdir():
        (other / path.name).write_bytes(path.read_bytes())
    (other / "frame-000001.color.png").unlink()
    code, stderr, out = run()
    assert code == 2
    assert "frame-000001.color" in stderr
    assert "seq-02" in stderr
    manifest = json.loads((out / "manifest.json").read_text())
    assert list(manifest["sequences"]) == ["seq-01@default"]
    assert list(manifest["failures"]) == ["seq-02@default"]
    assert (out / "failures.jsonl").read_text().count("\n") == 1


@pytest.mark.usefixtures("lean")
def test_a_failed_scene_is_measured_after_repair(run, scene):
    path = scene / "frame-000001.color.png"
    content = path.read_bytes()
    path.unlink()
    assert run()[0] == 1
    path.write_bytes(content)
    code, _, out = run()
    assert code == 0
    assert not (out / "failures.jsonl").exists()


def test_another_experiment_is_not_mixed_into_a_run(again):
    code, stderr, _ = again(("\nmin_features = 2", "\nmin_features = 3"))
    assert code == 1
    assert "holds a run with statistics.min_features = 2, expected 3" in stderr
    assert stderr.count("\n") == 1


@pytest.mark.usefixtures("lean")
def test_other_data_are_not_mixed_into_a_run(run, scene):
    assert run()[0] == 0
    (scene.parents[1] / "other").mkdir()
    shutil.copytree(scene, scene.parents[1] / "other" / "seq-02")
    code, stderr, _ = run(('root = "data"', 'root = "other"'))
    assert code == 1
    assert "holds a run with dataset.root = " in stderr


def test_data_that_have_moved_are_the_same_data(again, measured_scene):
    measured_scene.parent.rename(measured_scene.parents[1] / "moved")
    assert again(('root = "data"', 'root = "moved"'))[:2] == (0, "")


def test_depth_that_is_nowhere_valid(run, scene):
    for path in scene.glob("*.depth.png"):
        cv2.imwrite(str(path), np.zeros(SIZE, np.uint16))
    assert_one_line(run(), "seq-01", "no depth for any feature", "expected depth")


@pytest.mark.usefixtures("lean")
def test_a_sequence_whose_table_was_deleted_is_measured_again(again, tmp_path):
    for name in ("observations", "moments", "tracks"):
        table = tmp_path / "run" / name / "seq-01@default.parquet"
        content = table.read_bytes()
        table.unlink()
        assert again()[:2] == (0, "")
        assert table.read_bytes() == content


@pytest.mark.usefixtures("lean")
def test_imported_tracks_that_changed_are_measured_again(run, tmp_path):
    rows = [f"{track},{frame},{60 - 2 * frame},{20 + 10 * track}" for track in range(5) for frame in range(N_FRAMES)]
    (tmp_path / "tracks.csv").write_text("\n".join(["track,frame,u_px,v_px", *rows]))
    code, _, out = run(IMPORTED)
    before = (out / "tracks" / "seq-01@default.parquet").read_bytes()
    assert code == 0
    (tmp_path / "tracks.csv").write_text("\n".join(["track,frame,u_px,v_px", *rows[:-1]]))
    assert run()[0] == 0
    assert (out / "tracks" / "seq-01@default.parquet").read_bytes() != before


def test_imported_tracks_that_are_damaged_later_do_not_leave_the_old_numbers(run, tmp_path):
    (tmp_path / "tracks.csv").write_text("track,frame,u_px,v_px\n0,0,60,20\n0,1,58,20\n")
    assert run(IMPORTED)[0] == 0
    (tmp_path / "tracks.csv").write_text("track,frame,u_px,v_px\n0,0,sixty,20\n")
    assert_one_line(run(), "tracks.csv", "sixty")


@pytest.mark.usefixtures("measured_scene")
def test_fresh_replaces_a_run_but_nothing_else_in_its_folder(tmp_path):
    out = tmp_path / "run"
    (out / "notes.txt").write_text("mine")
    with pytest.raises(SystemExit) as exit_:
        main(["run", str(tmp_path / "x.toml"), "--out", str(out), "--fresh", "-q", "--no-report", "-w", "1"])
    assert exit_.value.code == 0
    assert (out / "notes.txt").read_text() == "mine"


def test_fresh_deletes_nothing_where_there_is_no_run(scene, tmp_path, capsys):
    web = tmp_path / "web"
    web.mkdir()
    (web / "manifest.json").write_text('{"name": "my web site"}')
    (web / "report").mkdir()
    with pytest.raises(SystemExit) as exit_:
        main(["run", str(tmp_path / "x.toml"), "--out", str(web), "--fresh", "-q"])
    assert exit_.value.code == 1
    assert "expected a run's manifest" in capsys.readouterr().err
    assert sorted(path.name for path in web.iterdir()) == ["manifest.json", "report"]


@pytest.mark.usefixtures("measured_scene")
def test_fresh_keeps_the_old_run_if_the_new_one_is_impossible(tmp_path):
    out = tmp_path / "run"
    with pytest.raises(SystemExit):
        main(["run", str(tmp_path / "x.toml"), "--data", str(tmp_path / "nowhere"), "-o", str(out), "--fresh", "-q"])
    assert (out / "statistics" / "summary.parquet").exists()
