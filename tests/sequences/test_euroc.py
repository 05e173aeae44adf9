import re
from contextlib import suppress
from decimal import Decimal
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp
from tests.writers.euroc import (
    BODY_FROM_CAMERA,
    START_NS,
    matrix,
    numbers,
    write_euroc,
    write_images,
    write_poses,
    write_sensor,
)

from tracknoise.exceptions import DataError, SettingsError, TracknoiseError, UnknownNameError
from tracknoise.geometry.cameras import Camera, EquidistantCamera
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.sequence import path_of
from tracknoise.sequences.simulated import Simulated
from tracknoise.sequences.stereo import with_stereo_depth
from tracknoise.truth.accuracies import known_accuracy

INTRINSICS = (60.0, 61.0, 31.0, 24.0)
RADTAN = (-0.28, 0.07, 0.0002, 1.8e-05)


def images(count):
    return list(np.random.default_rng(0).integers(0, 256, (count, 48, 64), dtype=np.uint8))


def motion(times_ns):
    """A steady turn and drift of the camera."""
    at_s = (np.asarray(times_ns) - START_NS) / 1e9
    made = np.broadcast_to(np.eye(4), (len(at_s), 4, 4)).copy()
    made[:, :3, :3] = Rotation.from_rotvec(np.outer(at_s, (0.5, -1.0, 0.3))).as_matrix()
    made[:, :3, 3] = np.outer(at_s, (1.0, 2.0, -0.5)) + np.array([4.0, -2.0, 1.0])
    return made


POSITION = "p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m]"
FRAMES_NS = START_NS + np.arange(4) * 50_000_000
INVERSE = np.linalg.inv(BODY_FROM_CAMERA)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    folder = tmp_path / "V1_01_easy"
    write_euroc(folder, images(4), motion(FRAMES_NS), intrinsics=INTRINSICS, distortion=RADTAN)
    return folder


def table(scene: Path, source: str = "state_groundtruth_estimate0") -> Path:
    return scene / "mav0" / source / "data.csv"


def test_a_simulated_recording_is_read_as_it_was_made(tmp_path):
    source = Simulated(motions=("arvr",), frames=5, width=96, height=64, supersampling=1)
    sequence = source.open(source.sequences()[0])
    camera = sequence.camera
    shown = [sequence.image(index) for index in range(5)]
    intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
    write_euroc(tmp_path / "arvr", shown, sequence.world_from_camera, intrinsics=intrinsics)
    read = open_sequence("euroc", tmp_path)
    assert (read.camera.fx, read.camera.fy, read.camera.cx, read.camera.cy) == intrinsics
    np.testing.assert_allclose(read.world_from_camera, sequence.world_from_camera, atol=1e-12)
    for index in range(5):
        np.testing.assert_array_equal(read.image(index), shown[index])
        assert read.depth(index) is None


def test_the_camera_and_its_distortion_are_those_of_the_sensor_file(scene):
    read = open_sequence("euroc", scene)
    assert read.camera == Camera(64, 48, *INTRINSICS, RADTAN)
    assert read.group == "V1"
    np.testing.assert_allclose(read.timestamps_s, (0.0, 0.05, 0.1, 0.15), rtol=0, atol=1e-12)


def test_body_poses_are_interpolated_at_the_images_to_the_nanosecond(scene):
    recorded_ns = START_NS - 20_000_000 + 3_333_337 * np.arange(70)
    write_poses(table(scene), recorded_ns.tolist(), motion(recorded_ns) @ INVERSE)
    read = open_sequence("euroc", scene)
    np.testing.assert_allclose(read.world_from_camera, bodies_between(recorded_ns) @ BODY_FROM_CAMERA, atol=1e-9)
    np.testing.assert_allclose(read.world_from_camera, motion(FRAMES_NS), atol=1e-5)
    assert read.clock_start_ns == START_NS


def bodies_between(recorded_ns):
    """Independently, at each image: slerp by SciPy and linear positions."""
    bodies = motion(recorded_ns) @ INVERSE
    made = np.broadcast_to(np.eye(4), (4, 4, 4)).copy()
    times, at = (recorded_ns - START_NS).astype(float), (FRAMES_NS - START_NS).astype(float)
    made[:, :3, :3] = Slerp(times, Rotation.from_matrix(bodies[:, :3, :3]))(at).as_matrix()
    for axis in range(3):
        made[:, axis, 3] = np.interp(at, times, bodies[:, axis, 3])
    return made


