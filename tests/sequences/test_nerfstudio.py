"""nerfstudio's transforms.json, written from a simulated sequence by an independent writer."""

import json
import math

import cv2
import numpy as np
import pytest
from tests.writers.exif import save_turned
from tests.writers.nerfstudio import write_transforms

from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.geometry.cameras import Camera, EquidistantCamera
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.sequence import IMAGE_AXES, OPENGL_AXES, recorded_axes
from tracknoise.sequences.views import view
from tracknoise.truth_faults.check_recording import check_reader

NAMES = ["images/frame_1.png", "images/frame_2.png", "images/frame_10.png"]


@pytest.fixture(scope="module")
def simulated():
    return open_sequence("simulated", motions=["arvr"], frames=3, width=64, height=48, supersampling=1)


def save(folder, sequence, names):
    for index, name in enumerate(names):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        assert cv2.imwrite(str(folder / name), sequence.image(index))


@pytest.fixture
def intrinsics(simulated):
    camera = simulated.camera
    return {
        "fl_x": camera.fx,
        "fl_y": camera.fy,
        "cx": camera.cx + 0.5,
        "cy": camera.cy + 0.5,
        "w": camera.width,
        "h": camera.height,
    }


def test_what_was_simulated_is_read(tmp_path, simulated, intrinsics):
    save(tmp_path / "scene", simulated, NAMES)
    further = []
    for index in range(3):
        depth = simulated.depth(index)
        plain = np.where(depth.valid & (depth.depth_m < 60), depth.depth_m, 0.0)
        file = f"depth/{index}.png" if index < 2 else "depth/2.npy"
        (tmp_path / "scene/depth").mkdir(exist_ok=True)
        if index < 2:
            assert cv2.imwrite(str(tmp_path / "scene" / file), np.rint(plain * 1000).astype(np.uint16))
        else:
            np.save(tmp_path / "scene" / file, (plain * 1000).astype(np.float32))
        further.append({"depth_file_path": file})
    order = [2, 0, 1]  # the file need not list frames in order
    write_transforms(
        tmp_path / "scene",
        [NAMES[index] for index in order],
        simulated.world_from_camera[order],
        camera_model="OPENCV",
        applied_transform=[[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]],
        frames=[further[index] for index in order],
        **intrinsics,
    )
    found = open_sequence("nerfstudio", tmp_path)
    assert found.id.scene == "scene"
    assert found.camera == simulated.camera
    assert recorded_axes(found) == OPENGL_AXES
    assert recorded_axes(view(found, n_frames=2, direction="backward", rotation=0)) == OPENGL_AXES
    assert recorded_axes(view(found, n_frames=2, direction="forward", rotation=90)) == IMAGE_AXES
    assert recorded_axes(OtherPoses(found, found.world_from_camera, "a file")) == IMAGE_AXES
    np.testing.assert_allclose(found.world_from_camera, simulated.world_from_camera, atol=1e-12)
    for index in range(3):
        np.testing.assert_array_equal(found.image(index), simulated.image(index))
        near = simulated.depth(index).depth_m < 60
        np.testing.assert_array_equal(found.depth(index).valid, near)
        np.testing.assert_allclose(found.depth(index).depth_m[near], simulated.depth(index).depth_m[near], atol=0.51e-3)
    assert any("applied_transform stays applied" in note for note in found.notes)
    assert "the unit of depth files is 0.001 m" in found.notes


def test_the_unit_of_depth(tmp_path, simulated, intrinsics):
    save(tmp_path, simulated, NAMES[:2])
    cv2.imwrite(str(tmp_path / "d.png"), np.full((48, 64), 5000, np.uint16))
    written = {"frames": [{"depth_file_path": "d.png"}, {}], **intrinsics}
    write_transforms(tmp_path, NAMES[:2], simulated.world_from_camera[:2], depth_unit_scale_factor=0.01, **written)
    found = open_sequence("nerfstudio", tmp_path)
    np.testing.assert_allclose(found.depth(0).depth_m, 50.0)
    assert found.depth(1) is None
    assert "birth" not in open_sequence("nerfstudio", tmp_path, depth_files="none").truths
    assert "1 of 2 frames has no depth" in found.notes
    np.testing.assert_allclose(open_sequence("nerfstudio", tmp_path, depth_unit_m=1.0).depth(0).depth_m, 5000.0)
    with pytest.raises(SettingsError, match=r"depth_unit_m is 0.0, expected a number above 0"):
        make_reader("nerfstudio", tmp_path, {"depth_unit_m": 0.0})


