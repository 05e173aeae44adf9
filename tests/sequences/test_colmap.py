"""Reconstructions of COLMAP, written from a simulated sequence by an independent writer."""

import re
import struct
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.writers.colmap import write_binary, write_depth_map, write_text
from tests.writers.exif import save_turned

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.experiments.load import load_experiment, option_paths
from tracknoise.experiments.template import experiment_template
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.reader_registry import make_reader, open_sequence

BOTH = pytest.mark.parametrize("write", [write_text, write_binary], ids=["text", "binary"])
SIZE = (64, 48)


@pytest.fixture(scope="module")
def simulated():
    return open_sequence("simulated", motions=["arvr"], frames=4, width=64, height=48, supersampling=1)


def pinhole(camera, *, shift=0.5):
    return ("PINHOLE", camera.width, camera.height, [camera.fx, camera.fy, camera.cx + shift, camera.cy + shift])


def save(folder, sequence, names):
    for index, name in enumerate(names):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        assert cv2.imwrite(str(folder / name), sequence.image(index))


def posed(sequence, names, camera=1):
    return {name: (camera, sequence.world_from_camera[index]) for index, name in enumerate(names)}


@BOTH
def test_what_was_simulated_is_read(tmp_path, simulated, write):
    names = ["im 1.png", "im 2.png", "im 10.png", "im 11.png"]  # not in the order of their letters
    save(tmp_path / "scene/images", simulated, names)
    write(tmp_path / "scene/sparse/0", {1: pinhole(simulated.camera)}, posed(simulated, names))
    for index, name in enumerate(names[:3]):
        depth = simulated.depth(index)
        plain = np.where(depth.valid, depth.depth_m, -1.0)
        write_depth_map(tmp_path / f"scene/stereo/depth_maps/{name}.geometric.bin", plain)
    found = open_sequence("colmap", tmp_path)
    assert found.id.scene == "scene/sparse/0"
    assert found.camera == simulated.camera
    np.testing.assert_allclose(found.world_from_camera, simulated.world_from_camera, atol=1e-9)
    for index in range(4):
        np.testing.assert_array_equal(found.image(index), simulated.image(index))
    np.testing.assert_array_equal(found.depth(1).valid, simulated.depth(1).valid)
    np.testing.assert_allclose(found.depth(1).depth_m, simulated.depth(1).depth_m, rtol=1e-7)
    assert found.depth(3) is None
    assert "1 of 4 frames has no depth" in found.notes
    assert any("scale" in note for note in found.notes)
    assert "birth" not in open_sequence("colmap", tmp_path, depth_maps="none").truths
    assert "birth" not in open_sequence("colmap", tmp_path, depth_maps="photometric").truths


@BOTH
def test_images_that_are_not_registered_are_frames_without_a_pose(tmp_path, simulated, write):
    names = [f"{index}.png" for index in range(4)]
    save(tmp_path / "images", simulated, names)
    images = posed(simulated, names)
    del images["0.png"], images["2.png"]
    write(tmp_path / "sparse", {1: pinhole(simulated.camera)}, images)
    found = open_sequence("colmap", tmp_path)
    np.testing.assert_array_equal(has_pose(found.world_from_camera), [False, True, False, True])
    assert any("2 of 4 frames have no pose" in note for note in found.notes)


@BOTH
def test_one_of_several_folders_of_images(tmp_path, simulated, write):
    left, right = ([f"{side}/{index}.png" for index in range(4)] for side in ("left", "right"))
    save(tmp_path / "images", simulated, [*left])
    save(tmp_path / "images", simulated, [*right])
    cameras = {3: pinhole(simulated.camera), 5: pinhole(simulated.camera, shift=2.5)}
    write(tmp_path / "sparse", cameras, {**posed(simulated, left, 3), **posed(simulated, right, 5)})
    with pytest.raises(
        DataError, match="images of several folders: left, right, expected one; choose it with --option folder=left"
    ):
        open_sequence("colmap", tmp_path)
    assert open_sequence("colmap", tmp_path, folder="left").camera == simulated.camera
    assert open_sequence("colmap", tmp_path, folder="right").camera.cx == simulated.camera.cx + 2
    with pytest.raises(UnknownNameError, match="known: left, right"):
        open_sequence("colmap", tmp_path, folder="centre")