def test_between_images_poses_are_those_that_were_recorded(scene):
    recorded_ns = START_NS - 20_000_000 + 3_333_337 * np.arange(70)
    shaken = motion(recorded_ns)
    shaken[:, 0, 3] += 0.01 * np.sin(2 * np.pi * (recorded_ns - START_NS) / 50e6)  # zero in every image
    write_poses(table(scene), recorded_ns.tolist(), shaken @ INVERSE)
    read = open_sequence("euroc", scene)
    path = path_of(read)
    np.testing.assert_array_equal(path.at(read.timestamps_s), read.world_from_camera)
    between_s = (recorded_ns - START_NS) / 1e9
    inside = (between_s > 0.0) & (between_s < read.timestamps_s[-1])
    np.testing.assert_allclose(path.at(between_s[inside]), shaken[inside], atol=1e-6)


def test_there_is_no_pose_in_a_gap_of_the_recorded_ones_nor_beyond_them(scene):
    recorded_ns = START_NS + 5_000_000 * np.arange(-2, 33)
    lost = (recorded_ns > FRAMES_NS[1]) & (recorded_ns < FRAMES_NS[2])
    write_poses(table(scene), recorded_ns[~lost].tolist(), motion(recorded_ns[~lost]) @ INVERSE)
    path = path_of(open_sequence("euroc", scene, max_pose_gap_s=0.02))
    at_s = np.array([-0.02, -0.01, 0.05, 0.06, 0.09, 0.1, 0.15, 0.2])
    assert np.isnan(path.at(at_s)).any(axis=(1, 2)).tolist() == [True, False, False, True, True, False, False, True]


def test_frames_outside_of_the_recorded_poses_have_none(scene):
    write_poses(table(scene), FRAMES_NS[1:3].tolist(), motion(FRAMES_NS[1:3]) @ INVERSE)
    read = open_sequence("euroc", scene)
    assert np.isnan(read.world_from_camera).all(axis=(1, 2)).tolist() == [True, False, False, True]
    assert any("2 of 4 frames have no pose" in note for note in read.notes)


def test_the_place_of_the_sensor_of_poses_is_applied(scene):
    """The poses of vicon0 are those of its marker: world_from_marker = world_from_body body_from_marker."""
    body_from_marker = np.eye(4)
    body_from_marker[:3, :3] = Rotation.from_rotvec((0.3, -0.2, 1.4)).as_matrix()
    body_from_marker[:3, 3] = (0.07, 0.02, -0.12)
    write_poses(table(scene, "vicon0"), FRAMES_NS.tolist(), motion(FRAMES_NS) @ INVERSE @ body_from_marker)
    table(scene, "vicon0").with_name("sensor.yaml").write_text(matrix("T_BS", body_from_marker))
    read = open_sequence("euroc", scene, pose_source="vicon0")
    np.testing.assert_allclose(read.world_from_camera, motion(FRAMES_NS), atol=1e-9)
    assert "poses come from vicon0" in read.notes
    assert "poses come from state_groundtruth_estimate0" in open_sequence("euroc", scene).notes


@pytest.mark.parametrize("text", [None, "sensor_type: pose\n"])
def test_a_sensor_of_poses_without_a_place_is_the_body(scene, text):
    sensor = table(scene).with_name("sensor.yaml")
    sensor.unlink()
    if text is not None:
        sensor.write_text(text)
    read = open_sequence("euroc", scene)
    np.testing.assert_allclose(read.world_from_camera, motion(FRAMES_NS), atol=1e-9)
    assert f"there is no T_BS in {sensor}, so the poses are taken as those of the body" in read.notes