def test_images_are_used_as_they_are_stored(tmp_path, simulated, intrinsics):
    """nerfstudio ignores the orientation in EXIF data; also where the size of the images is that of the first."""
    names = ["0.jpg", "1.jpg"]
    for index, orientation in enumerate((6, 3)):
        save_turned(tmp_path / names[index], simulated.image(index), orientation)
    unsized = {key: value for key, value in intrinsics.items() if key not in "wh"}
    write_transforms(tmp_path, names, simulated.world_from_camera[:2], **unsized)
    found = open_sequence("nerfstudio", tmp_path)
    assert found.camera == simulated.camera
    for index in range(2):
        assert np.abs(found.image(index).astype(float) - simulated.image(index)).mean() < 3.0


def test_depths_have_the_scale_that_was_applied_to_positions(tmp_path, simulated, intrinsics):
    """nerfstudio multiplies depths by applied_scale, because the positions in the file were already multiplied."""
    save(tmp_path, simulated, NAMES[:2])
    cv2.imwrite(str(tmp_path / "d.png"), np.full((48, 64), 5000, np.uint16))
    written = {"frames": [{"depth_file_path": "d.png"}, {}], **intrinsics}
    poses = simulated.world_from_camera[:2].copy()
    poses[:, :3, 3] *= 0.25
    write_transforms(tmp_path, NAMES[:2], poses, applied_scale=0.25, **written)
    found = open_sequence("nerfstudio", tmp_path)
    np.testing.assert_allclose(found.depth(0).depth_m, 1.25)
    np.testing.assert_allclose(open_sequence("nerfstudio", tmp_path, depth_unit_m=1.0).depth(0).depth_m, 1250.0)
    said = "the unit of depth files is 0.00025 m: they are multiplied by applied_scale, 0.25, as positions were"
    assert said in found.notes
    write_transforms(tmp_path, NAMES[:2], poses, applied_scale=0, **written)
    with pytest.raises(DataError, match=r"applied_scale = 0, expected a finite number above 0"):
        open_sequence("nerfstudio", tmp_path)


def test_smaller_depth_maps_are_enlarged(tmp_path, simulated, intrinsics):
    """Of a slanted plane, whose inverse depth is linear in the image."""

    def inverse(u, v):
        return 0.3 + 0.0002 * u - 0.0004 * v

    save(tmp_path, simulated, NAMES[:2])
    v, u = np.indices((12, 16)) * 4.0 + 1.5  # centres of 4x4 pixels
    small = np.rint(1e4 / inverse(u, v)).astype(np.uint16)
    small[5, 8] = 0
    assert cv2.imwrite(str(tmp_path / "d.png"), small)
    assert cv2.imwrite(str(tmp_path / "bad.png"), small[:, :15])
    written = {"frames": [{"depth_file_path": "d.png"}, {"depth_file_path": "bad.png"}], **intrinsics}
    write_transforms(tmp_path, NAMES[:2], simulated.world_from_camera[:2], integer_depth_scale=1e-4, **written)
    found = open_sequence("nerfstudio", tmp_path)
    depth, (rows, columns) = found.depth(0), np.indices((48, 64))
    known = (columns >= 2) & (columns <= 61) & (rows >= 2) & (rows <= 45)
    np.testing.assert_array_equal(depth.valid, known & ~((abs(columns - 33.5) < 4) & (abs(rows - 21.5) < 4)))
    np.testing.assert_allclose(depth.depth_m[depth.valid], (1 / inverse(columns, rows))[depth.valid], rtol=3e-5)
    assert "depth maps of 16x12 pixels are enlarged to the 64x48 of the images" in found.notes
    with pytest.raises(DataError, match=r"bad.png: size 15x12, expected the camera's 64x48"):
        found.depth(1)


