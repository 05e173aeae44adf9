"""Camera files as the programs write them, against numbers that are known from elsewhere."""

import contextlib
import json
import os
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from tracknoise.exceptions import DataError, TracknoiseError, UnknownNameError
from tracknoise.geometry.cameras import (
    Camera,
    DoubleSphereCamera,
    EquidistantCamera,
    EucmCamera,
    FovCamera,
    OmniCamera,
)
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.camera_files import CameraFile, Lens, read_camera_file, read_yaml

K = np.array([[458.7, 0.0, 367.2], [0.0, 457.3, 248.4], [0.0, 0.0, 1.0]])
D = (-0.2834, 0.0740, 0.00019, 1.76e-05)
RADTAN = Camera(752, 480, 458.7, 457.3, 367.2, 248.4, D)
KB = (0.0034, 0.0007, -0.0020, 0.00020)
FISHEYE = EquidistantCamera(752, 480, 458.7, 457.3, 367.2, 248.4, KB)
RATIONAL = (0.5213, -2.6937, 0.0008, -0.0003, 1.6139, 0.3983, -2.5153, 1.5359)

EUROC = """\
# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam0 (MT9M034)

# Sensor extrinsics wrt. the body-frame.
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, -0.02,
         1.0, 0.0, 0.0, -0.06,
         0.0, 0.0, 1.0, 0.01,
         0.0, 0.0, 0.0, 1.0]

rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.7, 457.3, 367.2, 248.4] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.2834, 0.0740, 0.00019, 1.76e-05]
"""
KALIBR = """\
cam0:
  T_cam_imu:
  - [0.0, 1.0, 0.0, 0.1]
  - [-1.0, 0.0, 0.0, 0.2]
  - [0.0, 0.0, 1.0, 0.3]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [0.0034, 0.0007, -0.0020, 0.00020]
  distortion_model: equidistant
  intrinsics: [458.7, 457.3, 367.2, 248.4]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: -0.0012
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: ds
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [-0.17, 0.59, 358.3, 358.2, 370.0, 245.5]
  resolution: [752, 480]
  rostopic: /cam1/image_raw
"""
ROS = """\
image_width: 752
image_height: 480
camera_name: narrow
camera_matrix:
  rows: 3
  cols: 3
  data: [458.7, 0, 367.2, 0, 457.3, 248.4, 0, 0, 1]
distortion_model: {model}
distortion_coefficients:
  rows: 1
  cols: {count}
  data: {coefficients}
rectification_matrix: {{rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}}
projection_matrix: {{rows: 3, cols: 4, data: [400, 0, 360, 0, 0, 400, 240, 0, 0, 0, 1, 0]}}
"""


def read(tmp_path: Path, text: str, name: str = "camera.yaml", **options: object) -> CameraFile:
    path = tmp_path / name
    path.write_text(text)
    return read_camera_file(path, **options)


def by_opencv(path: Path, **entries: object) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in entries.items():
        storage.write(name, value)
    storage.release()
    return path


def test_euroc(tmp_path):
    file = read(tmp_path, EUROC)
    assert (file.camera, file.rate_hz, file.time_shift_s, file.notes) == (RADTAN, 20.0, None, ())
    expected = [[0, -1, 0, -0.02], [1, 0, 0, -0.06], [0, 0, 1, 0.01], [0, 0, 0, 1]]
    np.testing.assert_allclose(file.body_from_camera, expected, atol=1e-15)


def test_tum_vi_has_the_layout_of_euroc_with_another_lens(tmp_path):
    text = EUROC.replace("radial-tangential", "equidistant").replace("[-0.2834, 0.0740, 0.00019, 1.76e-05]", str([*KB]))
    assert read(tmp_path, text).camera == FISHEYE


def test_kalibr(tmp_path):
    first, second = (read(tmp_path, KALIBR, camera=name) for name in ("cam0", "cam1"))
    assert (first.camera, first.time_shift_s) == (FISHEYE, -0.0012)
    assert second.camera == DoubleSphereCamera(752, 480, 358.3, 358.2, 370.0, 245.5, -0.17, 0.59)
    camera_from_body = np.array([[0, 1, 0, 0.1], [-1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1.0]])
    np.testing.assert_allclose(first.body_from_camera @ camera_from_body, np.eye(4), atol=1e-15)
    shift = np.eye(4)
    shift[0, 3] = -0.11
    np.testing.assert_allclose(second.body_from_camera @ shift @ camera_from_body, np.eye(4), atol=1e-15)
    assert read(tmp_path, KALIBR).camera == first.camera
    with pytest.raises(UnknownNameError, match=r"unknown camera 'cam2'.*known: cam0, cam1"):
        read(tmp_path, KALIBR, camera="cam2")