def write_tum_vi(root: Path) -> Path:
    """TUM-VI: no sensor files but a Kalibr chain, fisheye lenses, 16-bit images, poses of mocap0 in 8 columns."""
    folder = root / "dataset-room1_512_16"
    device = folder / "mav0"
    for camera in ("cam0", "cam1"):
        shown = [(image.astype(np.uint16) << 8) | 3 for image in images(4)]
        write_images(device, camera, FRAMES_NS.tolist(), shown)
    header = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
    write_poses(table(folder, "mocap0"), FRAMES_NS.tolist(), motion(FRAMES_NS) @ INVERSE, header=header)
    (folder / "dso").mkdir()
    rows = "".join(f"  - [{numbers(row)}]\n" for row in INVERSE)
    common = "  camera_model: pinhole\n  distortion_model: equidistant\n  resolution: [64, 48]\n"
    lens = f"{common}  intrinsics: [{numbers(np.array(INTRINSICS))}]\n  distortion_coeffs: [0.01, -0.002, 0.001, 0.0]\n"
    other = lens.replace("60", "70")
    (folder / "dso" / "camchain.yaml").write_text(
        f"cam0:\n{lens}  T_cam_imu:\n{rows}  timeshift_cam_imu: 0.004\ncam1:\n{other}  T_cam_imu:\n{rows}"
    )
    return folder


def test_tum_vi_has_fisheye_lenses_a_kalibr_chain_and_images_of_16_bits(tmp_path):
    folder = write_tum_vi(tmp_path)
    read = open_sequence("euroc", tmp_path, image_levels=(0, 65535), time_shift_s=0.0)
    assert read.camera == EquidistantCamera(64, 48, *INTRINSICS, (0.01, -0.002, 0.001, 0.0))
    np.testing.assert_allclose(read.world_from_camera, motion(FRAMES_NS), atol=1e-9)
    np.testing.assert_allclose(read.image(0).astype(int), images(4)[0], atol=1)
    assert read.group == "room"
    assert any("mocap0" in note and "taken as those of the body" in note for note in read.notes)
    assert open_sequence("euroc", tmp_path, camera="cam1").camera.fx == 70.0
    with pytest.raises(DataError, match="image_levels"):
        open_sequence("euroc", tmp_path).image(0)
    chain = folder / "dso" / "camchain.yaml"
    chain.rename(tmp_path / "elsewhere.yaml")
    with pytest.raises(DataError, match=r"sensor\.yaml: no such file, .* or --option camera_file=FILE"):
        open_sequence("euroc", tmp_path)
    assert open_sequence("euroc", tmp_path, camera_file=tmp_path / "elsewhere.yaml").camera.fx == 60.0


@pytest.mark.parametrize(
    "names", [["camchain-room.yaml"], ["room-camchain.yaml"], ["camchain-room.yaml", "camchain-imucam-room.yaml"]]
)
def test_a_kalibr_chain_has_the_name_that_kalibr_gave_it(tmp_path, names):
    folder = write_tum_vi(tmp_path)
    chain = folder / "dso" / "camchain.yaml"
    text = chain.read_text()
    chain.unlink()
    for name in names[:-1]:
        (folder / "dso" / name).write_text("cam0: {}\n")
    (folder / "dso" / names[-1]).write_text(text)
    assert open_sequence("euroc", tmp_path).camera.fx == 60.0


def test_several_kalibr_chains_need_a_choice(tmp_path):
    folder = write_tum_vi(tmp_path)
    (folder / "dso" / "camchain.yaml").rename(folder / "dso" / "camchain-a.yaml")
    (folder / "dso" / "camchain-b.yaml").write_text("cam0: {}\n")
    with pytest.raises(DataError, match=r"several files: camchain-a.yaml, camchain-b.yaml, expected one, or --option"):
        open_sequence("euroc", tmp_path)


def test_names_in_the_list_may_have_the_folder_data(scene):
    listed = scene / "mav0" / "cam0" / "data.csv"
    listed.write_bytes(re.sub(rb",(\d+)", rb",data/\1", listed.read_bytes()))
    np.testing.assert_array_equal(open_sequence("euroc", scene).image(0), images(4)[0])


def test_the_clock_of_the_poses_is_that_of_the_images_plus_the_shift(tmp_path):
    folder = write_tum_vi(tmp_path)
    recorded_ns = START_NS + 1_000_000 * np.arange(-50, 250)
    write_poses(table(folder, "mocap0"), recorded_ns.tolist(), motion(recorded_ns) @ INVERSE)
    for options, shift_ns in (({}, 4_000_000), ({"time_shift_s": -0.02}, -20_000_000)):
        read = open_sequence("euroc", tmp_path, **options)
        np.testing.assert_allclose(read.world_from_camera, motion(FRAMES_NS + shift_ns), atol=1e-9)
        assert f"{shift_ns / 1e6:g} ms were added to the times of the images for the clock of the poses" in read.notes


