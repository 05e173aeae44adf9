import struct
import zlib

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.images import (
    image_size,
    read_depth_npy,
    read_depth_png16,
    read_depth_png_float32,
    read_gray,
)

CAMERA = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
MILLIMETRES = {"metres_per_unit": 0.001}


@pytest.fixture
def colour():
    return np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)


@pytest.fixture
def write(tmp_path):
    def write(name, array):
        path = tmp_path / name
        assert cv2.imwrite(str(path), array)
        return path

    return write


@pytest.mark.parametrize("name", ["image.png", "image.jpg", "image.bmp"])
def test_gray_is_what_opencv_reads(write, colour, name):
    path = write(name, colour)
    image = read_gray(path, CAMERA)
    assert image.dtype == np.uint8
    np.testing.assert_array_equal(image, cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
    assert image_size(path) == (64, 48)


def test_gray_of_a_jpeg_is_its_luma_and_not_a_conversion_of_its_colours(write, colour):
    path = write("image.jpg", colour)
    converted = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2GRAY)
    assert np.any(read_gray(path, CAMERA) != converted)


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.bmp"])
def test_gray_of_one_channel_is_read_as_it_is(write, colour, name):
    image = read_gray(write(name, colour[..., 0]), CAMERA)
    assert image.dtype == np.uint8
    if not name.endswith("jpg"):
        np.testing.assert_array_equal(image, colour[..., 0])


def test_16_bit_images_are_scaled_as_stated_and_never_as_guessed(write, colour):
    path = write("a.png", colour[..., 0].astype(np.uint16) * 257)
    with pytest.raises(DataError) as caught:
        read_gray(path, CAMERA)
    assert str(caught.value) == (
        f"{path}: a 16-bit image of 1 channel, expected 8 bits, or image_levels = [low, high] of folder or euroc"
    )
    np.testing.assert_array_equal(read_gray(path, CAMERA, levels=(0, 65535)), colour[..., 0])
    np.testing.assert_array_equal(
        read_gray(write("b.png", colour), CAMERA, levels=(0, 1)), read_gray(path.with_name("b.png"), CAMERA)
    )


def test_levels_are_rounded_and_clipped(write):
    values = np.zeros((48, 64), np.uint16)
    values[0, :6] = (0, 1000, 1002, 2000, 3000, 65535)
    image = read_gray(write("a.png", values), CAMERA, levels=(1000, 3000))
    assert image.dtype == np.uint8
    assert image[0, :6].tolist() == [0, 0, 0, 128, 255, 255]


@pytest.mark.parametrize("name", ["image.png", "image.jpg", "image.bmp"])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.99])
def test_truncated_images_are_refused_in_silence(write, colour, capfd, name, share):
    path = write(name, colour)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(DataError) as caught:
        read_gray(path, CAMERA)
    assert str(caught.value).startswith(f"{path}: truncated or damaged image of ")
    assert str(caught.value).endswith("expected a whole PNG, JPEG or BMP image")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["image.png", "image.jpg", "image.bmp"])
def test_every_cut_is_noticed(write, name):
    path = write(name, np.random.default_rng(1).integers(0, 256, (48, 64), dtype=np.uint8))
    whole = path.read_bytes()
    for length in range(3, len(whole) - 1, 97):
        path.write_bytes(whole[:length])
        with pytest.raises(DataError):
            read_gray(path, CAMERA)


def test_a_cut_jpeg_with_a_whole_thumbnail_is_refused(write, colour):
    """The thumbnail's own end marker must not pass for the image's."""
    path = write("image.jpg", colour)
    whole = path.read_bytes()
    small = cv2.imencode(".jpg", colour[:8, :8])[1].tobytes()
    segment = b"\xff\xe1" + (len(small) + 2).to_bytes(2, "big") + small
    path.write_bytes(whole[:2] + segment + whole[2:])
    assert read_gray(path, CAMERA).shape == (48, 64)
    path.write_bytes(whole[:2] + segment + whole[2:-200])
    with pytest.raises(DataError, match="truncated or damaged image"):
        read_gray(path, CAMERA)


