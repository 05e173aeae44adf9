import json
import os
import pickle
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.geometry.cameras import Camera, CameraModel, DoubleSphereCamera, EquidistantCamera
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.camera_files import Lens
from tracknoise.sequences.folder import Folder, write_folder
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.reader_registry import make_reader
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import TruthKind
from tracknoise.sequences.views import turned
from tracknoise.tables.identity import SequenceId

FRAMES, WIDTH, HEIGHT = 3, 20, 16
CAMERA = Camera(WIDTH, HEIGHT, 18.5, 18.25, 9.3, 7.9, (0.1, -0.02, 0.001, 0.002, 0.003))


class Made:
    """A sequence made of random numbers; the last frame has no depth, nor has the first pixel."""

    id = SequenceId("made", "up", "default")
    camera = CAMERA
    notes = ()
    truths = (TruthKind.birth,)
    surface = None

    def __init__(self, frames: int = FRAMES, *, deep: bool = True) -> None:
        self.world_from_camera = np.broadcast_to(np.eye(4), (frames, 4, 4)).copy()
        self.world_from_camera[:, :3, :3] = Rotation.random(frames, rng=np.random.default_rng(0)).as_matrix()
        self.world_from_camera[:, :3, 3] = np.random.default_rng(1).normal(0.0, 50.0, (frames, 3))
        self._deep = deep

    def __len__(self) -> int:
        return len(self.world_from_camera)

    def image(self, index: int) -> np.ndarray:
        return np.random.default_rng(index).integers(0, 256, (HEIGHT, WIDTH), dtype=np.uint8)

    def depth(self, index: int) -> DepthMap | None:
        depth = np.random.default_rng(index).uniform(1.0, 300.0, (HEIGHT, WIDTH))
        return DepthMap(depth, np.arange(depth.size).reshape(depth.shape) > 0) if self._deep and index < 2 else None


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    write_folder(Made(), tmp_path / "scene")
    return tmp_path / "scene"


def opened(root: Path) -> RecordedSequence:
    reader = Folder(root)
    return reader.open(reader.sequences()[0])


def read_all(root: Path) -> None:
    sequence = opened(root)
    for index in range(len(sequence)):
        sequence.image(index)
        sequence.depth(index)


def expect(root: Path, place: str, message: str) -> None:
    """All of the sequence is read; the error is one line that names the place."""
    with pytest.raises(DataError) as caught:
        read_all(root)
    assert str(caught.value) == f"{root / place if place else root}{message}"


def test_what_is_written_comes_back(scene: Path) -> None:
    made, read = Made(), opened(scene)
    assert read.id == SequenceId("folder", "scene")
    assert (len(read), read.camera, read.truths, read.surface) == (FRAMES, CAMERA, (TruthKind.birth,), None)
    assert read.notes == ("1 of 3 frames has no depth",)
    np.testing.assert_allclose(read.world_from_camera, made.world_from_camera, rtol=0.0, atol=1e-15)
    np.testing.assert_array_equal(read.world_from_camera[:, :3, 3], made.world_from_camera[:, :3, 3])
    for index in range(FRAMES):
        np.testing.assert_array_equal(read.image(index), made.image(index))
    for index in range(2):
        before, after = made.depth(index), read.depth(index)
        np.testing.assert_array_equal(after.valid, before.valid)
        np.testing.assert_allclose(after.depth_m[after.valid], before.depth_m[before.valid], rtol=6e-8)
    assert read.depth(2) is None


def rolling(frames: int = FRAMES) -> RecordedSequence:
    """A recording with timestamps and a rolling shutter."""
    made = Made(frames)
    return RecordedSequence(
        id=made.id,
        source="made",
        camera=CAMERA,
        world_from_camera=made.world_from_camera,
        images=made.image,
        depths=made.depth,
        timestamps_s=0.1 + np.arange(frames) / 3.0,
        shutter=RollingShutter(0.0261),
    )


def test_timestamps_and_readout_come_back(tmp_path: Path) -> None:
    write_folder(rolling(), tmp_path / "scene")
    read = opened(tmp_path / "scene")
    np.testing.assert_array_equal(read.timestamps_s, rolling().timestamps_s)
    assert read.shutter == RollingShutter(0.0261)
    assert json.loads((tmp_path / "scene" / "camera.json").read_text())["readout_s"] == 0.0261


