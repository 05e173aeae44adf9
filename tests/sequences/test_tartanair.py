import os
import pickle

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.sequence import TruthKind
from tracknoise.sequences.tartanair import TartanAir
from tracknoise.tables.identity import SequenceId

BOTH = pytest.mark.parametrize("camera", ["left", "lcam_front"], ids=["v1", "v2"])


def only(root, **options):
    reader = TartanAir(root, **options)
    (listed,) = reader.sequences()
    return reader.open(listed)


def test_lists_trajectories_of_both_versions(tmp_path, write_tartanair):
    write_tartanair(tmp_path / "v1/office/Easy/P001", frames=1)
    write_tartanair(tmp_path / "v2/Hospital/Data_easy/P000", frames=1, camera="lcam_front")
    scenes = [item.scene for item in TartanAir(tmp_path).sequences()]
    assert scenes == ["v1/office/Easy/P001", "v2/Hospital/Data_easy/P000"]
    assert [item.scene for item in TartanAir(tmp_path / "v1/office/Easy/P001").sequences()] == ["P001"]


@BOTH
def test_reads_images_depth_and_intrinsics(tmp_path, write_tartanair, camera):
    folder = write_tartanair(tmp_path / "P000", camera=camera)
    sequence = only(tmp_path)
    assert sequence.id == SequenceId("tartanair", "P000")
    assert len(sequence) == 3
    assert sequence.truths == (TruthKind.birth,)
    intrinsics = (sequence.camera.fx, sequence.camera.fy, sequence.camera.cx, sequence.camera.cy)
    assert intrinsics == (320, 320, 319.5, 239.5 if camera == "left" else 319.5)
    file = str(folder / f"image_{camera}/000002_{camera}.png")
    np.testing.assert_array_equal(sequence.image(2), cv2.imread(file, cv2.IMREAD_GRAYSCALE))
    depth = sequence.depth(2)
    assert depth.depth_m[1, 1] == 2.5
    assert np.argwhere(~depth.valid).tolist() == [[0, 0]]  # the sky, farther than 10 km
    assert len(pickle.loads(pickle.dumps(sequence))) == 3


@pytest.mark.parametrize(
    ("row", "right", "down", "forward"),
    [
        # Upright, heading north: right is east, down is down. World axes of ours: x east, y down, z north.
        ("1 2 3 0 0 0 1", (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        # Turned a quarter about down: heading east, right is south.
        (f"1 2 3 0 0 {np.sqrt(0.5)} {np.sqrt(0.5)}", (0, 0, -1), (0, 1, 0), (1, 0, 0)),
        # Pitched up by a quarter (right-handed about east): looking at the sky, down in the image is north.
        (f"1 2 3 0 {np.sqrt(0.5)} 0 {np.sqrt(0.5)}", (1, 0, 0), (0, 0, 1), (0, -1, 0)),
    ],
)
def test_ned_poses_by_hand(tmp_path, write_tartanair, row, right, down, forward):
    folder = write_tartanair(tmp_path / "P000", frames=1)
    (folder / "pose_left.txt").write_text(row + "\n")
    pose = only(tmp_path).world_from_camera[0]
    np.testing.assert_allclose(pose[:3, :3].T, (right, down, forward), atol=1e-15)
    np.testing.assert_allclose(pose[:3, 3], (2, 3, 1))


def test_pose_rows_belong_to_frame_numbers(tmp_path, write_tartanair):
    folder = write_tartanair(tmp_path / "P000", frames=5, rows=40, camera="lcam_front")
    for index in (0, 1):
        (folder / f"image_lcam_front/{index:06d}_lcam_front.png").unlink()
        (folder / f"depth_lcam_front/{index:06d}_lcam_front_depth.png").unlink()
    sequence = only(tmp_path)
    assert len(sequence) == 3
    np.testing.assert_allclose(sequence.world_from_camera[:, 2, 3], (1.0, 1.5, 2.0))
    assert sequence.notes == ()


def test_rows_of_no_frame_are_not_checked(tmp_path, write_tartanair):
    folder = write_tartanair(tmp_path / "P000", frames=2, camera="lcam_front")
    with (folder / "pose_lcam_front.txt").open("a") as file:
        file.write("nan nan nan 0 0 0 0\n")
    assert len(only(tmp_path)) == 2


@BOTH
def test_fewer_poses_than_images(tmp_path, write_tartanair, camera):
    folder = write_tartanair(tmp_path / "P000", frames=3, rows=2, camera=camera)
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    poses = folder / f"pose_{camera}.txt"
    assert str(caught.value) == f"{poses}: 2 poses, expected at least 3, one for each image"


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("0 0 0 0 0 1", "6 fields, expected 7 (x y z qx qy qz qw)"),
        ("0 0 0 0 0 0 0", "a quaternion of norm 0, expected norm 1"),
        ("0 nan 0 0 0 0 1", "NaN or infinity in the pose, expected finite numbers"),
    ],
)
def test_damaged_poses_name_their_line(tmp_path, write_tartanair, row, message):
    folder = write_tartanair(tmp_path / "P000", frames=2)
    (folder / "pose_left.txt").write_text(f"0 0 0 0 0 0 1\n{row}\n")
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    assert str(caught.value) == f"{folder / 'pose_left.txt'}:2: {message}"


