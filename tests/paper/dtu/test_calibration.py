import cv2
import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError, DataWarning
from tracknoise.geometry.pose import invert, transform
from tracknoise.paper.dtu import read_calibration, write_mat


@pytest.fixture
def path(tmp_path):
    return tmp_path / "Calib_Results_11.mat"


def full_size(calibration):
    """As the data set has it: for images of 1600x1200, of which it says nothing, with a lens that distorts."""
    kept = {name: value for name, value in calibration.items() if name not in ("nx", "ny", "alpha_c")}
    intrinsics = {
        "fc": np.array([[2898.5], [2902.25]]),
        "cc": np.array([[811.5], [590.75]]),
        "kc": np.array([[-0.12], [0.21], [0.0011], [-0.0007], [0.03]]),
    }
    return {**kept, **intrinsics}


def test_points_project_as_with_opencv(path, calibration) -> None:
    """World to camera, first pixel's centre 0, coefficients in OpenCV's order, and each position in its place."""
    variables = full_size(calibration)
    rng = np.random.default_rng(0)
    for position in range(1, 50):
        variables[f"Rc_{position}"] = Rotation.random(rng=rng).as_matrix()
        variables[f"Tc_{position}"] = rng.normal(size=(3, 1))
    write_mat(path, variables)
    read = read_calibration(path)
    assert (read.camera.width, read.camera.height) == (1600, 1200)
    points_camera = rng.uniform((-0.1, -0.1, 0.5), (0.1, 0.1, 0.8), (20, 3))
    for index, pose in enumerate(read.world_from_camera):
        rotation, shift = variables[f"Rc_{index + 1}"], variables[f"Tc_{index + 1}"]
        points_world = (points_camera - shift.T) @ rotation
        matrix = np.array([[2898.5, 0, 811.5], [0, 2902.25, 590.75], [0, 0, 1.0]])
        theirs, _ = cv2.projectPoints(points_world, rotation, shift, matrix, variables["kc"])
        ours = read.camera.project(transform(invert(pose), points_world))
        np.testing.assert_allclose(ours, theirs[:, 0], atol=1e-9)


def test_a_lens_that_does_not_distort_has_no_coefficients(path, calibration) -> None:
    write_mat(path, calibration)
    read = read_calibration(path)
    assert read.camera.distortion == ()
    assert read.notes == ()
    assert read.world_from_camera.shape == (49, 4, 4)


@pytest.mark.parametrize("name", ["fc", "cc", "kc", "Rc_1", "Rc_49", "Tc_30"])
def test_a_missing_key_is_named(path, calibration, name) -> None:
    del calibration[name]
    write_mat(path, calibration)
    with pytest.raises(DataError) as caught:
        read_calibration(path)
    count = {"fc": 2, "cc": 2, "kc": 5, "R": 9, "T": 3}[name if name[0] not in "RT" else name[0]]
    assert str(caught.value) == f"{path}: no {name}, expected {name}: {count} finite numbers"


def test_positions_of_other_arcs_are_not_needed_nor_looked_at(path, calibration) -> None:
    write_mat(path, {**calibration, "Rc_50": np.full((3, 3), np.nan)})
    assert len(read_calibration(path).world_from_camera) == 49


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("fc", np.ones(3), "fc of 3 numbers, expected 2 finite numbers"),
        ("kc", np.zeros((4, 1)), "kc of 4 numbers, expected 5 finite numbers"),
        ("cc", np.array([1.0, np.nan]), "NaN or infinity in cc, expected 2 finite numbers"),
        ("cc", "words", "cc that is not an array of real numbers, expected cc: 2 finite numbers"),
        ("cc", np.array([40.0, 12.0]), "cc = 40, 12, expected a principal point within the image of 32x24"),
        ("fc", np.array([-50.0, 50.0]), "fc = -50, 50, expected focal lengths above 0"),
        ("alpha_c", 0.01, "a skew of alpha_c = 0.01, expected 0: pixels with right angles"),
        ("nx", 33.0, "nx = 33, ny = 24, expected even numbers of pixels"),
        ("Rc_7", np.zeros(9), "Rc_7 of shape 1x9, expected a 3x3 matrix"),
        ("kc", np.array([-500.0, 0, 0, 0, 0]), "kc that cannot be inverted over the whole image"),
    ],
)
def test_wrong_numbers_are_one_clear_line(path, calibration, name, value, message) -> None:
    write_mat(path, {**calibration, name: value})
    with pytest.raises(DataError) as caught:
        read_calibration(path)
    assert str(caught.value).startswith(f"{path}: {message}")


@pytest.mark.parametrize(
    ("rotation", "message"),
    [
        (np.diag([1.0, 1.0, -1.0]), "Rc_7: a pose with a reflection, expected a rotation"),
        (2.0 * np.eye(3), "Rc_7: a pose whose singular values differ from 1 by 1"),
        (np.full((3, 3), np.inf), "NaN or infinity in Rc_7"),
    ],
)
def test_a_rotation_that_is_none_is_named(path, calibration, rotation, message) -> None:
    write_mat(path, {**calibration, "Rc_7": rotation})
    with pytest.raises(DataError) as caught:
        read_calibration(path)
    assert str(caught.value).startswith(f"{path}: {message}")


def test_a_rotation_that_is_not_quite_one_is_corrected_and_noted(path, calibration) -> None:
    write_mat(path, {**calibration, "Rc_7": 1.002 * calibration["Rc_7"]})
    with pytest.warns(DataWarning, match="Rc_7: the rotation is not orthonormal"):
        notes = read_calibration(path).notes
    assert len(notes) == 1


@pytest.mark.parametrize("content", [b"", b"nothing of the kind", b"\x00" * 500])
def test_what_is_no_matlab_file_is_refused(path, content) -> None:
    path.write_bytes(content)
    with pytest.raises(DataError) as caught:
        read_calibration(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_file_of_version_7_3_is_refused(path) -> None:
    remark = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + b"\x00" * 8 + b"\x00\x02IM"
    path.write_bytes(remark + b"\x00" * 384 + b"\x89HDF\r\n\x1a\n" + b"\x00" * 100)
    with pytest.raises(DataError, match=r"a MATLAB 7\.3 file, expected an earlier version"):
        read_calibration(path)


def test_a_missing_file(path) -> None:
    with pytest.raises(DataError, match=r"Calib_Results_11\.mat: no such file, expected a MATLAB file"):
        read_calibration(path)
    path.mkdir()
    with pytest.raises(DataError, match=r"Calib_Results_11\.mat: unreadable"):
        read_calibration(path)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("compressed", [False, True])
def test_a_truncated_file_is_refused(path, calibration, share, compressed) -> None:
    savemat(path, calibration, do_compression=compressed)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(DataError) as caught:
        read_calibration(path)
    assert "\n" not in str(caught.value)
