"""`init` of recordings whose poses are in a file of another program, or nowhere, and what then is measured."""

import importlib.util
import json
import tomllib

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.experiments.load import load_experiment
from tracknoise.experiments.plan import open_batch, plan
from tracknoise.geometry.pose import invert
from tracknoise.sequences.reader_registry import open_sequence

FRAMES, SIZE = 10, (200, 150)
needs_colmap = pytest.mark.skipif(importlib.util.find_spec("pycolmap") is None, reason="pycolmap is not installed")


@pytest.fixture(scope="module")
def walk():
    return open_sequence(
        "simulated", motions=("sideways",), frames=FRAMES, width=SIZE[0], height=SIZE[1], noise_sigma=1
    )


@pytest.fixture
def files(walk, tmp_path):
    """Images alone in `tmp_path / "shots"`, a camera file and trajectories in two formats."""
    (tmp_path / "shots").mkdir()
    for index in range(FRAMES):
        assert cv2.imwrite(str(tmp_path / "shots" / f"shot{index}.png"), walk.image(index))
    camera = walk.camera
    stated = {"width": camera.width, "height": camera.height, "fx": camera.fx, "fy": camera.fy}
    (tmp_path / "cam.json").write_text(json.dumps({**stated, "cx": camera.cx, "cy": camera.cy}))
    poses = walk.world_from_camera
    np.savetxt(tmp_path / "kitti.txt", poses[:, :3].reshape(FRAMES, 12), fmt="%.12g")
    rows = np.c_[np.arange(FRAMES) / 25, poses[:, :3, 3], Rotation.from_matrix(poses[:, :3, :3]).as_quat()]
    np.savetxt(tmp_path / "tum.txt", rows, fmt="%.9f")
    return tmp_path


def write_video(path, walk, kind, rate=25.0):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*kind), rate, SIZE, False)
    for index in range(FRAMES):
        writer.write(walk.image(index))
    writer.release()


def opened(file):
    return open_batch(plan(load_experiment(file))[:1])[0]


@pytest.mark.usefixtures("lean")
def test_images_with_intrinsics_and_a_trajectory_are_measured(tracknoise, files, walk):
    arguments = [str(files / "shots"), "--camera", str(files / "cam.json"), "--trajectory", str(files / "kitti.txt")]
    code, out, _ = tracknoise("init", *arguments, "-o", str(files / "x.toml"))
    assert code == 0
    assert "poses of 10 of 10 frames are from" in out
    assert "in the format of KITTI, of the camera" in out
    written = tomllib.loads((files / "x.toml").read_text())
    dataset = written["dataset"]
    assert written["name"] == "x"  # of the run folder too
    assert (dataset["trajectory"], dataset["trajectory_of"]) == (str(files / "kitti.txt"), "camera")
    np.testing.assert_allclose(opened(files / "x.toml").world_from_camera, walk.world_from_camera, atol=1e-9)
    run = ["run", str(files / "x.toml"), "--out", str(files / "run"), "--workers", "1", "--quiet", "--no-report"]
    assert tracknoise(*run, "--trackers", "lucas-kanade")[0] == 0


def test_a_run_says_why_there_is_nothing_to_set(tracknoise, files, walk):
    every_other = np.c_[
        np.arange(0, FRAMES, 2),
        walk.world_from_camera[::2, :3, 3],
        Rotation.from_matrix(walk.world_from_camera[::2, :3, :3]).as_quat(),
    ]
    np.savetxt(files / "numbers.txt", every_other, fmt="%.9f")
    arguments = [str(files / "shots"), "--camera", str(files / "cam.json"), "--trajectory", str(files / "numbers.txt")]
    assert tracknoise("init", *arguments, "-o", str(files / "x.toml"))[0] == 0
    run = ["run", str(files / "x.toml"), "--out", str(files / "run"), "--workers", "1", "--quiet", "--no-report"]
    code, out, _ = tracknoise(*run, "--trackers", "lucas-kanade")
    assert code == 0
    assert "true positions are known in too few successive frames" in " ".join(out.split())


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_images_of_16_bits_have_the_levels_of_their_sensor(tracknoise, files, walk, bits):
    for index in range(FRAMES):
        deep = np.rint(walk.image(index) * ((2**bits - 1) / 255.0)).astype(np.uint16)
        assert cv2.imwrite(str(files / "shots" / f"shot{index}.png"), deep)
    arguments = [str(files / "shots"), "--camera", str(files / "cam.json"), "--trajectory", str(files / "kitti.txt")]
    assert tracknoise("init", *arguments, "-o", str(files / "x.toml"))[0] == 0
    assert tomllib.loads((files / "x.toml").read_text())["dataset"]["options"]["image_levels"] == [0, 2**bits - 1]
    np.testing.assert_allclose(opened(files / "x.toml").image(3), walk.image(3), atol=1)