def test_timestamps_beyond_the_last_image_are_left_out(tmp_path: Path) -> None:
    write_folder(rolling(), tmp_path / "scene")
    with (tmp_path / "scene" / "timestamps.txt").open("a") as file:
        file.write("# more\n7.5\n8.5\n")
    assert len(opened(tmp_path / "scene").timestamps_s) == FRAMES


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ("0.1\n0.2\n", "2 timestamps, expected one for each of the 3 poses"),
        ("0.1\n0.2\n0.2\n", "timestamps that do not increase"),
        ("0\n1e-320\n2e-320\n", "timestamps that do not increase"),
        ("0.1\n0.2\ninf\n", "timestamps.txt:3: a timestamp of inf, expected seconds"),
        (
            "1e18\n2e18\n3e18\n",
            "a timestamp of 1e+18, expected seconds, up to 1e+11; it is probably in ns: --option time_unit=ns",
        ),
        ("0.1\n0.2\nnoon\n", "timestamps.txt:3: 'noon', expected a number (timestamp_s)"),
        ("0.1 0.2 0.3\n", "timestamps.txt:1: 3 fields, expected 1 (timestamp_s)"),
        (None, "a rolling shutter without timestamps, expected the time of each frame, seconds"),
    ],
)
def test_wrong_timestamps_are_named(tmp_path: Path, times: str | None, message: str) -> None:
    write_folder(rolling(), tmp_path / "scene")
    file = tmp_path / "scene" / "timestamps.txt"
    if times is None:
        file.unlink()
    else:
        file.write_text(times)
    with pytest.raises(DataError) as caught:
        opened(tmp_path / "scene")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_columns_that_are_exposed_one_after_the_other_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="a shutter that exposes columns, expected one that exposes rows"):
        write_folder(turned(rolling(), 90), tmp_path / "scene")


def test_depth_is_dense_unless_a_radius_is_given(scene: Path) -> None:
    assert opened(scene).depth(0).radius_px is None
    reader = Folder(scene, depth_radius_px=1.5)
    sparse = reader.open(reader.sequences()[0])
    assert sparse.depth(0).radius_px == 1.5
    assert sparse.depth(2) is None
    np.testing.assert_array_equal(sparse.depth(1).depth_m, opened(scene).depth(1).depth_m)
    assert pickle.loads(pickle.dumps(sparse)).depth(0).radius_px == 1.5


@pytest.mark.parametrize("radius", [-0.1, "1", True, float("inf"), float("nan")])
def test_an_impossible_radius(scene: Path, radius: object) -> None:
    with pytest.raises(SettingsError, match=r"reader 'folder': depth_radius_px.* expected a .*number"):
        make_reader("folder", scene, {"depth_radius_px": radius})


def test_a_read_sequence_can_be_pickled(scene: Path) -> None:
    copy = pickle.loads(pickle.dumps(opened(scene)))
    np.testing.assert_array_equal(copy.depth(0).valid, opened(scene).depth(0).valid)


def test_the_files_have_the_documented_names(scene: Path) -> None:
    names = {path.relative_to(scene).as_posix() for path in scene.rglob("*") if path.is_file()}
    images = {f"images/00000{index}.png" for index in range(FRAMES)}
    assert names == images | {"depth/000000.npy", "depth/000001.npy", "poses.txt", "camera.json"}