@BOTH
def test_each_image_may_have_its_own_camera(tmp_path, simulated, write):
    names = [f"{index}.png" for index in range(4)]
    save(tmp_path / "images", simulated, names)
    images = posed(simulated, names)
    images["2.png"] = (2, images["2.png"][1])
    write(tmp_path / "sparse", {1: pinhole(simulated.camera), 2: pinhole(simulated.camera, shift=3.5)}, images)
    found = open_sequence("colmap", tmp_path)
    assert [found.camera_at(index).cx - simulated.camera.cx for index in range(4)] == [0, 0, 3, 0]
    write(tmp_path / "sparse", {1: pinhole(simulated.camera), 2: ("PINHOLE", 32, 24, [9.0, 9.0, 9.0, 9.0])}, images)
    with pytest.raises(
        DataError, match=r"images of several sizes: 64x48 \(0.png\), 32x24 \(2.png\), expected one size"
    ):
        open_sequence("colmap", tmp_path)


def projected(model, p, x, y):
    """COLMAP's own formulas: pixels with (0, 0) at the corner, from normalised coordinates."""
    single = "SIMPLE" in model or model in ("RADIAL", "RADIAL_FISHEYE")
    fx, fy, cx, cy, *k = [p[0], *p] if single else p
    r2 = x * x + y * y
    if model.endswith("FISHEYE"):
        theta = np.arctan(np.sqrt(r2))
        k = [*k, 0.0, 0.0, 0.0, 0.0][:4]
        scale = theta * (1 + sum(k[i] * theta ** (2 * i + 2) for i in range(4))) / np.sqrt(r2)
        x, y = x * scale, y * scale
    elif model == "EUCM":
        scale = 1 / (k[0] * np.sqrt(k[1] * r2 + 1) + 1 - k[0])
        x, y = x * scale, y * scale
    elif model == "FOV":
        scale = np.arctan(2.0 * np.sqrt(r2) * np.tan(k[0] / 2.0)) / k[0] / np.sqrt(r2)
        x, y = x * scale, y * scale
    elif "RADIAL" in model:
        scale = 1 + sum(value * r2 ** (i + 1) for i, value in enumerate(k))
        x, y = x * scale, y * scale
    elif "OPENCV" in model:
        k1, k2, p1, p2, *higher = k
        k3, k4, k5, k6 = higher or [0.0] * 4
        scale = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        dx, dy = 2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        x, y = x * scale + dx, y * scale + dy
    return np.array([fx * x + cx, fy * y + cy])


@BOTH
@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        ("SIMPLE_PINHOLE", [50.0, 31.0, 25.0]),
        ("PINHOLE", [50.0, 52.0, 31.0, 25.0]),
        ("SIMPLE_RADIAL", [50.0, 31.0, 25.0, -0.05]),
        ("RADIAL", [50.0, 31.0, 25.0, -0.05, 0.01]),
        ("OPENCV", [50.0, 52.0, 31.0, 25.0, -0.05, 0.01, 0.001, -0.002]),
        ("FULL_OPENCV", [50.0, 52.0, 31.0, 25.0, -0.05, 0.01, 0.001, -0.002, 0.003, 0.02, 0.001, 0.002]),
        ("OPENCV_FISHEYE", [50.0, 52.0, 31.0, 25.0, 0.02, 0.003, 0.002, -0.001]),
        ("SIMPLE_RADIAL_FISHEYE", [50.0, 31.0, 25.0, 0.02]),
        ("RADIAL_FISHEYE", [50.0, 31.0, 25.0, 0.02, -0.003]),
        ("SIMPLE_FISHEYE", [50.0, 31.0, 25.0]),
        ("FISHEYE", [50.0, 52.0, 31.0, 25.0]),
        ("FOV", [50.0, 52.0, 31.0, 25.0, 0.9]),
        ("EUCM", [50.0, 52.0, 31.0, 25.0, 0.6, 1.1]),
    ],
)
def test_camera_models(tmp_path, simulated, write, model, parameters):
    save(tmp_path / "images", simulated, ["0.png", "1.png"])
    write(tmp_path / "sparse", {1: (model, *SIZE, parameters)}, posed(simulated, ["0.png", "1.png"]))
    camera = open_sequence("colmap", tmp_path).camera
    for x, y in [(0.1, 0.2), (-0.4, 0.3), (0.5, -0.35)]:
        from_corner = projected(model, parameters, x, y)
        np.testing.assert_allclose(camera.project(np.array([x, y, 1.0])), from_corner - 0.5, atol=1e-9)


