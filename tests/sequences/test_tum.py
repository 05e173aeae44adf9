import re
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.writers.tum import pose_row, stamp, write_list, write_poses, write_tum

from tracknoise.exceptions import DataError, NothingToMeasureError, SettingsError, TracknoiseError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.sequence import SWEPT, TRIANGULATED, path_of
from tracknoise.sequences.simulated import Simulated
from tracknoise.sequences.timed_poses import poses_at, trajectory
from tracknoise.sequences.tum import Tum

INTRINSICS = (60.0, 61.0, 31.0, 24.0)


def images(count, size=(64, 48)):
    return list(np.random.default_rng(0).integers(0, 256, (count, *size[::-1]), dtype=np.uint8))


def poses(count):
    made = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    made[:, :3, :3] = Rotation.from_rotvec(np.outer(np.arange(count), (0.02, -0.03, 0.01))).as_matrix()
    made[:, :3, 3] = np.arange(count)[:, None] * (0.1, 0.0, 0.2) + (1.0, 2.0, 3.0)
    return made


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    folder = tmp_path / "mine"
    write_tum(folder, images(4), poses(4), depths=[np.full((48, 64), 1.5)] * 4)
    (folder / "calibration.txt").write_text("60 61 31 24\n")
    return folder


def test_between_images_poses_are_those_that_were_recorded(scene):
    times_s = 1305031241.0 + np.arange(0.0, 0.1, 0.005)
    moved = np.broadcast_to(np.eye(4), (len(times_s), 4, 4)).copy()
    moved[:, 0, 3] = np.square(times_s - times_s[0])
    write_poses(scene / "groundtruth.txt", times_s, moved)
    sequence = open_sequence("tum", scene.parent)
    path = path_of(sequence)
    posed = np.isfinite(sequence.world_from_camera[:, 0, 0])
    np.testing.assert_array_equal(path.at(sequence.timestamps_s[posed]), sequence.world_from_camera[posed])
    np.testing.assert_allclose(path.at(np.array([0.015]))[0, 0, 3], 0.015**2, atol=1e-8)


def test_a_simulated_recording_is_read_as_it_was_made(tmp_path):
    source = Simulated(motions=("arvr",), frames=6, width=96, height=64, supersampling=1)
    sequence = source.open(source.sequences()[0])
    camera = sequence.camera
    shown = [sequence.image(index) for index in range(6)]
    deep = [
        np.where(depth.valid & (depth.depth_m < 13.1), depth.depth_m, 0.0) for depth in map(sequence.depth, range(6))
    ]
    write_tum(tmp_path / "arvr", shown, sequence.world_from_camera, depths=deep)
    (tmp_path / "arvr" / "calibration.txt").write_text(f"{camera.fx!r} {camera.fy!r} {camera.cx!r} {camera.cy!r}\n")
    read = open_sequence("tum", tmp_path)
    assert read.camera == camera
    np.testing.assert_allclose(read.world_from_camera, sequence.world_from_camera, atol=1e-9)
    for index in range(6):
        np.testing.assert_array_equal(read.image(index), shown[index])
        depth = read.depth(index)
        np.testing.assert_allclose(depth.depth_m[depth.valid], deep[index][depth.valid], atol=1.01e-4)
        np.testing.assert_array_equal(depth.valid, deep[index] > 5e-5)


def test_poses_are_interpolated_between_those_around_an_image(tmp_path):
    """A steady turn and drift, recorded at 100 Hz with another phase than the images."""
    start = 1305031241.0

    def at(times_s):
        made = np.broadcast_to(np.eye(4), (len(times_s), 4, 4)).copy()
        made[:, :3, :3] = Rotation.from_rotvec(np.outer(times_s - start, (0.5, -1.0, 0.3))).as_matrix()
        made[:, :3, 3] = np.outer(times_s - start, (1.0, 2.0, -0.5))
        return made

    folder = tmp_path / "mine"
    times_s = write_tum(folder, images(6), poses(6))
    recorded_s = np.round(start - 0.05 + np.arange(40) * 0.01 + 0.0037, 6)
    write_poses(folder / "groundtruth.txt", recorded_s, at(recorded_s))
    (folder / "calibration.txt").write_text("60 61 31 24\n")
    read = open_sequence("tum", tmp_path)
    np.testing.assert_allclose(read.world_from_camera, at(times_s), atol=2e-7)
    np.testing.assert_allclose(read.timestamps_s, times_s - times_s[0], atol=1e-6)
    assert abs(read.clock_start_ns / 1e9 - times_s[0]) < 1e-6
    shifted = open_sequence("tum", tmp_path, time_shift_s=0.01)
    np.testing.assert_allclose(shifted.world_from_camera, at(times_s + 0.01), atol=2e-7)


