"""Images are used as stored, whatever orientation their EXIF data state, and such files are named."""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.sequences.test_tum import INTRINSICS, images, poses
from tests.writers.bags import BagWriter, Format
from tests.writers.euroc import write_euroc
from tests.writers.exif import save_turned
from tests.writers.kitti_odometry import write_kitti_odometry
from tests.writers.nerfstudio import write_transforms
from tests.writers.tum import write_tum

import tracknoise as tn
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.folder import write_folder
from tracknoise.sequences.images import read_depth_png16, read_gray
from tracknoise.sequences.orientation import orientation_notes, orientation_of
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.identity import SequenceId

N = 4
CAMERA = Camera(64, 48, *INTRINSICS)
SMOOTH = [cv2.GaussianBlur(image, (0, 0), 3.0) for image in images(N)]


def as_jpeg(path: Path, image: np.ndarray, orientation: int) -> Path:
    """A JPEG file in place of a PNG file of the same name."""
    path.unlink(missing_ok=True)
    save_turned(path.with_suffix(".jpg"), image, orientation)
    return path.with_suffix(".jpg")


def png_with(orientation: int, image: np.ndarray, *, first: bytes = b"MM") -> bytes:
    """A PNG file with a chunk of EXIF data before its pixels."""
    data = cv2.imencode(".png", image)[1].tobytes()
    order = "<" if first == b"II" else ">"
    tiff = first + struct.pack(f"{order}HIHHHIHHI", 42, 8, 1, 0x112, 3, 1, orientation, 0, 0)
    chunk = b"eXIf" + tiff
    start = data.index(b"IDAT") - 4
    return data[:start] + struct.pack(">I", len(tiff)) + chunk + struct.pack(">I", zlib.crc32(chunk)) + data[start:]


def write_plain(root: Path, orientation: int) -> None:
    source = RecordedSequence(
        id=SequenceId("made", "up"),
        source="memory",
        camera=CAMERA,
        world_from_camera=poses(N),
        images=SMOOTH.__getitem__,
    )
    write_folder(source, root / "scene")
    for index, path in enumerate(sorted((root / "scene/images").iterdir())):
        as_jpeg(path, SMOOTH[index], orientation)


def write_drive(root: Path, orientation: int) -> None:
    folder = write_kitti_odometry(root, SMOOTH, poses(N), intrinsics=INTRINSICS)
    for index, path in enumerate(sorted((folder / "image_0").iterdir())):
        as_jpeg(path, SMOOTH[index], orientation)


def write_rgbd(root: Path, orientation: int) -> None:
    write_tum(root / "scene", SMOOTH, poses(N))
    (root / "scene/calibration.txt").write_text("60 61 31 24\n")
    for index, path in enumerate(sorted((root / "scene/rgb").iterdir())):
        as_jpeg(path, SMOOTH[index], orientation)
    listed = root / "scene/rgb.txt"
    listed.write_text(listed.read_text().replace(".png", ".jpg"))


def write_asl(root: Path, orientation: int) -> None:
    write_euroc(root / "scene", SMOOTH, poses(N), intrinsics=INTRINSICS)
    for index, path in enumerate(sorted((root / "scene/mav0/cam0/data").iterdir())):
        as_jpeg(path, SMOOTH[index], orientation)
    listed = root / "scene/mav0/cam0/data.csv"
    listed.write_text(listed.read_text().replace(".png", ".jpg"))


def write_nerf(root: Path, orientation: int) -> None:
    names = [f"images/{index}.jpg" for index in range(N)]
    for name, image in zip(names, SMOOTH, strict=True):
        save_turned(root / name, image, orientation)
    write_transforms(root, names, poses(N), w=64, h=48, fl_x=60.0, fl_y=61.0, cx=31.5, cy=24.5)


def write_bag(root: Path, orientation: int) -> None:
    with BagWriter(root / "run", Format.ros1) as bag:
        bag.camera_info("/cam/camera_info", 1, "optical", size=(64, 48), k=INTRINSICS)
        for index, image in enumerate(SMOOTH):
            path = as_jpeg(root / "one.png", image, orientation)
            stamp = 10**18 + index * 50_000_000
            bag.compressed("/cam/image_raw/compressed", stamp, "optical", "jpeg", path.read_bytes())
            bag.posed("/pose", stamp, "PoseStamped", "world", "", poses(N)[index])


@pytest.mark.parametrize(
    ("reader", "write"),
    [
        ("folder", write_plain),
        ("kitti-odometry", write_drive),
        ("tum", write_rgbd),
        ("euroc", write_asl),
        ("nerfstudio", write_nerf),
        ("rosbag", write_bag),
    ],
)
@pytest.mark.parametrize("orientation", [3, 6])
def test_every_reader_uses_images_as_stored(
    tmp_path: Path, reader: str, write: Callable[[Path, int], None], orientation: int
) -> None:
    write(tmp_path, orientation)
    found = tn.open_sequence(reader, tmp_path)
    for index, expected in enumerate(SMOOTH):
        assert np.abs(found.image(index).astype(int) - expected).mean() < 2.0
    (note,) = [note for note in found.notes if "EXIF" in note]
    assert f"4 of 4 images state an EXIF orientation ({orientation}, " in note
    assert note.endswith("not applied: images are used as stored")


@pytest.mark.parametrize("orientation", range(1, 9))
def test_every_orientation_of_jpeg_and_png(tmp_path, orientation):
    jpeg, png = as_jpeg(tmp_path / "a.png", SMOOTH[0], orientation), tmp_path / "b.png"
    png.write_bytes(png_with(orientation, SMOOTH[0], first=b"II" if orientation % 2 else b"MM"))
    for path in (jpeg, png):
        assert orientation_of(path.read_bytes()) == orientation
        assert np.abs(read_gray(path, CAMERA).astype(int) - SMOOTH[0]).mean() < 2.0
        assert len(orientation_notes([path])) == (orientation != 1)


def test_depth_is_as_stored_too(tmp_path):
    units = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64) + 1000
    path = tmp_path / "depth.png"
    path.write_bytes(png_with(6, units))
    np.testing.assert_allclose(read_depth_png16(path, CAMERA, metres_per_unit=1.0).depth_m, units)


def test_one_turned_image_among_many_is_named(tmp_path):
    paths = [as_jpeg(tmp_path / f"{index}.png", SMOOTH[index], 8 if index == 2 else 1) for index in range(N)]
    (note,) = orientation_notes(paths)
    assert note.startswith(f"{paths[2]}: 1 of 4 images states an EXIF orientation (8, turned by 90 degrees counter")
    assert orientation_notes([paths[0], tmp_path / "missing.jpg"]) == ()
    assert orientation_notes([]) == ()


@pytest.mark.parametrize("kept", [0, 1, 2, 5, 12, 20, 24, 30, 36])
def test_a_file_that_is_cut_off_has_no_orientation_and_no_exception(tmp_path, kept):
    for data in (as_jpeg(tmp_path / "a.png", SMOOTH[0], 6).read_bytes(), png_with(6, SMOOTH[0])):
        assert orientation_of(data[:kept]) in (1, 6)
