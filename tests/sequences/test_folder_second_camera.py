"""A second camera of the plain layout: images, calibration and pose are those that were written."""

import json
import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.experiments.template import experiment_template
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.folder import write_folder
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.sequence import ImageReader, Sequence
from tracknoise.truth_faults.rig_check import second_camera

FRAMES, START_NS, STEP_NS = 6, 1_700_000_000_123_456_789, 50_000_000
SECOND = Camera(64, 48, 60.0, 61.0, 30.0, 24.0)
# the second camera is 0.11 m on the right of the first: points of the first have x smaller by 0.11 in it
SECOND_FROM_FIRST = [[1.0, 0, 0, -0.11], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]
ASIDE = np.linalg.inv(SECOND_FROM_FIRST)


def picture(number: int) -> np.ndarray:
    return np.random.default_rng(100 + number).integers(0, 256, (48, 64), dtype=np.uint8)


def write_seconds(folder: Path, names: list[str], *, first: int = 0) -> None:
    folder.mkdir(parents=True)
    for number, name in enumerate(names, start=first):
        cv2.imwrite(str(folder / name), picture(number))


def chain(*, related: bool = True) -> str:
    def part(camera: Camera) -> dict[str, object]:
        return {
            "camera_model": "pinhole",
            "distortion_model": "none",
            "distortion_coeffs": [],
            "intrinsics": [camera.fx, camera.fy, camera.cx, camera.cy],
            "resolution": [64, 48],
        }

    beside = {**part(SECOND), **({"T_cn_cnm1": SECOND_FROM_FIRST} if related else {})}
    return yaml.safe_dump({"cam0": part(Camera(64, 48, 50.0, 50.0, 31.5, 23.5)), "cam1": beside})


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    options = {"motions": ["arvr"], "frames": FRAMES, "width": 64, "height": 48, "supersampling": 1}
    write_folder(open_sequence("simulated", imaging={"rate_hz": 20.0}, **options), tmp_path / "scene")
    (tmp_path / "chain.yaml").write_text(chain())
    return tmp_path / "scene"


def opened(scene: Path, **options: object) -> Sequence:
    return open_sequence("folder", scene, **{"camera_file": scene.parent / "chain.yaml", **options})


def numbers_of(sequence: Sequence) -> list[int | None]:
    """Which picture the second camera has in each frame."""
    images = [sequence.second.images(index) for index in range(len(sequence))]
    known = {picture(number).tobytes(): number for number in range(FRAMES)}
    return [None if image is None else known[image.tobytes()] for image in images]


def test_a_chain_and_a_second_folder_of_images_are_enough(scene: Path) -> None:
    assert opened(scene).second is None
    write_seconds(scene / "images_second", [f"{number:06d}.png" for number in range(FRAMES)])
    read = opened(scene)
    assert read.second.camera == SECOND
    np.testing.assert_allclose(read.second.first_from_second, ASIDE, atol=1e-15)
    assert numbers_of(read) == [*range(FRAMES)]
    copy = pickle.loads(pickle.dumps(read))
    np.testing.assert_array_equal(copy.second.images(2), picture(2))


def test_the_first_may_be_the_right_one(scene: Path) -> None:
    write_seconds(scene / "right", [f"{number}.png" for number in range(FRAMES)])
    read = opened(scene, camera="cam1", second_images="right")
    assert (read.camera, read.second.camera.fx) == (SECOND, 50.0)
    np.testing.assert_allclose(read.second.first_from_second, SECOND_FROM_FIRST, atol=1e-15)


def test_frames_without_an_image_of_its_name_have_none(scene: Path) -> None:
    write_seconds(scene / "images_second", [f"{number:04d}.png" for number in (1, 2, 4)])
    read = opened(scene)
    assert numbers_of(read) == [None, 0, 1, None, 2, None]
    assert "3 of 6 frames have no image of the second camera, and no depth from it" in read.notes


def test_images_are_matched_by_a_file_of_times(scene: Path) -> None:
    times_s = np.loadtxt(scene / "timestamps.txt")
    write_seconds(scene / "images_second", [f"{number}.png" for number in range(3)])
    np.savetxt(scene / "images_second/timestamps.txt", times_s[[1, 3, 5]])
    assert numbers_of(opened(scene)) == [None, 0, None, 1, None, 2]
    (scene / "images_second/timestamps.txt").write_text("0.05\n0.1\n")
    with pytest.raises(DataError, match=r"timestamps.txt: 2 times for 3 images of the second camera, expected"):
        opened(scene)
    (scene / "images_second/timestamps.txt").write_text("0.01\n0.06\n0.11\n")
    with pytest.raises(DataError, match=r"images_second: no image of any of 6 frames, such as 0.png, expected names"):
        opened(scene)