@pytest.mark.parametrize(
    ("header", "order"),
    [
        ("", (0, 1, 2, 3, 4, 5, 6)),
        ("timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z", (0, 1, 2, 3, 4, 5, 6)),
        (
            "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_x [],q_RS_y [],q_RS_z [],q_RS_w []",
            (0, 1, 2, 4, 5, 6, 3),
        ),
        (
            "#timestamp [ns],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m]",
            (3, 4, 5, 6, 0, 1, 2),
        ),
        ("#time,some,thing,else,that,names,no,columns", (0, 1, 2, 3, 4, 5, 6)),
        ("#timestamp [ns], x [m], y [m], z [m], qx, qy, qz, qw", (0, 1, 2, 4, 5, 6, 3)),
        ("time,east,north,up,q_x,q_y,q_z,q_w", (0, 1, 2, 4, 5, 6, 3)),
        (
            "time,field.rotation.x,field.rotation.y,field.rotation.z,field.rotation.w,"
            "field.translation.x,field.translation.y,field.translation.z",
            (4, 5, 6, 3, 0, 1, 2),
        ),
    ],
)
def test_columns_are_found_by_their_names_else_the_scalar_is_first(scene, header, order):
    bodies = motion(FRAMES_NS) @ INVERSE
    lines = [header] if header else []
    for time, pose in zip(FRAMES_NS, bodies, strict=True):
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        usual = np.array([*pose[:3, 3], w, x, y, z])
        lines.append(f"{time},{numbers(usual[list(order)])}")
    table(scene).write_text("\r\n".join(lines))
    np.testing.assert_allclose(open_sequence("euroc", scene).world_from_camera, motion(FRAMES_NS), atol=1e-9)


def test_a_header_that_names_the_quaternion_where_positions_would_be_is_refused(scene):
    path = table(scene)
    rows = path.read_text().splitlines()[1:]
    path.write_text("\n".join(["time,qw,qx,qy,qz,east,north,up,a,b,c", *rows]))
    with pytest.raises(DataError, match="names of a part of the columns"):
        open_sequence("euroc", scene)


def test_another_camera_of_the_body(scene):
    body_from_other = BODY_FROM_CAMERA.copy()
    body_from_other[:3, 3] += BODY_FROM_CAMERA[:3, 0] * 0.11
    write_images(scene / "mav0", "cam1", FRAMES_NS.tolist(), images(4)[::-1])
    write_sensor(scene / "mav0/cam1/sensor.yaml", (64, 48), INTRINSICS, body_from_camera=body_from_other)
    read = open_sequence("euroc", scene, camera="cam1")
    aside = np.eye(4)
    aside[0, 3] = 0.11
    np.testing.assert_allclose(read.world_from_camera, motion(FRAMES_NS) @ aside, atol=1e-9)
    np.testing.assert_array_equal(read.image(0), images(4)[3])
    with pytest.raises(UnknownNameError, match="known: cam0, cam1"):
        open_sequence("euroc", scene, camera="cam7")


def test_the_other_camera_of_a_pair_is_the_second_one(scene):
    assert open_sequence("euroc", scene).second is None
    body_from_other = BODY_FROM_CAMERA.copy()
    body_from_other[:3, 3] += BODY_FROM_CAMERA[:3, 0] * 0.11
    write_images(scene / "mav0", "cam1", FRAMES_NS.tolist(), images(4)[::-1])
    write_sensor(scene / "mav0/cam1/sensor.yaml", (64, 48), INTRINSICS, body_from_camera=body_from_other)
    second = open_sequence("euroc", scene).second
    aside = np.eye(4)
    aside[0, 3] = 0.11
    np.testing.assert_allclose(second.first_from_second, aside, atol=1e-12)
    np.testing.assert_array_equal(second.images(1), images(4)[2])
    first = open_sequence("euroc", scene, camera="cam1").second
    np.testing.assert_allclose(first.first_from_second, np.linalg.inv(aside), atol=1e-12)


