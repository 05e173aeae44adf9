from pathlib import Path

import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.sequences.kitti import Kitti
from tracknoise.sequences.kitti_files import pose_time_notes, read_timestamps

LINES = [
    "2011-09-26 23:59:59.900000000",
    "2011-09-26 23:59:59.999999999",
    "2011-09-27 00:00:00.103400001",
    "2011-09-27 00:00:00.206800000",
]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "timestamps.txt"
    path.write_text("\n".join(LINES) + "\n")
    return path


def test_times_count_from_the_first_frame_to_the_nanosecond(file):
    times, notes = read_timestamps(file, range(1, 4))
    np.testing.assert_allclose(times, [0.0, 0.103400002, 0.206800001], rtol=0, atol=1e-15)
    assert times.dtype == np.float64
    assert notes == ()


def test_without_a_file_times_are_unknown(tmp_path):
    assert read_timestamps(tmp_path / "timestamps.txt", range(3)) == (None, ())


def test_times_that_do_not_increase_are_unknown_and_said_to_be(file):
    file.write_text("\n".join([*LINES[:2], LINES[0], *LINES[3:]]))
    times, (note,) = read_timestamps(file, range(4))
    assert times is None
    assert note == f"{file}: the times do not increase, so they are not used"


@pytest.mark.parametrize("line", ["soon", "", "2011-09-26 25:00:00"])
def test_a_line_that_is_no_time_is_named(file, line):
    file.write_text("\n".join([LINES[0], line, *LINES[2:]]))
    with pytest.raises(DataError, match=f":2: '{line}', expected a time such as 2011-09-26 13:02:25"):
        read_timestamps(file, range(3))


def test_too_few_lines_are_counted(file):
    with pytest.raises(DataError, match="4 lines, expected at least 5, one for each image"):
        read_timestamps(file, range(5))


def test_the_reader_has_them(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    drive.timestamps.write_text("\n".join(LINES[:3]))
    reader = Kitti(tmp_path)
    (listed,) = reader.sequences()
    np.testing.assert_allclose(reader.open(listed).timestamps_s, [0.0, 0.099999999, 0.203400001], atol=1e-15)


@pytest.mark.parametrize(
    "line", ["2011-09-26 13:02:25Z", "2011-13-26 13:02:25", "9999-01-01 00:00:00", "2011-09-26 1:1"]
)
def test_times_that_cannot_be_are_named(tmp_path, line):
    (tmp_path / "t.txt").write_text(f"2011-09-26 13:02:25.0\n{line}\n")
    with pytest.raises(DataError, match=r"t.txt:2: .*, expected a time such as"):
        read_timestamps(tmp_path / "t.txt", range(2))


def test_times_between_images_and_poses_are_stated(file, tmp_path):
    later = [line[:-9] + f"{int(line[-9:]) - 1_500_000 * (row + 1):09d}" for row, line in enumerate(LINES[:3])]
    (tmp_path / "oxts.txt").write_text("\n".join(later))
    (note,) = pose_time_notes(file, tmp_path / "oxts.txt", range(3))
    assert "3.0 ms from it in the median, 4.5 ms at most" in note


@pytest.mark.parametrize("content", [None, "", "yesterday\n" * 4])
def test_nothing_is_said_where_times_of_poses_cannot_be_read(file, tmp_path, content):
    if content is not None:
        (tmp_path / "oxts.txt").write_text(content)
    assert pose_time_notes(file, tmp_path / "oxts.txt", range(4)) == ()
