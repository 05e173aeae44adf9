"""Encodings of images and depth maps, written to a bag and read again."""

import json
import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.writers.bags import BagWriter, Format, png

from tracknoise.exceptions import DataError
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.sequence import Sequence

Write = Callable[[BagWriter], None]
RNG = np.random.default_rng(5)
GRAY = RNG.integers(0, 256, (6, 8), np.uint8)
COLOUR = RNG.integers(0, 256, (6, 8, 3), np.uint8)
GRAY16 = RNG.integers(0, 4096, (6, 8)).astype(np.uint16)


def opened(root: Path, *parts: Write, kind: Format = Format.ros1, **options: object) -> Sequence:
    with BagWriter(root / "run", kind) as bag:
        bag.camera_info("/camera_info", 1, "optical", size=(8, 6), k=(9.0, 9.0, 3.5, 2.5))
        for stamp in (1, 2):
            held = np.eye(4)
            held[0, 3] = stamp
            bag.posed("/pose", stamp, "PoseStamped", "world", "", held)
        for part in parts:
            part(bag)
    return open_sequence("rosbag", root, **options)


def image(encoding: str, pixels: np.ndarray, topic: str = "/image") -> Write:
    return lambda bag: bag.image(topic, 1, "optical", encoding, pixels, padding=3)


def compressed(format_: str, data: bytes, topic: str = "/image/compressed") -> Write:
    return lambda bag: bag.compressed(topic, 1, "optical", format_, data)


def with_alpha(pixels: np.ndarray) -> np.ndarray:
    return np.concatenate([pixels, np.full((6, 8, 1), 9, np.uint8)], axis=2)


def interleaved(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.stack([first, second], axis=2)


@pytest.mark.parametrize("kind", Format)
@pytest.mark.parametrize(
    ("encoding", "pixels", "expected"),
    [
        ("mono8", GRAY, GRAY),
        ("8UC1", GRAY, GRAY),
        ("bgr8", COLOUR, cv2.cvtColor(COLOUR, cv2.COLOR_BGR2GRAY)),
        ("rgb8", COLOUR, cv2.cvtColor(COLOUR, cv2.COLOR_RGB2GRAY)),
        ("bgra8", with_alpha(COLOUR), cv2.cvtColor(COLOUR, cv2.COLOR_BGR2GRAY)),
        ("rgba8", with_alpha(COLOUR), cv2.cvtColor(COLOUR, cv2.COLOR_RGB2GRAY)),
        ("yuv422", interleaved(255 - GRAY, GRAY), GRAY),
        ("yuv422_yuy2", interleaved(GRAY, 255 - GRAY), GRAY),
    ],
)
def test_encodings_of_eight_bits(tmp_path, kind, encoding, pixels, expected):
    np.testing.assert_array_equal(opened(tmp_path, image(encoding, pixels), kind=kind).image(0), expected)


@pytest.mark.parametrize(
    ("encoding", "red", "blue"),
    [
        ("bayer_rggb8", (0, 0), (1, 1)),
        ("bayer_bggr8", (1, 1), (0, 0)),
        ("bayer_gbrg8", (1, 0), (0, 1)),
        ("bayer_grbg8", (0, 1), (1, 0)),
    ],
)
def test_colour_filters(tmp_path, encoding, red, blue):
    """A red surface: where the filter is read wrongly, its brightness is that of blue or green."""
    mosaic = np.full((6, 8), 30, np.uint8)
    mosaic[red[0] :: 2, red[1] :: 2] = 200
    mosaic[blue[0] :: 2, blue[1] :: 2] = 90
    expected = round(0.299 * 200 + 0.587 * 30 + 0.114 * 90)
    inside = opened(tmp_path, image(encoding, mosaic)).image(0)[2:-2, 2:-2]
    assert np.abs(inside.astype(int) - expected).max() <= 1


@pytest.mark.parametrize("order", ["<u2", ">u2"])
def test_sixteen_bits_are_scaled_as_stated(tmp_path, order):
    expected = np.rint(np.clip((GRAY16 - 100.0) / 3900.0, 0, 1) * 255)
    found = opened(tmp_path, image("mono16", GRAY16.astype(order)), image_levels=[100.0, 4000.0])
    np.testing.assert_array_equal(found.image(0), expected)
    with pytest.raises(DataError, match=r"/image: 16-bit images and no image_levels, expected image_levels = "):
        open_sequence("rosbag", tmp_path).image(0)


def test_compressed_images(tmp_path):
    jpeg = cv2.imencode(".jpg", COLOUR)[1].tobytes()
    expected = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
    found = opened(tmp_path / "jpeg", compressed("bgr8; jpeg compressed bgr8", jpeg))
    np.testing.assert_array_equal(found.image(0), expected)
    levels = {"image_levels": [0.0, 4095.0]}
    for said in ("mono16; png compressed ", "png"):
        root = tmp_path / said[:4]
        found = opened(root, compressed(said, png(GRAY16)), **levels)
        np.testing.assert_array_equal(found.image(0), np.rint(GRAY16 / 4095.0 * 255))
        with pytest.raises(DataError, match="16-bit images and no image_levels"):
            open_sequence("rosbag", root).image(0)


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        (image("16UC1", np.array([[0, 1500]] * 3, np.uint16).repeat(4, 1).repeat(2, 0), "/depth"), 1.5),
        (image("32FC1", np.array([[np.nan, 1.5]] * 3, "<f4").repeat(4, 1).repeat(2, 0), "/depth"), 1.5),
        (image("32FC1", np.array([[-1.0, 1.5]] * 3, ">f4").repeat(4, 1).repeat(2, 0), "/depth"), 1.5),
        (
            compressed(
                "16UC1; png compressed ", png(np.array([[0, 1500]] * 3, np.uint16).repeat(4, 1).repeat(2, 0)), "/d"
            ),
            1.5,
        ),
        (
            compressed(
                "32FC1; compressedDepth png",
                struct.pack("<iff", 0, 3000.0, -1.0)
                + png(np.array([[0, 1999]] * 3, np.uint16).repeat(4, 1).repeat(2, 0)),
                "/d/compressedDepth",
            ),
            1.5,
        ),
    ],
    ids=["16UC1", "32FC1", "big-endian", "png", "inverse depth"],
)
def test_depth_maps(tmp_path, part, expected):
    depth = opened(tmp_path, image("mono8", GRAY), part).depth(0)
    np.testing.assert_array_equal(depth.valid, [[False] * 4 + [True] * 4] * 6)
    np.testing.assert_allclose(depth.depth_m[depth.valid], expected, rtol=1e-7)


