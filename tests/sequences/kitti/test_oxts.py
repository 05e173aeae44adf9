import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.sequences.kitti_files import COLUMNS, poses_of_records, read_records, records_of_poses, write_record

NUMBERS = " ".join(["49.01", "8.43", "112.8", "0.02", "-0.01", "1.57"] + ["0"] * 24)


def pose_of(*record: float) -> np.ndarray:
    return poses_of_records(np.array([(49.0, 8.0, 100.0, 0, 0, 0), record]))[1]


def test_places_by_hand():
    """A degree of latitude is 111319.49 m in the projection's units, one of longitude at 49 degrees cos(49) of that."""
    np.testing.assert_allclose(pose_of(49.00001, 8.0, 100.0, 0, 0, 0)[:3, 3], (0, 1.1131949, 0), atol=1e-6)
    np.testing.assert_allclose(pose_of(49.0, 8.00001, 103.0, 0, 0, 0)[:3, 3], (0.7303215, 0, 3), atol=1e-6)


@pytest.mark.parametrize(
    ("angles", "forward", "left", "up"),
    [
        ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),  # yaw 0 is east
        ((0, 0, np.pi / 2), (0, 1, 0), (-1, 0, 0), (0, 0, 1)),  # counter-clockwise: north
        ((0, np.pi / 6, 0), (np.sqrt(0.75), 0, -0.5), (0, 1, 0), (0.5, 0, np.sqrt(0.75))),  # nose down
        ((np.pi / 6, 0, 0), (1, 0, 0), (0, np.sqrt(0.75), 0.5), (0, -0.5, np.sqrt(0.75))),  # left side up
        ((np.pi / 6, 0, np.pi / 2), (0, 1, 0), (-np.sqrt(0.75), 0, 0.5), (0.5, 0, np.sqrt(0.75))),  # roll, then yaw
    ],
)
def test_attitudes_by_hand(angles, forward, left, up):
    np.testing.assert_allclose(pose_of(49.0, 8.0, 100.0, *angles)[:3, :3].T, (forward, left, up), atol=1e-15)


@given(
    st.lists(st.tuples(*[st.floats(-3e3, 3e3)] * 3), min_size=2, max_size=6),
    st.floats(-70, 70),
    st.integers(0, 2**32 - 1),
)
def test_there_and_back(places, latitude, seed):
    poses = np.broadcast_to(np.eye(4), (len(places), 4, 4)).copy()
    poses[:, :3, 3] = places
    poses[:, :3, :3] = Rotation.random(len(places), rng=np.random.default_rng(seed)).as_matrix()
    again = poses_of_records(records_of_poses(poses, start=(latitude, 8.43, 115.0)))
    np.testing.assert_allclose(again[:, :3, :3], poses[:, :3, :3], atol=1e-7)
    np.testing.assert_allclose(again[:, :3, 3], poses[:, :3, 3] - poses[0, :3, 3], atol=2e-8)


def test_files_keep_all_digits(tmp_path):
    record = np.array([49.011212804408, -8.4228850417969, 112.83492279053, 1e-17, -np.pi, 0.1 + 0.2])
    write_record(tmp_path / "0.txt", record)
    assert len((tmp_path / "0.txt").read_text().split()) == len(COLUMNS.split()) == 30
    np.testing.assert_array_equal(read_records([tmp_path / "0.txt"] * 2), [record, record])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (NUMBERS.rpartition(" ")[0], f":1: 29 fields, expected 30 ({COLUMNS})"),
        (NUMBERS.replace("8.43", "east"), f":1: 'east', expected a number ({COLUMNS})"),
        (f"{NUMBERS}\n{NUMBERS}", ": 2 rows, expected one"),
        ("", ": 0 rows, expected one"),
        (NUMBERS.replace("112.8", "nan"), ": NaN or infinity, expected finite numbers"),
        (NUMBERS.replace("49.01", "4901"), ": latitude 4901 and longitude 8.43, expected degrees on the globe"),
        (NUMBERS.replace("112.8", "1e308"), ": a position of 1e+308, expected metres, up to 1e+09"),
        (NUMBERS.replace("1.57", "90"), ": roll 0.02, pitch -0.01 and yaw 90, expected radians"),
    ],
)
def test_faults(tmp_path, text, message):
    path = tmp_path / "0000000007.txt"
    path.write_text(text)
    with pytest.raises(DataError) as caught:
        read_records([path])
    assert str(caught.value) == f"{path}{message}"