def test_missing_pose_file(tmp_path, write_tartanair):
    folder = write_tartanair(tmp_path / "P000", frames=1)
    (folder / "pose_left.txt").unlink()
    with pytest.raises(DataError, match=r"pose_left\.txt: no such file, expected rows of x y z qx qy qz qw"):
        only(tmp_path)


def test_missing_image_folder(tmp_path, write_tartanair):
    folder = write_tartanair(tmp_path / "P000", frames=1)
    (folder / "image_left").rename(folder / "hidden")
    with pytest.raises(DataError, match="image_left: no such directory"):
        only(tmp_path)


def test_no_images(tmp_path, write_tartanair):
    folder = write_tartanair(tmp_path / "P000", frames=0)
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    assert str(caught.value) == f"{folder / 'image_left'}: no images, expected files such as 000000_left.png"


@BOTH
@pytest.mark.parametrize("number", [0, 1, 2], ids=["first", "middle", "last"])
def test_a_missing_image_is_named_and_not_skipped(tmp_path, write_tartanair, camera, number):
    folder = write_tartanair(tmp_path / "P000", frames=3, camera=camera)
    missing = folder / f"image_{camera}/{number:06d}_{camera}.png"
    missing.unlink()
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    assert str(caught.value) == f"{missing}: missing image, expected images 0 to 2 without a gap"


@pytest.mark.parametrize("number", [0, 2], ids=["first", "last"])
def test_in_v1_a_pose_without_its_image_is_enough_to_miss_it(tmp_path, write_tartanair, number):
    folder = write_tartanair(tmp_path / "P000", frames=3)
    missing = folder / f"image_left/{number:06d}_left.png"
    missing.unlink()
    (folder / f"depth_left/{number:06d}_left_depth.npy").unlink()
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    assert str(caught.value) == f"{missing}: missing image, expected images 0 to 2 without a gap"


@BOTH
def test_files_of_another_system_are_ignored(tmp_path, write_tartanair, camera):
    folder = write_tartanair(tmp_path / "P000", frames=2, camera=camera)
    for file in [*folder.glob("*/0*")]:
        file.with_name(f"._{file.name}").write_bytes(b"resource fork")
    sequence = only(tmp_path)
    assert len(sequence) == 2
    assert sequence.depth(1) is not None


def test_images_of_another_size_have_no_known_intrinsics(tmp_path, write_tartanair):
    folder = write_tartanair(tmp_path / "P000", frames=1)
    image = folder / "image_left/000000_left.png"
    cv2.imwrite(str(image), np.zeros((240, 320), np.uint8))
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    assert str(caught.value) == f"{image}: size 320x240, expected 640x480, whose intrinsics are known"


