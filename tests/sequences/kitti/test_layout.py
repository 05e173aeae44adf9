import shutil
from pathlib import Path

import pytest

from tracknoise.exceptions import DataError
from tracknoise.sequences.kitti_files import Drive, find_drives, find_frames


def test_finds_drives_from_any_level(tmp_path, write_drive):
    first = write_drive(tmp_path / "2011_09_26", number=1)
    other = write_drive(tmp_path / "2011_09_28", number=2)
    other.folder.rename(other.folder.with_name("2011_09_28_drive_0002_sync"))
    name = "2011_09_26_drive_0001_sync"
    assert list(find_drives(tmp_path, None)) == [name, "2011_09_28_drive_0002_sync"]
    assert list(find_drives(tmp_path / "2011_09_26", None)) == [name]
    found = find_drives(first.folder, None)[name]
    assert found.folder == first.folder
    assert found.day == tmp_path / "2011_09_26"


def test_the_day_of_a_drive_that_one_stands_in(tmp_path, write_drive, monkeypatch):
    drive = write_drive(tmp_path / "2011_09_26")
    monkeypatch.chdir(drive.folder)
    (found,) = find_drives(Path(), None).values()
    assert found.day == tmp_path / "2011_09_26"


@pytest.mark.parametrize("split", ["train", "val", ""])
def test_maps_of_the_depth_completion_release(tmp_path, write_drive, split):
    drive = write_drive(tmp_path / "raw/2011_09_26")
    write_drive(tmp_path / "raw/2011_09_26", number=2)
    release = tmp_path / "depth"
    (release / split).mkdir(parents=True)
    shutil.move(drive.folder / "proj_depth", release / split / drive.folder.name / "proj_depth")
    one, two = find_drives(tmp_path / "raw", release).values()
    assert find_frames(one).depths == tuple(
        release / split / drive.folder.name / f"proj_depth/groundtruth/image_02/{number:010d}.png"
        for number in range(3)
    )
    assert find_frames(two).depths == tuple(map(two.scan, range(3)))  # its own maps are not looked at


def test_a_release_in_the_data_s_own_folder_is_no_drive(tmp_path, write_drive):
    drive = write_drive(tmp_path / "2011_09_26")
    shutil.move(drive.folder / "proj_depth", tmp_path / "train" / drive.folder.name / "proj_depth")
    (found,) = find_drives(tmp_path, tmp_path).values()
    assert found.folder == drive.folder
    assert found.depth_folder.exists()


def test_a_release_without_any_of_the_drives(tmp_path, write_drive):
    write_drive(tmp_path / "raw/2011_09_26")
    (tmp_path / "depth").mkdir()
    with pytest.raises(DataError) as caught:
        find_drives(tmp_path / "raw", tmp_path / "depth")
    assert str(caught.value) == (
        f"{tmp_path / 'depth'}: no maps of the 1 drive in {tmp_path / 'raw'}, "
        "expected folders such as train/2011_09_26_drive_0001_sync/proj_depth/groundtruth/image_02"
    )
    with pytest.raises(DataError, match="nowhere: no such directory"):
        find_drives(tmp_path / "raw", tmp_path / "nowhere")


def test_no_drive_and_a_drive_twice(tmp_path, write_drive):
    with pytest.raises(
        DataError, match="no scene, expected drives: folders with image_02/ and oxts/ or poses_image_02"
    ):
        find_drives(tmp_path, None)
    write_drive(tmp_path / "2011_09_26")
    write_drive(tmp_path / "copy/2011_09_26")
    with pytest.raises(
        DataError, match=r"the drive 2011_09_26_drive_0001_sync again, which is also in .*, expected it once"
    ):
        find_drives(tmp_path, None)


def test_of_each_frame_the_map_else_the_scan(tmp_path, write_drive):
    drive = write_drive(tmp_path, frames=4, first=7)
    drive.depth(7).unlink()
    drive.depth(9).unlink()
    drive.scan(9).unlink()
    frames = find_frames(drive)
    assert frames.numbers == range(7, 11)
    assert frames.images == tuple(map(drive.image, frames.numbers))
    assert frames.depths == (drive.scan(7), drive.depth(8), None, drive.depth(10))


@pytest.mark.parametrize("number", [0, 1, 2], ids=["first", "middle", "last"])
def test_a_missing_image_is_named(tmp_path, write_drive, number):
    drive = write_drive(tmp_path)
    drive.image(number).unlink()
    with pytest.raises(DataError) as caught:
        find_frames(drive)
    assert str(caught.value) == f"{drive.image(number)}: missing image, expected images 0 to 2 without a gap"


def test_where_a_drive_s_files_lie():
    drive = Drive(Path("day/drive"))
    assert drive.image(12).as_posix() == "day/drive/image_02/data/0000000012.png"
    assert drive.oxts(12).as_posix() == "day/drive/oxts/data/0000000012.txt"
    assert drive.scan(12).as_posix() == "day/drive/velodyne_points/data/0000000012.bin"
    assert drive.depth(12).as_posix() == "day/drive/proj_depth/groundtruth/image_02/0000000012.png"