def test_frames_in_gaps_of_the_poses_have_none(scene):
    times_s = 1305031241.0 + np.array([-0.01, 0.0, 1 / 30, 1 / 15 + 0.2])
    write_poses(scene / "groundtruth.txt", np.round(times_s, 6), poses(4))
    read = open_sequence("tum", scene)
    assert np.isnan(read.world_from_camera).all(axis=(1, 2)).tolist() == [False, False, True, True]
    assert "2 of 4 frames have no pose: none was recorded around them within 0.1 s" in read.notes
    assert np.isfinite(open_sequence("tum", scene, max_pose_gap_s=0.3).world_from_camera).all()


@pytest.mark.parametrize("lost", ["nan nan nan nan nan nan nan", "0 0 0 0 0 0 0"])
def test_rows_without_a_pose_are_left_out(scene, lost):
    path = scene / "groundtruth.txt"
    path.write_text(re.sub(r"^(\S*1241\.033333) .*$", rf"\1 {lost}", path.read_text(), flags=re.MULTILINE))
    np.testing.assert_allclose(open_sequence("tum", scene).world_from_camera, poses(4), atol=1e-3)
    read = open_sequence("tum", scene, max_pose_gap_s=0.05)
    assert np.isnan(read.world_from_camera[:, 0, 0]).tolist() == [False, True, False, False]
    assert f"{path}: 1 of 4 rows holds no pose (NaN or a quaternion of 0)" in read.notes


def test_poses_of_another_clock_are_refused_with_both_ranges(scene):
    write_poses(scene / "groundtruth.txt", [10.0, 10.1], poses(2))
    with pytest.raises(
        DataError, match=r"groundtruth\.txt: poses from -1305031231\.000 s .* images end after 0\.100 s"
    ):
        open_sequence("tum", scene)


def test_depth_is_the_nearest_within_the_gap(scene):
    times_s = 1305031241.0 + np.array([0.0, 0.0433, 0.1])
    maps = [np.full((48, 64), units, np.uint16) for units in (5000, 10000, 15000)]
    write_list(scene, "depth", np.round(times_s, 6), maps)
    read = open_sequence("tum", scene)
    found = [None if depth is None else depth.depth_m[0, 0] for depth in map(read.depth, range(4))]
    assert found == [1.0, 2.0, None, 3.0]
    assert "1 of 4 frames has no depth" in read.notes
    assert any("0.0 ms from it in the median, 10.0 ms at most" in note for note in read.notes)
    assert open_sequence("tum", scene, max_gap_s=0.03).depth(2).depth_m[0, 0] == 2.0
    assert open_sequence("tum", scene, depth_unit_m=0.001).depth(0).depth_m[0, 0] == 5.0


def write_pairs(scene: Path, depth_of: dict[int, int], *, depth_first: bool = False, further: str = "") -> Path:
    """Depth maps of 1, 2, 3 and 4 m, 5 ms after the images, and a list of which of them belongs to which image."""
    times_s = np.round(1305031241.0 + np.arange(4) / 30, 6)
    write_list(scene, "depth", times_s + 0.005, [np.full((48, 64), 5000 * (i + 1), np.uint16) for i in range(4)])
    rows = []
    for image, depth in depth_of.items():
        names = [(stamp(times_s[image]), "rgb"), (stamp(times_s[depth] + 0.005), "depth")]
        fields = [f"{time} {kind}/{time}.png" for time, kind in (reversed(names) if depth_first else names)]
        rows.append(" ".join(fields) + further)
    path = scene / "associations.txt"
    path.write_text("# pairs\n" + "\n".join(rows) + "\n")
    return path


def depths_m(read) -> list[float | None]:
    return [None if depth is None else float(depth.depth_m[0, 0]) for depth in map(read.depth, range(len(read)))]