@pytest.mark.usefixtures("lean")
def test_a_changed_trajectory_is_measured_again(tracknoise, files):
    arguments = [str(files / "shots"), "--camera", str(files / "cam.json"), "--trajectory", str(files / "kitti.txt")]
    tracknoise("init", *arguments, "-o", str(files / "x.toml"))
    run = ["run", str(files / "x.toml"), "--out", str(files / "run"), "--workers", "1", "--no-report"]
    run += ["--trackers", "lucas-kanade"]
    assert tracknoise(*run)[0] == 0
    rows = np.loadtxt(files / "kitti.txt")
    np.savetxt(files / "kitti.txt", rows + 1e-3 * np.arange(FRAMES)[:, None] * (np.arange(12) == 3), fmt="%.12g")
    code, out, err = tracknoise(*run)
    assert code == 0
    assert "kitti.txt changed" in " ".join((out + err).split())


def test_the_check_takes_a_trajectory_too(tracknoise, files):
    arguments = ["folder", str(files / "shots"), "--option", f"camera_file={files / 'cam.json'}"]
    code, out, _ = tracknoise("check", *arguments, "--trajectory", str(files / "kitti.txt"), "--quiet")
    assert code in (0, 4)
    assert "poses are from" in " ".join(out.split())


@pytest.mark.parametrize(("name", "kind"), [("clip.mp4", "mp4v"), ("clip.avi", "MJPG")])
def test_frames_of_a_video_have_its_times_and_the_poses_of_a_trajectory(tracknoise, files, walk, name, kind):
    write_video(files / name, walk, kind)
    arguments = [str(files / name), "--camera", str(files / "cam.json"), "--trajectory", str(files / "tum.txt")]
    code, _, err = tracknoise("init", *arguments, "-o", str(files / "v.toml"))
    assert code == 0
    assert f"{FRAMES} frames of" in err
    sequence = opened(files / "v.toml")
    np.testing.assert_allclose(sequence.timestamps_s, np.arange(FRAMES) / 25, atol=1e-4)
    np.testing.assert_allclose(sequence.world_from_camera, walk.world_from_camera, atol=1e-3)
    for index in (7, 0, 3):  # in any order, each is the frame that was written
        difference = sequence.image(index).astype(float) - walk.image(index)
        assert np.abs(difference).mean() < 8.0


def test_frames_of_a_video_are_replaced_by_force_alone_and_kept_where_that_fails(tracknoise, files, walk):
    write_video(files / "clip.avi", walk, "MJPG")
    late, frames = files / "late.txt", files / "v-frames"
    rows = np.loadtxt(files / "tum.txt")
    np.savetxt(late, rows + 1e3 * (np.arange(rows.shape[1]) == 0), fmt="%.9f")

    def init(trajectory, *options):
        given = [str(files / "clip.avi"), "--camera", str(files / "cam.json"), "--trajectory", str(trajectory)]
        code, _, err = tracknoise("init", *given, "-o", str(files / "v.toml"), *options)
        return code, err

    assert init(late)[0] == 1
    assert not frames.exists()
    assert init(files / "tum.txt")[0] == 0
    assert init(files / "tum.txt")[0] == 1
    before = (frames / "images" / "000003.png").stat().st_mtime_ns
    assert init(late, "--force")[0] == 1
    assert (frames / "images" / "000003.png").stat().st_mtime_ns == before
    assert init(files / "tum.txt", "--force")[0] == 0
    assert (frames / "images" / "000003.png").stat().st_mtime_ns > before
    assert not [*files.glob(".v-frames*")]
    (frames / "mine.txt").touch()
    code, err = init(files / "tum.txt", "--force")
    assert code == 1
    assert "already exists, expected a new or empty folder" in err