@BOTH
@pytest.mark.parametrize(
    ("model", "parameters", "message"),
    [
        ("FOV", [50.0, 50.0, 31.0, 25.0, 3.5], "omega must be 0 to below pi, not 3.5"),
        (
            "THIN_PRISM_FISHEYE",
            [50.0, 50.0, 31.0, 25.0, *[0.0] * 8],
            "camera model THIN_PRISM_FISHEYE, expected one of",
        ),
        ("PINHOLE", [-50.0, 50.0, 31.0, 25.0], "an impossible camera"),
    ],
)
def test_cameras_that_cannot_be_used(tmp_path, simulated, write, model, parameters, message):
    save(tmp_path / "images", simulated, ["0.png", "1.png"])
    write(tmp_path / "sparse", {1: (model, *SIZE, parameters)}, posed(simulated, ["0.png", "1.png"]))
    with pytest.raises(DataError, match=message):
        open_sequence("colmap", tmp_path)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("cameras.txt", "PINHOLE", "WARPED", r"cameras.txt:2: '1 WARPED .*, expected CAMERA_ID MODEL"),
        ("cameras.txt", " 64 ", " -64 ", r"cameras.txt:2: '-64', expected a whole number"),
        ("cameras.txt", " 48 ", " 48 9 ", r"cameras.txt:2: 5 parameters of the model PINHOLE, expected 4"),
        ("images.txt", " 1 0.png", "", r"images.txt:3: 8 fields, expected 10"),
        ("images.txt", " 1 0.png", " 2 0.png", r"images.txt:3: camera 2, expected one of 1"),
        (
            "images.txt",
            " 1 0.png",
            " 1 ../0.png",
            r"images.txt:3: the name '../0.png', expected the path of a file below",
        ),
        ("images.txt", " 1 1.png", " 1 0.png", r"images.txt:5: a second image 0.png, expected one of each name"),
        ("images.txt", "\n1 ", "\n1 nan", r"images.txt:3: 'nan.*', expected a finite number"),
        ("images.txt", "\n1 ", "\n1 9", r"images.txt:3: a quaternion of norm"),
    ],
)
def test_damaged_text_names_its_line(tmp_path, simulated, file, old, new, message):
    save(tmp_path / "images", simulated, ["0.png", "1.png"])
    write_text(tmp_path / "sparse", {1: pinhole(simulated.camera)}, posed(simulated, ["0.png", "1.png"]))
    path = tmp_path / "sparse" / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(DataError, match=message):
        open_sequence("colmap", tmp_path)


@pytest.mark.parametrize("name", ["{}.png", "my images {}.png"])
def test_images_without_their_lines_of_points_are_refused(tmp_path, simulated, name):
    names = [name.format(index) for index in range(2)]
    save(tmp_path / "images", simulated, names)
    write_text(tmp_path / "sparse", {1: pinhole(simulated.camera)}, posed(simulated, names))
    path = tmp_path / "sparse" / "images.txt"
    path.write_text("\n".join(line for line in path.read_text().splitlines() if line.endswith("png")))
    with pytest.raises(DataError, match=r"images.txt:2: '2 .*', expected points \(X Y POINT3D_ID\), or an empty line"):
        open_sequence("colmap", tmp_path)