def test_a_png_with_a_flipped_bit_is_refused(write, colour, capfd):
    path = write("image.png", colour)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(DataError, match="truncated or damaged image"):
        read_gray(path, CAMERA)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "an empty file, expected a PNG, JPEG or BMP image"),
        (b"<html>", "no image, expected a PNG, JPEG or BMP image"),
        (None, "no such file, expected an image"),
    ],
)
def test_what_is_no_image_is_refused(tmp_path, content, message):
    path = tmp_path / "image.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DataError) as caught:
        read_gray(path, CAMERA)
    assert str(caught.value) == f"{path}: {message}"


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("width", [61, 62, 63, 64])
def test_a_bmp_may_lack_none_of_its_pixels(tmp_path, channels, width):
    """Rows are padded to four bytes; the size of the file in its header is not always right, and not needed."""
    image = np.random.default_rng(0).integers(0, 256, (48, width, channels), dtype=np.uint8)
    data = bytearray(cv2.imencode(".bmp", image)[1].tobytes())
    data[2:6] = bytes(4)
    path, camera = tmp_path / "image.bmp", Camera(width, 48, 50.0, 50.0, 31.5, 23.5)
    path.write_bytes(data)
    np.testing.assert_array_equal(read_gray(path, camera), cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
    path.write_bytes(data[:-1])
    with pytest.raises(DataError, match="truncated or damaged image"):
        read_gray(path, camera)


def test_a_bmp_whose_rows_go_down(tmp_path, colour):
    data = bytearray(cv2.imencode(".bmp", colour)[1].tobytes())
    data[22:26] = (-48).to_bytes(4, "little", signed=True)
    path = tmp_path / "image.bmp"
    path.write_bytes(data)
    upright = cv2.imdecode(cv2.imencode(".bmp", colour)[1], cv2.IMREAD_GRAYSCALE)
    np.testing.assert_array_equal(read_gray(path, CAMERA), upright[::-1])


def test_a_folder_is_no_image(tmp_path):
    with pytest.raises(DataError, match="unreadable"):
        read_gray(tmp_path, CAMERA)


@pytest.mark.parametrize("shape", [(48, 60), (64, 48)])
def test_an_image_of_another_size_is_refused(write, shape):
    path = write("image.png", np.zeros(shape, np.uint8))
    with pytest.raises(DataError) as caught:
        read_gray(path, CAMERA)
    assert str(caught.value) == f"{path}: size {shape[1]}x{shape[0]}, expected the camera's 64x48"


def test_integer_depth(write):
    units = np.full((48, 64), 1234, np.uint16)
    units[0, :3] = 0, 65535, 40000
    depth = read_depth_png16(write("depth.png", units), CAMERA, **MILLIMETRES)
    assert depth.valid[0, :4].tolist() == [False, False, True, True]
    np.testing.assert_allclose(depth.depth_m[0, 2:4], (40.0, 1.234), rtol=1e-15)


def test_depth_of_four_bytes(write):
    metres = np.random.default_rng(2).uniform(0.5, 50.0, (48, 64)).astype("<f4")
    metres[0, :5] = 20_000.0, np.inf, np.nan, -1.0, 0.0
    path = write("depth.png", metres.view(np.uint8).reshape(48, 64, 4))
    depth = read_depth_png_float32(path, CAMERA, farthest_m=10_000.0)
    np.testing.assert_array_equal(depth.depth_m, metres)
    assert not depth.valid[0, :5].any()
    assert np.count_nonzero(~depth.valid) == 5


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_depth_of_numpy_files(tmp_path, kind):
    metres = np.random.default_rng(3).uniform(0.5, 50.0, (48, 64)).astype(kind)
    metres[0, :5] = 20_000.0, np.inf, np.nan, -1.0, 0.0
    np.save(tmp_path / "depth.npy", metres)
    depth = read_depth_npy(tmp_path / "depth.npy", CAMERA, farthest_m=10_000.0)
    np.testing.assert_array_equal(depth.depth_m, metres)
    assert np.count_nonzero(~depth.valid) == 5


def test_depth_of_another_size_is_refused(write, tmp_path):
    png16 = write("d16.png", np.ones((24, 32), np.uint16))
    packed = write("d32.png", np.ones((24, 32, 4), np.uint8))
    npy = tmp_path / "d.npy"
    np.save(npy, np.ones((24, 32), np.float32))
    for path, read in ((packed, read_depth_png_float32), (npy, read_depth_npy)):
        with pytest.raises(DataError) as caught:
            read(path, CAMERA)
        assert str(caught.value) == f"{path}: size 32x24, expected the camera's 64x48"
    with pytest.raises(DataError, match="size 32x24, expected the camera's 64x48"):
        read_depth_png16(png16, CAMERA, **MILLIMETRES)


def test_depth_of_another_type_is_refused(write, tmp_path):
    gray = write("gray.png", np.ones((48, 64), np.uint8))
    with pytest.raises(DataError, match="8-bit image of 1 channel, expected 16-bit single-channel depth"):
        read_depth_png16(gray, CAMERA, **MILLIMETRES)
    with pytest.raises(DataError, match="8-bit image of 1 channel, expected 8-bit four-channel depth"):
        read_depth_png_float32(gray, CAMERA)
    np.save(tmp_path / "d.npy", np.ones((48, 64), np.int32))
    with pytest.raises(DataError, match="int32 numbers, expected float32 or float64 depth in metres"):
        read_depth_npy(tmp_path / "d.npy", CAMERA)
    np.save(tmp_path / "d3.npy", np.ones((48, 64, 2), np.float32))
    with pytest.raises(DataError, match="size 64x48x2, expected the camera's 64x48"):
        read_depth_npy(tmp_path / "d3.npy", CAMERA)


@pytest.mark.parametrize("keep", [0, 5, 60, 1000])
def test_truncated_numpy_files_are_refused(tmp_path, keep):
    path = tmp_path / "depth.npy"
    np.save(path, np.ones((48, 64), np.float32))
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(DataError) as caught:
        read_depth_npy(path, CAMERA)
    assert str(caught.value) == f"{path}: damaged or truncated file, expected a NumPy array of float32 depth"


def test_a_missing_numpy_file(tmp_path):
    with pytest.raises(DataError, match=r"depth\.npy: no such file, expected a depth map"):
        read_depth_npy(tmp_path / "depth.npy", CAMERA)


def test_pickles_are_not_opened(tmp_path):
    np.save(tmp_path / "depth.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(DataError, match="damaged or truncated file"):
        read_depth_npy(tmp_path / "depth.npy", CAMERA)


def test_a_small_file_cannot_become_a_huge_image(tmp_path):
    """A PNG of 20000x20000 pixels of one value has 400 kB, and would take 400 MB."""
    row = zlib.compress(bytes(20_001 * 20_000), 1)
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", 20_000, 20_000, 8, 0, 0, 0, 0)), (b"IDAT", row), (b"IEND", b"")]
    packed = [struct.pack(">I", len(data)) + kind + data for kind, data in chunks]
    packed = [chunk + struct.pack(">I", zlib.crc32(chunk[4:])) for chunk in packed]
    path = tmp_path / "bomb.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(packed))
    for read in (image_size, lambda path: read_depth_png16(path, CAMERA, **MILLIMETRES)):
        with pytest.raises(DataError, match=r"an image of 20000x20000, expected at most 67108864 pixels$"):
            read(path)


@pytest.mark.parametrize("name", ["image.jpg", "image.bmp"])
def test_the_size_in_the_header_of_other_formats_is_limited_too(write, colour, name):
    path = write(name, colour)
    data = bytearray(path.read_bytes())
    if name.endswith("jpg"):
        start = data.index(b"\xff\xc0") + 5
        data[start : start + 4] = struct.pack(">HH", 65_000, 65_000)
        size = "65000x65000"
    else:
        data[18:26] = struct.pack("<ii", 1 << 20, 1 << 20)
        data[28:34] = struct.pack("<HI", 0, 0)  # no bits, so that the file seems to be long enough
        size = "1048576x1048576"
    path.write_bytes(data)
    with pytest.raises(DataError, match=f"an image of {size}, expected at most"):
        image_size(path)


def test_a_jpeg_of_very_many_scans_is_refused(tmp_path, write):
    path = write("image.jpg", np.zeros((2000, 2000), np.uint8))
    data = path.read_bytes()
    path.write_bytes(data[:-2] + b"\xff\xda\x00\x08\x01\x01\x00\x00\x3f\x00" * 2000 + b"\xff\xd9")
    with pytest.raises(DataError, match=r"2001 scans of 2000x2000, expected at most 1073 scans of this size$"):
        image_size(path)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (
            "{'descr': '<f4', 'fortran_order': False, 'shape': (100000, 100000)}",
            "size 100000x100000, expected the camer",
        ),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (" + "9" * 5000 + ", 4)}", "damaged or truncated file"),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (", "damaged or truncated file"),
        ("(" * 9000, "damaged or truncated file"),
    ],
)
def test_headers_of_numpy_files_are_checked_before_anything_is_allocated(tmp_path, header, message):
    path = tmp_path / "depth.npy"
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + bytes(100))
    with pytest.raises(DataError, match=message):
        read_depth_npy(path, CAMERA)


def test_numpy_arrays_stored_by_columns_are_read(tmp_path):
    depth = np.arange(1, 48 * 64 + 1, dtype=np.float64).reshape(48, 64)
    np.save(tmp_path / "rows.npy", depth)
    np.save(tmp_path / "columns.npy", np.asfortranarray(depth))
    for name in ("rows.npy", "columns.npy"):
        np.testing.assert_array_equal(read_depth_npy(tmp_path / name, CAMERA).depth_m, depth)