def test_a_unit_of_depth_can_be_stated(tmp_path):
    deep = np.full((6, 8), 5000, np.uint16)
    found = opened(tmp_path, image("mono8", GRAY), image("16UC1", deep, "/depth"), depth_unit_m=1 / 5000)
    np.testing.assert_allclose(found.depth(0).depth_m, 1.0)


def test_the_unit_of_depth_is_that_of_the_camera_file(tmp_path):
    deep = np.full((6, 8), 5000, np.uint16)
    stated = {"width": 8, "height": 6, "fx": 10.0, "fy": 10.0, "cx": 3.5, "cy": 2.5, "depth_scale": 5000}
    (tmp_path / "camera.json").write_text(json.dumps(stated))
    parts = image("mono8", GRAY), image("16UC1", deep, "/depth")
    found = opened(tmp_path, *parts, camera_file=tmp_path / "camera.json")
    np.testing.assert_allclose(found.depth(0).depth_m, 1.0)
    found = open_sequence("rosbag", tmp_path, camera_file=tmp_path / "camera.json", depth_unit_m=0.001)
    np.testing.assert_allclose(found.depth(0).depth_m, 5.0)


@pytest.mark.parametrize(
    ("part", "message"),
    [
        (image("hsv8", COLOUR), "an image with the encoding 'hsv8', expected mono8, mono16"),
        (compressed("jpeg", b"\xff\xd8\xffhalf"), "truncated or damaged image of 7 bytes"),
        (compressed("jpeg", b""), "an empty file"),
        (image("mono8", GRAY[:, :5]), r"shape \(6, 5\) and type uint8, expected shape \(6, 8\)"),
    ],
)
def test_images_that_cannot_be_used_are_named(tmp_path, part, message):
    sequence = opened(tmp_path, part)
    with pytest.raises(DataError, match=message) as caught:
        sequence.image(0)
    assert str(tmp_path / "run.bag") in str(caught.value)


def test_the_largest_integer_is_no_depth(tmp_path):
    deep = np.full((6, 8), 65534, np.uint16)
    deep[0, :2] = 65535
    found = opened(tmp_path, image("mono8", GRAY), image("16UC1", deep, "/depth")).depth(0)
    np.testing.assert_array_equal(found.valid, deep != 65535)


def test_other_depths_are_refused(tmp_path):
    squeezed = compressed("16UC1; compressedDepth rvl", bytes(40), "/d")
    with pytest.raises(DataError, match="depth in the format '16UC1; compressedDepth rvl', expected compressedDepth"):
        opened(tmp_path, image("mono8", GRAY), squeezed).depth(0)