@pytest.mark.parametrize("as_written", [lambda d: d, lambda d: np.rint(d).astype(np.uint16), lambda d: d[..., None]])
def test_smaller_numpy_depth_is_enlarged(tmp_path, simulated, intrinsics, as_written):
    """Float32, 16-bit integers, and with an axis of one channel."""
    save(tmp_path, simulated, NAMES[:2])
    np.save(tmp_path / "d.npy", as_written(np.full((24, 32), 2000.0, np.float32)))
    np.save(tmp_path / "bad.npy", np.ones((24, 31), np.float32))
    written = {"frames": [{"depth_file_path": "d.npy"}, {"depth_file_path": "bad.npy"}], **intrinsics}
    write_transforms(tmp_path, NAMES[:2], simulated.world_from_camera[:2], **written)
    found = open_sequence("nerfstudio", tmp_path)
    depth = found.depth(0)
    assert depth.valid[1:-1, 1:-1].all()
    np.testing.assert_allclose(depth.depth_m[depth.valid], 2.0, rtol=1e-6)
    assert "depth maps of 32x24 pixels are enlarged to the 64x48 of the images" in found.notes
    with pytest.raises(DataError, match=r"bad.npy: size 31x24, expected the camera's 64x48"):
        found.depth(1)


@pytest.mark.parametrize("shape", [(48, 64, 2), (3072,), (), (49, 64), (0, 0)])
def test_numpy_depth_of_another_shape_is_refused(tmp_path, simulated, intrinsics, shape):
    save(tmp_path, simulated, NAMES[:2])
    np.save(tmp_path / "d.npy", np.ones(shape, np.float32))
    written = {"frames": [{"depth_file_path": "d.npy"}, {}], **intrinsics}
    write_transforms(tmp_path, NAMES[:2], simulated.world_from_camera[:2], **written)
    with pytest.raises(DataError, match=r"d.npy: size .*, expected the camera's 64x48"):
        open_sequence("nerfstudio", tmp_path).depth(0)


def test_a_coefficient_that_is_null_says_nothing(tmp_path, simulated, intrinsics):
    save(tmp_path, simulated, NAMES[:2])
    plain = {"k1": None, "k2": None, "frames": [{"k1": None, "fl_x": None}, {"cx": None}], **intrinsics}
    write_transforms(tmp_path, NAMES[:2], simulated.world_from_camera[:2], **plain)
    assert open_sequence("nerfstudio", tmp_path).camera == simulated.camera


def test_the_original_layout_of_nerf(tmp_path, simulated):
    """An angle of view, names without an ending, and no size: the principal point is the centre of the image."""
    save(tmp_path, simulated, ["train/r_0.png", "train/r_1.png"])
    names = ["./train/r_0", "./train/r_1"]
    write_transforms(
        tmp_path, names, simulated.world_from_camera[:2], name="transforms_train.json", camera_angle_x=math.pi / 2
    )
    found = open_sequence("nerfstudio", tmp_path)
    camera = found.camera
    assert (camera.width, camera.height, camera.cx, camera.cy, camera.distortion) == (64, 48, 31.5, 23.5, ())
    assert (camera.fx, camera.fy) == pytest.approx((32.0, 32.0))
    np.testing.assert_array_equal(found.image(1), simulated.image(1))
    assert make_reader("nerfstudio", tmp_path, {"file": "transforms_train.json"}).sequences()
    with pytest.raises(DataError, match=r"no scene, expected folders with transforms_test.json"):
        make_reader("nerfstudio", tmp_path, {"file": "transforms_test.json"}).sequences()


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ({"camera_model": "PINHOLE"}, Camera(64, 48, 50.0, 52.0, 31.5, 23.5)),
        ({"k1": 0.0, "p1": 0.0}, Camera(64, 48, 50.0, 52.0, 31.5, 23.5)),
        (
            {"camera_model": "OPENCV", "k1": -0.1, "k2": 0.01, "p1": 0.001, "p2": 0.002},
            Camera(64, 48, 50.0, 52.0, 31.5, 23.5, (-0.1, 0.01, 0.001, 0.002)),
        ),
        (
            {"k1": -0.1, "k2": 0.01, "k3": 0.003, "p1": 0.001, "p2": 0.002},
            Camera(64, 48, 50.0, 52.0, 31.5, 23.5, (-0.1, 0.01, 0.001, 0.002, 0.003)),
        ),
        (
            {"camera_model": "OPENCV_FISHEYE", "k1": 0.1, "k2": 0.01, "k3": 0.003, "k4": 0.001},
            EquidistantCamera(64, 48, 50.0, 52.0, 31.5, 23.5, (0.1, 0.01, 0.003, 0.001)),
        ),
        ({"is_fisheye": True}, EquidistantCamera(64, 48, 50.0, 52.0, 31.5, 23.5)),
    ],
)
def test_camera_models(tmp_path, simulated, said, expected):
    save(tmp_path, simulated, NAMES)
    common = {"fl_x": 50.0, "fl_y": 52.0, "cx": 32.0, "cy": 24.0, "w": 64, "h": 48.0}
    write_transforms(tmp_path, NAMES, simulated.world_from_camera, **common, **said)
    assert open_sequence("nerfstudio", tmp_path).camera == expected