def test_progress_is_told_after_each_frame(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    write_folder(Made(), tmp_path / "scene", progress=lambda done, total: told.append((done, total)))
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_a_root_may_hold_scenes_at_any_depth(tmp_path: Path) -> None:
    for name in ("b", "a/deep/one", "a/two"):
        write_folder(Made(frames=1), tmp_path / name)
    reader = Folder(tmp_path)
    assert [item.scene for item in reader.sequences()] == ["a/deep/one", "a/two", "b"]
    assert len(reader.open(SequenceId("folder", "a/two"))) == 1
    with pytest.raises(UnknownNameError, match="unknown scene 'c'; known: a/deep/one, a/two, b"):
        reader.open(SequenceId("folder", "c"))


def test_depth_is_optional(tmp_path: Path) -> None:
    write_folder(Made(deep=False), tmp_path / "scene")
    (tmp_path / "scene/depth").rmdir()
    sequence = opened(tmp_path / "scene")
    assert sequence.truths == ("swept", "triangulated")
    assert sequence.depth(0) is None


def test_depth_may_be_integers_of_a_stated_unit(scene: Path) -> None:
    (scene / "depth/000000.npy").unlink()
    (scene / "depth/000001.npy").unlink()
    cv2.imwrite(str(scene / "depth/1.png"), np.pad(np.full((1, 1), 2500, np.uint16), ((0, HEIGHT - 1), (0, WIDTH - 1))))
    change_camera(scene, depth_unit_m=0.0002)
    depth = opened(scene).depth(1)
    assert depth.valid.sum() == 1
    assert depth.depth_m[0, 0] == pytest.approx(0.5)


def test_a_depth_that_no_scene_has_is_unknown(scene: Path) -> None:
    np.save(scene / "depth/000001.npy", np.full((HEIGHT, WIDTH), 1e-320))
    assert not opened(scene).depth(1).valid.any()


@pytest.mark.parametrize("unit", [{"depth_unit_m": 1e-320}, {"depth_unit_m": 1e308}, {"depth_scale": 1e-320}])
def test_a_unit_that_makes_no_depth_of_a_scene_leaves_it_unknown(scene: Path, unit: dict[str, float]) -> None:
    for path in (scene / "depth").iterdir():
        path.unlink()
    cv2.imwrite(str(scene / "depth/1.png"), np.full((HEIGHT, WIDTH), 2500, np.uint16))
    change_camera(scene, **unit)
    assert not opened(scene).depth(1).valid.any()


def test_images_may_be_jpeg_and_poses_have_comments(scene: Path) -> None:
    for index in range(FRAMES):
        (scene / f"images/{index:06d}.png").unlink()
        cv2.imwrite(str(scene / f"images/{index}.jpg"), np.full((HEIGHT, WIDTH), 77, np.uint8))
    (scene / "poses.txt").write_text("# nothing moves\n\n" + "0 0 0 0 0 0 1\n" * FRAMES)
    sequence = opened(scene)
    assert np.all(sequence.image(2) == 77)
    np.testing.assert_array_equal(sequence.world_from_camera[2], np.eye(4))


def change_camera(scene: Path, **entries: object) -> None:
    path = scene / "camera.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **entries}))


def test_a_missing_image_is_named(scene: Path) -> None:
    (scene / "images/000001.png").unlink()
    expect(scene, "images/000001.png", ": missing image, expected images 0 to 2 without a gap")


def test_a_missing_image_is_named_like_the_others(scene: Path) -> None:
    for path in (scene / "images").iterdir():
        path.rename(path.with_name(f"{int(path.stem)}.jpg"))
    (scene / "images/1.jpg").unlink()
    expect(scene, "images/1.jpg", ": missing image, expected images 0 to 2 without a gap")


def test_poses_may_outnumber_images(scene: Path) -> None:
    (scene / "images/000002.png").unlink()
    sequence = opened(scene)
    assert len(sequence) == len(sequence.world_from_camera) == 2
    assert sequence.notes == (f"{scene / 'poses.txt'}: 3 poses for 2 images: only the first 2 are used",)


def test_frames_without_a_pose_are_kept_and_written_again(scene: Path, tmp_path: Path) -> None:
    (scene / "poses.txt").write_text(f"{STILL}\n{' '.join(['nan'] * 7)}\n1 {STILL[2:]}\n")
    sequence = opened(scene)
    assert has_pose(sequence.world_from_camera).tolist() == [True, False, True]
    assert np.isnan(sequence.world_from_camera[1]).all()
    write_folder(sequence, tmp_path / "again")
    again = opened(tmp_path / "again")
    np.testing.assert_array_equal(again.world_from_camera, sequence.world_from_camera)


def test_a_single_pose_is_too_few(scene: Path) -> None:
    (scene / "poses.txt").write_text(f"{' '.join(['nan'] * 7)}\n{STILL}\n{' '.join(['nan'] * 7)}\n")
    with pytest.raises(DataError, match="1 pose for 3 frames, expected poses for at least 2"):
        read_all(scene)


def test_a_truncated_image_is_named(scene: Path) -> None:
    path = scene / "images/000001.png"
    path.write_bytes(path.read_bytes()[:200])
    expect(
        scene, "images/000001.png", ": truncated or damaged image of 200 bytes, expected a whole PNG, JPEG or BMP image"
    )


def test_an_image_of_another_size_is_named(scene: Path) -> None:
    cv2.imwrite(str(scene / "images/000001.png"), np.zeros((HEIGHT, WIDTH + 1), np.uint8))
    expect(scene, "images/000001.png", ": size 21x16, expected the camera's 20x16")


def test_depth_of_another_size_is_named(scene: Path) -> None:
    np.save(scene / "depth/000001.npy", np.ones((HEIGHT, WIDTH // 2), np.float32))
    expect(scene, "depth/000001.npy", ": size 10x16, expected the camera's 20x16")


def test_truncated_depth_is_named(scene: Path) -> None:
    path = scene / "depth/000001.npy"
    path.write_bytes(path.read_bytes()[:-8])
    expect(scene, "depth/000001.npy", ": damaged or truncated file, expected a NumPy array of float32 depth")


def test_depth_of_two_kinds_is_refused(scene: Path) -> None:
    cv2.imwrite(str(scene / "depth/000002.png"), np.ones((HEIGHT, WIDTH), np.uint16))
    expect(scene, "depth", ": both .npy and .png files, expected files of one kind")


def test_integer_depth_needs_its_unit(scene: Path) -> None:
    for index in range(2):
        (scene / f"depth/00000{index}.npy").unlink()
    cv2.imwrite(str(scene / "depth/000000.png"), np.ones((HEIGHT, WIDTH), np.uint16))
    expect(scene, "camera.json", ": no depth_unit_m, expected it, since the depths are 16-bit PNG files")


STILL = "0 0 0 0 0 0 1"


@pytest.mark.parametrize(
    ("rows", "place", "message"),
    [
        ([STILL] * 2, "poses.txt", ": 2 poses, expected at least 3, one for each image"),
        ([], "poses.txt", ": 0 poses, expected at least 3, one for each image"),
        ([STILL, "0 nan 0 0 0 0 1", STILL], "poses.txt", ":2: NaN or infinity in the pose, expected finite numbers"),
        ([STILL, "0 0 0 0 0 1 1", STILL], "poses.txt", ":2: a quaternion of norm 1.41421, expected norm 1"),
        (["0 0 0 0 0 1"], "poses.txt", ":1: 6 fields, expected 7 (tx ty tz qx qy qz qw)"),
        (["0 0 0 0 0 0 one"], "poses.txt", ":1: 'one', expected a number (tx ty tz qx qy qz qw)"),
    ],
)
def test_bad_poses_are_named(scene: Path, rows: list[str], place: str, message: str) -> None:
    (scene / "poses.txt").write_text("\n".join(rows) + "\n")
    expect(scene, place, message)


NO_INVERSE = (
    "fx, fy, cx, cy and distortion that cannot be inverted over the whole image, "
    "expected a ray of its own for every pixel"
)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"width": 20.0}, "width = 20.0, expected a whole number above 0"),
        ({"width": True}, "width = true, expected a whole number above 0"),
        ({"height": 0}, "height = 0, expected a whole number above 0"),
        ({"fx": "18"}, 'fx = "18", expected a finite number above 0'),
        ({"fy": -18.0}, "fy = -18.0, expected a finite number above 0"),
        ({"cx": None}, "cx = null, expected a finite number"),
        ({"cy": float("nan")}, "cy = NaN, expected a finite number"),
        (
            {"distortion": [0.1, 0.2]},
            "distortion = [0.1, 0.2], expected a list of 0, 4, 5 or 8 numbers (k1, k2, p1, p2, k3, k4, k5, k6)",
        ),
        ({"distortion": [0.1, 0, 0, 0, "x"]}, 'distortion = "x", expected a finite number'),
        ({"depth_unit_m": 0}, "depth_unit_m = 0, expected a finite number above 0"),
        ({"height": -5}, "height = -5, expected a whole number above 0"),
        ({"width": 10**400}, f"width = 1{'0' * 59}..., expected a whole number above 0"),
        ({"fx": 10**400}, f"fx = 1{'0' * 59}..., expected a finite number above 0"),
        ({"fx": float("inf")}, "fx = Infinity, expected a finite number above 0"),
        ({"cx": False}, "cx = false, expected a finite number"),
        (
            {"distortion": True},
            "distortion = true, expected a list of 0, 4, 5 or 8 numbers (k1, k2, p1, p2, k3, k4, k5, k6)",
        ),
        ({"distortion": [0, 0, 0, 0, [[]]]}, "distortion = [[]], expected a finite number"),
        ({"distortion": [-5, 0, 0, 0, 0]}, NO_INVERSE),
        ({"distortion": [1e308] * 5}, NO_INVERSE),
        ({"cx": 1e300, "distortion": []}, NO_INVERSE),
        ({"fx": 1e100}, "fx = 1e+100, expected a focal length from 0.001 to 1e+06 px"),
        (
            {"model": "equidistant", "distortion": [0.0] * 4, "fy": 1e-300},
            "fy = 1e-300, expected a focal length from 0.001 to 1e+06 px",
        ),
        ({"readout_s": 26.1}, "readout_s = 26.1, expected seconds between -1 and 1"),
        ({"readout_s": "fast"}, 'readout_s = "fast", expected a finite number'),
        (
            {"depth_unit_m": 0.001, "depth_scale": 5000},
            "depth_unit_m 0.001 and depth_scale 5000, whose product is not 1, expected one of them",
        ),
    ],
)
def test_bad_cameras_are_named(scene: Path, entries: dict[str, object], message: str) -> None:
    change_camera(scene, **entries)
    expect(scene, "camera.json", f": {message}")


