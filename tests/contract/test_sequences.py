"""What every reader must do: those of the package, and one of another package, which is in `tests/foreign`.

To hold another reader to this contract, add the function that writes its layout to `LAYOUTS`.
"""

import importlib.util
import json
import pickle
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.writers.bags import BagWriter, Format
from tests.writers.colmap import write_binary as write_reconstruction
from tests.writers.colmap import write_depth_map
from tests.writers.euroc import write_euroc
from tests.writers.kitti_odometry import write_kitti_odometry
from tests.writers.nerfstudio import write_transforms
from tests.writers.tum import write_tum

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.geometry.cameras import Camera, CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import invert, transform
from tracknoise.paper.dtu import Dtu, write_mat
from tracknoise.paper.dtu_writer import calibration_variables
from tracknoise.paper.light_stage import arc, stage_camera
from tracknoise.sequences.colmap import Colmap
from tracknoise.sequences.euroc import Euroc
from tracknoise.sequences.folder import Folder, write_folder
from tracknoise.sequences.kitti import Kitti
from tracknoise.sequences.kitti_files import Drive, records_of_poses, write_record
from tracknoise.sequences.kitti_odometry import KittiOdometry
from tracknoise.sequences.kitti_writer import CAMERA_FROM_IMU, write_calibration
from tracknoise.sequences.nerfstudio import Nerfstudio
from tracknoise.sequences.reader_registry import READERS, reader_defaults
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.rosbag import Rosbag
from tracknoise.sequences.sequence import Reader, Sequence, camera_at
from tracknoise.sequences.sevenscenes import SevenScenes
from tracknoise.sequences.simulated import Simulated
from tracknoise.sequences.tartanair import TartanAir
from tracknoise.sequences.tum import Tum
from tracknoise.tables.identity import Direction, SequenceId

CAMERA = Camera(64, 48, 60.0, 61.0, 31.0, 24.0)


@dataclass(frozen=True)
class Written:
    """A data set of one scene, and what must be read from it.

    Images may be unknown (None) where nothing is written; `depths` are those of every frame, None without any.
    """

    reader: Reader
    world_from_camera: np.ndarray
    images: list[np.ndarray] | None
    depths: list[np.ndarray] | None = None
    depth_tolerance_m: float = 0.0
    pose_tolerance: float = 1e-12
    scan: np.ndarray | None = None
    lighting: str = "default"
    timed: bool = False
    length: int = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "length", len(self.world_from_camera))

    def open(self) -> Sequence:
        listed = [item for item in self.reader.sequences() if item.lighting == self.lighting]
        return self.reader.open(listed[0])


def images(count: int, camera: CameraModel = CAMERA) -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    return list(rng.integers(0, 256, (count, camera.height, camera.width), dtype=np.uint8))


def depths(count: int, camera: CameraModel = CAMERA) -> list[np.ndarray]:
    """(height, width) float64, metres; 0, which is none, in the first pixel."""
    made = np.random.default_rng(2).uniform(1.0, 20.0, (count, camera.height, camera.width))
    made[:, 0, 0] = 0.0
    return list(made)


def poses(count: int) -> np.ndarray:
    """Half a metre from frame to frame, and turned in every axis."""
    made = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    made[:, :3, :3] = Rotation.from_rotvec(np.random.default_rng(3).normal(0.0, 0.4, (count, 3))).as_matrix()
    made[:, :3, 3] = np.arange(count)[:, None] * (0.4, -0.1, 0.3) + (1.0, 2.0, 3.0)
    return made


def write_png(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image)


def folder(root: Path, count: int) -> Written:
    shown, deep = images(count), depths(count)
    source = RecordedSequence(
        id=SequenceId("made", "up"),
        source="memory",
        camera=CAMERA,
        world_from_camera=poses(count),
        images=lambda index: shown[index],
        depths=lambda index: DepthMap(deep[index], deep[index] > 0),
    )
    write_folder(source, root / "scene")
    return Written(Folder(root), poses(count), shown, deep, depth_tolerance_m=2e-6)