KALIBR_MODELS = {
    "omni-radtan": ("omni", "radtan", [0.9, 700.0, 701.0, 370.0, 241.0], [*D], OmniCamera, (0.9, D)),
    "omni-none": ("omni", "none", [0.9, 700.0, 701.0, 370.0, 241.0], [], OmniCamera, (0.9,)),
    "eucm-none": ("eucm", "none", [0.6, 1.1, 700.0, 701.0, 370.0, 241.0], [], EucmCamera, (0.6, 1.1)),
    "pinhole-fov": ("pinhole", "fov", [700.0, 701.0, 370.0, 241.0], [0.93], FovCamera, (0.93,)),
    "joined": ("omni-radtan", None, [0.9, 700.0, 701.0, 370.0, 241.0], [*D], OmniCamera, (0.9, D)),
}


@pytest.mark.parametrize(
    ("model", "lens", "intrinsics", "coefficients", "kind", "own"), KALIBR_MODELS.values(), ids=KALIBR_MODELS
)
def test_omnidirectional_unified_and_field_of_view_cameras_of_kalibr(
    tmp_path, model, lens, intrinsics, coefficients, kind, own
):
    camera = {"camera_model": model, "intrinsics": intrinsics, "distortion_coeffs": coefficients}
    camera |= {"resolution": [752, 480]} | ({} if lens is None else {"distortion_model": lens})
    expected = kind(752, 480, 700.0, 701.0, 370.0, 241.0, *own)
    assert read(tmp_path, yaml.safe_dump({"cam0": camera})).camera == expected


def test_kalibr_without_an_imu_has_no_body(tmp_path):
    text = yaml.dump({"cam0": {key: value for key, value in yaml.safe_load(KALIBR)["cam0"].items() if key[0] != "T"}})
    assert read(tmp_path, text).body_from_camera is None


@pytest.mark.parametrize(
    ("model", "coefficients", "expected"),
    [
        ("plumb_bob", [*D], RADTAN),
        ("plumb_bob", [*D, 0.0], Camera(752, 480, 458.7, 457.3, 367.2, 248.4, (*D, 0.0))),
        ("plumb_bob", [0, 0, 0, 0, 0], Camera(752, 480, 458.7, 457.3, 367.2, 248.4)),
        ("rational_polynomial", [*RATIONAL], Camera(752, 480, 458.7, 457.3, 367.2, 248.4, RATIONAL)),
        ("equidistant", [*KB], FISHEYE),
        ("fisheye", [*KB], FISHEYE),
        ("''", [], Camera(752, 480, 458.7, 457.3, 367.2, 248.4)),
    ],
)
def test_ros(tmp_path, model, coefficients, expected):
    text = ROS.format(model=model, count=len(coefficients), coefficients=coefficients)
    assert read(tmp_path, text).camera == expected


@pytest.mark.parametrize("names", ["DKRP", "dkrp"])
def test_a_message_of_ros_printed_to_a_file(tmp_path, names):
    d, k, r, p = names
    text = f"""\
header:
  stamp: {{secs: 1, nsecs: 5}}
  frame_id: camera
height: 480
width: 752
distortion_model: plumb_bob
{d}: {[*D]}
{k}: {K.ravel().tolist()}
{r}: [1, 0, 0, 0, 1, 0, 0, 0, 1]
{p}: [400, 0, 360, 0, 0, 400, 240, 0, 0, 0, 1, 0]
binning_x: 0
---
"""
    assert read(tmp_path, text).camera == RADTAN


@pytest.mark.parametrize("name", ["camera.yml", "camera.xml"])
@pytest.mark.parametrize("matrix", ["camera_matrix", "cameraMatrix", "K"])
def test_opencv_file_storage(tmp_path, name, matrix):
    coefficients = "distCoeffs" if matrix == "cameraMatrix" else "distortion_coefficients"
    entries = {"image_width": 752, "image_height": 480, "note": "made by a calibration", matrix: K}
    path = by_opencv(tmp_path / name, **entries, **{coefficients: np.array([[*D, 0.01]])})
    assert read_camera_file(path).camera == replace(RADTAN, distortion=(*D, 0.01))


