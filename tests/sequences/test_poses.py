import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError, DataWarning
from tracknoise.sequences.poses import checked_poses, quaternion_poses, read_matrix, read_rows, require_poses

COLUMNS = "x y z qx qy qz qw"


def poses(count: int = 4) -> np.ndarray:
    made = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    made[:, :3, :3] = Rotation.random(count, rng=np.random.default_rng(0)).as_matrix()
    made[:, :3, 3] = np.arange(3 * count).reshape(count, 3)
    return made


PLACES = [f"pose{index}.txt" for index in range(4)]


def test_rows_with_their_lines(tmp_path):
    path = tmp_path / "pose.txt"
    path.write_text("# x y\n1 2\n\n  3\t4e-1 \n")
    rows, places = read_rows(path, "x y")
    assert rows.tolist() == [[1.0, 2.0], [3.0, 0.4]]
    assert places == [f"{path}:2", f"{path}:4"]


def test_a_byte_order_mark_is_skipped(tmp_path):
    (tmp_path / "pose.txt").write_bytes(b"\xef\xbb\xbf1 2\n")
    assert read_rows(tmp_path / "pose.txt", "x y")[0].tolist() == [[1.0, 2.0]]


def test_a_folder_is_no_file_of_rows(tmp_path):
    with pytest.raises(DataError, match=r"unreadable \(Is a directory\), expected text of rows of x y"):
        read_rows(tmp_path, "x y")


def test_an_empty_file_has_no_rows(tmp_path):
    (tmp_path / "pose.txt").touch()
    rows, places = read_rows(tmp_path / "pose.txt", COLUMNS)
    assert rows.shape == (0, 7)
    assert places == []


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1 2 3 0 0 0", "6 fields, expected 7 (x y z qx qy qz qw)"),
        ("1", "1 field, expected 7 (x y z qx qy qz qw)"),
        ("1 2 3 0 0 0 1 9", "8 fields, expected 7 (x y z qx qy qz qw)"),
        ("1 2 three 0 0 0 1", "'three', expected a number (x y z qx qy qz qw)"),
        ("1_0.0 2 3 0 0 0 1", "'1_0.0', expected a number (x y z qx qy qz qw)"),
        ("1 2 \u0663 0 0 0 1", "'\u0663', expected a number (x y z qx qy qz qw)"),
        ("1,2,3,0,0,0,1", "1 field, expected 7 (x y z qx qy qz qw)"),
    ],
)
def test_wrong_rows_name_their_line(tmp_path, line, message):
    path = tmp_path / "pose_left.txt"
    path.write_text("0 0 0 0 0 0 1\n" * 16 + line + "\n")
    with pytest.raises(DataError) as caught:
        read_rows(path, COLUMNS)
    assert str(caught.value) == f"{path}:17: {message}"


def test_missing_and_binary_pose_files(tmp_path):
    path = tmp_path / "pose.txt"
    with pytest.raises(DataError, match=r"pose\.txt: no such file, expected rows of x y"):
        read_rows(path, "x y")
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match=r"pose\.txt: not UTF-8 in line 1, expected text of rows of x y"):
        read_rows(path, "x y")


def test_matrix(tmp_path):
    path = tmp_path / "matrix.txt"
    path.write_text("1 2\n3 4\n")
    assert read_matrix(path, size=2).tolist() == [[1.0, 2.0], [3.0, 4.0]]
    path.write_text("1 2\n")
    with pytest.raises(DataError, match=r"matrix\.txt: 1 row, expected a 2x2 matrix"):
        read_matrix(path, size=2)
    path.write_text("1 2\n3\n")
    with pytest.raises(DataError, match=r"matrix\.txt:2: 1 field, expected 2"):
        read_matrix(path, size=2)