@pytest.mark.parametrize("layout", [{}, {"depth_first": True}, {"further": " 1305031241.0 1 2 3 0 0 0 1"}])
@pytest.mark.parametrize("listed", [True, False])
def test_depth_is_the_one_that_a_list_of_pairs_names(scene, layout, listed):
    """Not the nearest in time, and however far; the list says so where images are listed elsewhere too."""
    path = write_pairs(scene, {0: 1, 1: 0, 2: 3, 3: 3}, **layout)
    if not listed:
        (scene / "rgb.txt").unlink()
        (scene / "depth.txt").unlink()
    read = open_sequence("tum", scene)
    assert depths_m(read) == [2.0, 1.0, 4.0, 4.0]
    np.testing.assert_array_equal(read.image(3), images(4)[3])
    note = f"the depth of an image is the one that {path} names: 33.3 ms from it in the median, 38.3 ms at most"
    assert note in read.notes
    assert not any("repeat" in note or "nearest" in note for note in read.notes)


def test_an_image_that_no_pair_names_has_no_depth(scene):
    write_pairs(scene, {1: 0, 3: 2})
    read = open_sequence("tum", scene)
    assert depths_m(read) == [None, 1.0, None, 3.0]
    assert "2 of 4 frames have no depth" in read.notes


@pytest.mark.parametrize("text", ["# none\n", "1305031241.0 rgb/1305031241.000000.png 1305031241.0 1 2 3 0 0 0 1\n"])
def test_a_list_of_the_same_name_without_pairs_changes_nothing(scene, text):
    write_pairs(scene, {0: 1}).write_text(text)
    assert depths_m(open_sequence("tum", scene)) == [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("1305031241.1 rgb/1305031241.100000.png", "2 fields, expected 4"),
        ("1305031241.1 rgb/1305031241.100000.png later depth/a.png", "'later', expected a timestamp, seconds"),
        ("1305031241.1 rgb/1305031241.100000.png 1305031241100000000 depth/a.png", "a timestamp of 1.30503e.18"),
        ("1305031241.1 rgb/1305031241.100000.png 1305031241.1 0.5", "0.5 as a filename"),
        ("1305031241.1 depth/a.png 1305031241.1 rgb/1305031241.100000.png", "image and depth map in another order"),
        ("1305031241.0 rgb/1305031241.000000.png 1305031241.1 depth/a.png", "another depth map of rgb/1305031241.0"),
    ],
)
def test_a_wrong_pair_is_refused_with_its_line(scene, row, message):
    path = write_pairs(scene, {0: 1, 1: 0})
    path.write_text(f"{path.read_text()}{row}\n")
    with pytest.raises(DataError, match=f"{re.escape(str(path))}:4: {message}"):
        open_sequence("tum", scene)


def test_pairs_of_other_images_are_refused(scene):
    path = write_pairs(scene, {0: 1})
    path.write_text("1.0 rgb/other.png 1.0 depth/other.png\n")
    with pytest.raises(DataError, match=r"associations\.txt: no pair of an image of the recording"):
        open_sequence("tum", scene)


def test_pairs_of_images_that_are_not_listed_are_counted(scene):
    path = write_pairs(scene, {0: 1})
    path.write_text(f"{path.read_text()}1305031249.0 rgb/other.png 1305031249.0 depth/other.png\n")
    assert f"{path}: 1 pair of images that rgb.txt does not list, left out" in open_sequence("tum", scene).notes


def test_without_depth_there_is_no_truth_at_birth(scene):
    (scene / "depth.txt").unlink()
    read = open_sequence("tum", scene)
    assert read.depth(0) is None
    assert read.truths == (SWEPT, TRIANGULATED)
    write_list(scene, "depth", [1.0], [np.zeros((48, 64), np.uint16)])
    with pytest.raises(DataError, match=r"depth: depth maps: 1, but none within 0\.02 s of an image"):
        open_sequence("tum", scene)


