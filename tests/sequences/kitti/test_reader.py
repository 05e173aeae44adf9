import os
import pickle

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.geometry.depth import sample as read_depth
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.kitti import Kitti
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.sequence import FilteringReader, TruthKind
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth_registry import make_truth

NAME = "2011_09_26_drive_0001_sync"
POSE = "1 0 0 {} 0 1 0 0 0 0 1 0\n"


def opened(root, **options):
    return Kitti(root, **options).open(SequenceId("kitti", NAME))


def instead_of_oxts(drive, rows: int) -> None:
    for number in range(3):
        drive.oxts(number).unlink()
    drive.oxts(0).parent.rmdir()
    drive.oxts(0).parent.parent.rmdir()
    drive.poses.write_text("".join(POSE.format(0.5 * row) for row in range(rows)))


def test_reads_images_poses_and_depth(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    drive.depth(1).unlink()
    drive.depth(2).unlink()
    drive.scan(2).unlink()
    sequence = opened(tmp_path, radius_px=1.5)
    assert Kitti(tmp_path).sequences() == [sequence.id] == [SequenceId("kitti", NAME)]
    assert sequence.truths == (TruthKind.birth,)
    assert sequence.notes == (
        "frames with depth from depth-completion maps: 1, from projected Velodyne scans: 1",
        "1 of 3 frames has no depth",
    )
    assert sequence.image(2)[0, 0] == 20
    np.testing.assert_allclose(np.diff(sequence.world_from_camera[:, :3, 3], axis=0), [(0, 0.5, 0)] * 2, atol=1e-6)
    mapped, scanned, missing = map(sequence.depth, range(3))
    assert mapped.radius_px == scanned.radius_px == 1.5
    assert missing is None
    assert mapped.valid.sum() == 32 * 24 - 1
    assert mapped.depth_m[5, 5] == 1.0
    assert scanned.valid.sum() == 1
    assert len(pickle.loads(pickle.dumps(sequence))) == 3


def test_a_scan_s_point_by_hand(tmp_path, write_drive):
    """2 m before the Velodyne; the mount of the simulated car in the formula of the data set's description."""
    drive = write_drive(tmp_path)
    drive.depth(0).unlink()
    numbers = {}
    for name in ("cam_to_cam", "velo_to_cam"):
        for line in (tmp_path / f"calib_{name}.txt").read_text().splitlines():
            key, _, rest = line.partition(": ")
            numbers[key] = rest.split()
    P, rectify, velo = (np.array(numbers[key], float) for key in ("P_rect_02", "R_rect_00", "R"))
    T = np.array(numbers["T"], float)
    on_image = P.reshape(3, 4) @ np.append(rectify.reshape(3, 3) @ (velo.reshape(3, 3) @ (2.0, 0.0, 0.0) + T), 1.0)
    column, row = np.rint(on_image[:2] / on_image[2]).astype(int)
    depth = opened(tmp_path).depth(0)
    assert np.argwhere(depth.valid).tolist() == [[row, column]]
    np.testing.assert_allclose(depth.depth_m[row, column], on_image[2], rtol=1e-12)


def test_poses_from_their_own_file(tmp_path, write_drive):
    instead_of_oxts(write_drive(tmp_path), rows=3)
    (tmp_path / "calib_imu_to_velo.txt").unlink()  # not needed then
    sequence = opened(tmp_path)
    assert sequence.notes[0] == "there is no oxts: poses come from poses_image_02.txt"
    np.testing.assert_array_equal(sequence.world_from_camera[:, 0, 3], (0.0, 0.5, 1.0))


def test_there_is_a_pose_for_each_image(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    instead_of_oxts(drive, 2)
    with pytest.raises(DataError) as caught:
        opened(tmp_path)
    assert str(caught.value) == f"{drive.poses}: 2 poses, expected at least 3, one for each image"


def test_poses_may_outnumber_images(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    instead_of_oxts(drive, 4)
    sequence = opened(tmp_path)
    np.testing.assert_array_equal(sequence.world_from_camera[:, 0, 3], (0.0, 0.5, 1.0))
    assert f"{drive.poses}: 4 poses for 3 images: only the first 3 are used" in sequence.notes


def test_neither_oxts_nor_poses(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    instead_of_oxts(drive, 3)
    drive.poses.unlink()
    with pytest.raises(DataError) as caught:
        opened(tmp_path)
    expected = "one of them, for the poses of the camera"
    assert str(caught.value) == f"{drive.folder}: neither oxts nor poses_image_02.txt, expected {expected}"


def test_a_missing_record_is_named(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    drive.oxts(1).unlink()
    with pytest.raises(DataError, match=r"0000000001\.txt: no such file, expected rows of lat lon alt roll pitch yaw"):
        opened(tmp_path)


def test_images_have_the_calibrated_size(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    cv2.imwrite(str(drive.image(0)), np.zeros((24, 31), np.uint8))
    with pytest.raises(DataError) as caught:
        opened(tmp_path)
    assert str(caught.value) == f"{drive.image(0)}: size 31x24, expected the 32x24 of the calibration"


def test_damaged_depth_is_named(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    os.truncate(drive.depth(0), 40)
    drive.depth(1).unlink()
    os.truncate(drive.scan(1), 15)
    sequence = opened(tmp_path)
    with pytest.raises(DataError, match=r"0000000000\.png: truncated or damaged image of 40 bytes"):
        sequence.depth(0)
    with pytest.raises(DataError, match=r"0000000001\.bin: 15 bytes, expected a multiple of 16"):
        sequence.depth(1)


def test_drives_that_stand_still_are_left_out(tmp_path, write_drive):
    write_drive(tmp_path, number=1, frames=12, step_m=0.019)
    write_drive(tmp_path, number=2, frames=12, step_m=0.021)
    reader = Kitti(tmp_path)
    assert isinstance(reader, FilteringReader)
    assert [listed.scene for listed in reader.sequences()] == ["2011_09_26_drive_0002_sync"]
    reason = "stands still in frames 1 to 11, each less than 0.02 m from the one before"
    assert reader.excluded_scenes() == {NAME: reason}
    with pytest.raises(
        DataError, match=f"{NAME}: {reason}, expected a drive without still stretches, or keep_still = true"
    ):
        opened(tmp_path)
    for kept in (Kitti(tmp_path, keep_still=True), Kitti(tmp_path, still_m=0.01), Kitti(tmp_path, still_frames=12)):
        assert len(kept.sequences()) == 2
        assert kept.excluded_scenes() == {}
        assert len(kept.open(SequenceId("kitti", NAME))) == 12


def test_when_all_are_left_out(tmp_path, write_drive):
    write_drive(tmp_path, frames=12, step_m=0.0)
    with pytest.raises(DataError) as caught:
        Kitti(tmp_path).sequences()
    found = "1 drive, none without a still stretch"
    assert str(caught.value) == f"{tmp_path}: {found}, expected a drive without still stretches, or keep_still = true"


def test_a_damaged_drive_is_listed_and_fails_when_opened(tmp_path, write_drive):
    drive = write_drive(tmp_path)
    drive.oxts(1).write_text("1 2 3")
    assert [listed.scene for listed in Kitti(tmp_path).sequences()] == [NAME]
    with pytest.raises(DataError, match=r"0000000001\.txt:1: 3 fields, expected 30"):
        opened(tmp_path)


def test_unknown_scenes_and_lightings(tmp_path, write_drive):
    write_drive(tmp_path)
    with pytest.raises(UnknownNameError, match="unknown scene '0002'"):
        Kitti(tmp_path).open(SequenceId("kitti", "0002"))
    with pytest.raises(UnknownNameError, match="unknown lighting 'dark'"):
        Kitti(tmp_path).open(SequenceId("kitti", NAME, "dark"))


@pytest.mark.parametrize(
    "options",
    [
        {"radius_px": -1.0},
        {"radius_px": "1"},
        {"still_m": float("nan")},
        {"still_frames": 0},
        {"still_frames": 2.5},
        {"keep_still": 1},
    ],
)
def test_impossible_options(tmp_path, options):
    (name,) = options
    with pytest.raises(SettingsError, match=f"reader 'kitti': {name}.* expected "):
        make_reader("kitti", tmp_path, options)


def test_the_real_sample(sample):
    root = sample("kitti")
    reader = Kitti(root)
    (listed,) = reader.sequences()
    assert reader.excluded_scenes() == {}
    sequence = reader.open(listed)
    assert len(sequence) == 40
    assert sequence.camera.cx == 609.5593
    assert sequence.image(39).shape == (375, 1242)
    assert sequence.notes == (
        "there is no oxts: poses come from poses_image_02.txt",
        "frames with depth from depth-completion maps: 40, from projected Velodyne scans: 0",
    )


def test_the_real_sample_s_maps_are_its_projected_scans(sample, tmp_path):
    """They were made by other hands, from the same scans: each pixel agrees to the maps' last digit."""
    folder = sample("kitti") / "2011_09_26"
    for path in folder.glob("calib*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (drive,) = folder.glob("*_sync")
    below = tmp_path / drive.name
    (below / "image_02/data").mkdir(parents=True)
    for number in range(3):
        name = f"{number:010d}.png"
        (below / "image_02/data" / name).symlink_to(drive / "image_02/data" / name)
    (below / "velodyne_points").symlink_to(drive / "velodyne_points")
    (below / "poses_image_02.txt").write_text("".join(POSE.format(row) for row in range(3)))
    scanned, mapped = opened_only(tmp_path), opened_only(sample("kitti"))
    for index in range(3):
        ours, theirs = scanned.depth(index), mapped.depth(index)
        np.testing.assert_array_equal(ours.valid, theirs.valid)
        assert np.abs(ours.depth_m - theirs.depth_m)[ours.valid].max() < 0.51 / 256


def test_the_real_sample_s_depth_agrees_with_that_of_the_next_frame(sample):
    """Poses and calibration are right: scans agree to half a percent, though some cars of this scene move."""
    sequence = opened_only(sample("kitti"))
    truth, relative = make_truth(sequence), []
    for index in range(0, 39, 6):
        v, u = np.nonzero(sequence.depth(index).valid)
        points, status = truth.anchor(index, np.stack([u, v], axis=-1).astype(np.float64))
        points = points[status == TruthStatus.valid]
        measured = read_depth(sequence.depth(index + 1), truth.project(index + 1, points), sequence.camera)
        moved_m = transform(invert(sequence.world_from_camera[index + 1]), points)[:, 2]
        relative.append(np.abs(moved_m / measured.depth_m - 1.0)[measured.valid])
    assert np.median(np.concatenate(relative)) < 0.006
    assert len(np.concatenate(relative)) > 10_000


def opened_only(root):
    reader = Kitti(root)
    (listed,) = reader.sequences()
    return reader.open(listed)


def test_camera_3_is_the_second_one(tmp_path, write_drive):
    day = tmp_path / "2011_09_26"
    drive = write_drive(day)
    assert open_sequence("kitti", tmp_path).second is None
    for index in range(3):
        path = drive.folder / "image_03" / "data" / drive.image(index).name
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), np.full((24, 32), 5 * index, np.uint8))
    assert open_sequence("kitti", tmp_path).second is None  # its calibration is missing
    calibration = day / "calib_cam_to_cam.txt"
    text = calibration.read_text()
    (line,) = (line for line in text.splitlines() if line.startswith("P_rect_02:"))
    numbers = np.array(line.split()[1:], float).reshape(3, 4)
    numbers[0, 3] -= 0.54 * numbers[0, 0]
    calibration.write_text(text + f"P_rect_03: {' '.join(map(repr, numbers.ravel().tolist()))}\n")
    second = open_sequence("kitti", tmp_path).second
    expected = np.eye(4)
    expected[0, 3] = 0.54
    np.testing.assert_allclose(second.first_from_second, expected, atol=1e-9)
    assert second.images(2).max() == 10