def test_intrinsics_of_single_frames(tmp_path, simulated, intrinsics):
    save(tmp_path, simulated, NAMES)
    further = [{}, {"fl_x": 70.0}, {}]
    write_transforms(tmp_path, NAMES, simulated.world_from_camera, frames=further, **intrinsics)
    found = open_sequence("nerfstudio", tmp_path)
    expected = [simulated.camera.fx, 70.0, simulated.camera.fx]
    assert [found.camera_at(index).fx for index in range(3)] == expected
    write_transforms(tmp_path, NAMES, simulated.world_from_camera, frames=[{}, {"w": 32, "h": 24}, {}], **intrinsics)
    with pytest.raises(
        DataError, match=r"images of several sizes: 64x48 \(.*\), 32x24 \(images/frame_2.png\), expected"
    ):
        open_sequence("nerfstudio", tmp_path)


@pytest.mark.parametrize(
    ("common", "frame", "message"),
    [
        ({"camera_model": "EQUIRECTANGULAR"}, {}, 'camera_model = "EQUIRECTANGULAR", expected one of PINHOLE'),
        ({"k4": 0.1}, {}, "k4 = 0.1, expected 0, since OpenCV's model has no such coefficient"),
        ({"fl_x": -1.0}, {}, "fl_x = -1.0, expected a finite number above 0"),
        ({"w": 64.5}, {}, "w = 64.5, expected a whole number"),
        ({"cx": "left"}, {}, 'cx = "left", expected a finite number'),
        ({}, {"file_path": 7}, "file_path = 7, expected the path of a file"),
        ({}, {"file_path": "images/frame_2.png"}, "file_path images/frame_2.png again, expected one frame for each"),
        ({}, {"transform_matrix": [[1.0] * 4] * 2}, "transform_matrix = .*, expected 12 or 16 numbers"),
        ({}, {"transform_matrix": [[2.0, 0, 0, 0], [0, 2.0, 0, 0], [0, 0, 2.0, 0]]}, "frame 0: a pose whose singular"),
    ],
)
def test_what_cannot_be_used_is_named(tmp_path, simulated, intrinsics, common, frame, message):
    save(tmp_path, simulated, NAMES)
    write_transforms(tmp_path, NAMES, simulated.world_from_camera, frames=[frame, {}, {}], **{**intrinsics, **common})
    with pytest.raises(DataError, match=message) as caught:
        open_sequence("nerfstudio", tmp_path)
    assert str(tmp_path / "transforms.json") in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "transforms.json:1: no JSON"),
        ("[]", "JSON, but no object"),
        ("{}", "no frames, expected a list of frames"),
        ('{"frames": [3]}', "frame 0: no object, expected file_path and transform_matrix"),
        ('{"frames": [{}]}', "frame 0: no file_path"),
        (json.dumps({"frames": [{"file_path": "a.png"}]}), "a.png: no such file, expected an image"),
    ],
)
def test_other_files(tmp_path, content, message):
    (tmp_path / "transforms.json").write_text(content)
    with pytest.raises(DataError, match=message):
        open_sequence("nerfstudio", tmp_path)