@pytest.mark.parametrize(
    ("name", "camera", "place"),
    [
        ("rgbd_dataset_freiburg1_desk", (517.3, 516.5, 318.6, 255.3), "freiburg1"),
        ("fr2_xyz", (520.9, 521.0, 325.1, 249.7), "freiburg2"),
        ("rgbd_dataset_freiburg3_office", (535.4, 539.2, 320.1, 247.6), "freiburg3"),
        ("rgbd_bonn_balloon", (542.822841, 542.57687, 315.59352, 237.756098), "bonn"),
    ],
)
def test_cameras_of_known_recordings_are_used_and_said(tmp_path, name, camera, place):
    write_tum(tmp_path / name, images(2, (640, 480)), poses(2))
    for root in (tmp_path, tmp_path / name):
        read = open_sequence("tum", root)
        assert (read.camera.fx, read.camera.fy, read.camera.cx, read.camera.cy) == camera
        assert read.group == place
        assert any("published camera" in note for note in read.notes)


def test_a_camera_file_is_used_before_what_is_published(tmp_path):
    folder = tmp_path / "freiburg1"
    write_tum(folder, images(2), poses(2), depths=[np.ones((48, 64))] * 2, units_per_metre=1000)
    (folder / "camera.yaml").write_text(
        "model: radtan\nwidth: 64\nheight: 48\nfx: 60\nfy: 61\ncx: 31\ncy: 24\ndistortion: []\ndepth_scale: 1000\n"
    )
    read = open_sequence("tum", tmp_path)
    assert read.camera == Camera(64, 48, *INTRINSICS)
    assert read.depth(0).depth_m[0, 0] == pytest.approx(1.0)
    other = tmp_path / "other.yaml"
    other.write_text((folder / "camera.yaml").read_text().replace("fx: 60", "fx: 70"))
    assert open_sequence("tum", tmp_path, camera_file=other).camera.fx == 70.0
    with pytest.raises(DataError, match="missing"):
        open_sequence("tum", tmp_path, camera_file=tmp_path / "missing.yaml")


def test_a_file_of_orb_slam_states_the_camera_and_the_unit_of_depth(tmp_path):
    write_tum(tmp_path / "desk", images(2), poses(2), depths=[np.ones((48, 64))] * 2, units_per_metre=1000)
    file = tmp_path / "desk.yaml"
    numbers = {"Camera.fx": 60.0, "Camera.fy": 61.0, "Camera.cx": 31.0, "Camera.cy": 24.0, "DepthMapFactor": 1000.0}
    file.write_text("%YAML:1.0\n" + "".join(f"{key}: {value}\n" for key, value in numbers.items()))
    read = open_sequence("tum", tmp_path, camera_file=file)
    assert read.camera == Camera(64, 48, 60.0, 61.0, 31.0, 24.0)
    assert read.depth(0).depth_m[0, 0] == pytest.approx(1.0)


def test_unknown_names_need_a_camera(tmp_path):
    write_tum(tmp_path / "vehicle", images(2), poses(2))
    with pytest.raises(DataError, match=r"no camera, .* expected one of camera\.yaml, .* or --option camera_file=FILE"):
        open_sequence("tum", tmp_path)


def test_poses_of_markers_are_moved_to_the_camera(tmp_path):
    """Bonn publishes T_ros T_marker T_ros T_m; T_ros is its own inverse, and a world may be turned."""
    write_tum(tmp_path / "rgbd_bonn_box", images(3, (640, 480)), poses(3))
    read = open_sequence("tum", tmp_path)
    moved = invert(poses(3)) @ read.world_from_camera
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0], (3, 4, 4)), atol=1e-12)
    published = np.array([[-1.0157, -0.1828, 0.2389], [-0.3009, 0.6147, -0.8085], [0.0009, -0.8431, -0.6413]]) / 1.0592
    np.testing.assert_allclose(moved[0, :3, :3], published, atol=2e-3)
    np.testing.assert_allclose(moved[0, :3, 3], (-0.0113, 0.0111, -0.0098), atol=1e-12)


