import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.paper.dtu import read_scan, write_mat

NEAR = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
FAR = np.array([[7.0], [8.0], [9.0]])


@pytest.fixture
def path(tmp_path):
    return tmp_path / "Clean_Reconstruction_01.mat"


def test_points_are_columns_of_both_parts(path) -> None:
    colours = np.full((3, 2), 200.0)
    write_mat(path, {"pts3D_near": np.concatenate([NEAR, colours]), "pts3D_far": FAR.astype(np.float32)})
    scan, notes = read_scan(path)
    np.testing.assert_array_equal(scan.points_world, [[1, 3, 5], [2, 4, 6], [7, 8, 9]])
    assert scan.points_world.dtype == np.float64
    assert scan.key_frame == 24
    assert notes == ()


def test_points_that_are_not_finite_are_ignored_and_counted(path) -> None:
    broken = np.array([[np.nan, 1.0, np.inf], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    write_mat(path, {"pts3D_near": NEAR, "pts3D_far": broken})
    scan, notes = read_scan(path)
    assert len(scan.points_world) == 3
    assert notes == ("Clean_Reconstruction_01.mat: 2 of 5 scan points are not finite and are ignored",)


def test_one_part_may_be_empty(path) -> None:
    write_mat(path, {"pts3D_near": NEAR, "pts3D_far": np.empty((0, 0))})
    assert len(read_scan(path)[0].points_world) == 2


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"pts3D_near": np.empty((3, 0)), "pts3D_far": np.empty((0, 0))}, "a scan without points"),
        ({"pts3D_near": np.full((3, 4), np.nan), "pts3D_far": np.empty((0, 0))}, "a scan without points"),
        ({"pts3D_near": NEAR}, "no pts3D_far, expected pts3D_far: numbers"),
        ({"pts3D_far": NEAR}, "no pts3D_near, expected pts3D_near: numbers"),
        ({"pts3D_near": NEAR.T, "pts3D_far": NEAR.T}, "pts3D_near of shape 2x3, expected a column a point"),
        ({"pts3D_near": "points", "pts3D_far": NEAR}, "pts3D_near that is not an array of real numbers"),
    ],
)
def test_wrong_scans_are_one_clear_line(path, variables, message) -> None:
    write_mat(path, variables)
    with pytest.raises(DataError) as caught:
        read_scan(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


def test_a_missing_scan(path) -> None:
    with pytest.raises(DataError, match=r"Clean_Reconstruction_01\.mat: no such file, expected a MATLAB file"):
        read_scan(path)