def test_listed_images_that_do_not_exist_are_a_caveat(tmp_path, simulated, intrinsics):
    """Instant NGP ignores them."""
    save(tmp_path, simulated, NAMES)
    gone = ["images/frame_0.png", *NAMES[:2], "images/frame_5.png", NAMES[2]]
    poses = simulated.world_from_camera[[0, 0, 1, 1, 2]]
    further = [{"transform_matrix": [[0.0] * 4] * 3}, {}, {}, {}, {"fl_x": 70.0}]
    write_transforms(tmp_path, gone, poses, frames=further, **intrinsics)
    found = open_sequence("nerfstudio", tmp_path)
    assert len(found) == 3
    np.testing.assert_allclose(found.world_from_camera, simulated.world_from_camera, atol=1e-12)
    assert [found.camera_at(index).fx for index in range(3)] == [simulated.camera.fx] * 2 + [70.0]
    np.testing.assert_array_equal(found.image(2), simulated.image(2))
    (caveat,) = found.caveats
    assert caveat.startswith("2 of 5 listed images do not exist (images/frame_0.png first); these frames are left out")
    assert caveat in found.notes
    report = check_reader(make_reader("nerfstudio", tmp_path), "x")
    assert f"{caveat}." in [item.text for item in report.every_item() if item.severity == "caveat"]
    (tmp_path / NAMES[0]).unlink()
    (tmp_path / NAMES[2]).unlink()
    assert len(open_sequence("nerfstudio", tmp_path)) == 1
    (tmp_path / NAMES[1]).unlink()
    with pytest.raises(DataError, match=r"images/frame_0.png: no such file, expected an image"):
        open_sequence("nerfstudio", tmp_path)


def test_all_listed_images_exist(tmp_path, simulated, intrinsics):
    save(tmp_path, simulated, NAMES)
    write_transforms(tmp_path, NAMES, simulated.world_from_camera, **intrinsics)
    found = open_sequence("nerfstudio", tmp_path)
    assert found.caveats == ()
    assert not any("exist" in note for note in found.notes)


def test_neither_a_focal_length_nor_an_angle(tmp_path, simulated):
    save(tmp_path, simulated, NAMES)
    write_transforms(tmp_path, NAMES, simulated.world_from_camera)
    with pytest.raises(DataError, match="no fl_x and no camera_angle_x, expected one of them"):
        open_sequence("nerfstudio", tmp_path)
    write_transforms(tmp_path, NAMES, simulated.world_from_camera, camera_angle_x=3.5)
    with pytest.raises(DataError, match=r"camera_angle_x = 3.5, expected an angle below pi, in radians"):
        open_sequence("nerfstudio", tmp_path)


def test_images_of_several_folders_are_those_of_several_cameras(tmp_path, simulated, intrinsics):
    """Left and right of a rig would be joined as one path, with jumps of the baseline."""
    names = [f"images/{side}/{index}.png" for index in range(2) for side in ("left", "right")]
    save(tmp_path, simulated, names[:3])
    save(tmp_path, simulated, names[3:])
    poses = simulated.world_from_camera[[0, 1, 2, 0]]
    write_transforms(tmp_path, names, poses, **intrinsics)
    found = r"transforms.json: images of several folders: images/left, images/right, expected one; choose it with "
    with pytest.raises(DataError, match=found + "--option folder=images/left"):
        open_sequence("nerfstudio", tmp_path)
    right = open_sequence("nerfstudio", tmp_path, folder="images/right")
    np.testing.assert_allclose(right.world_from_camera, poses[[1, 3]], atol=1e-12)
    with pytest.raises(UnknownNameError, match="unknown folder of images 'images/top'"):
        open_sequence("nerfstudio", tmp_path, folder="images/top")