def test_quaternions_have_the_scalar_last():
    rotation = Rotation.from_rotvec([0.1, -0.2, 0.3])
    made = quaternion_poses(np.array([[1.0, 2.0, 3.0]]), rotation.as_quat()[None], PLACES[:1])
    np.testing.assert_allclose(made[0, :3, :3], rotation.as_matrix(), atol=1e-15)
    assert made[0, :3, 3].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ([0, 0, 0, 0, 0, 0, 0], "a quaternion of norm 0, expected norm 1"),
        ([0, 0, 0, 1e200, 1e200, 0, 1], "a quaternion of norm inf, expected norm 1"),
        ([0, 0, 0, 1, 1, 1, 1], "a quaternion of norm 2, expected norm 1"),
        ([0, np.nan, 0, 0, 0, 0, 1], "NaN or infinity in the pose, expected finite numbers"),
        ([0, 0, 0, 0, np.inf, 0, 1], "NaN or infinity in the pose, expected finite numbers"),
    ],
)
def test_impossible_quaternions(row, message):
    rows = np.array([[0, 0, 0, 0, 0, 0, 1], row], dtype=float)
    with pytest.raises(DataError) as caught:
        quaternion_poses(rows[:, :3], rows[:, 3:], ["pose.txt:1", "pose.txt:2"])
    assert str(caught.value) == f"pose.txt:2: {message}"


def test_good_poses_pass_without_a_note():
    checked, notes = checked_poses(poses(), PLACES)
    np.testing.assert_allclose(checked, poses(), atol=1e-14)
    assert notes == ()


def test_small_corrections_are_silent_and_make_the_rotation_exact():
    bent = poses()
    bent[2, 0, 0] += 5e-4
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checked, notes = checked_poses(bent, PLACES)
    assert notes == ()
    products = checked[:, :3, :3] @ np.swapaxes(checked[:, :3, :3], 1, 2)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-14)


def test_large_corrections_are_warned_of_with_their_size():
    bent = poses()
    bent[2, :3, :3] *= 1.01
    correction = np.abs(bent[2, :3, :3] - poses()[2, :3, :3]).max()
    with pytest.warns(DataWarning) as warned:
        checked, notes = checked_poses(bent, PLACES)
    assert len(notes) == 1
    assert notes[0] == str(warned[0].message)
    assert notes[0].startswith("pose2.txt: the rotation is not orthonormal; ")
    assert notes[0].endswith(f"up to {correction:.2g}")
    np.testing.assert_allclose(checked, poses(), atol=1e-14)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda pose: pose.__setitem__((0, 3), np.nan), "NaN or infinity in the pose, expected finite numbers"),
        (lambda pose: pose.__setitem__((1, 1), -np.inf), "NaN or infinity in the pose, expected finite numbers"),
        (lambda pose: pose[:3, :3].__imul__(2.0), "singular values differ from 1 by 1, expected a rotation"),
        (lambda pose: pose[:3, 2].__imul__(-1), "a pose with a reflection, expected a rotation"),
        (lambda pose: pose[:3, :3].fill(0.0), "singular values differ from 1 by 1, expected a rotation"),
        (
            lambda pose: pose.__setitem__((slice(3), slice(3)), -5e-324 * np.eye(3)[::-1]),
            "singular values differ from 1 by 1, expected a rotation",
        ),
        (lambda pose: pose.__setitem__((3, 0), 0.5), "a pose whose last row is 0.5 0 0 1, expected 0 0 0 1"),
        (
            lambda pose: pose.__setitem__(slice(None), pose.T.copy()),
            "a pose whose last row is 3 4 5 1, expected 0 0 0 1",
        ),
    ],
    ids=["nan", "infinity", "scale", "reflection", "zeros", "subnormal", "last row", "transposed"],
)
def test_what_is_no_pose_is_refused(spoil, message):
    spoilt = poses()
    spoil(spoilt[1])
    with pytest.raises(DataError) as caught:
        checked_poses(spoilt, PLACES)
    assert str(caught.value).startswith("pose1.txt: ")
    assert message in str(caught.value)


def test_no_poses():
    checked, notes = checked_poses(np.empty((0, 4, 4)), [])
    assert checked.shape == (0, 4, 4)
    assert notes == ()
    assert quaternion_poses(np.empty((0, 3)), np.empty((0, 4)), []).shape == (0, 4, 4)


def test_a_pose_for_every_image():
    require_poses("poses.txt", poses=5, images=5)
    require_poses("poses.txt", poses=9, images=5)
    with pytest.raises(DataError) as caught:
        require_poses("poses.txt", poses=4, images=5)
    assert str(caught.value) == "poses.txt: 4 poses, expected at least 5, one for each image"


def test_positions_that_are_no_metres_are_named():
    far = np.array([[0.0, 0.0, 0.0], [1e308, 0.0, 0.0]])
    with pytest.raises(DataError, match=r"b: a position of 1e\+308 0 0, expected metres, up to 1e\+09$"):
        quaternion_poses(far, np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)), ["a", "b"])