STATES = {
    "by-the-option": ({}, {"lens": Lens.radtan}, RADTAN),
    "fisheye-by-the-option": (
        {},
        {"lens": Lens.equidistant},
        EquidistantCamera(752, 480, 458.7, 457.3, 367.2, 248.4, D),
    ),
    "plumb-bob": ({"distortion_model": "plumb_bob"}, {}, RADTAN),
    "pinhole": ({"camera_model": "pinhole"}, {}, RADTAN),
    "fisheye": ({"model": "fisheye"}, {}, EquidistantCamera(752, 480, 458.7, 457.3, 367.2, 248.4, D)),
    "device": ({"model": "D435", "fisheye_model": 0}, {}, RADTAN),
    "omnidir": ({"xi": 0.9}, {}, OmniCamera(752, 480, 458.7, 457.3, 367.2, 248.4, 0.9, D)),
    "omnidir-matrix": ({"xi": np.array([[0.9]])}, {}, OmniCamera(752, 480, 458.7, 457.3, 367.2, 248.4, 0.9, D)),
}


@pytest.mark.parametrize("name", ["camera.yml", "camera.xml"])
@pytest.mark.parametrize(("words", "options", "expected"), STATES.values(), ids=STATES)
@pytest.mark.parametrize("shape", [(1, 4), (4, 1)])
def test_four_coefficients_of_opencv_are_those_of_the_lens_that_is_stated(
    tmp_path, name, words, options, expected, shape
):
    entries = {"image_width": 752, "image_height": 480, "camera_matrix": K, "D": np.array(D).reshape(shape)}
    assert read_camera_file(by_opencv(tmp_path / name, **entries, **words), **options).camera == expected


@pytest.mark.parametrize(
    ("words", "options", "message"),
    [
        (
            {},
            {},
            "D of 4 numbers, .* pinhole .* fisheye, expected its lens, radtan or equidistant: --option lens=radtan",
        ),
        ({"distortion_model": ""}, {}, "D of 4 numbers, .* --option lens=radtan"),
        ({"model": "D435"}, {}, "D of 4 numbers, .* --option lens=radtan"),
        ({"distortion_model": "plumb_bob"}, {"lens": Lens.equidistant}, "lens = equidistant for .* states radtan"),
    ],
)
def test_four_coefficients_of_no_or_two_lenses_are_refused(tmp_path, words, options, message):
    text = yaml.safe_dump({"image_size": [752, 480], "camera_matrix": K.tolist(), "D": [*D], **words})
    with pytest.raises(DataError, match=message):
        read(tmp_path, text, **options)


def test_a_lens_is_asked_for_only_where_the_file_does_not_say(tmp_path):
    with pytest.raises(DataError, match="lens = radtan for a file that states the model"):
        read(tmp_path, EUROC, lens=Lens.radtan)


@pytest.mark.parametrize("name", ["camera.yml", "camera.xml"])
def test_opencv_fisheye_and_a_size_from_elsewhere(tmp_path, name):
    path = by_opencv(tmp_path / name, fisheye_model=1, camera_matrix=K, distortion_coefficients=np.array(KB)[:, None])
    assert read_camera_file(path, size=(752, 480)).camera == FISHEYE
    with pytest.raises(DataError, match="no size of the image, expected image_width and image_height"):
        read_camera_file(path)


@pytest.mark.parametrize("name", ["pair.yml", "pair.xml"])
def test_an_opencv_pair(tmp_path, name):
    other = K + np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 3.0], [0.0, 0.0, 0.0]])
    path = by_opencv(tmp_path / name, M1=K, D1=np.array([[*D, 0.01]]), M2=other, D2=np.zeros((1, 14)))
    size, first = (752, 480), replace(RADTAN, distortion=(*D, 0.01))
    assert read_camera_file(path, size=size).camera == first
    assert read_camera_file(path, camera="1", size=size).camera == first
    second = Camera(752, 480, 459.7, 458.3, 369.2, 251.4)
    assert read_camera_file(path, camera="2", size=size).camera == second
    with pytest.raises(DataError, match="no camera 3"):
        read_camera_file(path, camera="3", size=size)