def test_missing_and_unknown_keys_are_named_with_those_that_are_expected(scene: Path) -> None:
    whole = json.loads((scene / "camera.json").read_text())
    for entries, found in (({"width": 20}, "no height"), ({**whole, "distorsion": []}, "unknown key 'distorsion'")):
        (scene / "camera.json").write_text(json.dumps(entries))
        with pytest.raises(DataError, match=f"{found}, expected width, height, fx, fy, cx, cy and, if need be, model"):
            read_all(scene)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"width": 20,\n', ":2: no JSON (Expecting property name enclosed in double quotes), expected a JSON object"),
        ('{"width": 1' + "0" * 5000 + "}", ": unreadable file, expected a JSON object"),
        ("[" * 200_000, ": unreadable file, expected a JSON object"),
        ("[20, 16]", ": JSON, but no object, expected a JSON object"),
        ('{"fx": 20, "cx": NaN, "fx": 21}', ": fx twice, with different values, expected each key once"),
    ],
)
def test_a_malformed_camera_file_is_named(scene: Path, text: str, message: str) -> None:
    (scene / "camera.json").write_text(text)
    expect(scene, "camera.json", message)


@pytest.mark.parametrize("depth", [100, 500, 900, 2000, 20_000])
def test_lists_in_lists_are_refused_however_deep(scene: Path, depth: int) -> None:
    path = scene / "camera.json"
    path.write_text(path.read_text().replace('"width": 20', f'"width": {"[" * depth}{"]" * depth}'))
    with pytest.raises(
        DataError, match=r"camera\.json: (width = .+, expected a whole|unreadable file, expected a JSON)"
    ):
        read_all(scene)


