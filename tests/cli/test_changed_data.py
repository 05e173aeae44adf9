"""Data that change after they were measured: they are measured again, whatever changed, and the message names it."""

import os
import shutil

import cv2
import numpy as np
import pytest

from tracknoise.cli.app import main
from tracknoise.tables.store import RunFolder

pytestmark = pytest.mark.usefixtures("lean")


@pytest.fixture
def start(tmp_path, capsys):
    """Run the experiment; returns exit status and stderr."""

    def go(*options):
        command = ["run", str(tmp_path / "x.toml"), "--out", str(tmp_path / "run"), "--no-report", "-w", "1"]
        with pytest.raises(SystemExit) as exit_:
            main([*command, *options])
        return exit_.value.code, capsys.readouterr().err

    return go


def moments(tmp_path):
    return RunFolder(tmp_path / "run").sequence_table("moments", "seq-01@default")


def moved(pose_file):
    pose = np.loadtxt(pose_file)
    pose[1, 3] += 1e-3
    np.savetxt(pose_file, pose)


CHANGES = {
    "camera-intrinsics.txt": lambda file: file.write_text(file.read_text().replace("1.17", "1.19")),
    "frame-000002.pose.txt": moved,
    "frame-000000.depth.png": lambda file: cv2.imwrite(str(file), np.full((96, 128), 120, np.uint16)),
    "frame-000001.color.png": lambda file: shutil.copy(file.with_name("frame-000002.color.png"), file),
}


def test_a_changed_file_of_the_data_gives_new_numbers(start, measured_scene, tmp_path):
    scene = measured_scene
    assert "resuming: 1 of 1 sequence already measured" in start()[1]
    for name, change in CHANGES.items():
        before = moments(tmp_path)
        change(scene / name)
        status, stderr = start()
        assert status == 0
        assert f"seq-01@default is measured again: {scene / name} changed\n" in stderr
        assert "resuming" not in stderr
        assert not moments(tmp_path).equals(before), name
    assert "resuming: 1 of 1 sequence already measured" in start()[1]


def test_a_removed_image_is_an_error_not_the_old_numbers(start, measured_scene):
    scene = measured_scene
    (scene / "frame-000003.color.png").unlink()
    status, stderr = start()
    assert status != 0
    assert f"measured again: {scene / 'frame-000003.color.png'} is missing" in stderr


def test_further_frames_are_measured(start, scene, tmp_path):
    kept = tmp_path / "kept"
    kept.mkdir()
    for file in scene.glob("frame-000003.*"):
        shutil.move(file, kept / file.name)
    assert start()[0] == 0
    for file in kept.iterdir():
        shutil.move(file, scene / file.name)
    status, stderr = start()
    assert status == 0
    assert "frame-000003.pose.txt was added" in stderr
    assert RunFolder(tmp_path / "run").manifest().sequences["seq-01@default"].n_frames == 4


def test_a_repaired_scene_and_a_corrected_file_do_not_mix_old_and_new(start, scene, tmp_path):
    """A file of both scenes is corrected together with what made one fail."""
    other = scene.with_name("seq-02")
    shutil.copytree(scene, other)
    shutil.move(scene / "camera-intrinsics.txt", scene.parent / "camera-intrinsics.txt")
    (other / "camera-intrinsics.txt").unlink()
    image = (other / "frame-000001.color.png").read_bytes()
    (other / "frame-000001.color.png").write_bytes(image[:100])
    assert start()[0] == 2
    (other / "frame-000001.color.png").write_bytes(image)
    camera = scene.parent / "camera-intrinsics.txt"
    camera.write_text(camera.read_text().replace("1.17", "1.19"))
    status, stderr = start()
    assert status == 0
    assert f"seq-01@default is measured again: {camera} changed" in stderr
    run_folder = RunFolder(tmp_path / "run")
    assert run_folder.sequence_table("moments", "seq-02@default").drop("scene").equals(moments(tmp_path).drop("scene"))


def test_content_is_compared_on_request(start, measured_scene, tmp_path):
    image = measured_scene / "frame-000003.color.png"
    content, status = image.read_bytes(), image.stat()
    image.write_bytes(content[:-20] + b"\0" + content[-19:])
    os.utime(image, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert "resuming: 1 of 1 sequence already measured" in start()[1]
    settings = tmp_path / "x.toml"
    settings.write_text(f"verify = true\n{settings.read_text()}")
    assert f"measured again: {image} changed" in start()[1]
