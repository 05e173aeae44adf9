"""Camera files of SLAM systems and of OpenSfM, as these write them, against cameras that are known from elsewhere."""

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracknoise.exceptions import DataError, TracknoiseError, UnknownNameError
from tracknoise.geometry.cameras import (
    Camera,
    DoubleSphereCamera,
    EquidistantCamera,
    EucmCamera,
    FovCamera,
    KnownCamera,
    OmniCamera,
)
from tracknoise.sequences.camera_files import CameraFile, cameras_in, read_camera_file

D = (-0.2834, 0.0740, 0.00019, 1.76e-05)
KB = (0.0034, 0.0007, -0.0020, 0.00020)
OPTICS = (752, 480, 458.7, 457.3, 367.2, 248.4)
RADTAN, FISHEYE = Camera(*OPTICS, D), EquidistantCamera(*OPTICS, KB)
POSE = np.array([[0.0, -1.0, 0.0, -0.02], [1.0, 0.0, 0.0, -0.06], [0.0, 0.0, 1.0, 0.01], [0.0, 0.0, 0.0, 1.0]])
BESIDE = np.array([[1.0, 0.0, 0.0, 0.11], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def matrix(values: np.ndarray, indent: str = "   ") -> str:
    """As OpenCV's FileStorage writes it."""
    rows, columns = values.shape
    return f"!!opencv-matrix\n{indent}rows: {rows}\n{indent}cols: {columns}\n{indent}dt: d\n{indent}data: " + str(
        values.ravel().tolist()
    )


VINS = f"""\
%YAML:1.0
---
imu_topic: "/imu0"
model_type: PINHOLE
camera_name: camera
image_width: 752
image_height: 480
distortion_parameters:
   k1: -0.2834
   k2: 0.0740
   p1: 0.00019
   p2: 1.76e-05
projection_parameters:
   fx: 4.587e+02
   fy: 4.573e+02
   cx: 3.672e+02
   cy: 2.484e+02
estimate_extrinsic: 0
extrinsicRotation: {matrix(POSE[:3, :3])}
extrinsicTranslation: {matrix(POSE[:3, 3:])}
td: 0.003
estimate_td: 0
rolling_shutter: 0
rolling_shutter_tr: 0
"""
VINS_KB = """\
%YAML:1.0
---
model_type: KANNALA_BRANDT
camera_name: camera
image_width: 752
image_height: 480
projection_parameters:
   k2: 0.0034
   k3: 0.0007
   k4: -0.0020
   k5: 0.00020
   mu: 458.7
   mv: 457.3
   u0: 367.2
   v0: 248.4
"""
VINS_MEI = """\
%YAML:1.0
---
model_type: MEI
camera_name: camera
image_width: 752
image_height: 480
mirror_parameters:
   xi: 2.2
distortion_parameters:
   k1: -0.2834
   k2: 0.0740
   p1: 0.00019
   p2: 1.76e-05
projection_parameters:
   gamma1: 1458.7
   gamma2: 1457.3
   u0: 367.2
   v0: 248.4
"""
ORB3 = f"""\
%YAML:1.0
File.version: "1.0"
Camera.type: "PinHole"
Camera1.fx: 458.7
Camera1.fy: 457.3
Camera1.cx: 367.2
Camera1.cy: 248.4
Camera1.k1: -0.2834
Camera1.k2: 0.0740
Camera1.p1: 0.00019
Camera1.p2: 1.76e-05
Camera2.fx: 468.7
Camera2.fy: 467.3
Camera2.cx: 377.2
Camera2.cy: 258.4
Camera2.k1: 0.0
Camera2.k2: 0.0
Camera2.p1: 0.0
Camera2.p2: 0.0
Camera.width: 752
Camera.height: 480
Camera.newWidth: 600
Camera.newHeight: 350
Camera.fps: 20
Stereo.T_c1_c2: {matrix(BESIDE, "  ")}
IMU.T_b_c1: {matrix(POSE, "   ")}
"""
ORB2 = """\
%YAML:1.0
Camera.fx: 517.306408
Camera.fy: 516.469215
Camera.cx: 318.643040
Camera.cy: 255.313989
Camera.k1: 0.262383
Camera.k2: -0.953104
Camera.p1: -0.005358
Camera.p2: 0.002628
Camera.k3: 1.163314
Camera.fps: 30.0
DepthMapFactor: 5000.0
"""
KINECT = (0.262383, -0.953104, -0.005358, 0.002628, 1.163314)
OKVIS = f"""\
%YAML:1.0
cameras:
     - {{T_SC:
        {POSE.ravel().tolist()},
        image_dimension: [752, 480],
        distortion_coefficients: {[*D]},
        distortion_type: radialtangential,
        focal_length: [458.7, 457.3],
        principal_point: [367.2, 248.4],
        camera_type: gray}}
     - {{T_SC:
        {(POSE @ BESIDE).ravel().tolist()},
        image_dimension: [752, 480],
        distortion_coefficients: {[*KB]},
        distortion_type: equidistant,
        focal_length: [458.7, 457.3],
        principal_point: [367.2, 248.4]}}
imu_params:
    a_max: 176.0
"""
SVO = f"""\
label: euroc
cameras:
- camera:
    label: cam0
    line-delay-nanoseconds: 0
    image_height: 480
    image_width: 752
    type: pinhole
    intrinsics:
      cols: 1
      rows: 4
      data: [458.7, 457.3, 367.2, 248.4]
    distortion:
      type: radial-tangential
      parameters:
        cols: 1
        rows: 4
        data: {[*D]}
  T_B_C:
    cols: 4
    rows: 4
    data: {POSE.ravel().tolist()}
"""
VIKIT = """\
cam_model: Pinhole
cam_width: 752
cam_height: 480
cam_fx: 458.7
cam_fy: 457.3
cam_cx: 367.2
cam_cy: 248.4
cam_d0: -0.2834
cam_d1: 0.0740
cam_d2: 0.00019
cam_d3: 1.76e-05
"""
ATAN = """\
cam_model: ATAN
cam_width: 640
cam_height: 480
cam_fx: 0.5
cam_fy: 0.75
cam_cx: 0.5
cam_cy: 0.5
cam_d0: 0.93
"""
HALF_TURN = {"px": -0.02, "py": -0.06, "pz": 0.01, "qx": 0.0, "qy": 0.0, "qz": 0.5**0.5, "qw": 0.5**0.5}
"""`POSE`: a quarter turn about z."""


def basalt(kind: str, **numbers: float) -> str:
    intrinsics = {"fx": 458.7, "fy": 457.3, "cx": 367.2, "cy": 248.4, **numbers}
    camera = {"camera_type": kind, "intrinsics": intrinsics}
    other = {
        "camera_type": "pinhole",
        "intrinsics": dict(zip(("fx", "fy", "cx", "cy"), (1.0, 1.0, 3.0, 4.0), strict=True)),
    }
    value = {
        "T_imu_cam": [HALF_TURN, HALF_TURN],
        "intrinsics": [camera, other],
        "resolution": [[752, 480], [8, 8]],
        "cam_time_offset_ns": 2_000_000,
    }
    return json.dumps({"value0": value})


def opensfm(kind: str, **numbers: float) -> str:
    return json.dumps({"v2 phone 640 480": {"projection_type": kind, "width": 640, "height": 480, **numbers}})


RATIONAL = dict(
    zip(("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), (0.5, -2.7, 8e-4, -3e-4, 1.6, 0.4, -2.5, 1.5), strict=True)
)
FOUR = dict(zip(("k1", "k2", "k3", "k4"), KB, strict=True))
READ: dict[str, tuple[str, str, KnownCamera]] = {
    "vins": ("a.yaml", VINS, RADTAN),
    "vins-kb": ("a.yaml", VINS_KB, FISHEYE),
    "vins-mei": ("a.yaml", VINS_MEI, OmniCamera(752, 480, 1458.7, 1457.3, 367.2, 248.4, 2.2, D)),
    "orb-slam3": ("a.yaml", ORB3, RADTAN),
    "orb-slam3-kb": (
        "a.yaml",
        ORB3.replace("PinHole", "KannalaBrandt8").replace(
            "Camera1.k1: -0.2834\nCamera1.k2: 0.0740\nCamera1.p1: 0.00019\nCamera1.p2: 1.76e-05",
            "Camera1.k1: 0.0034\nCamera1.k2: 0.0007\nCamera1.k3: -0.0020\nCamera1.k4: 0.00020",
        ),
        FISHEYE,
    ),
    "orb-slam3-rectified": ("a.yaml", ORB3.replace("PinHole", "Rectified"), Camera(*OPTICS)),
    "orb-slam2": (
        "TUM1.yaml",
        ORB2,
        Camera(*(640, 480, 517.306408, 516.469215, 318.643040, 255.313989), KINECT),
    ),
    "okvis": ("a.yaml", OKVIS, RADTAN),
    "svo": ("a.yaml", SVO, RADTAN),
    "svo-kb": ("a.yaml", SVO.replace("radial-tangential", "equidistant").replace(str([*D]), str([*KB])), FISHEYE),
    "svo-fisheye-is-fov": (
        "a.yaml",
        SVO.replace("radial-tangential", "fisheye").replace(str([*D]), "[0.93]"),
        FovCamera(*OPTICS, 0.93),
    ),
    "maplab-unified": (
        "a.yaml",
        SVO.replace("pinhole", "unified-projection").replace("[458.7", "[0.2, 458.7"),
        OmniCamera(*OPTICS, 0.2, D),
    ),
    "vikit": ("a.yaml", VIKIT, RADTAN),
    "vikit-atan": ("a.yaml", ATAN, FovCamera(640, 480, 320.0, 360.0, 319.5, 239.5, 0.93)),
    "basalt": ("a.json", basalt("pinhole"), Camera(*OPTICS)),
    "basalt-kb4": ("a.json", basalt("kb4", **FOUR), FISHEYE),
    "basalt-ds": ("a.json", basalt("ds", xi=-0.17, alpha=0.59), DoubleSphereCamera(*OPTICS, -0.17, 0.59)),
    "basalt-eucm": ("a.json", basalt("eucm", alpha=0.6, beta=1.1), EucmCamera(*OPTICS, 0.6, 1.1)),
    "basalt-ucm": ("a.json", basalt("ucm", alpha=0.6), EucmCamera(*OPTICS, 0.6, 1.0)),
    "basalt-fov": ("a.json", basalt("fov", w=0.93), FovCamera(*OPTICS, 0.93)),
    "basalt-radtan8": (
        "a.json",
        basalt("pinhole-radtan8", **RATIONAL, rpmax=2.7),
        Camera(*OPTICS, tuple(RATIONAL.values())),
    ),
    "opensfm": (
        "camera_models.json",
        opensfm("perspective", focal=0.9, k1=-0.1, k2=0.02),
        Camera(640, 480, 576.0, 576.0, 319.5, 239.5, (-0.1, 0.02, 0.0, 0.0)),
    ),
    "opensfm-brown": (
        "camera_models.json",
        opensfm("brown", focal_x=0.9, focal_y=0.8, c_x=0.01, c_y=-0.02, k1=-0.1, k2=0.02, p1=1e-3, p2=2e-3, k3=0.01),
        Camera(640, 480, 576.0, 512.0, 325.9, 226.7, (-0.1, 0.02, 1e-3, 2e-3, 0.01)),
    ),
    "opensfm-fisheye": (
        "camera_models.json",
        opensfm("fisheye", focal=0.5, k1=-0.1, k2=0.02),
        EquidistantCamera(640, 480, 320.0, 320.0, 319.5, 239.5, (-0.1, 0.02, 0.0, 0.0)),
    ),
    "opensfm-fisheye-opencv": (
        "camera_models.json",
        opensfm("fisheye_opencv", focal_x=0.5, focal_y=0.5, c_x=0.0, c_y=0.0, **FOUR),
        EquidistantCamera(640, 480, 320.0, 320.0, 319.5, 239.5, KB),
    ),
}  # fmt: skip


def read(tmp_path: Path, text: str, name: str = "a.yaml", **options: object) -> CameraFile:
    path = tmp_path / name
    path.write_text(text)
    return read_camera_file(path, **options)


@pytest.mark.parametrize(("name", "text", "expected"), READ.values(), ids=READ)
def test_the_camera_is_read(tmp_path, name, text, expected):
    camera = read(tmp_path, text, name, size=(640, 480)).camera
    assert type(camera) is type(expected)
    points = np.array([[0.3, -0.2, 1.0], [-1.0, 0.7, 2.0], [0.0, 0.0, 3.0]])
    assert (camera.width, camera.height) == (expected.width, expected.height)
    np.testing.assert_allclose(camera.project(points), expected.project(points), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["vins", "orb-slam3", "okvis", "svo", "basalt"])
def test_the_place_of_the_camera_on_the_body_is_read(tmp_path, name):
    file, text, _ = READ[name]
    np.testing.assert_allclose(read(tmp_path, text, file).body_from_camera, POSE, atol=1e-12)


def test_further_cameras_are_named_and_chosen(tmp_path):
    second = read(tmp_path, ORB3, camera="cam1")
    assert second.camera == Camera(752, 480, 468.7, 467.3, 377.2, 258.4)
    np.testing.assert_allclose(second.body_from_camera, POSE @ BESIDE, atol=1e-12)
    assert second.rate_hz == 20.0
    second = read(tmp_path, OKVIS, camera="cam1")
    assert second.camera == FISHEYE
    np.testing.assert_allclose(second.body_from_camera, POSE @ BESIDE, atol=1e-12)
    assert read(tmp_path, basalt("kb4", **FOUR), "a.json", camera="cam1").camera.width == 8
    assert cameras_in(tmp_path / "a.json") == cameras_in(tmp_path / "a.yaml") == ["cam0", "cam1"]
    with pytest.raises(UnknownNameError, match=r"unknown camera 'cam2'.*known: cam0, cam1"):
        read(tmp_path, OKVIS, camera="cam2")
    with pytest.raises(DataError, match="no camera cam1, expected no name: a file of VINS has one camera"):
        read(tmp_path, VINS, camera="cam1")


def test_times_depth_units_and_shutters(tmp_path):
    assert read(tmp_path, VINS).time_shift_s == 0.003
    assert read(tmp_path, VINS.replace("estimate_td: 0", "estimate_td: 1")).time_shift_s is None
    assert read(tmp_path, VINS.replace("estimate_extrinsic: 0", "estimate_extrinsic: 1")).body_from_camera is None
    assert read(tmp_path, basalt("pinhole"), "a.json").time_shift_s == pytest.approx(0.002)
    assert read(tmp_path, ORB2, size=(640, 480)).depth_unit_m == 1 / 5000
    assert read(tmp_path, VINS).notes == ()
    for text in (
        VINS.replace("rolling_shutter: 0", "rolling_shutter: 1"),
        SVO.replace("nanoseconds: 0", "nanoseconds: 9"),
    ):
        file = read(tmp_path, text)
        assert file.shutter is None
        assert ["which is not used: readout_s states one" in note for note in file.notes] == [True]
    assert read(tmp_path, VINS + "readout_s: 0.02\n").shutter.readout_s == 0.02


SIDES = """\
LEFT.width: 752
LEFT.height: 480
LEFT.D: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [-0.2834, 0.0740, 0.00019, 1.76e-05, 0.0]
LEFT.K: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [458.7, 0.0, 367.2, 0.0, 457.3, 248.4, 0.0, 0.0, 1.0]
"""


def test_rectified_and_recorded_images_of_orb_slam2_are_not_taken_for_each_other(tmp_path):
    with pytest.raises(DataError, match="the cameras cam0, LEFT, expected --option camera=LEFT"):
        read(tmp_path, ORB2 + SIDES, size=(752, 480))
    recorded = read(tmp_path, ORB2 + SIDES, camera="LEFT").camera
    assert recorded == Camera(*OPTICS, (*D, 0.0))
    assert read(tmp_path, ORB2 + SIDES, camera="cam0", size=(752, 480)).camera.fx == 517.306408


def test_a_camera_of_opensfm_is_chosen(tmp_path):
    cameras = json.loads(opensfm("perspective", focal=0.9, k1=0.0, k2=0.0))
    cameras["v2 drone"] = {**cameras["v2 phone 640 480"], "focal": 0.5}
    with pytest.raises(DataError, match="the cameras v2 phone 640 480, v2 drone, expected --option camera=v2 drone"):
        read(tmp_path, json.dumps(cameras), "camera_models.json")
    assert read(tmp_path, json.dumps(cameras), "camera_models.json", camera="v2 drone").camera.fx == 320.0


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        (
            "a.yaml",
            VINS.replace("PINHOLE", "SCARAMUZZA"),
            r"a camera of VINS \(camodocal\) with the model SCARAMUZZA, exp",
        ),
        (
            "a.yaml",
            "cam0_calib: left.yaml\nimu: 1\n",
            "VINS-Fusion, whose cameras are in .*expected the file .*left.yaml",
        ),
        (
            "a.yaml",
            ORB3.replace("PinHole", "Dual"),
            "a camera of ORB-SLAM with the model Dual, expected one of PinHole, K",
        ),
        (
            "a.yaml",
            OKVIS.replace("radialtangential", "eucm"),
            "a camera of OKVIS with the model eucm, expected one of radial",
        ),
        ("a.yaml", SVO.replace("pinhole", "omni"), r"a camera of SVO \(vikit\) with the model omni, radial-tangential"),
        (
            "a.yaml",
            VIKIT.replace("Pinhole", "Ocam"),
            r"a camera of SVO \(vikit\) with the model Ocam, expected one of Pin",
        ),
        ("a.json", basalt("bal"), "a camera of Basalt with the model bal, expected one of pinhole"),
        ("a.json", opensfm("spherical"), "a camera of OpenSfM with the model spherical, expected one of perspective"),
        ("a.yaml", VINS.replace("   fx: 4.587e+02\n", ""), "no fx, expected it"),
        ("a.yaml", ORB3.replace("Camera1.k2: 0.0740\n", ""), "no Camera1.k2, expected it"),
        ("a.yaml", ORB2, "no Camera.width, expected it"),
        ("a.json", basalt("kb4", k1=0.0), "no k2, expected it"),
    ],
)
def test_what_is_not_read_is_named(tmp_path, name, text, message):
    with pytest.raises(DataError, match=message):
        read(tmp_path, text, name)


PIECES = st.sampled_from(["", "-1", "0", "1e999", "[]", "{}", "nan", "true", "null", '"x"', "[[1]]", "9" * 30])


@given(st.sampled_from(list(READ.values())), st.integers(0, 2000), st.integers(0, 40), PIECES)
@settings(max_examples=300, deadline=None)
def test_whatever_such_a_file_holds_only_our_errors_come_out(tmp_path_factory, which, start, length, piece):
    name, text, _ = which
    path = tmp_path_factory.mktemp("fuzz") / name
    path.write_text(text[:start] + piece + text[start + length :])
    for camera in (None, "cam1", "LEFT"):
        with contextlib.suppress(TracknoiseError):
            read_camera_file(path, camera=camera, size=(640, 480))
    with contextlib.suppress(TracknoiseError):
        cameras_in(path)