@pytest.mark.parametrize("file", ["cameras.bin", "images.bin"])
def test_truncated_and_exaggerated_binaries(tmp_path, simulated, file):
    save(tmp_path / "images", simulated, ["0.png", "1.png"])
    write_binary(tmp_path / "sparse", {1: pinhole(simulated.camera)}, posed(simulated, ["0.png", "1.png"]))
    path = tmp_path / "sparse" / file
    whole = path.read_bytes()
    for damaged in (whole[:-9], whole[:5], b"", struct.pack("<Q", 2**63) + whole[8:]):
        path.write_bytes(damaged)
        with pytest.raises(DataError, match=re.escape(str(path))):
            open_sequence("colmap", tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"64&48&1&" + bytes(9), "9 bytes of depths, expected 12288"),
        (b"64&24&1&" + bytes(64 * 24 * 4), "size 64x24 and 1 channel, expected the camera's 64x48 and one channel"),
        (b"depth", "no header, expected a depth map of COLMAP: width&height&channels&"),
    ],
)
def test_damaged_depth_maps(tmp_path, simulated, content, message):
    save(tmp_path / "images", simulated, ["0.png", "1.png"])
    write_text(tmp_path / "sparse", {1: pinhole(simulated.camera)}, posed(simulated, ["0.png", "1.png"]))
    (tmp_path / "stereo/depth_maps").mkdir(parents=True)
    (tmp_path / "stereo/depth_maps/0.png.geometric.bin").write_bytes(content)
    with pytest.raises(DataError, match=message):
        open_sequence("colmap", tmp_path).depth(0)


def test_images_in_another_place(tmp_path, simulated):
    save(tmp_path / "pictures", simulated, ["0.png", "1.png"])
    write_text(tmp_path / "models/a", {1: pinhole(simulated.camera)}, posed(simulated, ["0.png", "1.png"]))
    with pytest.raises(DataError, match="no folder of images, expected images beside it or above, or --option image_"):
        open_sequence("colmap", tmp_path / "models")
    found = open_sequence("colmap", tmp_path / "models", image_folder=tmp_path / "pictures")
    np.testing.assert_array_equal(found.image(1), simulated.image(1))


def test_the_folder_of_images_is_relative_to_the_recording(tmp_path, simulated, monkeypatch):
    """In an experiment file and on the command line too, wherever they are."""
    names = ["0.png", "1.png"]
    save(tmp_path / "data/pictures", simulated, names)
    write_text(tmp_path / "data/models/a", {1: pinhole(simulated.camera)}, posed(simulated, names))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    found = open_sequence("colmap", tmp_path / "data", image_folder="pictures")
    np.testing.assert_array_equal(found.image(1), simulated.image(1))
    text = 'name = "x"\n[dataset]\nreader = "colmap"\nroot = "../data"\n'
    text += 'options = { image_folder = "pictures" }\n[[trackers]]\nkind = "lucas-kanade"\n'
    Path("x.toml").write_text(text)
    experiment = load_experiment("x.toml")
    dataset = experiment.dataset
    assert dataset.options["image_folder"] == "pictures"
    (sequence,) = (reader := make_reader(dataset.reader, dataset.root, dataset.options)).sequences()
    np.testing.assert_array_equal(reader.open(sequence).image(1), simulated.image(1))
    assert tmp_path / "data/pictures" in [Path(path).resolve() for path in option_paths(experiment)]
    template = tomllib.loads(experiment_template(reader, dataset.root, {"image_folder": "pictures"}))
    assert template["dataset"]["options"] == {"image_folder": "pictures"}
    with pytest.raises(DataError, match=re.escape(f"{tmp_path}/data/other: no such directory")):
        open_sequence("colmap", tmp_path / "data", image_folder="other")


def test_scenes_are_a_group_if_they_have_the_same_images_and_not_if_folders_have_the_same_name(tmp_path, simulated):
    """COLMAP's automatic reconstruction puts the images of every workspace into dense/0/images."""
    names = ["0.png", "1.png"]
    for workspace in ("kitchen/dense/0", "garden/dense/0"):
        save(tmp_path / workspace / "images", simulated, names)
        for model in ("sparse", "other/sparse"):
            write_text(tmp_path / workspace / model, {1: pinhole(simulated.camera)}, posed(simulated, names))
    reader = make_reader("colmap", tmp_path)
    groups = {one.scene: reader.open(one).group for one in reader.sequences()}
    assert len(groups) == 4
    for workspace in ("kitchen/dense/0", "garden/dense/0"):
        assert groups[f"{workspace}/sparse"] == groups[f"{workspace}/other/sparse"] == f"{workspace}/images"


