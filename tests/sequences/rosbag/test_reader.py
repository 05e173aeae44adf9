"""Bags written from a simulated sequence: what is read is what was simulated."""

import pickle
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.writers.bags import SECOND_NS, BagWriter, Format, png

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.sequence import Sequence, path_of

START_NS, STEP_NS = 1_700_000_000_123_456_789, 33_333_333
EVERY = pytest.mark.parametrize("kind", Format)
OPTICAL = "camera_optical_frame"


def pose(rotation: tuple[float, float, float], position: tuple[float, float, float]) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = Rotation.from_rotvec(rotation).as_matrix(), position
    return made


def slide(far: float) -> np.ndarray:
    return pose((0.0, 0.0, 0.0), (far, 0.0, 2.0 * far))


def turn(far: float) -> np.ndarray:
    return pose((0.0, far, 0.0), (0.0, 0.0, 0.0))


LASER = pose((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
BODY_FROM_CAMERA = pose((0.1, -1.2, 1.1), (0.2, -0.1, 0.05))
BASE_FROM_BODY = pose((0.0, 0.3, 0.2), (0.0, 0.0, 0.4))


@pytest.fixture(scope="module")
def simulated() -> Sequence:
    return open_sequence("simulated", motions=["arvr"], frames=4, width=64, height=48, supersampling=1)


@dataclass(frozen=True)
class Content:
    """What is written of a simulated sequence."""

    sequence: Sequence

    def stamps(self) -> list[int]:
        return [START_NS + index * STEP_NS for index in range(len(self.sequence))]

    def images(self, bag: BagWriter, topic: str = "/cam/image_raw") -> None:
        for index, stamp in enumerate(self.stamps()):
            bag.image(topic, stamp, OPTICAL, "mono8", self.sequence.image(index), padding=5)

    def depths(self, bag: BagWriter) -> None:
        for index, stamp in enumerate(self.stamps()):
            deep = self.sequence.depth(index)
            assert deep is not None
            pixels = np.where(deep.valid, deep.depth_m, np.nan).astype("<f4")
            bag.image("/cam/depth", stamp + 4_000_000, OPTICAL, "32FC1", pixels)

    def intrinsics(self, bag: BagWriter, topic: str = "/cam/camera_info") -> None:
        camera = self.sequence.camera
        assert isinstance(camera, Camera)
        k = (camera.fx, camera.fy, camera.cx, camera.cy)
        bag.camera_info(topic, START_NS, OPTICAL, size=(camera.width, camera.height), k=k)

    def odometry(self, bag: BagWriter, kind: str = "Odometry", child: str = "imu") -> None:
        camera_from_body = invert(BODY_FROM_CAMERA) if child == "imu" else np.eye(4)
        for stamp, world_from_camera in zip(self.stamps(), self.sequence.world_from_camera, strict=True):
            bag.posed("/odom", stamp, kind, "odom", child, world_from_camera @ camera_from_body)

    def static(self, bag: BagWriter) -> None:
        bag.tf("/tf_static", START_NS - SECOND_NS, ("imu", OPTICAL, BODY_FROM_CAMERA))


def opened(path: Path, **options: object) -> Sequence:
    return open_sequence("rosbag", path, **options)


def require_same(found: Sequence, simulated: Sequence) -> None:
    np.testing.assert_allclose(found.world_from_camera, simulated.world_from_camera, rtol=0, atol=1e-9)
    assert found.camera == simulated.camera
    for index in range(len(simulated)):
        np.testing.assert_array_equal(found.image(index), simulated.image(index))
    times_s = np.arange(len(simulated)) * STEP_NS / 1e9
    np.testing.assert_allclose(found.timestamps_s, times_s, rtol=0, atol=1e-12)
    assert found.clock_start_ns == START_NS


@EVERY
def test_images_depths_intrinsics_and_odometry_with_a_static_transform(tmp_path, simulated, kind):
    content = Content(simulated)
    with BagWriter(tmp_path / "run", kind) as bag:
        for write in (content.intrinsics, content.images, content.depths, content.odometry, content.static):
            write(bag)
    found = opened(tmp_path)
    require_same(found, simulated)
    for index in range(len(simulated)):
        depth, expected = found.depth(index), simulated.depth(index)
        np.testing.assert_array_equal(depth.valid, expected.valid)
        np.testing.assert_allclose(depth.depth_m[depth.valid], expected.depth_m[depth.valid], rtol=1e-7)
    assert found.source.endswith("/cam/image_raw")
    assert any("odom from imu from camera_optical_frame" in note for note in found.notes)
    copy = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(copy.image(2), found.image(2))


@EVERY
def test_tf_chain_is_resolved_and_each_link_interpolated(tmp_path, simulated, kind):
    """Two links move, at other times than the images. A chain may also go up and down again."""
    content = Content(simulated)
    moves = [(stamp - START_NS) / SECOND_NS for stamp in content.stamps()]
    with BagWriter(tmp_path / "run", kind) as bag:
        content.intrinsics(bag)
        content.images(bag)
        bag.tf("/tf_static", START_NS, ("base", "imu", BASE_FROM_BODY), ("imu", OPTICAL, BODY_FROM_CAMERA))
        bag.tf("/tf_static", START_NS, ("base", "laser", LASER))
        for stamp in [START_NS + index * STEP_NS // 2 for index in range(-1, 2 * len(simulated))]:
            shift = (stamp - START_NS) / SECOND_NS
            bag.tf("/tf", stamp, ("map", "odom", slide(shift)))
            bag.tf("/tf", stamp, ("odom", "base", turn(shift)))
    camera = BASE_FROM_BODY @ BODY_FROM_CAMERA
    expected = [slide(moved) @ turn(moved) @ camera for moved in moves]
    np.testing.assert_allclose(opened(tmp_path).world_from_camera, expected, atol=1e-9)
    of_odom = opened(tmp_path, world_frame="laser", camera_frame="odom").world_from_camera
    np.testing.assert_allclose(of_odom, [invert(turn(moved) @ LASER) for moved in moves], atol=1e-9)


def test_between_images_poses_are_those_that_were_recorded(tmp_path, simulated):
    """Two links move, at times of their own; one of them is shaken between the images, and not seen for a while."""
    content = Content(simulated)
    period_s = STEP_NS / SECOND_NS
    lost_s = (2.3 * period_s, 2.7 * period_s)

    def shaken(at_s: float) -> np.ndarray:
        return slide(0.1 * float(np.sin(2 * np.pi * at_s / period_s)))

    with BagWriter(tmp_path / "run", Format.mcap) as bag:
        content.intrinsics(bag)
        content.images(bag)
        for stamp in range(START_NS - STEP_NS, START_NS + 4 * STEP_NS, 2_000_000):
            at_s = (stamp - START_NS) / SECOND_NS
            if not lost_s[0] < at_s < lost_s[1]:
                bag.tf("/tf", stamp, ("map", "odom", shaken(at_s)))
        for stamp in range(START_NS - STEP_NS, START_NS + 4 * STEP_NS, 5_000_000):
            bag.tf("/tf", stamp, ("odom", OPTICAL, turn((stamp - START_NS) / SECOND_NS)))
    found = opened(tmp_path, max_pose_gap_s=0.008)
    path = path_of(found)
    np.testing.assert_array_equal(path.at(found.timestamps_s), found.world_from_camera)
    at_s = np.array([0.25, 0.6, 1.3, 2.9]) * period_s
    np.testing.assert_allclose(path.at(at_s), [shaken(one) @ turn(one) for one in at_s], atol=5e-3)
    assert np.isnan(path.at(np.array([2.5 * period_s, 6 * period_s]))).all()


def test_frames_with_two_parents_are_refused(tmp_path, simulated):
    content = Content(simulated)
    with BagWriter(tmp_path / "run", Format.ros1) as bag:
        content.intrinsics(bag)
        content.images(bag)
        for stamp in content.stamps():
            bag.tf("/tf", stamp, ("odom", OPTICAL, slide(stamp / 1e18)), ("base", OPTICAL, turn(stamp / 1e18)))
    with pytest.raises(DataError, match=r"frame camera_optical_frame in base and in odom, expected one parent frame"):
        opened(tmp_path)


def test_transforms_in_a_circle_are_refused(write, simulated):
    content = Content(simulated)
    circle = ("odom", OPTICAL, slide(1.0)), (OPTICAL, "odom", slide(2.0))
    root = write(content.images, content.intrinsics, lambda bag: bag.tf("/tf", START_NS, *circle))
    with pytest.raises(
        DataError, match="transforms in a circle: camera_optical_frame, odom, expected a tree of frames"
    ):
        opened(root)


def test_frames_beside_the_chain_may_have_several_parents(write, simulated):
    """Such as markers that several cameras see. ROS 1 wrote names of frames with a slash in front."""
    content = Content(simulated)

    def seen(bag: BagWriter) -> None:
        for stamp, held in zip(content.stamps(), simulated.world_from_camera, strict=True):
            bag.tf("/tf", stamp, ("/world", f"/{OPTICAL}", held))
            bag.tf("/tf", stamp, ("other", "marker", held), (OPTICAL, "marker", held))

    root = write(content.images, content.intrinsics, seen)
    require_same(opened(root), simulated)
    require_same(opened(root, world_frame="/world"), simulated)


@EVERY
@pytest.mark.parametrize("message", ["PoseStamped", "PoseWithCovarianceStamped", "TransformStamped", "Odometry"])
def test_every_message_with_a_pose(tmp_path, simulated, kind, message):
    content = Content(simulated)
    with BagWriter(tmp_path / "run", kind) as bag:
        content.intrinsics(bag)
        content.images(bag)
        content.odometry(bag, message, OPTICAL)
    found = opened(tmp_path)
    require_same(found, simulated)
    assert any("do not name the frame" in note for note in found.notes) == message.startswith("Pose")


@EVERY
def test_the_body_can_be_named_and_its_camera_given(tmp_path, simulated, kind):
    content = Content(simulated)
    with BagWriter(tmp_path / "run", kind) as bag:
        content.intrinsics(bag)
        content.images(bag)
        content.odometry(bag, "PoseStamped")
        content.static(bag)
    require_same(opened(tmp_path, pose_frame="imu"), simulated)
    require_same(opened(tmp_path, body_from_camera=BODY_FROM_CAMERA.ravel().tolist()), simulated)
    wrong = opened(tmp_path).world_from_camera  # the pose of the body, taken as the camera's, which a note says
    assert np.abs(wrong - simulated.world_from_camera).max() > 0.1


@pytest.mark.parametrize(
    ("kind", "compression"),
    [
        (Format.ros1, "bz2"),
        (Format.ros1, "lz4"),
        (Format.sqlite, "file"),
        (Format.sqlite, "message"),
        (Format.mcap, "message"),
        (Format.mcap, "storage"),
    ],
)
def test_compressed_bags_and_images(tmp_path, simulated, kind, compression):
    content = Content(simulated)
    with BagWriter(tmp_path / "run", kind, compression=compression) as bag:
        content.intrinsics(bag)
        content.odometry(bag, child=OPTICAL)
        for index, stamp in enumerate(content.stamps()):
            bag.compressed(
                "/cam/image_raw/compressed", stamp, OPTICAL, "mono8; png compressed ", png(simulated.image(index))
            )
            deep = simulated.depth(index)
            units = np.where(deep.depth_m < 60.0, np.rint(deep.depth_m * 1000), 0).astype(np.uint16)
            header = np.zeros(12, np.uint8).tobytes()
            bag.compressed(
                "/cam/depth/compressedDepth", stamp, OPTICAL, "16UC1; compressedDepth png", header + png(units)
            )
    found = opened(tmp_path)
    require_same(found, simulated)
    depth, expected = found.depth(1), simulated.depth(1)
    np.testing.assert_array_equal(depth.valid, expected.depth_m < 60.0)
    np.testing.assert_allclose(depth.depth_m[depth.valid], expected.depth_m[depth.valid], atol=0.501e-3)


@pytest.fixture
def write(tmp_path, simulated):
    """Writes a ROS 1 bag from parts of the content, and returns its folder."""

    def written(*parts: object, kind: Format = Format.ros1) -> Path:
        with BagWriter(tmp_path / "run", kind) as bag:
            for part in parts:
                part(bag)
        return tmp_path

    return written


def test_scenes_are_bags_at_any_depth(tmp_path, simulated):
    content = Content(simulated)
    for place, kind in (("a/one", Format.ros1), ("a/two", Format.sqlite), ("three", Format.mcap)):
        with BagWriter(tmp_path / place, kind) as bag:
            content.images(bag)
    (tmp_path / "three" / "metadata.yaml").unlink()  # a storage file alone can be read too
    (tmp_path / "metadata.yaml").write_text("of: something else\n")
    listed = make_reader("rosbag", tmp_path).sequences()
    assert [item.scene for item in listed] == ["a/one.bag", "a/two", "three/three.mcap"]
    alone = make_reader("rosbag", tmp_path / "a" / "one.bag").sequences()
    assert [item.scene for item in alone] == ["one.bag"]


@EVERY
def test_a_storage_file_alone_is_read(tmp_path, simulated, kind):
    content = Content(simulated)
    with BagWriter(tmp_path / "run", kind) as bag:
        for part in (content.intrinsics, content.images, content.odometry, content.static):
            part(bag)
    (file,) = (path for path in tmp_path.rglob(f"*.{kind}"))
    require_same(opened(file), simulated)


def test_a_topic_is_not_guessed_where_several_fit(write, simulated):
    content = Content(simulated)
    root = write(
        content.images,
        lambda bag: content.images(bag, "/other/image"),
        content.intrinsics,
        lambda bag: content.intrinsics(bag, "/other/camera_info"),
        content.odometry,
        content.static,
        lambda bag: bag.tf("/tf", START_NS, ("odom", "imu", turn(0.1))),
    )
    with pytest.raises(DataError) as caught:
        opened(root, pose_topic="/odom")
    listed = "/cam/image_raw (sensor_msgs/msg/Image, 4), /other/image (sensor_msgs/msg/Image, 4)"
    chosen = f"--option image_topic={listed.split(' ')[0]}, or image_topic in [dataset.options]"
    chosen += "; second_image_topic names that of a second camera"
    assert str(caught.value) == f"{root / 'run.bag'}: {listed}, expected one topic; choose it with {chosen}"
    with pytest.raises(
        DataError, match=r"/odom \(nav_msgs/msg/Odometry, 4\), /tf .*choose it with --option pose_topic=/"
    ):
        opened(root, image_topic="/other/image")
    found = opened(root, image_topic="/other/image", pose_topic="/odom")  # with the camera_info beside it
    require_same(found, simulated)
    with pytest.raises(DataError, match=r"image_topic '/odom': /odom \(nav_msgs/msg/Odometry, 4\), expected one of"):
        opened(root, image_topic="/odom")
    with pytest.raises(DataError, match=r"pose_topic '/pose': no messages of /pose, expected one of /cam/camera_info"):
        opened(root, image_topic="/other/image", pose_topic="/pose")


def test_a_bag_without_intrinsics_points_to_the_camera_file(write, simulated):
    content = Content(simulated)
    with pytest.raises(DataError, match=r"one topic of sensor_msgs/msg/CameraInfo, or --option camera_file=FILE"):
        opened(write(content.images, content.odometry))


def test_a_bag_without_poses_lists_its_topics(write, simulated):
    content = Content(simulated)
    root = write(content.images, content.intrinsics)
    with pytest.raises(DataError, match=r"/cam/camera_info \(sensor_msgs/msg/CameraInfo, 1\), .*expected one topic of"):
        opened(root)


def test_frames_without_a_pose_are_kept(write, simulated):
    content = Content(simulated)

    def lost(bag: BagWriter) -> None:
        for index, stamp in enumerate(content.stamps()):
            held = simulated.world_from_camera[index].copy()
            if index == 1:
                held[0, 3] = np.nan
            if index != 3:
                bag.posed("/odom", stamp, "Odometry", "odom", OPTICAL, held)

    found = opened(write(content.images, content.intrinsics, lost), max_pose_gap_s=0.05)
    np.testing.assert_array_equal(has_pose(found.world_from_camera), [True, False, True, False])
    assert len(found) == 4
    assert "1 message of /odom without a pose (NaN, or a quaternion of zeros)" in found.notes
    assert any(note.startswith("2 of 4 frames have no pose") for note in found.notes)
    between = open_sequence("rosbag", Path(found.source.split()[0]), max_pose_gap_s=0.1)
    np.testing.assert_array_equal(has_pose(between.world_from_camera), [True, True, True, False])


def test_poses_at_other_times_are_refused_with_both_times(write, simulated):
    content = Content(simulated)
    late = [stamp + 60 * SECOND_NS for stamp in content.stamps()]
    root = write(
        content.images,
        content.intrinsics,
        lambda bag: [bag.posed("/odom", stamp, "Odometry", "odom", OPTICAL, slide(stamp / 1e18)) for stamp in late],
    )
    with pytest.raises(DataError) as caught:
        opened(root)
    assert "poses for 0 of 4 images; the images are from 0 s to 0.100 s, camera_optical_frame from 60.000 s" in str(
        caught.value
    )
    shifted = opened(root, time_shift_s=60.0)
    np.testing.assert_allclose(shifted.world_from_camera, [slide(stamp / 1e18) for stamp in late], atol=1e-9)
    assert "poses are taken 60 s after the times of the images" in shifted.notes


def test_times_of_headers_or_of_receipt(write, simulated):
    content = Content(simulated)
    order = [0, 2, 1, 3]

    def unordered(bag: BagWriter) -> None:
        for index, stamp in zip(order, sorted(content.stamps()), strict=True):
            held = simulated.image(index)
            bag.image("/cam/image_raw", content.stamps()[index], OPTICAL, "mono8", held, received_ns=stamp)

    root = write(unordered, content.intrinsics, content.odometry, content.static)
    by_header, by_receipt = opened(root), opened(root, time="received")
    require_same(by_header, simulated)
    for index, shown in enumerate(order):
        np.testing.assert_array_equal(by_receipt.image(index), simulated.image(shown))


def test_headers_without_times_and_repeated_images(tmp_path, simulated):
    content = Content(simulated)
    with BagWriter(tmp_path / "zero" / "run", Format.ros1) as bag:
        content.intrinsics(bag)
        content.odometry(bag, child=OPTICAL)
        for index, stamp in enumerate(content.stamps()):
            bag.image("/cam/image_raw", 0, OPTICAL, "mono8", simulated.image(index), received_ns=stamp)
    with pytest.raises(DataError, match='the time 0 in all headers, expected times, or time = "received"'):
        opened(tmp_path / "zero")
    with BagWriter(tmp_path / "twice" / "run", Format.mcap) as bag:
        content.intrinsics(bag)
        content.odometry(bag, child=OPTICAL)
        content.images(bag)
        content.images(bag)
    found = opened(tmp_path / "twice")
    require_same(found, simulated)
    assert "4 images have the time of another one and are left out" in found.notes


def test_a_frame_that_is_not_connected_is_named(write, simulated):
    content = Content(simulated)
    root = write(content.images, content.intrinsics, content.odometry)
    with pytest.raises(DataError) as caught:
        opened(root)
    given = "--option body_from_camera=[16 NUMBERS], or body_from_camera in [dataset.options]"
    expected = f"connected frames among no frames, or {given}"
    assert str(caught.value).endswith(f"no chain of transforms from camera_optical_frame to imu, expected {expected}")


def test_tf_without_the_frame_of_the_images_lists_its_frames(write, simulated):
    content = Content(simulated)
    moved = [(stamp, slide(index)) for index, stamp in enumerate(content.stamps())]
    root = write(
        content.images,
        content.intrinsics,
        lambda bag: [bag.tf("/tf", stamp, ("world", "cam0", held)) for stamp, held in moved],
    )
    with pytest.raises(DataError, match=r"no transform of camera_optical_frame, expected one of cam0, world"):
        opened(root)
    found = opened(root, camera_frame="cam0")
    np.testing.assert_allclose(found.world_from_camera, [held for _, held in moved], atol=1e-12)
    assert any("cam0 are taken as those of a camera" in note for note in found.notes)
    given = opened(root, body_from_camera=LASER.ravel().tolist(), pose_frame="cam0")
    np.testing.assert_allclose(given.world_from_camera, [held @ LASER for _, held in moved], atol=1e-12)
    with pytest.raises(
        DataError, match="body_from_camera, poses from /tf and no pose_frame, expected --option pose_frame=NAME"
    ):
        opened(root, body_from_camera=LASER.ravel().tolist())


def test_poses_of_a_topic_take_the_place_of_tf(write, simulated):
    """The measured frame and the camera hang on the same base, which tf has in another pose."""
    content = Content(simulated)
    base_from_camera = BASE_FROM_BODY @ BODY_FROM_CAMERA

    def other_poses(bag: BagWriter) -> None:
        for index, stamp in enumerate(content.stamps()):
            bag.tf("/tf", stamp, ("map", "odom", slide(index)), ("odom", "base", turn(index)))

    root = write(
        content.images,
        content.intrinsics,
        content.odometry,
        lambda bag: bag.tf(
            "/tf_static", START_NS, ("base", "imu", BASE_FROM_BODY), ("base", OPTICAL, base_from_camera)
        ),
        other_poses,
    )
    require_same(opened(root, pose_topic="/odom"), simulated)
    in_map = opened(root, pose_topic="/odom", world_frame="map")
    expected = [slide(index) @ pose for index, pose in enumerate(simulated.world_from_camera)]
    np.testing.assert_allclose(in_map.world_from_camera, expected, atol=1e-9)
    tf = opened(root, pose_topic="/tf")
    expected = [slide(index) @ turn(index) @ base_from_camera for index in range(4)]
    np.testing.assert_allclose(tf.world_from_camera, expected, atol=1e-9)


def test_depth_is_that_of_the_nearest_time(write, simulated):
    content = Content(simulated)
    root = write(content.images, content.depths, content.intrinsics, content.odometry, content.static)
    assert opened(root, max_gap_s=0.003).depth(0) is None
    assert "4 of 4 frames have no depth" in opened(root, max_gap_s=0.003).notes
    assert "birth" not in opened(root, depth_topic="").truths
    assert opened(root, depth_radius_px=1.5).depth(1).radius_px == 1.5


def realsense_depths(bag: BagWriter, kind: str, frame: str, focal: float, metres: float) -> None:
    """Depth maps with their intrinsics, as the driver of a RealSense names them."""
    for index in range(4):
        pixels = np.full((48, 64), 1000 * metres, "<u2")
        bag.image(f"/camera/{kind}/image", START_NS + index * STEP_NS, frame, "16UC1", pixels)
    bag.camera_info(f"/camera/{kind}/camera_info", START_NS, frame, size=(64, 48), k=(focal, focal, 31.5, 23.5))


def test_depth_in_the_frame_of_the_images_precedes_that_of_another_camera(write, simulated):
    content, focal = Content(simulated), simulated.camera.fx
    root = write(
        content.images,
        content.intrinsics,
        content.odometry,
        content.static,
        lambda bag: realsense_depths(bag, "depth", "depth_optical", 1.2 * focal, 3.0),
        lambda bag: realsense_depths(bag, "aligned", OPTICAL, focal, 2.0),
    )
    np.testing.assert_allclose(opened(root).depth(0).depth_m, 2.0)


def test_depth_of_another_camera_is_refused(write, simulated):
    """It is known by its intrinsics: another frame alone may be another name."""
    content, focal = Content(simulated), simulated.camera.fx
    depths = partial(realsense_depths, kind="depth", frame="depth_optical", metres=3.0)
    parts = (content.images, content.intrinsics, content.odometry, content.static)
    root = write(*parts, partial(depths, focal=focal))
    assert any("depths and images are in the frames depth_optical" in note for note in opened(root).notes)
    (root / "run.bag").unlink()
    root = write(*parts, partial(depths, focal=1.2 * focal))
    with pytest.raises(DataError, match=r"/camera/depth/image: depth of another camera: .* in the frame camera_opt"):
        opened(root)
    assert "birth" not in opened(root, depth_topic="").truths


def librealsense(bag: BagWriter, sequence: Sequence, depth_focal: float) -> None:
    """Colour and depth as the viewer of RealSense records them: no frames, and intrinsics once, without a time."""
    camera, size = sequence.camera, (64, 48)
    assert isinstance(camera, Camera)
    for index in range(len(sequence)):
        stamp = START_NS + index * STEP_NS
        pixels = np.full((48, 64), 2000, "<u2")
        bag.image("/device_0/sensor_0/Depth_0/image/data", stamp, "0", "mono16", pixels)
        bag.image("/device_0/sensor_1/Color_0/image/data", stamp, "0", "mono8", sequence.image(index))
    for stream, focal in (("sensor_0/Depth_0", depth_focal), ("sensor_1/Color_0", camera.fx)):
        k = (focal, focal, camera.cx, camera.cy)
        topic = f"/device_0/{stream}/info/camera_info"
        bag.camera_info(topic, START_NS, "", size=size, k=k, model="Inverse Brown Conrady")


def test_a_recording_of_librealsense_has_its_intrinsics_and_no_depth_of_another_camera(write, simulated):
    content, focal = Content(simulated), simulated.camera.fx
    poses = partial(content.odometry, child="0")
    root = write(lambda bag: librealsense(bag, simulated, focal), poses)
    assert opened(root).camera.fx == pytest.approx(focal)
    np.testing.assert_allclose(opened(root).depth(0).depth_m, 2.0)
    (root / "run.bag").unlink()
    root = write(lambda bag: librealsense(bag, simulated, 1.2 * focal), poses)
    with pytest.raises(DataError, match=r"Depth_0/image/data: depth of another camera: it has other intrinsics than"):
        opened(root)
    assert opened(root, depth_topic="").camera.fx == pytest.approx(focal)


def test_a_camera_file_replaces_the_topic(write, simulated, tmp_path):
    content, camera = Content(simulated), simulated.camera
    rows = [", ".join(map(str, row)) for row in invert(BODY_FROM_CAMERA).tolist()]
    (tmp_path / "chain.yaml").write_text(
        "cam0:\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [0, 0, 0, 0]\n"
        f"  intrinsics: [{camera.fx}, {camera.fy}, {camera.cx}, {camera.cy}]\n"
        f"  resolution: [{camera.width}, {camera.height}]\n  timeshift_cam_imu: 0.0\n"
        "  T_cam_imu:\n" + "".join(f"  - [{row}]\n" for row in rows)
    )
    root = write(content.images, content.odometry)
    require_same(opened(root, camera_file=tmp_path / "chain.yaml"), simulated)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"body_from_camera": [1.0, 2.0]}, "body_from_camera is .*, expected 16 numbers"),
        ({"image_levels": [9.0, 3.0]}, "image_levels is .*, expected .low, high."),
        ({"max_pose_gap_s": -1.0}, "max_pose_gap_s is -1.0, expected a number not below 0"),
        ({"depth_unit_m": 0.0}, "depth_unit_m is 0.0, expected a number above 0"),
        ({"time_shift_s": 1e9}, "time_shift_s is .*, expected a number between -86400 and 86400"),
        ({"time": "sent"}, "time: .*found 'sent'"),
    ],
)
def test_impossible_options(tmp_path, options, message):
    with pytest.raises(SettingsError, match=message):
        make_reader("rosbag", tmp_path, options)