def test_images_are_matched_by_times_in_their_names(scene: Path) -> None:
    """The images of the first camera are numbered, and their times are in a file."""
    write_seconds(scene / "images_second", [f"{START_NS + number * STEP_NS}.png" for number in (0, 2, 3)])
    (scene / "timestamps.txt").write_text("".join(f"{(START_NS + n * STEP_NS) / 1e9:.9f}\n" for n in range(FRAMES)))
    assert numbers_of(opened(scene)) == [0, None, 1, 2, None, None]


def test_images_without_poses_have_a_second_camera_too(tmp_path: Path) -> None:
    """As of a recording of two folders, with times in names to the nanosecond and in seconds."""
    (tmp_path / "chain.yaml").write_text(chain())
    write_seconds(tmp_path / "run/cam0", [f"{START_NS + number * STEP_NS}.png" for number in range(FRAMES)])
    stamps = [divmod(START_NS + number * STEP_NS, 10**9) for number in (1, 2)]
    write_seconds(tmp_path / "right", [f"{seconds}.{ns:09d}.png" for seconds, ns in stamps], first=1)
    reader = make_reader(
        "folder", tmp_path / "run/cam0", {"camera_file": tmp_path / "chain.yaml", "second_images": "../../right"}
    )
    assert isinstance(reader, ImageReader)
    assert numbers_of(reader.open_images(reader.recordings()[0])) == [None, 1, 2, None, None, None]


def test_camera_json_holds_both(scene: Path) -> None:
    write_seconds(scene / "images_second", [f"{number:06d}.png" for number in range(FRAMES)])
    path = scene / "camera.json"
    beside = {"width": 64, "height": 48, "fx": 60.0, "fy": 61.0, "cx": 30.0, "cy": 24.0}
    both = {**json.loads(path.read_text()), "second": {**beside, "first_from_second": ASIDE.tolist()}}
    path.write_text(json.dumps(both))
    read = open_sequence("folder", scene)
    assert read.second.camera == SECOND
    np.testing.assert_allclose(read.second.first_from_second, ASIDE, atol=1e-15)


def test_the_pose_may_be_an_option(scene: Path) -> None:
    write_seconds(scene / "images_second", [f"{number:06d}.png" for number in range(FRAMES)])
    read = open_sequence(
        "folder",
        scene,
        second_camera_file=scene.parent / "chain.yaml",
        second_camera="cam1",
        first_from_second=ASIDE.ravel().tolist(),
    )
    assert read.second.camera == SECOND
    np.testing.assert_allclose(read.second.first_from_second, ASIDE, atol=1e-15)


def test_the_experiment_file_shows_how_to_use_it(scene: Path) -> None:
    write_seconds(scene / "images_second", [f"{number:06d}.png" for number in range(FRAMES)])
    options = {"camera_file": str(scene.parent / "chain.yaml")}
    assert '# kind = "second-view"' in experiment_template(make_reader("folder", scene, options), scene, options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"second_images": "cam1"}, "cam1: no such folder, expected the images of the second camera"),
        ({"second_camera": "cam1"}, "images_second: no such folder, expected the images of the second camera"),
        ({"second_images": "depth"}, "depth: no images, expected PNG, JPEG or BMP files of the second camera"),
        (
            {"second_images": "images", "camera_file": None},
            "camera.json: one camera, expected two cameras, or --option",
        ),
        (
            {"second_images": "images", "camera_file": "apart.yaml"},
            "apart.yaml: no pose of the second camera in the fi",
        ),
        ({"second_images": "images", "second_camera": "cam0"}, "cam0 as both cameras, expected another one of cam0"),
    ],
)
def test_what_is_missing_is_named(scene: Path, options: dict[str, str], message: str) -> None:
    (scene.parent / "apart.yaml").write_text(chain(related=False))
    if options.get("camera_file"):
        options = {**options, "camera_file": str(scene.parent / options["camera_file"])}
    with pytest.raises(DataError, match=message) as caught:
        opened(scene, **options)
    assert "\n" not in str(caught.value)


def test_a_pose_of_other_than_16_numbers_is_named(scene: Path) -> None:
    with pytest.raises(SettingsError, match=r"first_from_second is .*, expected 16 numbers"):
        opened(scene, first_from_second=[1.0])


def test_images_of_another_size_are_named(scene: Path) -> None:
    write_seconds(scene / "images_second", [f"{number:06d}.png" for number in range(FRAMES)])
    cv2.imwrite(str(scene / "images_second/000002.png"), np.zeros((24, 32), np.uint8))
    with pytest.raises(DataError, match=r"images_second/000002.png: size 32x24, expected the camera's 64x48"):
        opened(scene).second.images(2)
    for path in (scene / "images_second").iterdir():
        cv2.imwrite(str(path), np.zeros((24, 32), np.uint8))
    item = second_camera(opened(scene))
    assert "size 32x24, expected the camera's 64x48" in item.text
