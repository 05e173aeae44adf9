"""A second camera in bags: images, intrinsics and pose are those that were written."""

import pickle
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation
from tests.writers.bags import BagWriter, Format

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.experiments.template import experiment_template
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.second_camera import second_image
from tracknoise.sequences.sequence import ImageReader, Sequence

START_NS, STEP_NS = 1_700_000_000_123_456_789, 50_000_000
FRAMES = 4
FIRST, SECOND = Camera(64, 48, 50.0, 50.0, 31.5, 23.5), Camera(64, 48, 60.0, 61.0, 30.0, 24.0)
# the second camera is 0.11 m on the right of the first: points of the first have x smaller by 0.11 in it
SECOND_FROM_FIRST = [[1.0, 0, 0, -0.11], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]
ASIDE = np.linalg.inv(SECOND_FROM_FIRST)
TURNED = np.array([[0, -1, 0, 0.2], [1, 0, 0, 0.1], [0, 0, 1, -0.3], [0, 0, 0, 1.0]])


def picture(number: int) -> np.ndarray:
    return np.random.default_rng(100 + number).integers(0, 256, (48, 64), dtype=np.uint8)


def k_of(camera: Camera) -> tuple[float, ...]:
    return (camera.fx, camera.fy, camera.cx, camera.cy)


def p_of(camera: Camera, position_m: float = 0.0) -> np.ndarray:
    """P of a camera of a rectified pair, at a position along the baseline."""
    return np.array([camera.fx, 0, camera.cx, -camera.fx * position_m, 0, camera.fy, camera.cy, 0, 0, 0, 1.0, 0])


def written(
    folder: Path,
    *,
    kind: Format = Format.mcap,
    named: str = "image_raw",
    at: tuple[int, ...] = (0, 1, 2, 3),
    late_ns: int = 0,
    frames: tuple[str, str] = ("left", "right"),
    static: np.ndarray | None = None,
    infos: bool = True,
    size: tuple[int, int] = (48, 64),
    **second: object,
) -> Path:
    """A bag of two cameras: `at` are frames in which the second one has an image, `second` is of its CameraInfo."""
    first = second.pop("first", {})
    with BagWriter(folder / "run", kind) as bag:
        if infos:
            bag.camera_info("/left/camera_info", START_NS, frames[0], size=(64, 48), k=k_of(FIRST), **first)
            bag.camera_info("/right/camera_info", START_NS, frames[1], size=(64, 48), k=k_of(SECOND), **second)
        for index in range(FRAMES):
            stamp = START_NS + index * STEP_NS
            pose = np.eye(4)
            pose[0, 3] = 0.1 * index
            bag.image(f"/left/{named}", stamp, frames[0], "mono8", picture(index + 10))
            bag.posed("/pose", stamp, "PoseStamped", "world", "", pose)
            if index in at:
                pixels = picture(index)[: size[0], : size[1]]
                bag.image(f"/right/{named}", stamp + late_ns, frames[1], "mono8", pixels)
        if static is not None:
            bag.tf("/tf_static", START_NS, ("base", "left", TURNED), ("base", "right", TURNED @ static))
    return bag.path


def opened(path: Path, named: str = "image_raw", **options: object) -> Sequence:
    return open_sequence("rosbag", path, **{"second_image_topic": f"/right/{named}", **options})


def chain(folder: Path, *, related: bool = True) -> Path:
    lens = {"camera_model": "pinhole", "distortion_model": "none", "distortion_coeffs": [], "resolution": [64, 48]}
    cameras = {"cam0": {"intrinsics": [*k_of(FIRST)], **lens}, "cam1": {"intrinsics": [*k_of(SECOND)], **lens}}
    if related:
        cameras["cam1"]["T_cn_cnm1"] = SECOND_FROM_FIRST
    path = folder / "chain.yaml"
    path.write_text(yaml.safe_dump(cameras))
    return path


def require(found: Sequence, place: np.ndarray, source: str) -> None:
    assert (found.camera, found.second.camera) == (FIRST, SECOND)
    np.testing.assert_allclose(found.second.first_from_second, place, atol=1e-12)
    np.testing.assert_array_equal(found.image(1), picture(11))
    np.testing.assert_array_equal(found.second.images(1), picture(1))
    assert any(f"second camera: its pose in the first is that of {source}" in note for note in found.notes)


@pytest.mark.parametrize("kind", Format)
def test_p_of_a_rectified_pair(tmp_path: Path, kind: Format) -> None:
    written(
        tmp_path, kind=kind, named="image_rect", frames=("left", "left"), p=p_of(SECOND, 0.11), first={"p": p_of(FIRST)}
    )
    found = opened(tmp_path, "image_rect")
    require(found, ASIDE, "P of /right/camera_info")
    copy = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(copy.second.images(2), picture(2))
    with pytest.raises(DataError, match=r"choose it with --option image_topic=/left/image_rect.*; second_image_topic"):
        open_sequence("rosbag", tmp_path)
    right = open_sequence("rosbag", tmp_path, image_topic="/right/image_rect", second_image_topic="/left/image_rect")
    np.testing.assert_allclose(right.second.first_from_second, SECOND_FROM_FIRST, atol=1e-12)