@BOTH
def test_depth_may_be_missing(tmp_path, write_tartanair, camera):
    folder = write_tartanair(tmp_path / "P000", frames=2, camera=camera)
    (depth,) = folder.glob("depth_*/000001*")
    depth.unlink()
    sequence = only(tmp_path)
    assert sequence.depth(1) is None
    assert sequence.notes == ("1 of 2 frames has no depth",)
    (folder / f"depth_{camera}").rename(folder / "hidden")
    assert only(tmp_path).truths == ("swept", "triangulated")


@BOTH
def test_truncated_depth(tmp_path, write_tartanair, camera):
    folder = write_tartanair(tmp_path / "P000", frames=1, camera=camera)
    (depth,) = folder.glob("depth_*/000000*")
    os.truncate(depth, 1000)
    with pytest.raises(DataError, match="truncated"):
        only(tmp_path).depth(0)


def test_the_camera_can_be_chosen(tmp_path, write_tartanair):
    write_tartanair(tmp_path / "P000", frames=1)
    (tmp_path / "right").mkdir()
    write_tartanair(tmp_path / "right/P000", frames=2, camera="right")
    assert [item.scene for item in TartanAir(tmp_path, camera="right").sequences()] == ["right/P000"]
    assert len(only(tmp_path, camera="right")) == 2
    with pytest.raises(DataError, match=r"no scene, expected folders with image_rcam_top and pose_rcam_top\.txt"):
        TartanAir(tmp_path, camera="rcam_top").sequences()


def test_unknown_cameras_and_scenes(tmp_path, write_tartanair):
    with pytest.raises(UnknownNameError, match=r"unknown camera 'lcam_frnt' \(did you mean 'lcam_front'\?\)"):
        make_reader("tartanair", tmp_path, {"camera": "lcam_frnt"})
    write_tartanair(tmp_path / "P000", frames=1)
    with pytest.raises(UnknownNameError, match="unknown scene 'P001'"):
        TartanAir(tmp_path).open(SequenceId("tartanair", "P001"))


@pytest.mark.parametrize(
    ("name", "frames", "size"), [("tartanair_v1", 20, (480, 640)), ("tartanair_v2", 10, (640, 640))]
)
def test_the_real_samples(sample, name, frames, size):
    sequence = open_sequence("tartanair", sample(name))
    assert len(sequence) == frames
    assert sequence.notes == ()
    assert sequence.image(frames - 1).shape == size
    assert sequence.depth(frames - 1).depth_m.shape == size


@pytest.mark.parametrize(
    ("first", "other", "aside_m"),
    [("left", "right", 0.25), ("right", "left", -0.25), ("lcam_front", "rcam_front", 0.25)],
)
def test_the_other_eye_is_the_second_camera(tmp_path, write_tartanair, first, other, aside_m):
    folder = write_tartanair(tmp_path / "P000", camera=first)
    assert only(tmp_path, camera=first).second is None
    write_tartanair(tmp_path / "other", camera=other)
    for part in (f"image_{other}", f"pose_{other}.txt"):
        (tmp_path / "other" / part).rename(folder / part)
    rows = [f"{0.5 * index} {aside_m} 0 0 0 0 1\n" for index in range(3)]
    (folder / f"pose_{other}.txt").write_text("".join(rows))  # y is right in NED
    sequence = only(tmp_path, camera=first)
    expected = np.eye(4)
    expected[0, 3] = aside_m
    np.testing.assert_allclose(sequence.second.first_from_second, expected, atol=1e-12)
    assert sequence.second.images(1).shape == sequence.image(1).shape
    (folder / f"image_{other}" / f"000001_{other}.png").unlink()
    assert only(tmp_path, camera=first).second is None


def test_a_camera_ahead_is_no_second_one(tmp_path, write_tartanair):
    folder = write_tartanair(tmp_path / "P000")
    write_tartanair(tmp_path / "other", camera="right")
    for part in ("image_right", "pose_right.txt"):
        (tmp_path / "other" / part).rename(folder / part)
    (folder / "pose_right.txt").write_text("".join(f"{0.5 * index + 0.25} 0 0 0 0 0 1\n" for index in range(3)))
    assert only(tmp_path, camera="left").second is None