def test_poses_of_a_body_need_to_know_where_the_camera_is(scene):
    with pytest.raises(DataError, match="poses of a body and no camera file"):
        open_sequence("tum", scene, poses_of="body")
    text = "camera_model: pinhole\nintrinsics: [60, 61, 31, 24]\ndistortion_model: radtan\n"
    text += "distortion_coefficients: [0, 0, 0, 0]\nresolution: [64, 48]\n"
    (scene / "camera.yaml").write_text(text)
    with pytest.raises(DataError, match="no position of the camera on the body"):
        open_sequence("tum", scene, poses_of="body")
    (scene / "camera.yaml").write_text(f"{text}T_BS:\n  data: [1, 0, 0, 0.5, 0, 0, -1, 0, 0, 1, 0, 0.25, 0, 0, 0, 1]\n")
    body_from_camera = np.array([[1.0, 0, 0, 0.5], [0, 0, -1, 0], [0, 1, 0, 0.25], [0, 0, 0, 1]])
    moved = open_sequence("tum", scene, poses_of="body").world_from_camera
    np.testing.assert_allclose(moved, poses(4) @ body_from_camera, atol=1e-9)
    (scene / "camera.yaml").write_text((scene / "camera.yaml").read_text() + "timeshift_cam_imu: 0.0125\n")
    shifted = "the camera file states a time shift of 12.5 ms; only the option time_shift_s is applied"
    assert shifted in open_sequence("tum", scene, poses_of="body").notes
    unmoved = open_sequence("tum", scene)
    np.testing.assert_allclose(unmoved.world_from_camera, poses(4), atol=1e-9)
    assert any("taken as those of the camera" in note for note in unmoved.notes)


def write_icl_nuim(folder: Path, poses_up: np.ndarray) -> None:
    """Depth first, frames numbered, and poses from frame 1 on: a world and a camera whose y points up."""
    for kind, made in (("rgb", images(3, (640, 480))), ("depth", [np.full((480, 640), 5000, np.uint16)] * 3)):
        (folder / kind).mkdir(parents=True)
        for index, image in enumerate(made):
            assert cv2.imwrite(str(folder / kind / f"{index}.png"), image)
    rows = "".join(f"{index} depth/{index}.png {index} rgb/{index}.png\n" for index in range(3))
    (folder / "associations.txt").write_text(rows)
    (folder / "livingRoom2.gt.freiburg").write_text(
        "\n".join(pose_row(str(i + 1), poses_up[i]) for i in range(2)) + "\n"
    )


def test_icl_nuim_has_negative_fy_numbers_for_times_and_no_pose_of_frame_0(tmp_path):
    """What its own formula v = cy - 480 y / z gives is what the camera that is read gives, in a world turned over."""
    points_up = np.random.default_rng(5).uniform((-1, -1, 3), (1, 1, 5), (20, 3))
    poses_up = poses(2)
    poses_up[:, :3, 3] *= 0.1
    write_icl_nuim(tmp_path / "living_room_traj2_frei_png", poses_up)
    read = open_sequence("tum", tmp_path)
    assert np.isnan(read.world_from_camera[:, 0, 0]).tolist() == [True, False, False]
    assert read.timestamps_s is None
    assert read.depth(0).depth_m[0, 0] == pytest.approx(1.0)
    assert read.group == "living_room"
    for index in (1, 2):
        x, y, z = transform(invert(poses_up[index - 1]), points_up).T
        expected = np.stack([319.5 + 481.2 * x / z, 239.5 - 480.0 * y / z], axis=-1)
        seen = read.camera.project(transform(invert(read.world_from_camera[index]), points_up * (1.0, -1.0, 1.0)))
        np.testing.assert_allclose(seen, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("camera.yaml", "width: 640\nheight: 480\nfx: 481.2\nfy: 480\ncx: 319.5\ncy: 239.5\n"),
        ("calibration.txt", "481.2 480 319.5 239.5\n"),
        ("calibration.txt", "481.2 -480 319.5 239.5\n"),
    ],
)
def test_the_poses_of_icl_nuim_are_turned_with_any_camera_file(tmp_path, file, text):
    """Camera files cannot hold a negative fy; the poses are those that were published all the same."""
    folder = tmp_path / "living_room_traj2_frei_png"
    write_icl_nuim(folder, poses(2))
    published = open_sequence("tum", folder)
    (folder / file).write_text(text)
    read = open_sequence("tum", folder)
    assert read.camera == published.camera
    np.testing.assert_array_equal(read.world_from_camera, published.world_from_camera)
    assert sum("turned down" in note for note in read.notes) == 1


def test_a_negative_fy_in_a_calibration_file_turns_the_poses_too(scene):
    (scene / "calibration.txt").write_text("60 -61 31 24\n")
    read = open_sequence("tum", scene)
    assert read.camera == Camera(64, 48, *INTRINSICS)
    flip = np.diag((1.0, -1.0, 1.0, 1.0))
    np.testing.assert_allclose(read.world_from_camera, flip @ poses(4) @ flip, atol=1e-9)
    assert any("fy is negative" in note for note in read.notes)


