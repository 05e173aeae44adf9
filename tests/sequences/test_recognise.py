"""Formats are recognised from names of files; unknown layouts name the nearest format."""

import pytest

from tracknoise.exceptions import DataError
from tracknoise.sequences.reader_registry import READERS
from tracknoise.sequences.recognise import SIGNATURES, recognise

FILES = {
    "sevenscenes": ["chess/seq-01/frame-000000.pose.txt"],
    "tartanair": ["P000/pose_lcam_front.txt"],
    "kitti": ["2011_09_26/calib_cam_to_cam.txt"],
    "dtu": ["SET001/Img025_07.bmp"],
    "folder": ["office/poses.txt", "office/images/000000.png"],
    "tum": ["fr1/rgb.txt", "fr1/groundtruth.txt"],
    "euroc": ["V1_01/mav0/cam0/data.csv"],
    "kitti-odometry": ["sequences/00/calib.txt", "poses/00.txt"],
}


def made(folder, files):
    for name in files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    return folder


@pytest.mark.parametrize("reader", sorted(FILES.keys() & set(READERS.names())))
def test_a_layout_is_recognised_from_above_and_from_within(reader, tmp_path):
    made(tmp_path, FILES[reader])
    assert recognise(tmp_path) == reader
    if "/" in FILES[reader][0] and reader != "kitti-odometry":
        assert recognise((tmp_path / FILES[reader][0]).parent) == reader


@pytest.mark.parametrize(
    ("reader", "files"),
    [
        ("tum", ["living_room/associations.txt", "living_room/livingRoom0.gt.freiburg", "living_room/rgb/0.png"]),
        ("nerfstudio", ["lego/transforms_train.json", "lego/train/r_0.png"]),
        ("kitti-odometry", ["00/calib.txt", "00/image_0/000000.png", "00/times.txt"]),
        ("kitti-odometry", ["00/calib.txt", "00/image_2/000000.png", "00/poses.txt"]),
        ("rosbag", ["run/metadata.yaml", "run/run_0.db3.zstd"]),
    ],
)
def test_variants_of_a_layout_are_recognised_too(reader, files, tmp_path):
    made(tmp_path, files)
    assert recognise(tmp_path) == reader
    assert recognise(tmp_path / files[0].partition("/")[0]) == reader


@pytest.mark.parametrize(
    ("reader", "file"),
    [("dtu", "scene001/001_00.png"), ("dtu", "dtu/Calib_Results_11.mat"), ("euroc", "V1_01/cam0/data.csv")],
)
def test_a_part_of_a_layout_is_enough(reader, file, tmp_path):
    made(tmp_path, [file])
    assert recognise(tmp_path) == reader


@pytest.mark.parametrize(
    ("reader", "name"),
    [
        ("sevenscenes", "sevenscenes"),
        ("tartanair", "tartanair_v1"),
        ("tartanair", "tartanair_v2"),
        ("kitti", "kitti"),
        ("tum", "tum_rgbd"),
        ("kitti-odometry", "kitti_odometry"),
    ],
)
def test_samples_are_recognised(reader, name, sample):
    assert recognise(sample(name)) == reader


def test_every_signature_is_of_a_reader_or_of_none_yet_and_none_twice():
    named = [signature.reader for signature in SIGNATURES]
    assert len(named) == len(set(named))
    assert set(READERS.built_in) - {"simulated"} <= set(named)


def test_an_unknown_layout_names_the_nearest_format_and_the_folder_layout(tmp_path):
    made(tmp_path, ["velodyne_points/0.bin", "images/0.bmp", "image_02/0.bmp"])
    with pytest.raises(DataError, match=r"no known layout .*the nearest format is kitti; .*docs/data\.md"):
        recognise(tmp_path)


def test_nothing_at_all_is_an_error(tmp_path):
    with pytest.raises(DataError, match="no such file or folder"):
        recognise(tmp_path / "missing")
    with pytest.raises(DataError, match=r"no known layout \(nothing\)"):
        recognise(tmp_path)
