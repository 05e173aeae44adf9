import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.sequences.kitti_files import read_scan, write_scan


def test_reads_what_the_sensor_writes(tmp_path):
    """Four little-endian float32 a point."""
    path = tmp_path / "scan.bin"
    path.write_bytes(np.array([[10.5, -2.25, 0.125, 0.9], [3.0, 4.0, 5.0, 0.1]], "<f4").tobytes())
    points = read_scan(path)
    assert points.dtype == np.float64
    np.testing.assert_array_equal(points, [[10.5, -2.25, 0.125], [3.0, 4.0, 5.0]])
    write_scan(path, points)
    np.testing.assert_array_equal(read_scan(path), points)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (bytes(33), "33 bytes, expected a multiple of 16 (float32 x y z reflectance), not 0"),
        (b"", "0 bytes, expected a multiple of 16 (float32 x y z reflectance), not 0"),
        (np.array([1, np.nan, 3, 0], "<f4").tobytes(), "NaN or infinity among the points, expected finite x y z"),
        (None, "no such file, expected a Velodyne scan"),
    ],
)
def test_faults(tmp_path, data, message):
    path = tmp_path / "scan.bin"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(DataError) as caught:
        read_scan(path)
    assert str(caught.value) == f"{path}: {message}"