def test_frames_without_an_image_of_the_second_camera_have_no_depth(scene):
    """As in V2_03 of EuRoC, where cam1 lost some of its images."""
    body_from_other = BODY_FROM_CAMERA.copy()
    body_from_other[:3, 3] += BODY_FROM_CAMERA[:3, 0] * 0.11
    write_images(scene / "mav0", "cam1", FRAMES_NS[[0, 1, 3]].tolist(), images(4)[:3])
    write_sensor(scene / "mav0/cam1/sensor.yaml", (64, 48), INTRINSICS, body_from_camera=body_from_other)
    read = open_sequence("euroc", scene)
    np.testing.assert_array_equal(read.second.images(3), images(4)[2])
    assert read.second.images(2) is None
    assert "1 of 4 frames has no image of cam1, and no depth from it" in read.notes
    made = with_stereo_depth(read)
    assert made.depth(2) is None
    assert made.depth(3) is not None


def test_images_of_the_second_camera_that_are_listed_and_missing_are_left_out(scene: Path) -> None:
    body_from_other = BODY_FROM_CAMERA.copy()
    body_from_other[:3, 3] += BODY_FROM_CAMERA[:3, 0] * 0.11
    write_images(scene / "mav0", "cam1", FRAMES_NS.tolist(), images(4))
    write_sensor(scene / "mav0/cam1/sensor.yaml", (64, 48), INTRINSICS, body_from_camera=body_from_other)
    paths = sorted((scene / "mav0/cam1/data").iterdir())
    paths[2].unlink()
    read = open_sequence("euroc", scene)
    assert read.second is not None
    assert [read.second.images(index) is None for index in range(4)] == [False, False, True, False]
    assert "1 of 4 frames has no image of cam1, and no depth from it" in read.notes
    for path in paths[:2] + paths[3:]:
        path.unlink()
    read = open_sequence("euroc", scene)
    assert read.second is None
    assert any(note.startswith("cam1 gives no depth: ") for note in read.notes)


def test_depth_from_stereo_leaves_the_poses_between_images_as_they_were_recorded(scene):
    """A rolling shutter and a clock offset need them."""
    body_from_other = BODY_FROM_CAMERA.copy()
    body_from_other[:3, 3] += BODY_FROM_CAMERA[:3, 0] * 0.11
    write_images(scene / "mav0", "cam1", FRAMES_NS.tolist(), images(4))
    write_sensor(scene / "mav0/cam1/sensor.yaml", (64, 48), INTRINSICS, body_from_camera=body_from_other)
    recorded_ns = START_NS + 5_000_000 * np.arange(-2, 33)
    shaken = motion(recorded_ns)
    shaken[:, 0, 3] += 0.01 * np.sin(2 * np.pi * (recorded_ns - START_NS) / 50e6)
    write_poses(table(scene), recorded_ns.tolist(), shaken @ INVERSE)
    read = open_sequence("euroc", scene)
    at_s = np.array([0.015, 0.06, 0.125])
    np.testing.assert_array_equal(path_of(with_stereo_depth(read)).at(at_s), path_of(read).at(at_s))


def test_a_file_of_one_camera_is_not_that_of_the_second(scene, tmp_path):
    body_from_other = BODY_FROM_CAMERA.copy()
    body_from_other[:3, 3] += BODY_FROM_CAMERA[:3, 0] * 0.11
    write_images(scene / "mav0", "cam1", FRAMES_NS.tolist(), images(4))
    write_sensor(scene / "mav0/cam1/sensor.yaml", (64, 48), (70.0, 71.0, 31.0, 24.0), body_from_camera=body_from_other)
    write_sensor(tmp_path / "mine.yaml", (64, 48), (50.0, 51.0, 31.0, 24.0))
    read = open_sequence("euroc", scene, camera_file=tmp_path / "mine.yaml")
    assert (read.camera.fx, read.second.camera.fx) == (50.0, 70.0)
    np.testing.assert_allclose(read.second.first_from_second[:3, 3], (0.11, 0.0, 0.0), atol=1e-9)