def test_what_is_stated_twice_and_is_the_same_is_read(scene: Path) -> None:
    change_camera(scene, depth_unit_m=0.0002, depth_scale=5000)
    path = scene / "camera.json"
    path.write_text(path.read_text().replace("{", '{"depth_scale": 5e3, ', 1))
    assert opened(scene).camera == CAMERA


def to_nothing(path: Path) -> None:
    path.symlink_to(path.with_name("nothing"))


@pytest.mark.parametrize(
    ("name", "make", "message"),
    [
        ("timestamps.txt", os.mkdir, "unreadable (Is a directory), expected text of rows of timestamp_s"),
        ("timestamps.txt", os.mkfifo, "unreadable (not a regular file), expected text of rows of timestamp_s"),
        ("timestamps.txt", to_nothing, "no such file, expected rows of timestamp_s"),
        ("depth", to_nothing, "no such directory, expected a data set's folder"),
    ],
)
def test_a_part_that_cannot_be_read_is_not_taken_for_a_missing_one(
    scene: Path, name: str, make: Callable[[Path], None], message: str
) -> None:
    shutil.rmtree(scene / name, ignore_errors=True)
    make(scene / name)
    expect(scene, name, f": {message}")


def test_files_may_begin_with_a_byte_order_mark(scene: Path) -> None:
    before = opened(scene)
    for name in ("camera.json", "poses.txt"):
        (scene / name).write_bytes(b"\xef\xbb\xbf" + (scene / name).read_bytes())
    assert opened(scene).camera == before.camera
    np.testing.assert_array_equal(opened(scene).world_from_camera, before.world_from_camera)