def test_rows_that_repeat_a_time_are_ignored_and_unsorted_ones_sorted(scene):
    lines = (scene / "rgb.txt").read_text().splitlines()
    (scene / "rgb.txt").write_text("\n".join([*lines[:2], lines[4], lines[3], lines[2], lines[2], lines[5]]) + "\n")
    read = open_sequence("tum", scene)
    np.testing.assert_array_equal(read.image(0), images(4)[0])
    np.testing.assert_allclose(read.world_from_camera, poses(4), atol=1e-9)
    rgb = scene / "rgb.txt"
    assert f"{rgb}: the rows are not in order of time, so they were sorted" in read.notes
    assert f"{rgb}: 1 of 5 rows repeats the time of an earlier row and is ignored" in read.notes


@pytest.mark.parametrize("change", [(b" ", b","), (b" ", b", "), (b" ", b"\t"), (b"rgb/", b"rgb\\"), (b"\n", b"\r\n")])
def test_lists_are_read_as_the_tools_of_the_benchmark_read_them(scene, change):
    """Commas and tabs separate fields; lists that were written on Windows have other ends of lines and folders."""
    expected = open_sequence("tum", scene)
    for name in ("rgb.txt", "groundtruth.txt"):
        (scene / name).write_bytes((scene / name).read_bytes().replace(*change))
    found = open_sequence("tum", scene)
    np.testing.assert_array_equal(found.world_from_camera, expected.world_from_camera)
    np.testing.assert_array_equal(found.image(1), expected.image(1))


def test_an_image_that_is_listed_and_missing_is_named_when_it_is_read(scene):
    name = scene / "rgb" / f"{stamp(1305031241.0)}.png"
    name.unlink()
    read = open_sequence("tum", scene)
    assert read.image(1).shape == (48, 64)
    with pytest.raises(DataError, match=re.escape(f"{name}: no such file")):
        read.image(0)


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("rgb.txt", "# nothing\n", "no files, expected rows of a timestamp and a file"),
        ("rgb.txt", "1.0\n", r":1: 1 field, expected 2 \(timestamp filename\)"),
        ("rgb.txt", "now rgb/a.png\n", ":1: 'now', expected a timestamp, seconds"),
        ("rgb.txt", "nan rgb/a.png\n", ":1: a timestamp of nan, expected seconds"),
        ("rgb.txt", "1305031241029623000 rgb/a.png\n", ":1: a timestamp of 1.30503e.18, expected seconds"),
        ("groundtruth.txt", "# empty\n", "no poses, expected rows of a time and a pose"),
        ("groundtruth.txt", "1305031241029623000 0 0 0 0 0 0 1\n", ":1: a timestamp of 1.30503e.18, expected seconds"),
        ("groundtruth.txt", "1305031241 0 0 0 0 0 0 2\n", ":1: a quaternion of norm 2, expected norm 1"),
        ("calibration.txt", "0 61 31 24\n", "fx 0, fy 61, cx 31, cy 24, expected focal lengths"),
        ("calibration.txt", "60 61 31 24\n60 61 31 24\n", "2 rows, expected one of fx fy cx cy"),
    ],
)
def test_damaged_files_are_named_with_what_was_found(scene, file, text, message):
    (scene / file).write_text(text)
    with pytest.raises(DataError, match=f"{re.escape(str(scene / file))}.*{message}"):
        open_sequence("tum", scene)


@pytest.mark.parametrize(("fy", "p1"), [(61, 0.002), (-61, -0.002)])
def test_a_row_of_numbers_may_have_coefficients_of_distortion(scene, fy, p1):
    (scene / "calibration.txt").write_text(f"# fx fy cx cy k1 k2 p1 p2\n60 {fy} 31 24 -0.1 0.01 0.002 0.003\n")
    camera = open_sequence("tum", scene).camera
    assert (camera.fx, camera.fy, camera.distortion) == (60.0, 61.0, (-0.1, 0.01, p1, 0.003))