@pytest.mark.parametrize(
    ("entries", "expected"),
    [
        ({"distortion": [*D]}, RADTAN),
        ({"model": "radtan", "distortion": [*D]}, RADTAN),
        ({"model": "pinhole"}, Camera(752, 480, 458.7, 457.3, 367.2, 248.4)),
        ({"model": "equidistant", "distortion": [*KB]}, FISHEYE),
        (
            {"model": "double_sphere", "xi": -0.17, "alpha": 0.59},
            DoubleSphereCamera(752, 480, 458.7, 457.3, 367.2, 248.4, -0.17, 0.59),
        ),
        (
            {"model": "omni", "xi": 0.2, "distortion": [*D]},
            OmniCamera(752, 480, 458.7, 457.3, 367.2, 248.4, 0.2, D),
        ),
        ({"model": "omni-none", "xi": 0.2}, OmniCamera(752, 480, 458.7, 457.3, 367.2, 248.4, 0.2)),
        (
            {"model": "eucm", "alpha": 0.6, "beta": 1.1},
            EucmCamera(752, 480, 458.7, 457.3, 367.2, 248.4, 0.6, 1.1),
        ),
        ({"model": "pinhole-fov", "omega": 0.9}, FovCamera(752, 480, 458.7, 457.3, 367.2, 248.4, 0.9)),
    ],
)
@pytest.mark.parametrize("name", ["camera.json", "camera.yaml"])
def test_tracknoise_s_own(tmp_path, entries, expected, name):
    plain = {"width": 752, "height": 480, "fx": 458.7, "fy": 457.3, "cx": 367.2, "cy": 248.4}
    write = json.dumps if name.endswith("json") else yaml.safe_dump
    file = read(tmp_path, write(plain | entries | {"depth_unit_m": 0.001}), name)
    assert (file.camera, file.depth_unit_m) == (expected, 0.001)


@pytest.mark.skipif("TRACKNOISE_DATA" not in os.environ, reason="no real samples")
def test_the_real_camera_of_tum_rgbd():
    (path,) = (Path(os.environ["TRACKNOISE_DATA"]) / "tum_rgbd").glob("*/camera.yaml")
    file = read_camera_file(path)
    assert file.camera == Camera(640, 480, 517.3, 516.5, 318.6, 255.3, (0.2624, -0.9531, -0.0054, 0.0026, 1.1633))
    assert file.depth_unit_m == 1 / 5000


def test_a_lens_wider_than_180_degrees_is_noted(tmp_path):
    """90 degrees lie at 297 px from the centre: beyond that circle are 8 % of the square of 512 px."""
    text = KALIBR.replace("[458.7, 457.3, 367.2, 248.4]", "[190.98, 190.97, 254.9, 256.9]").replace(
        "752, 480", "512, 512"
    )
    (note,) = read(tmp_path, text).notes
    assert note == "the camera model gives about 8 % of the image no ray; features there have no truth"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "intrinsics: [458.7, 457.3, 367.2, 248.4]",
            "intrinsics: [458.7, 457.3, 367.2]",
            "intrinsics = .*expected 4 num",
        ),
        ("intrinsics: [458.7,", "intrinsics: [0,", "an impossible camera .*must be positive"),
        ("intrinsics: [458.7,", "intrinsics: [.nan,", "intrinsics = NaN, expected a finite number"),
        ("[-0.2834, 0.0740", "[-5, 0.0", "only .* of the image a ray, expected those of this image size"),
        ("camera_model: pinhole", "camera_model: omni", "intrinsics = .*expected 5 numbers"),
        ("camera_model: pinhole", "camera_model: cata", 'camera_model = "cata", expected pinhole, omni, eucm or ds'),
        ("radial-tangential", "thin", 'distortion_model = "thin", expected one of none, radtan'),
        ("radial-tangential", "fov", "expected 1 number .omega. for the model fov"),
        ("distortion_model: radial-tangential\n", "", "no distortion_model"),
        ("resolution: [752, 480]\n", "", "no resolution, expected it"),
        ("resolution: [752, 480]", "resolution: [752.5, 480]", "resolution = 752.5, expected a whole number above 0"),
        ("[0.0, -1.0, 0.0, -0.02,", "[0.0, -2.0, 0.0, -0.02,", "T_BS: a pose whose singular values differ"),
        ("0.0, 0.0, 0.0, 1.0]", "0.0, 0.0, 0.0]", "T_BS = .*expected 16 numbers"),
        ("rate_hz: 20", "rate_hz: -20", "rate_hz = -20, expected a finite number above 0"),
        ("sensor_type: camera", "sensor_type: [camera", r"camera\.yaml:\d+: no YAML"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, message):
    assert old in EUROC
    with pytest.raises(DataError, match=message):
        read(tmp_path, EUROC.replace(old, new))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\n", "no camera, expected a camera file of Kalibr"),
        ("- 1\n- 2\n", "YAML without keys"),
        ("", "YAML without keys"),
        ("<a><b/></a>", "XML of <a>, expected <opencv_storage>"),
        ("<a>", "malformed XML"),
        ("width: 3\n", "no height, expected width, height"),
        ("camera_matrix: !!python/object:os.system {}\n", "no YAML"),
        ("camera_matrix: 5\n", "camera_matrix = 5, expected a list of numbers"),
        ("camera_matrix: [1, 2, 0, 0, 1, 0, 0, 0, 1]\n", "expected fx 0 cx"),
        ("[" * 5000, "no YAML"),
        ("a: " + "9" * 5000, "no YAML"),
        ("a: 2001-99-99\n", "no YAML"),
        ("? [a, b]\n: 1\n", "no"),
    ],
)
def test_other_files_are_refused(tmp_path, text, message):
    with pytest.raises(DataError, match=message):
        read(tmp_path, text)