def test_a_missing_camera_file_is_named(scene: Path) -> None:
    (scene / "camera.json").unlink()
    expect(scene, "camera.json", ": no such file, expected the camera's width, height, fx, fy, cx and cy in JSON")


def test_a_sequence_without_frames_is_refused(scene: Path) -> None:
    for path in (scene / "images").iterdir():
        path.unlink()
    (scene / "poses.txt").write_text("# none\n")
    expect(scene, "images", ": no images, expected files such as 000000.png")


def test_a_folder_without_a_scene_is_refused(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    expect(tmp_path, "", ": no scene, expected folders with images/, poses.txt and camera.json")


MISSING_POSES = ": no such file, expected rows of tx ty tz qx qy qz qw"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("poses.txt", MISSING_POSES),
        ("camera.json", ": no such file, expected the camera's width, height, fx, fy, cx and cy in JSON"),
        ("images", ": no such directory, expected a data set's folder"),
    ],
)
def test_an_incomplete_scene_is_not_passed_over(tmp_path: Path, name: str, message: str) -> None:
    for scene in ("a", "b"):
        write_folder(Made(), tmp_path / scene)
    (tmp_path / "a" / name).rename(tmp_path / "elsewhere")
    assert [item.scene for item in Folder(tmp_path).sequences()] == ["a", "b"]
    expect(tmp_path, f"a/{name}", message)


@pytest.mark.parametrize("left", ["camera.json", "depth"])
def test_images_and_one_more_part_are_a_scene(scene: Path, left: str) -> None:
    for name in {"camera.json", "depth"} - {left}:
        (scene / name).rename(scene.parent / f"{name} elsewhere")
    (scene / "poses.txt").unlink()
    assert [item.scene for item in Folder(scene).sequences()] == ["scene"]
    if left == "camera.json":
        expect(scene, "poses.txt", MISSING_POSES)


def test_a_folder_in_place_of_a_file_is_named(scene: Path) -> None:
    (scene / "poses.txt").unlink()
    (scene / "poses.txt").mkdir()
    expect(scene, "poses.txt", ": unreadable (Is a directory), expected text of rows of tx ty tz qx qy qz qw")


@pytest.mark.parametrize(
    ("name", "kind"), [("images/1.png", "images"), ("images/1.jpg", "images"), ("depth/1.npy", "depth")]
)
def test_two_files_of_one_frame_are_refused(scene: Path, name: str, kind: str) -> None:
    first = next((scene / kind).glob("000001.*"))
    first.with_name(Path(name).name).write_bytes(first.read_bytes())
    with pytest.raises(DataError) as caught:
        read_all(scene)
    assert str(caught.value) == f"{scene / name}: the number of {first.name} again, expected one file for each frame"


def test_depth_without_an_image_is_named(scene: Path) -> None:
    np.save(scene / "depth/000003.npy", np.ones((HEIGHT, WIDTH), np.float32))
    expect(scene, "images/000003.png", ": missing image, expected images 0 to 3 without a gap")


def test_nothing_is_overwritten(scene: Path) -> None:
    with pytest.raises(DataError, match="already exists, expected a new or empty folder"):
        write_folder(Made(), scene)
    with pytest.raises(DataError, match="already exists, expected a new or empty folder"):
        write_folder(Made(), scene / "poses.txt")


def test_an_empty_folder_may_be_filled(tmp_path: Path) -> None:
    (tmp_path / "scene").mkdir()
    write_folder(Made(), tmp_path / "scene")
    assert len(opened(tmp_path / "scene")) == FRAMES


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match=r"file/scene: cannot be written \(.+\), expected a folder that can be written"):
        write_folder(Made(), tmp_path / "file/scene")


