"""CameraInfo messages, through a bag."""

import numpy as np
import pytest
from tests.writers.bags import BagWriter, Format

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera, EquidistantCamera
from tracknoise.sequences.reader_registry import open_sequence

K = (90.0, 91.0, 39.5, 29.5)
RADTAN, RATIONAL = (-0.1, 0.02, 0.001, 0.002, 0.003), (-0.1, 0.02, 0.001, 0.002, 0.003, 0.01, 0.02, 0.001)


def camera_of(root, topic="/image_raw", shape=(60, 80), kind=Format.mcap, times=1, **said):
    with BagWriter(root / "run", kind) as bag:
        for _ in range(times):
            bag.camera_info("/camera_info", 1, "optical", **{"size": (80, 60), "k": K, **said})
        bag.image(topic, 1, "optical", "mono8", np.zeros(shape, np.uint8))
        bag.posed("/pose", 1, "PoseStamped", "world", "", np.eye(4))
    sequence = open_sequence("rosbag", root)
    assert sequence.image(0).shape == shape
    return sequence.camera, sequence.notes


@pytest.mark.parametrize("kind", Format)
@pytest.mark.parametrize(
    ("model", "d", "expected"),
    [
        ("plumb_bob", RADTAN, Camera(80, 60, *K, RADTAN)),
        ("plumb_bob", RADTAN[:4], Camera(80, 60, *K, RADTAN[:4])),
        ("rational_polynomial", RATIONAL, Camera(80, 60, *K, RATIONAL)),
        ("rational_polynomial", (*RATIONAL, 0.0, 0.0, 0.0, 0.0), Camera(80, 60, *K, RATIONAL)),
        ("equidistant", (0.01, 0.002, 0.0, 0.001), EquidistantCamera(80, 60, *K, (0.01, 0.002, 0.0, 0.001))),
        ("equidistant", (0.0, 0.0, 0.0, 0.0), EquidistantCamera(80, 60, *K)),
        ("plumb_bob", (0.0,) * 5, Camera(80, 60, *K)),
        ("", (), Camera(80, 60, *K)),
        ("Inverse Brown Conrady", (0.0,) * 5, Camera(80, 60, *K)),
    ],
)
def test_models(tmp_path, kind, model, d, expected):
    assert camera_of(tmp_path, kind=kind, model=model, d=d)[0] == expected


@pytest.mark.parametrize(
    ("topic", "focal"), [("/direct/image", 90.0), ("/a/image_rect_color", 70.0), ("/rect/a", 70.0)]
)
def test_images_are_rectified_only_where_a_word_of_their_topic_says_so(tmp_path, topic, focal):
    p = np.array([70.0, 0.0, 39.5, 0.0, 0.0, 70.0, 29.5, 0.0, 0.0, 0.0, 1.0, 0.0])
    assert camera_of(tmp_path, topic=topic, p=p)[0].fx == focal


def test_the_second_camera_of_a_rectified_pair_is_said(tmp_path):
    """P has -fx times the baseline; some drivers give both cameras the frame of the first."""
    p = np.array([70.0, 0.0, 39.5, -8.4, 0.0, 70.0, 29.5, 0.0, 0.0, 0.0, 1.0, 0.0])
    _, notes = camera_of(tmp_path, topic="/right/image_rect", p=p)
    said = "second camera of a pair, 0.12 m beside the first; the frame of the images is taken as its own"
    assert any(said in note for note in notes)


def test_joined_pixels_and_a_part_of_the_image(tmp_path):
    """The same ray has the position u in the full image, and (u + 0.5 - left) / 2 - 0.5 in the part at half size."""
    camera, _ = camera_of(tmp_path, shape=(20, 30), binning=(2, 2), roi=(10, 4, 60, 40), d=RADTAN)
    uv = np.array([[30.0, 20.0]])
    ray = Camera(80, 60, *K, RADTAN).bearings(uv)
    np.testing.assert_allclose(camera.project(ray), (uv + 0.5 - (10, 4)) / 2 - 0.5, atol=1e-9)


def test_rectified_images_have_the_intrinsics_of_the_projection(tmp_path):
    p = np.array([70.0, 0, 38.0, 0, 0, 70.0, 28.0, 0, 0, 0, 1.0, 0])
    camera, notes = camera_of(tmp_path, topic="/image_rect", d=RADTAN, p=p)
    assert camera == Camera(80, 60, 70.0, 70.0, 38.0, 28.0)
    assert any("P is used and not K" in note for note in notes)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"k": (0.0, 0.0, 0.0, 0.0)}, "K with the focal lengths 0 and 0, expected focal lengths above 0"),
        ({"k": (np.nan, 9.0, 0.0, 0.0)}, "K with the focal lengths nan and 9, expected focal lengths above 0"),
        ({"size": (0, 0)}, "an image size of 0x0, expected a size of at least 1x1"),
        ({"model": "thin_prism", "d": RADTAN}, "distortion model 'thin_prism', expected plumb_bob"),
        ({"d": RADTAN[:3]}, "3 coefficients of the model 'plumb_bob', expected 4 or 5 or 8 coefficients"),
        ({"d": (*RATIONAL, 0.1)}, "9 coefficients of the model"),
        ({"d": (np.inf,) * 5}, "distortion with NaN or infinity"),
        ({"d": (-90.0, 0.0, 0.0, 0.0, 0.0)}, "ray"),
    ],
)
def test_messages_that_cannot_be_used_are_named(tmp_path, said, message):
    with pytest.raises(DataError, match=message) as caught:
        camera_of(tmp_path, **said)
    assert f"{tmp_path / 'run'} /camera_info" in str(caught.value)


def test_intrinsics_that_change_are_refused(tmp_path):
    with BagWriter(tmp_path / "run", Format.ros1) as bag:
        for focal in (90.0, 91.0):
            bag.camera_info("/camera_info", 1, "optical", size=(80, 60), k=(focal, focal, 39.5, 29.5))
        bag.image("/image_raw", 1, "optical", "mono8", np.zeros((60, 80), np.uint8))
        bag.posed("/pose", 1, "PoseStamped", "world", "", np.eye(4))
    with pytest.raises(DataError, match="2 different intrinsics, expected the same intrinsics in all messages"):
        open_sequence("rosbag", tmp_path)