def test_few_aliases_that_stand_for_billions_of_values_are_refused_at_once(tmp_path):
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 10)}]" for level in range(1, 12)]
    path = tmp_path / "bomb.yaml"
    path.write_text("\n".join(lines))
    with pytest.raises(DataError, match="more than 20000 values or 16 levels"):
        read_yaml(path)
    path.write_text("a: &a [*a]\n")
    with pytest.raises(DataError, match="more than"):
        read_yaml(path)
    path.write_text("a: &a {x: 1}\nb: *a\nc: {<<: *a, y: 1e-5}\n")
    assert read_yaml(path) == {"a": {"x": 1}, "b": {"x": 1}, "c": {"x": 1, "y": "1e-5"}}
    path.write_bytes(b"a: 1\n" * 60_000)
    with pytest.raises(DataError, match="of at most 262144 bytes"):
        read_yaml(path)


VALID = [EUROC, KALIBR, ROS.format(model="plumb_bob", count=4, coefficients=[*D])]


@given(st.data())
@settings(max_examples=300, deadline=None)
def test_whatever_a_file_holds_only_our_errors_come_out(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("fuzz") / data.draw(st.sampled_from(["a.yaml", "a.xml", "a.json"]))
    content = data.draw(st.binary(max_size=200) | st.sampled_from(VALID).map(str.encode).flatmap(damaged))
    path.write_bytes(content)
    for camera in (None, "cam1"):
        with contextlib.suppress(TracknoiseError):
            read_camera_file(path, camera=camera, size=(640, 480))


def damaged(content: bytes) -> st.SearchStrategy[bytes]:
    """The content with a piece of it replaced by something else."""
    pieces = st.sampled_from(
        [b"", b"-1", b"1e999", b"[]", b"{}", b"*a", b"&a", b"~", b"nan", b"'", b"\x00", b"!!x ", b": "]
    )
    places = st.tuples(st.integers(0, len(content)), st.integers(0, 30))
    return st.tuples(pieces, places).map(lambda drawn: content[: drawn[1][0]] + drawn[0] + content[sum(drawn[1]) :])


@pytest.mark.parametrize(
    "text",
    [
        EUROC + "readout_s: 0.0261\n",
        KALIBR.replace("cam0:\n", "cam0:\n  readout_s: 0.0261\n"),
        "image_width: 752\nimage_height: 480\ncamera_matrix: {data: [458.7, 0, 367.2, 0, 457.3, 248.4, 0, 0, 1]}\n"
        "distortion_coefficients: {data: [0, 0, 0, 0]}\nreadout_s: 0.0261\n",
        "width: 752\nheight: 480\nfx: 458.7\nfy: 457.3\ncx: 367.2\ncy: 248.4\nreadout_s: 0.0261\n",
    ],
)
def test_any_camera_file_may_state_a_readout(tmp_path, text):
    path = tmp_path / "camera.yaml"
    path.write_text(text)
    assert read_camera_file(path).shutter == RollingShutter(0.0261)
    path.write_text(text.replace("0.0261", "0"))
    assert read_camera_file(path).shutter is None
    path.write_text(text.replace("0.0261", "26.1"))
    with pytest.raises(DataError, match=r"readout_s = 26.1, expected seconds between -1 and 1"):
        read_camera_file(path)


def test_tabs_behind_values_are_white_space(tmp_path):
    tabs = EUROC.replace(" #fu", "\t#fu").replace("rate_hz: ", "rate_hz:\t").replace(", ", ",\t")
    (tmp_path / "plain.yaml").write_text(EUROC)
    (tmp_path / "tabs.yaml").write_text(tabs)
    assert read_yaml(tmp_path / "tabs.yaml") == read_yaml(tmp_path / "plain.yaml")