def test_raw_images_are_turned_as_the_rectification_states(tmp_path: Path) -> None:
    """X_rectified = R X_raw of each camera, and the rectified second one is 0.11 m on the right."""
    turns = [Rotation.from_rotvec(turn).as_matrix() for turn in ((0.01, 0.02, -0.03), (-0.02, 0.01, 0.04))]
    written(
        tmp_path,
        p=p_of(SECOND, 0.11),
        r=turns[1].ravel(),
        first={"p": p_of(FIRST), "r": turns[0].ravel()},
    )
    point = np.array([0.3, -0.2, 4.0])  # of the second camera
    of_first = turns[0].T @ (turns[1] @ point + [0.11, 0.0, 0.0])
    place = opened(tmp_path).second.first_from_second
    np.testing.assert_allclose(place[:3, :3] @ point + place[:3, 3], of_first, atol=1e-12)


@pytest.mark.parametrize("kind", [Format.ros1, Format.sqlite])
def test_static_transforms(tmp_path: Path, kind: Format) -> None:
    written(tmp_path, kind=kind, static=ASIDE)
    require(opened(tmp_path), ASIDE, "static transforms")
    reader = make_reader("rosbag", tmp_path, {"second_image_topic": "/right/image_raw"})
    assert isinstance(reader, ImageReader)
    alone = reader.open_images(reader.recordings()[0])
    np.testing.assert_allclose(alone.second.first_from_second, ASIDE, atol=1e-12)


def test_a_chain_of_kalibr(tmp_path: Path) -> None:
    """Without CameraInfo, and before static transforms."""
    written(tmp_path, infos=False, static=TURNED)
    require(opened(tmp_path, camera_file=chain(tmp_path)), ASIDE, str(tmp_path / "chain.yaml"))


def test_intrinsics_of_a_file_and_the_pose_of_an_option(tmp_path: Path) -> None:
    written(tmp_path)
    options = {"second_camera_file": chain(tmp_path, related=False), "second_camera": "cam1"}
    require(opened(tmp_path, **options, first_from_second=TURNED.ravel().tolist()), TURNED, "the option first_from_sec")
    with pytest.raises(SettingsError, match=r"first_from_second is .*, expected 16 numbers"):
        opened(tmp_path, **options, first_from_second=[1.0])


def test_frames_without_an_image_at_their_time_have_none(tmp_path: Path) -> None:
    written(tmp_path, at=(0, 1, 3), static=ASIDE)
    found = opened(tmp_path)
    assert found.second.images(2) is None
    np.testing.assert_array_equal(found.second.images(3), picture(3))
    assert "1 of 4 frames has no image of /right/image_raw, and no depth from it" in found.notes


def test_times_that_differ_need_an_option(tmp_path: Path) -> None:
    written(tmp_path, static=ASIDE, late_ns=2_000_000)
    with pytest.raises(DataError, match=r"image_raw: no image at any of 4 times of frames; the nearest is 0.002 s off"):
        opened(tmp_path)
    np.testing.assert_array_equal(opened(tmp_path, second_gap_s=0.0025).second.images(3), picture(3))


def test_the_experiment_file_shows_how_to_use_it(tmp_path: Path) -> None:
    path = written(tmp_path, static=ASIDE)
    options = {"second_image_topic": "/right/image_raw"}
    text = experiment_template(make_reader("rosbag", path, options), path, options)
    assert 'second_image_topic = "/right/image_raw"' in text
    assert '# kind = "second-view"' in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"second_image_topic": "/third"},
            "second_image_topic '/third': no messages of /third, expected one of /left/",
        ),
        ({"second_image_topic": "/pose"}, "second_image_topic '/pose': /pose .*PoseStamped, 4.*, expected one of"),
        ({"second_camera_info_topic": "/third"}, "second_camera_info_topic '/third': no messages of /third, expected"),
        ({"image_topic": "/right/image_raw"}, "/right/image_raw as images of both cameras, expected a topic of each"),
        (
            {"second_image_topic": None, "image_topic": "/left/image_raw", "second_camera": "cam1"},
            "no second_image_topic",
        ),
        (
            {},
            "no pose of the second camera in the first: their frames are 'left' and 'right', expected static trans",
        ),
        ({"camera_file": "chain.yaml"}, "no pose of the second camera in the first: .*T_cn_cnm1"),
    ],
)
def test_what_is_missing_is_named(tmp_path: Path, options: dict[str, object], message: str) -> None:
    written(tmp_path)
    if "camera_file" in options:
        options = {"camera_file": chain(tmp_path, related=False)}
    with pytest.raises(DataError, match=message) as caught:
        opened(tmp_path, **options)
    assert "\n" not in str(caught.value)


def test_intrinsics_of_the_first_camera_are_not_those_of_the_second(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run", Format.mcap) as bag:
        bag.camera_info("/left/camera_info", START_NS, "left", size=(64, 48), k=k_of(FIRST))
        for topic in ("/left/image_raw", "/right/image_raw"):
            bag.image(topic, START_NS, "left", "mono8", picture(0))
        bag.posed("/pose", START_NS, "PoseStamped", "world", "", np.eye(4))
    expected = "CameraInfo beside /right/image_raw, or --option second_camera_file=FILE"
    with pytest.raises(DataError, match=f"expected one topic of sensor_msgs/msg/{expected}"):
        opened(tmp_path)


def test_images_of_another_size_are_named(tmp_path: Path) -> None:
    written(tmp_path, static=ASIDE, size=(24, 32))
    found = opened(tmp_path)
    with pytest.raises(
        DataError, match=r"an image of the second camera of shape \(24, 32\), expected shape \(48, 64\)"
    ):
        second_image(found.second, 0, found.source)