def test_an_image_that_is_shorter_than_it_says_is_refused(tmp_path):
    def cut(bag: BagWriter) -> None:
        message = bag.make(
            "sensor_msgs/msg/Image",
            header=bag.header(1, "optical"),
            height=6,
            width=8,
            encoding="mono8",
            is_bigendian=0,
            step=8,
            data=np.zeros(40, np.uint8),
        )
        bag.write("/image", message, 1)

    with pytest.raises(DataError, match="40 bytes in rows of 8 for an image of 8x6, expected 6 rows of at least 8"):
        opened(tmp_path, cut).image(0)


MOSAIC = cv2.GaussianBlur(np.random.default_rng(5).integers(0, 256, (6, 8), dtype=np.uint8), (0, 0), 1.5)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize(
    ("said", "suffix", "most"), [("png compressed ", ".png", 0), ("jpeg compressed ", ".jpg", 3)], ids=["png", "jpeg"]
)
def test_a_compressed_mosaic_is_read_like_a_raw_one(tmp_path, pattern, said, suffix, most):
    """As `compressed_image_transport` writes it."""
    raw = opened(tmp_path / "raw", image(f"bayer_{pattern}8", MOSAIC)).image(0)
    data = cv2.imencode(suffix, MOSAIC, [cv2.IMWRITE_JPEG_QUALITY, 100])[1].tobytes()
    found = opened(tmp_path / "squeezed", compressed(f"bayer_{pattern}8; {said}", data)).image(0)
    assert np.abs(found.astype(int) - raw).max() <= most


def test_a_mosaic_of_sixteen_bits_is_filled_in_and_scaled(tmp_path):
    wide = MOSAIC.astype(np.uint16) * 16
    expected = opened(tmp_path / "narrow", image("bayer_gbrg8", MOSAIC)).image(0)
    levels = {"image_levels": [0.0, 255.0 * 16]}
    raw = opened(tmp_path / "raw", image("bayer_gbrg16", wide), **levels)
    squeezed = opened(tmp_path / "squeezed", compressed("bayer_gbrg16; png compressed ", png(wide)), **levels)
    for found in (raw.image(0), squeezed.image(0)):
        assert np.abs(found.astype(int) - expected).max() <= 1
    with pytest.raises(DataError, match="16-bit images and no image_levels"):
        open_sequence("rosbag", tmp_path / "squeezed").image(0)


def test_a_mosaic_that_was_filled_in_before_it_was_compressed_is_not_one(tmp_path):
    found = opened(tmp_path, compressed("bayer_rggb8; png compressed bgr8", png(COLOUR))).image(0)
    assert np.abs(found.astype(int) - cv2.cvtColor(COLOUR, cv2.COLOR_BGR2GRAY)).max() <= 1


@pytest.mark.parametrize(
    "part",
    [
        image("mono16", np.full((6, 8), 1500, np.uint16), "/cam/depth/image_rect"),
        image("mono16", np.full((6, 8), 1500, np.uint16), "/tof/depth_map"),
        compressed("mono16; png compressed ", png(np.full((6, 8), 1500, np.uint16)), "/depth_registered/compressed"),
        compressed("png", png(np.full((6, 8), 1500, np.uint16)), "/cam/depth/image"),
    ],
    ids=["rect", "map", "png of mono16", "png"],
)
def test_sixteen_bits_are_depth_by_the_name_of_their_topic(tmp_path, part):
    found = opened(tmp_path, image("mono8", GRAY), part)
    np.testing.assert_array_equal(found.image(0), GRAY)
    np.testing.assert_allclose(found.depth(0).depth_m, 1.5)
    assert any("is taken as depth in units of 0.001 m, by its name" in note for note in found.notes)


def test_both_options_are_advised_where_a_name_says_nothing(tmp_path):
    parts = image("mono16", np.full((6, 8), 1500, np.uint16), "/a/range"), image("mono8", GRAY, "/cam/image_raw")
    with pytest.raises(DataError, match=r"--option image_topic=/cam/image_raw.*if /a/range is depth, --option depth_t"):
        opened(tmp_path, *parts)
    found = open_sequence("rosbag", tmp_path, depth_topic="/a/range")
    np.testing.assert_array_equal(found.image(0), GRAY)
    np.testing.assert_allclose(found.depth(0).depth_m, 1.5)
    without = open_sequence("rosbag", tmp_path, image_topic="/cam/image_raw")
    assert without.depth(0) is None
    assert any("no depth is used" in note for note in without.notes)