POSED = ["shots", "--camera", "cam.json", "--trajectory", "kitti.txt"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["shots", "--trajectory", "kitti.txt"], "no camera.json, expected it, or --option camera_file=FILE"),
        (["shots"], "no known layout"),
        (["broken.mp4"], "a video without intrinsics, expected --camera FILE"),
        (["broken.mp4", "--camera", "cam.json", "--trajectory", "kitti.txt"], "a file that OpenCV cannot read"),
        (["shots", "--camera", "cam.json", "--trajectory", "cam.json"], "a first row of"),
        (
            ["shots", "--camera", "cam.json", "--trajectory", "kitti.txt", "--option", "trajectory_of=imu"],
            "camera or body",
        ),
        (
            ["shots", "--camera", "cam.json", "--trajectory", "kitti.txt", "--option", "trajectory_of=body"],
            "on the body",
        ),
    ],
)
def test_what_cannot_be_used_is_one_line(tracknoise, files, monkeypatch, arguments, message):
    monkeypatch.chdir(files)
    (files / "broken.mp4").write_bytes(b"\0" * 100)
    code, _, err = tracknoise("init", *arguments, "-o", "x.toml")
    assert code == 1
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not (files / "x.toml").exists()


def test_where_poses_alone_are_missing_it_says_how_to_give_them(tracknoise, files):
    (files / "shots").rename(files / "images")
    for index in range(FRAMES):
        (files / "images" / f"shot{index}.png").rename(files / "images" / f"{index:06d}.png")
    (files / "cam.json").rename(files / "camera.json")
    code, _, err = tracknoise("init", "folder", str(files), "-o", str(files / "x.toml"))
    assert code == 1
    assert "--trajectory FILE, or poses from the images: --camera FILE" in err


def test_without_pycolmap_it_says_what_to_install(tracknoise, files, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pycolmap", None)
    code, _, err = tracknoise("init", str(files / "shots"), "--camera", str(files / "cam.json"), "-o", str(files / "x"))
    assert code == 1
    assert "pip install 'tracknoise[sfm]', or give poses: --trajectory FILE" in err


@needs_colmap
def test_images_alone_give_poses_up_to_a_similarity(tracknoise, files, walk):
    arguments = [str(files / "shots"), "--camera", str(files / "cam.json"), "-o", str(files / "x.toml")]
    code, _, err = tracknoise("init", *arguments)
    assert code == 0, err
    assert f"{files / 'x-poses.txt'}: poses of 10 of 10 frames" in err
    found, exact = opened(files / "x.toml").world_from_camera, walk.world_from_camera
    of_first = [np.array([invert(poses[:1])[0] @ pose for pose in poses]) for poses in (found, exact)]
    turned = Rotation.from_matrix(of_first[0][:, :3, :3].transpose(0, 2, 1) @ of_first[1][:, :3, :3])
    assert np.degrees(turned.magnitude()).max() < 0.5
    steps = [poses[1:, :3, 3] / np.linalg.norm(poses[-1, :3, 3]) for poses in of_first]
    np.testing.assert_allclose(*steps, atol=0.05)
    code, _, err = tracknoise("init", *arguments, "--force")  # the same images give the same poses
    again = opened(files / "x.toml").world_from_camera
    assert code == 0
    np.testing.assert_array_equal(again, found)


@needs_colmap
def test_images_that_show_nothing_give_no_poses(tracknoise, files):
    for path in (files / "shots").iterdir():
        assert cv2.imwrite(str(path), np.full((SIZE[1], SIZE[0]), 128, np.uint8))
    code, _, err = tracknoise("init", str(files / "shots"), "--camera", str(files / "cam.json"), "-o", str(files / "x"))
    assert code == 1
    assert "images from which COLMAP reconstructs no poses" in err


def test_a_recording_whose_images_cannot_be_read_is_refused(tracknoise, files):
    first = files / "shots" / "shot0.png"
    cv2.imwrite(str(first), cv2.imread(str(first), cv2.IMREAD_GRAYSCALE)[::2, ::2])
    arguments = [str(files / "shots"), "--camera", str(files / "cam.json"), "--trajectory", str(files / "tum.txt")]
    code, _, err = tracknoise("init", *arguments, "-o", str(files / "x.toml"))
    assert code == 1
    assert "expected the camera's" in " ".join(err.split())
    assert "--trajectory FILE" not in err
    assert not (files / "x.toml").exists()