def test_a_file_of_okvis_states_both_cameras_and_their_places(scene, tmp_path):
    body_from_other = BODY_FROM_CAMERA.copy()
    body_from_other[:3, 3] += BODY_FROM_CAMERA[:3, 0] * 0.11
    write_images(scene / "mav0", "cam1", FRAMES_NS.tolist(), images(4))
    lens = {"distortion_type": "radialtangential", "distortion_coefficients": [0.0] * 4, "image_dimension": [64, 48]}
    both = [
        {"T_SC": pose.ravel().tolist(), "focal_length": [f, f], "principal_point": [31.0, 24.0], **lens}
        for pose, f in ((BODY_FROM_CAMERA, 50.0), (body_from_other, 70.0))
    ]
    (tmp_path / "okvis.yaml").write_text("%YAML:1.0\n" + yaml.safe_dump({"cameras": both}))
    read = open_sequence("euroc", scene, camera_file=tmp_path / "okvis.yaml")
    assert (read.camera.fx, read.second.camera.fx) == (50.0, 70.0)
    np.testing.assert_allclose(read.second.first_from_second[:3, 3], (0.11, 0.0, 0.0), atol=1e-9)
    other = open_sequence("euroc", scene, camera_file=tmp_path / "okvis.yaml", camera="cam1")
    assert other.camera.fx == 70.0
    np.testing.assert_allclose(
        other.world_from_camera[0][:3, 3] - read.world_from_camera[0][:3, 3],
        read.world_from_camera[0][:3, 0] * 0.11,
        atol=1e-9,
    )


def test_a_second_camera_that_cannot_be_used_is_no_error(scene):
    write_images(scene / "mav0", "cam1", (FRAMES_NS[:3] + 1).tolist(), images(3))
    read = open_sequence("euroc", scene)
    assert read.second is None
    assert any(note.startswith("cam1 gives no depth: ") and "sensor.yaml" in note for note in read.notes)
    write_sensor(scene / "mav0/cam1/sensor.yaml", (64, 48), INTRINSICS)
    read = open_sequence("euroc", scene)
    assert read.second is None
    assert any("no image at any of 4 times" in note for note in read.notes)


def test_a_recording_is_found_above_at_and_below_its_device_folder(scene):
    for root, name in ((scene.parent, scene.name), (scene, scene.name), (scene / "mav0", "mav0")):
        assert [item.scene for item in make_reader("euroc", root).sequences()] == [name]
        assert len(open_sequence("euroc", root)) == 4


def test_positions_without_rotations_are_refused(scene):
    leica = scene / "mav0" / "leica0" / "data.csv"
    leica.parent.mkdir()
    leica.write_text(f"#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m]\n{START_NS},1,2,3\n")
    with pytest.raises(DataError, match=r"leica0.data\.csv:2: 4 fields, expected a time, a position and a quaternion"):
        open_sequence("euroc", scene, pose_source="leica0")
    table(scene).unlink()
    with pytest.raises(DataError, match="leica0 only, which has no rotations, expected state_groundtruth_estimate0"):
        open_sequence("euroc", scene)
    leica.unlink()
    leica.parent.rmdir()
    with pytest.raises(DataError, match="mav0: no poses, expected state_groundtruth_estimate0"):
        open_sequence("euroc", scene)


@pytest.mark.parametrize("written", ["{}.0", "{:.18e}", " {}"])
def test_whole_nanoseconds_may_be_written_as_decimal_numbers(scene, written):
    plain = open_sequence("euroc", scene)
    for path in (scene / "mav0/cam0/data.csv", table(scene)):
        header, *rows = path.read_text().splitlines()
        fields = [row.split(",", 1) for row in rows]
        times = [written.format(Decimal(time) if "e" in written else time) for time, _ in fields]
        path.write_text("\n".join([header, *(f"{time},{rest}" for time, (_, rest) in zip(times, fields, strict=True))]))
    found = open_sequence("euroc", scene)
    np.testing.assert_array_equal(found.world_from_camera, plain.world_from_camera)
    np.testing.assert_array_equal(found.timestamps_s, plain.timestamps_s)


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("cam0/data.csv", "#timestamp [ns],filename\n", "no rows, expected rows of a time and the name of an image"),
        ("cam0/data.csv", f"{START_NS}\n", ":1: no name of a file, expected a time and the name of an image"),
        ("cam0/data.csv", "1403636579.76,a.png\n", ":1: a time of '1403636579.76', expected a whole number of nano"),
        ("cam0/data.csv", f"{2**63},a.png\n", ":1: a time of '9223372036854775808', expected a whole number"),
        ("state_groundtruth_estimate0/data.csv", f"{START_NS},1,2,3,1,0,x,0\n", ":1: 'x', expected a number"),
        ("state_groundtruth_estimate0/data.csv", f"{START_NS},1,2,3,1,1,0,0\n", ":1: a quaternion of norm 1.41421"),
        ("state_groundtruth_estimate0/sensor.yaml", "T_BS:\n  data: [1, 2]\n", "no matrix T_BS, expected T_BS with"),
        ("state_groundtruth_estimate0/sensor.yaml", "T_BS: [1]\n", "no matrix T_BS, expected T_BS with"),
    ],
)
def test_damaged_files_are_named_with_what_was_found(scene, file, text, message):
    path = scene / "mav0" / file
    path.write_text(text)
    with pytest.raises(DataError, match=f"{re.escape(str(path))}.*{message}"):
        open_sequence("euroc", scene)