def sevenscenes(root: Path, count: int) -> Written:
    reader = SevenScenes(root)
    written = Written(reader, poses(count), images(count), depths(count), depth_tolerance_m=0.5e-3, timed=True)
    for index in range(count):
        stem = root / "chess" / f"frame-{index:06d}"
        write_png(Path(f"{stem}.color.png"), images(count)[index])
        write_png(Path(f"{stem}.depth.png"), np.rint(depths(count)[index] * 1000).astype(np.uint16))
        np.savetxt(f"{stem}.pose.txt", poses(count)[index])
    np.savetxt(root / "camera-intrinsics.txt", CAMERA.matrix)
    return written


def tartanair(root: Path, count: int) -> Written:
    """North, east, down in the files: right, down and forward of a camera that looks north are y, z and x."""
    camera = Camera(640, 480, 320.0, 320.0, 319.5, 239.5)
    ned = np.eye(4)[[2, 0, 1, 3]]
    rows = []
    for index, pose in enumerate(ned @ poses(count) @ ned.T):
        write_png(root / "P000" / "image_left" / f"{index:06d}_left.png", images(count, camera)[index])
        (root / "P000" / "depth_left").mkdir(exist_ok=True)
        deep = depths(count, camera)[index].astype(np.float32)
        np.save(root / "P000" / "depth_left" / f"{index:06d}_left_depth.npy", deep)
        rows.append([*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()])
    np.savetxt(root / "P000" / "pose_left.txt", rows, fmt="%.17g")
    return Written(TartanAir(root), poses(count), images(count, camera), depths(count, camera), depth_tolerance_m=2e-6)


def kitti(root: Path, count: int) -> Written:
    """The world's origin is the first position of the inertial navigation system; degrees in float64 tell 1e-8 m."""
    drive = Drive(root / "2011_09_26" / "2011_09_26_drive_0001_sync")
    camera = Camera(64, 48, 60.0, 61.0, 31.0, 24.0)
    records = records_of_poses(poses(count) @ CAMERA_FROM_IMU, start=(49.0, 8.4, 110.0))
    for index in range(count):
        write_png(drive.image(index), images(count)[index])
        write_png(drive.depth(index), np.rint(depths(count)[index] * 256).astype(np.uint16))
        drive.oxts(index).parent.mkdir(parents=True, exist_ok=True)
        write_record(drive.oxts(index), records[index])
    drive.timestamps.write_text("".join(f"2011-09-26 13:02:{index:02d}.125000000\n" for index in range(count)))
    write_calibration(drive.day, camera)
    expected = poses(count)
    expected[:, :3, 3] -= (expected[0] @ CAMERA_FROM_IMU)[:3, 3]
    return Written(
        Kitti(root), expected, images(count), depths(count), depth_tolerance_m=1 / 512, pose_tolerance=1e-7, timed=True
    )


def colmap(root: Path, count: int) -> Written:
    """Positions in files are half a pixel more: (0, 0) is the corner of the first pixel."""
    names = [f"{index}.png" for index in range(count)]
    for index, name in enumerate(names):
        write_png(root / "scene" / "images" / name, images(count)[index])
        write_depth_map(root / "scene" / "stereo" / "depth_maps" / f"{name}.geometric.bin", depths(count)[index])
    camera = ("PINHOLE", 64, 48, [CAMERA.fx, CAMERA.fy, CAMERA.cx + 0.5, CAMERA.cy + 0.5])
    registered = {name: (1, pose) for name, pose in zip(names, poses(count), strict=True)}
    write_reconstruction(root / "scene" / "sparse" / "0", {1: camera}, registered)
    return Written(Colmap(root), poses(count), images(count), depths(count), depth_tolerance_m=2e-6)