def test_an_interrupted_write_leaves_nothing(tmp_path: Path) -> None:
    def interrupt(done: int, _: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    stop: Callable[[int, int], None] = interrupt
    with pytest.raises(KeyboardInterrupt):
        write_folder(Made(), tmp_path / "scene", progress=stop)
    assert list(tmp_path.iterdir()) == []


OWN = "xi and alpha for double_sphere, xi for omni, alpha and beta for eucm, omega for fov"
EQUIDISTANT = EquidistantCamera(WIDTH, HEIGHT, 8.5, 8.25, 9.3, 7.9, (0.01, -0.02, 0.001, 0.002))
SPHERES = DoubleSphereCamera(WIDTH, HEIGHT, 8.5, 8.25, 9.3, 7.9, -0.2, 0.6)


@pytest.mark.parametrize("camera", [EQUIDISTANT, SPHERES])
def test_other_lenses_come_back_too(tmp_path: Path, camera: CameraModel) -> None:
    made = Made()
    made.camera = camera
    write_folder(made, tmp_path / "scene")
    assert opened(tmp_path / "scene").camera == camera


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (
            {"model": "mirror"},
            'model = "mirror", expected one of pinhole, radtan, equidistant, double_sphere, omni, eucm, fov',
        ),
        ({"model": 5}, "model = 5, expected a text"),
        ({"xi": 0.1}, f"xi for the model radtan, expected {OWN}"),
        ({"model": "double_sphere", "distortion": []}, f"no xi, expected {OWN}"),
        ({"model": "omni", "xi": 0.5, "alpha": 0.5}, f"alpha for the model omni, expected {OWN}"),
        (
            {"model": "omni", "xi": 0.5, "distortion": [0.1]},
            "distortion = [0.1], expected a list of 0 or 4 numbers (k1, k2, p1, p2)",
        ),
        ({"model": "fov", "omega": 0.9, "distortion": [0.1]}, "distortion = [0.1], expected a list of no numbers"),
        (
            {"model": "equidistant", "distortion": [0.1]},
            "distortion = [0.1], expected a list of 4 numbers (k1, k2, k3, k4)",
        ),
        (
            {"model": "double_sphere", "xi": 7, "alpha": 0.5, "distortion": []},
            "an impossible camera (xi must be above -1 and at most 1, not 7.0), expected a double_sphere camera",
        ),
    ],
)
def test_bad_lenses_are_named(scene: Path, entries: dict[str, object], message: str) -> None:
    change_camera(scene, **entries)
    with pytest.raises(DataError) as caught:
        read_all(scene)
    assert str(caught.value).startswith(f"{scene / 'camera.json'}: {message}")  # further lenses are listed behind it


KALIBR = f"""\
cam0:
  camera_model: pinhole
  distortion_coeffs: [0.01, -0.02, 0.001, 0.002]
  distortion_model: equidistant
  intrinsics: [8.5, 8.25, 9.3, 7.9]
  resolution: [{WIDTH}, {HEIGHT}]
cam1:
  camera_model: ds
  intrinsics: [-0.2, 0.6, 8.5, 8.25, 9.3, 7.9]
  resolution: [{WIDTH}, {HEIGHT}]
"""


def test_a_camera_file_replaces_those_of_the_scenes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_folder(Made(), tmp_path / name)
        (tmp_path / name / "camera.json").unlink()
    path = tmp_path / "camchain.yaml"
    path.write_text(KALIBR)
    reader = Folder(tmp_path, camera_file=path)
    assert [reader.open(item).camera for item in reader.sequences()] == [EQUIDISTANT] * 2
    reader = Folder(tmp_path, camera_file=path, camera="cam1")
    sequence = reader.open(reader.sequences()[0])
    assert sequence.camera == SPHERES
    assert sequence.depth(0) is not None
    with pytest.raises(UnknownNameError, match="unknown camera 'cam7'"):
        Folder(tmp_path, camera_file=path, camera="cam7").open(reader.sequences()[0])


def test_the_images_say_their_size_where_the_camera_file_does_not(scene: Path) -> None:
    path = scene.parent / "camera.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("camera_matrix", CAMERA.matrix)
    storage.write("distortion_coefficients", np.array([CAMERA.distortion]))
    storage.release()
    reader = Folder(scene, camera_file=path)
    assert reader.open(reader.sequences()[0]).camera == CAMERA