def test_images_are_used_as_they_are_stored(tmp_path, simulated):
    """COLMAP ignores the orientation in EXIF data. 3 means that the camera was held upside down, 6 upright."""
    for index, orientation in enumerate((3, 6)):
        save_turned(tmp_path / f"images/{index}.jpg", simulated.image(index), orientation)
    write_text(tmp_path / "sparse", {1: pinhole(simulated.camera)}, posed(simulated, ["0.jpg", "1.jpg"]))
    found = open_sequence("colmap", tmp_path)
    for index in range(2):
        assert np.abs(found.image(index).astype(float) - simulated.image(index)).mean() < 3.0


def test_no_reconstruction(tmp_path):
    with pytest.raises(DataError, match=r"no scene, expected folders with cameras.bin and images.bin, or cameras.txt"):
        make_reader("colmap", tmp_path).sequences()


OPENCV = ("OPENCV", *SIZE, [60.0, 60.0, 32.0, 24.0, 0.05, 0.01, 0.0, 0.0])
UNDISTORTED = ("PINHOLE", *SIZE, [55.0, 55.0, 32.0, 24.0])


def write_splatting(folder, simulated, *, original, undistorted=UNDISTORTED):
    """As programs for Gaussian splatting lay it out: images/ were undistorted, and belong to sparse/0."""
    names = ["0.png", "1.png", "2.png"]
    save(folder / "images", simulated, names)
    write_binary(folder / original, {1: OPENCV}, posed(simulated, names))
    write_text(folder / "sparse/0", {1: undistorted}, posed(simulated, names))


@pytest.mark.parametrize("original", ["distorted/sparse/0", "colmap/sparse/0", "colmap/first/model"])
def test_undistorted_images_belong_to_the_cameras_without_distortion(tmp_path, simulated, original):
    write_splatting(tmp_path, simulated, original=original)
    reader = make_reader("colmap", tmp_path)
    assert [one.scene for one in reader.sequences()] == ["sparse/0"]
    assert original in reader.excluded_scenes()
    assert open_sequence("colmap", tmp_path).camera.fx == 55.0
    alone = re.escape("images holds the images of ")
    with pytest.raises(DataError, match=f"{alone}.*sparse/0, whose cameras are others.*--option image_folder=FOLDER"):
        open_sequence("colmap", tmp_path / original)


def test_original_images_are_paired_with_the_cameras_with_distortion(tmp_path, simulated):
    """Both are one recording, and therefore one group."""
    write_splatting(tmp_path, simulated, original="distorted/sparse/0")
    save(tmp_path / "input", simulated, ["1.png", "2.png", "3.png"])
    (tmp_path / "input/3.png").rename(tmp_path / "input/0.png")
    found = open_sequence("colmap", tmp_path, scene="distorted/sparse/0")
    assert found.camera.distortion == (0.05, 0.01, 0.0, 0.0)
    np.testing.assert_array_equal(found.image(1), simulated.image(0))
    np.testing.assert_array_equal(open_sequence("colmap", tmp_path, scene="sparse/0").image(1), simulated.image(1))
    reader = make_reader("colmap", tmp_path)
    assert len({reader.open(one).group for one in reader.sequences()}) == 1


def test_dense_depth_of_undistorted_images_is_not_that_of_the_original_ones(tmp_path, simulated):
    write_splatting(tmp_path, simulated, original="distorted/sparse/0")
    save(tmp_path / "input", simulated, ["0.png", "1.png", "2.png"])
    write_depth_map(tmp_path / "stereo/depth_maps/0.png.geometric.bin", np.full((SIZE[1], SIZE[0]), 2.0))
    assert open_sequence("colmap", tmp_path, scene="distorted/sparse/0").depth(0) is None
    assert open_sequence("colmap", tmp_path, scene="sparse/0").depth(0) is not None


def test_two_reconstructions_of_the_same_images_keep_them(tmp_path, simulated):
    names = ["0.png", "1.png"]
    save(tmp_path / "images", simulated, names)
    for folder in ("sparse/0", "sparse/1", "refined/sparse/0"):
        write_binary(tmp_path / folder, {1: OPENCV}, posed(simulated, names))
    assert len(make_reader("colmap", tmp_path).sequences()) == 3
    assert make_reader("colmap", tmp_path).excluded_scenes() == {}