def nerfstudio(root: Path, count: int) -> Written:
    names = [f"images/{index}.png" for index in range(count)]
    for index, name in enumerate(names):
        write_png(root / "scene" / name, images(count)[index])
        write_png(root / "scene" / f"depth{index}.png", np.rint(depths(count)[index] * 1000).astype(np.uint16))
    further = [{"depth_file_path": f"depth{index}.png"} for index in range(count)]
    intrinsics = {"fl_x": CAMERA.fx, "fl_y": CAMERA.fy, "cx": CAMERA.cx + 0.5, "cy": CAMERA.cy + 0.5}
    write_transforms(root / "scene", names, poses(count), frames=further, **intrinsics)
    return Written(Nerfstudio(root), poses(count), images(count), depths(count), depth_tolerance_m=0.5e-3)


def rosbag(root: Path, count: int) -> Written:
    with BagWriter(root / "run", Format.mcap) as bag:
        k = (CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
        bag.camera_info("/camera_info", 0, "optical", size=(CAMERA.width, CAMERA.height), k=k)
        for index in range(count):
            stamp_ns = 1_700_000_000_000_000_000 + index * 50_000_000
            bag.image("/image", stamp_ns, "optical", "mono8", images(count)[index])
            bag.image("/depth", stamp_ns, "optical", "32FC1", depths(count)[index].astype("<f4"))
            bag.posed("/pose", stamp_ns, "Odometry", "world", "optical", poses(count)[index])
    return Written(Rosbag(root), poses(count), images(count), depths(count), depth_tolerance_m=2e-6, timed=True)


def dtu(root: Path, count: int) -> Written:
    """The condensed release, which has always 49 positions, at half the size of the calibration."""
    camera = stage_camera(32, 24)
    shown = images(49, camera.halved())
    for position in range(49):
        for number in range(36):
            image = np.full((12, 16), number, np.uint8) if number else shown[position]
            write_png(root / "scene001" / f"{position + 1:03d}_{number:02d}.png", image)
    write_mat(root / "Calib_Results_11.mat", calibration_variables(camera, arc()))
    points = np.random.default_rng(4).normal(size=(3, 20))
    (root / "CleanRecon_2009_11_16").mkdir()
    scan = root / "CleanRecon_2009_11_16" / "Clean_Reconstruction_01.mat"
    write_mat(scan, {"pts3D_near": points[:, :8], "pts3D_far": points[:, 8:]})
    return Written(Dtu(root), arc(), shown, scan=points.T, lighting="diffuse")


def simulated(root: Path, count: int) -> Written:
    """Nothing is written: depth at pixel centres is that of the exact surface."""
    reader = Simulated(motions=("arvr",), frames=count, width=48, height=32, supersampling=1)
    sequence = reader.open(reader.sequences()[0])
    u, v = np.meshgrid(np.arange(48.0), np.arange(32.0))
    deep = []
    for index, pose in enumerate(sequence.world_from_camera):
        points, hit = sequence.cast(index, np.stack([u.ravel(), v.ravel()], axis=-1))
        deep.append(np.where(hit, transform(invert(pose), points)[:, 2], 0.0).reshape(32, 48))
    return Written(reader, sequence.world_from_camera, None, deep, depth_tolerance_m=1e-9)


def foreign() -> ModuleType:
    """The module of another package."""
    name, path = "tracknoise_foreign_tapes", Path(__file__).parents[1] / "foreign" / "tapes.py"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        assert spec.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


def tape(root: Path, count: int) -> Written:
    frames = {f"image{index}": image for index, image in enumerate(images(count))}
    frames |= {f"depth{index}": depth for index, depth in enumerate(depths(count))}
    np.savez(root / "a.npz", poses=poses(count), times=np.arange(count) / 7, **frames)
    return Written(foreign().Tape(root), poses(count), images(count), depths(count), timed=True)


def tum(root: Path, count: int) -> Written:
    """Depth maps lag behind the images by 5 ms."""
    shown, deep = images(count), [np.minimum(depth, 13.0) for depth in depths(count)]
    write_tum(root / "scene", shown, poses(count), depths=deep)
    (root / "scene" / "calibration.txt").write_text("60 61 31 24\n")
    return Written(Tum(root), poses(count), shown, deep, depth_tolerance_m=1e-4, timed=True)


def euroc(root: Path, count: int) -> Written:
    write_euroc(root / "MH_01_easy", images(count), poses(count), intrinsics=(60.0, 61.0, 31.0, 24.0))
    return Written(Euroc(root), poses(count), images(count), timed=True)


def kitti_odometry(root: Path, count: int) -> Written:
    write_kitti_odometry(root, images(count), poses(count), intrinsics=(60.0, 61.0, 31.0, 24.0))
    return Written(KittiOdometry(root), poses(count), images(count), timed=True)


LAYOUTS: dict[str, Callable[[Path, int], Written]] = {
    "colmap": colmap,
    "dtu": dtu,
    "euroc": euroc,
    "folder": folder,
    "kitti": kitti,
    "kitti-odometry": kitti_odometry,
    "nerfstudio": nerfstudio,
    "rosbag": rosbag,
    "sevenscenes": sevenscenes,
    "simulated": simulated,
    "tape": tape,
    "tartanair": tartanair,
    "tum": tum,
}
Write = Callable[[int], Written]


@pytest.fixture(scope="module", params=LAYOUTS)
def write(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Write:
    """Writes a data set of so many frames, each count once."""
    made: dict[int, Written] = {}

    def of(count: int) -> Written:
        key = 49 if request.param == "dtu" else count
        if key not in made:
            made[key] = LAYOUTS[request.param](tmp_path_factory.mktemp(request.param), count)
        return made[key]

    return of


def as_bytes(sequence: Sequence, index: int) -> tuple[bytes, ...]:
    """All that a frame holds."""
    depth = sequence.depth(index)
    known = () if depth is None else (depth.valid.tobytes(), depth.depth_m[depth.valid].tobytes())
    return sequence.image(index).tobytes(), sequence.world_from_camera[index].tobytes(), *known


def test_every_reader_of_the_package_is_held_to_this_contract():
    assert set(READERS.built_in) <= set(LAYOUTS)


def test_what_is_written_is_read(write):
    written = write(3)
    sequence = written.open()
    assert isinstance(sequence, Sequence)
    assert len(sequence) == written.length
    np.testing.assert_allclose(
        sequence.world_from_camera, written.world_from_camera, rtol=0, atol=written.pose_tolerance
    )
    for index in range(3):
        if written.images is not None:
            np.testing.assert_array_equal(sequence.image(index), written.images[index])
        depth = sequence.depth(index)
        assert (depth is None) == (written.depths is None)
        if depth is not None and written.depths is not None:
            np.testing.assert_array_equal(depth.valid, written.depths[index] > 0)
            off = np.abs(depth.depth_m - written.depths[index])[depth.valid]
            assert off.max() <= written.depth_tolerance_m * (1 + 1e-9)
    assert (sequence.scan is None) == (written.scan is None)
    if sequence.scan is not None:
        np.testing.assert_allclose(sequence.scan.points_world, written.scan)


@pytest.mark.parametrize("count", [1, 2])
def test_one_or_two_frames_are_enough(write, count):
    written = write(count)
    sequence = written.open()
    assert len(sequence) == written.length
    for index in (0, len(sequence) - 1):
        assert as_bytes(sequence, index)


def test_a_folder_that_is_empty_or_missing_is_named(write, tmp_path):
    kind: Any = type(write(3).reader)
    if not kind.needs_root:
        assert write(3).reader.sequences()
        return
    for root in (tmp_path, tmp_path / "missing"):
        with pytest.raises(DataError, match=re.escape(str(root))) as caught:
            kind(root).sequences()
        assert "\n" not in str(caught.value)
        assert ", expected " in str(caught.value)


def test_listed_names_are_sorted_differ_and_can_be_opened(write):
    reader = write(3).reader
    listed = reader.sequences()
    assert listed
    assert listed == sorted(listed)
    assert len({item.key for item in listed}) == len(listed)
    for item in listed:
        assert (item.dataset, item.rotation, item.direction) == (reader.name, 0, Direction.forward)
        assert reader.open(item).id == item


def test_names_that_are_not_listed_are_refused_with_those_that_are(write):
    reader = write(3).reader
    first = reader.sequences()[0]
    with pytest.raises(UnknownNameError, match=re.escape(first.scene)) as caught:
        reader.open(SequenceId(reader.name, "nowhere", first.lighting))
    assert caught.value.kind == "scene"
    with pytest.raises(UnknownNameError, match=re.escape(first.lighting)) as caught:
        reader.open(SequenceId(reader.name, first.scene, "moonlight"))
    assert caught.value.kind == "lighting"


def test_reader_and_sequence_can_be_sent_to_another_process(write):
    written = write(3)
    copy = pickle.loads(pickle.dumps(written.reader))
    assert copy == written.reader
    sequence = written.open()
    assert as_bytes(pickle.loads(pickle.dumps(sequence)), 2) == as_bytes(sequence, 2)


def test_frames_are_the_same_in_any_order_and_every_time(write):
    written = write(3)
    first, second = written.open(), written.open()
    forward = [as_bytes(first, index) for index in range(3)]
    backward = [as_bytes(second, index) for index in (2, 1, 0)]
    assert forward == backward[::-1] == [as_bytes(first, index) for index in range(3)]
    assert len({frame[0] for frame in forward}) == 3


def test_images_poses_and_depths_have_the_types_and_shapes_they_promise(write):
    sequence = write(3).open()
    n, shape = len(sequence), (sequence.camera.height, sequence.camera.width)
    assert (sequence.world_from_camera.dtype, sequence.world_from_camera.shape) == (np.float64, (n, 4, 4))
    rotation = sequence.world_from_camera[:, :3, :3]
    identity = np.broadcast_to(np.eye(3), (n, 3, 3))
    np.testing.assert_allclose(rotation @ rotation.transpose(0, 2, 1), identity, atol=1e-12)
    np.testing.assert_array_equal(sequence.world_from_camera[:, 3], np.broadcast_to((0.0, 0.0, 0.0, 1.0), (n, 4)))
    assert (sequence.image(1).dtype, sequence.image(1).shape) == (np.uint8, shape)
    depth = sequence.depth(1)
    if depth is not None:
        assert depth.depth_m.shape == depth.valid.shape == shape
        assert np.all(depth.depth_m[depth.valid] > 0)
        assert np.isfinite(depth.depth_m[depth.valid]).all()


def test_the_camera_is_a_camera_model_and_has_one_size(write):
    sequence = write(3).open()
    assert camera_at(sequence, 0) == sequence.camera
    for index in range(3):
        camera = camera_at(sequence, index)
        assert isinstance(camera, CameraModel)
        assert camera.is_invertible
        assert (camera.width, camera.height) == (sequence.camera.width, sequence.camera.height)


def test_timestamps_increase_where_they_are_known(write):
    sequence = write(3).open()
    assert (sequence.timestamps_s is not None) == write(3).timed
    if sequence.timestamps_s is None:
        return
    assert (sequence.timestamps_s.dtype, sequence.timestamps_s.shape) == (np.float64, (len(sequence),))
    assert np.all(np.diff(sequence.timestamps_s) > 0)


def test_stated_uncertainties_are_finite_and_not_negative(write):
    sequence = write(3).open()
    for stated in (sequence.pose_accuracy, sequence.depth_accuracy):
        if stated is not None:
            values = [getattr(stated, name) for name in stated.__dataclass_fields__]
            assert all(np.isfinite(value) and value >= 0 for value in values)


def test_notes_are_single_sentences(write):
    notes = write(3).open().notes
    assert isinstance(notes, tuple)
    for note in notes:
        assert isinstance(note, str)
        assert note
        assert note == note.strip()
        assert "\n" not in note
        assert not note.endswith(".")
        assert ". " not in note


@pytest.mark.parametrize("name", READERS.names())
def test_defaults_are_shown_as_toml_that_makes_the_same_reader(name, tmp_path):
    import tomllib

    given = {"root": tmp_path} if READERS.load(name).needs_root else {}
    options = tomllib.loads(reader_defaults(name))
    assert json.loads(json.dumps(options)) == options
    assert READERS.make(name, options, given=given) == READERS.load(name)(**given)