def test_the_lens_of_a_file_of_opencv_with_four_coefficients_is_an_option(scene: Path) -> None:
    path, four = scene.parent / "camera.yml", CAMERA.distortion[:4]
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("camera_matrix", CAMERA.matrix)
    storage.write("D", np.array(four)[:, None])
    storage.release()
    reader = Folder(scene, camera_file=path, lens=Lens.radtan)
    assert reader.open(reader.sequences()[0]).camera == replace(CAMERA, distortion=four)
    with pytest.raises(DataError, match=r"4 numbers, .* --option lens=radtan"):
        Folder(scene, camera_file=path).open(reader.sequences()[0])


def test_a_camera_file_of_another_size_is_named(scene: Path) -> None:
    path = scene.parent / "camchain.yaml"
    path.write_text(
        KALIBR.replace(f"[{WIDTH}, {HEIGHT}]", "[640, 480]").replace("8.5, 8.25, 9.3, 7.9", "400, 400, 320, 240")
    )
    reader = Folder(scene, camera_file=path)
    with pytest.raises(DataError, match="size 20x16, expected the camera's 640x480"):
        reader.open(reader.sequences()[0]).image(0)


def test_the_unit_of_depth_may_be_an_option(scene: Path) -> None:
    for index in range(2):
        (scene / f"depth/00000{index}.npy").unlink()
    cv2.imwrite(str(scene / "depth/000000.png"), np.full((HEIGHT, WIDTH), 5000, np.uint16))
    reader = Folder(scene, depth_unit_m=0.0002)
    assert reader.open(reader.sequences()[0]).depth(0).depth_m[3, 3] == pytest.approx(1.0)


def test_16_bit_images_need_their_levels(scene: Path) -> None:
    values = np.arange(WIDTH * HEIGHT, dtype=np.uint16).reshape(HEIGHT, WIDTH) * 10 + 500
    for index in range(FRAMES):
        cv2.imwrite(str(scene / f"images/{index:06d}.png"), values)
    expect(
        scene,
        "images/000000.png",
        ": a 16-bit image of 1 channel, expected 8 bits, or image_levels = [low, high] of folder or euroc",
    )
    reader = make_reader("folder", scene, {"image_levels": [500, 3690]})
    sequence = reader.open(reader.sequences()[0])
    assert sequence.notes[0] == "16-bit images are scaled: 500 becomes 0 and 3690 becomes 255"
    image = sequence.image(1)
    assert (image[0, 0], image[-1, -1]) == (0, 255)
    np.testing.assert_array_equal(image, np.rint((values - 500.0) * 255.0 / 3190.0))


@pytest.mark.parametrize("levels", [[5, 5], [7, 5], [-1, 5], [0, 65536], [0], [0.0, float("nan")], "all"])
def test_impossible_levels(scene: Path, levels: object) -> None:
    with pytest.raises(SettingsError, match="reader 'folder': image_levels"):
        make_reader("folder", scene, {"image_levels": levels})


@pytest.mark.parametrize(
    ("place", "shown"),
    [
        ("rgb/{0:06d}.png", "rgb/000000.png"),
        ("images/frame_{0:d}.png", "images/frame_0.png"),
        ("images/cam0/{0:d}.png", "images/cam0/0.png"),
        ("{0:d}.png", "0.png"),
    ],
)
def test_images_of_another_name_are_found(scene: Path, place: str, shown: str) -> None:
    for index, path in enumerate(sorted((scene / "images").iterdir())):
        moved = scene / place.format(index)
        moved.parent.mkdir(exist_ok=True)
        path.rename(moved)
    with pytest.raises(DataError, match=f"no images/000000.png, but {FRAMES} image files such as {re.escape(shown)}"):
        opened(scene)


def test_all_renames_that_are_needed_are_said_at_once(scene: Path) -> None:
    (scene / "images").rename(scene / "rgb")
    (scene / "camera.json").rename(scene / "intrinsics.json")
    with pytest.raises(DataError) as caught:
        opened(scene)
    assert str(caught.value) == (
        f"{scene}: no images/000000.png, no camera.json, but 3 image files such as rgb/000000.png, "
        "beside intrinsics.json, rgb, expected images/000000.png and so on, poses.txt and camera.json: rename them"
    )
