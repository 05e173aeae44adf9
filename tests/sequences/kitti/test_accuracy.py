"""What OXTS files state about their own errors."""

import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.geometry.accuracy import AccuracyKind, PoseAccuracy
from tracknoise.sequences.kitti import Kitti
from tracknoise.sequences.kitti_files import COLUMNS
from tracknoise.sequences.sequence import accuracy_of

FIELDS = COLUMNS.split()


def state(drive, accuracies: list[tuple[str, str]]) -> None:
    """Writes accuracies of position and velocity into the records of a drive."""
    for index, (position, velocity) in enumerate(accuracies):
        record = drive.oxts(index).read_text().split()
        record[FIELDS.index("pos_accuracy")], record[FIELDS.index("vel_accuracy")] = position, velocity
        drive.oxts(index).write_text(" ".join(record) + "\n")


def opened(root):
    reader = Kitti(root)
    return reader.open(reader.sequences()[0])


def test_medians_over_frames_are_stated(tmp_path, write_drive):
    state(write_drive(tmp_path), [("0.05", "0.02"), ("0.11", "0.03"), ("0.08", "0.08")])
    sequence = opened(tmp_path)
    assert sequence.pose_accuracy == PoseAccuracy(0.08, None)
    found = accuracy_of(sequence)
    assert found.translation_m_per_frame == pytest.approx(0.03 * 0.1)
    assert (found.translation_white_m, found.rotation_white_deg, found.rotation_deg_per_frame) == (None, None, None)
    assert found.kind is AccuracyKind.stated
    assert any("0.08 m in position and 0.03 m/s in velocity (medians of 3 of 3 frames)" in n for n in sequence.notes)


def test_the_error_between_frames_is_that_of_the_velocity_over_their_time(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    state(drive, [("0.05", "0.04")] * 3)
    stamps = [f"2011-09-26 13:02:25.{tenths}50000000" for tenths in (1, 3, 5)]
    drive.timestamps.write_text("\n".join(stamps) + "\n")
    sequence = opened(tmp_path)
    np.testing.assert_allclose(np.diff(sequence.timestamps_s), 0.2)
    assert accuracy_of(sequence).translation_m_per_frame == pytest.approx(0.04 * 0.2)


@pytest.mark.parametrize("nothing", [("0", "0"), ("nan", "0.02"), ("-1", "0.02")])
def test_frames_that_state_nothing_do_not_count(tmp_path, write_drive, nothing):
    drive = write_drive(tmp_path)
    state(drive, [nothing, ("0.07", "0.05"), nothing])
    assert opened(tmp_path).pose_accuracy == PoseAccuracy(0.07, None)
    state(drive, [nothing] * 3)
    sequence = opened(tmp_path)
    assert sequence.pose_accuracy is None
    assert sequence.truth_accuracy is None
    assert not any("OXTS states" in note for note in sequence.notes)


def test_simulated_drives_state_nothing(tmp_path, write_drive):
    write_drive(tmp_path)
    assert opened(tmp_path).pose_accuracy is None


def test_a_damaged_record_is_named(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    drive.oxts(1).write_text("49 8 0 0 0 0\n")
    with pytest.raises(DataError, match=r"0000000001\.txt:1: 6 fields, expected 30"):
        opened(tmp_path)