def test_a_camera_without_its_place_on_the_body_is_refused(scene):
    sensor = scene / "mav0/cam0/sensor.yaml"
    sensor.write_text(re.sub(r"T_BS:\n(  .*\n)+", "", sensor.read_text()))
    with pytest.raises(DataError, match="no place of cam0 on the body, expected T_BS or T_cam_imu"):
        open_sequence("euroc", scene)


FILES = ["cam0/data.csv", "cam0/sensor.yaml", "state_groundtruth_estimate0/data.csv"]


@given(st.sampled_from([*FILES, "state_groundtruth_estimate0/sensor.yaml"]), st.binary(max_size=200))
def test_any_bytes_give_one_clear_line(tmp_path_factory, file, content):
    folder = tmp_path_factory.mktemp("fuzz")
    write_euroc(folder, images(2), motion(FRAMES_NS[:2]), intrinsics=INTRINSICS)
    (folder / "mav0" / file).write_bytes(content)
    with suppress(TracknoiseError):
        open_sequence("euroc", folder).image(0)


@given(st.lists(st.lists(st.text("0123456789.,-+einfx# \x00", max_size=24), max_size=9).map(",".join), max_size=6))
def test_any_table_gives_one_clear_line(tmp_path_factory, lines):
    folder = tmp_path_factory.mktemp("fuzz")
    write_euroc(folder, images(2), motion(FRAMES_NS[:2]), intrinsics=INTRINSICS)
    table(folder).write_text("\n".join(lines))
    with suppress(TracknoiseError):
        open_sequence("euroc", folder)


@pytest.mark.parametrize(
    ("option", "value"), [("max_pose_gap_s", -1.0), ("time_shift_s", float("inf")), ("image_levels", [9.0, 9.0])]
)
def test_impossible_options_are_named(tmp_path, option, value):
    with pytest.raises(SettingsError, match=option):
        make_reader("euroc", tmp_path, {option: value})


def test_an_image_that_is_listed_and_missing_is_named_when_it_is_read(scene):
    name = scene / "mav0/cam0/data" / f"{START_NS}.png"
    assert cv2.imread(str(name)) is not None
    name.unlink()
    read = open_sequence("euroc", scene)
    assert read.image(1).shape == (48, 64)
    with pytest.raises(DataError, match=re.escape(f"{name}: no such file")):
        read.image(0)


@pytest.mark.parametrize("folder", ["MH_01_easy", "machine_hall/MH_01_easy"])
def test_the_stated_accuracy_is_that_of_the_machine_hall_wherever_the_recording_lies(tmp_path, folder):
    """The laser tracker measured positions there; elsewhere nothing is stated."""
    write_euroc(tmp_path / folder, images(4), motion(FRAMES_NS), intrinsics=INTRINSICS)
    write_euroc(tmp_path / "vicon_room1/V1_01_easy", images(4), motion(FRAMES_NS), intrinsics=INTRINSICS)
    reader = make_reader("euroc", tmp_path)
    found = [known_accuracy(reader.open(one), "triangulated").figures for one in reader.sequences()]
    assert [one.translation_white_m for one in found] == [0.001, None]