@given(
    st.sampled_from(["rgb.txt", "depth.txt", "associations.txt", "groundtruth.txt", "calibration.txt"]),
    st.binary(max_size=200),
)
def test_any_bytes_give_one_clear_line(tmp_path_factory, file, content):
    folder = tmp_path_factory.mktemp("fuzz") / "mine"
    write_tum(folder, images(2), poses(2), depths=[np.ones((48, 64))] * 2)
    (folder / "calibration.txt").write_text("60 61 31 24\n")
    (folder / file).write_bytes(content)
    with suppress(TracknoiseError):
        sequence = open_sequence("tum", folder)
        sequence.image(0)
        sequence.depth(0)


@pytest.mark.parametrize("option", ["depth_unit_m", "max_gap_s", "max_pose_gap_s"])
def test_impossible_options_are_named(tmp_path, option):
    with pytest.raises(SettingsError, match=option):
        make_reader("tum", tmp_path, {option: -1.0})


def test_the_real_sample_is_read(sample):
    root = sample("tum_rgbd")
    reader = Tum(root)
    (listed,) = reader.sequences()
    read = reader.open(listed)
    assert len(read) == 50
    assert np.isfinite(read.world_from_camera).all()
    assert np.median(np.diff(read.timestamps_s)) == pytest.approx(1 / 30, abs=0.003)
    assert (read.camera.fx, read.camera.distortion[0]) == (517.3, 0.2624)
    depth = read.depth(25)
    assert 0.5 < np.median(depth.depth_m[depth.valid]) < 5.0


def rounded(path, digits):
    """The rows of a file whose times were printed with fewer digits."""
    rows = [line.split(" ", 1) for line in path.read_text().splitlines() if not line.startswith("#")]
    path.write_text("".join(f"{float(time):.{digits}g} {rest}\n" for time, rest in rows))


@pytest.mark.parametrize("name", ["groundtruth.txt", "rgb.txt"])
@pytest.mark.parametrize("digits", [6, 10])
def test_times_that_have_lost_their_digits_are_named(scene, name, digits):
    rounded(scene / name, digits)
    with pytest.raises(DataError, match=rf"{name}: 3 of 4 rows repeat the time of an earlier row, expected times with"):
        open_sequence("tum", scene.parent)


def test_rows_that_are_written_twice_do_no_harm(scene):
    truth = scene / "groundtruth.txt"
    truth.write_text(truth.read_text() + truth.read_text())
    found = open_sequence("tum", scene.parent)
    np.testing.assert_allclose(found.world_from_camera, poses(4), atol=1e-6)
    assert any("4 of 8 rows repeat the time of an earlier row" in note for note in found.notes)


def test_an_error_about_the_times_of_poses_keeps_what_was_found_out_about_them(scene):
    truth = scene / "groundtruth.txt"
    rows = truth.read_text().splitlines()
    truth.write_text("\n".join([*rows, rows[-1].replace("1305031241", "1305031300"), rows[-1]]) + "\n")
    with pytest.raises(DataError, match=r"after the first image, .*: 1 of 6 rows repeats the time of an earlier row"):
        open_sequence("tum", scene.parent, time_shift_s=1e4)


@pytest.mark.parametrize(("moved_m", "notes"), [(0.0, 1), (1.0, 2)])
def test_rows_of_one_time_that_contradict_are_named(tmp_path, moved_m, notes):
    rows = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (5, 1))
    rows[3, 0] = moved_m
    recorded = trajectory(tmp_path / "poses.txt", np.array([0.0, 0.1, 0.2, 0.2, 0.3]), rows, ["line"] * 5)
    assert len(recorded.notes) == notes
    assert ("positions up to 1 m apart" in recorded.notes[-1]) == (moved_m > 0.0)


def test_where_one_frame_has_a_pose_the_times_of_both_are_said(tmp_path):
    """Times from 0 in milliseconds: the first pose is at the first image."""
    path = tmp_path / "poses.txt"
    identity = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (5, 1))
    recorded = trajectory(path, 33.0 * np.arange(5), identity, [f"line {line}" for line in range(5)])
    expected = r"1 pose for 5 frames; poses from 0\.000 s to 132\.000 s after the first image, .* end after 0\.132 s"
    with pytest.raises(NothingToMeasureError, match=expected):
        poses_at(recorded, 0.033 * np.arange(5), max_gap_s=0.1)
