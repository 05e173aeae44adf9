import os
import pickle

import cv2
import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import DataError, DataWarning, UnknownNameError
from tracknoise.experiments.measure import measure
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.sequence import TruthKind
from tracknoise.sequences.sevenscenes import Calibration, SevenScenes
from tracknoise.tables.identity import SequenceId


def only(root):
    """The sequence as its files have it."""
    reader = SevenScenes(root, calibration=Calibration.raw)
    (listed,) = reader.sequences()
    return reader.open(listed)


def test_lists_scenes_at_any_level(tmp_path, write_sevenscenes):
    for scene in ("office/seq-02", "chess/seq-01"):
        write_sevenscenes(tmp_path / scene, frames=1)
    assert [item.scene for item in SevenScenes(tmp_path).sequences()] == ["chess/seq-01", "office/seq-02"]
    assert [item.scene for item in SevenScenes(tmp_path / "chess").sequences()] == ["seq-01"]
    assert [item.scene for item in SevenScenes(tmp_path / "chess/seq-01").sequences()] == ["seq-01"]


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_reads_images_depth_and_poses(tmp_path, write_sevenscenes, suffix):
    folder = write_sevenscenes(tmp_path / "seq-01", suffix=suffix)
    sequence = only(tmp_path)
    assert sequence.id == SequenceId("sevenscenes", "seq-01")
    assert len(sequence) == 3
    assert sequence.truths == (TruthKind.birth,)
    file = str(folder / f"frame-000001.color.{suffix}")
    np.testing.assert_array_equal(sequence.image(1), cv2.imread(file, cv2.IMREAD_GRAYSCALE))
    assert sequence.depth(1).depth_m[5, 5] == pytest.approx(1.5, abs=1e-12)
    np.testing.assert_allclose(sequence.world_from_camera[:, 0, 3], (0.0, 0.1, 0.2))
    assert len(pickle.loads(pickle.dumps(sequence))) == 3


def test_depth_0_and_65535_are_invalid(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01", frames=1)
    depth = np.full((480, 640), 1500, np.uint16)
    depth[0, :3] = 0, 65535, 65534
    cv2.imwrite(str(folder / "frame-000000.depth.png"), depth)
    assert only(tmp_path).depth(0).valid[0, :4].tolist() == [False, False, True, True]


def test_without_intrinsics_the_kinect_s_are_assumed_and_said(tmp_path, write_sevenscenes):
    write_sevenscenes(tmp_path / "seq-01", frames=1)
    sequence = only(tmp_path)
    camera = sequence.camera
    assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == (640, 480, 585, 585, 320, 240)
    assert any("no camera-intrinsics.txt" in note for note in sequence.notes)


@pytest.mark.parametrize("level", ["", "chess", "chess/seq-01"])
def test_intrinsics_of_the_folder_or_one_above(tmp_path, write_sevenscenes, level):
    write_sevenscenes(tmp_path / "chess/seq-01", frames=1, size=(64, 48))
    np.savetxt(tmp_path / level / "camera-intrinsics.txt", [[50, 0, 31], [0, 51, 23], [0, 0, 1]])
    sequence = only(tmp_path)
    camera = sequence.camera
    assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == (64, 48, 50, 51, 31, 23)
    assert not any("intrinsics" in note for note in sequence.notes)


def test_intrinsics_above_the_root_are_not_looked_for(tmp_path, write_sevenscenes):
    write_sevenscenes(tmp_path / "chess/seq-01", frames=1)
    np.savetxt(tmp_path / "camera-intrinsics.txt", [[50, 0, 31], [0, 51, 23], [0, 0, 1]])
    assert only(tmp_path / "chess").camera.fx == 585


def test_other_sizes_need_intrinsics(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01", frames=1, size=(64, 48))
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    image = folder / "frame-000000.color.png"
    assert str(caught.value) == f"{image}: size 64x48 and no camera-intrinsics.txt, expected 640x480 or that file"


@pytest.mark.parametrize("rows", ["50 1 31\n0 50 23\n0 0 1", "-50 0 31\n0 50 23\n0 0 1", "nan 0 31\n0 50 23\n0 0 1"])
def test_intrinsics_that_are_no_pinhole_camera(tmp_path, write_sevenscenes, rows):
    write_sevenscenes(tmp_path / "seq-01", frames=1)
    (tmp_path / "camera-intrinsics.txt").write_text(rows)
    with pytest.raises(DataError, match=r"camera-intrinsics\.txt: no pinhole camera, expected rows fx 0 cx"):
        only(tmp_path)


def test_rotations_are_made_exact_with_a_warning_of_the_size(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01")
    np.savetxt(folder / "frame-000001.pose.txt", np.diag([1.01, 1.0, 1.0, 1.0]))
    with pytest.warns(DataWarning, match=r"frame-000001\.pose\.txt: .* changes its entries by up to 0\.01"):
        sequence = only(tmp_path)
    np.testing.assert_allclose(sequence.world_from_camera[1], np.eye(4), atol=1e-12)
    assert any("up to 0.01" in note for note in sequence.notes)


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (np.diag([2.0, 1, 1, 1]), "singular values differ from 1 by 1, expected a rotation"),
        (np.eye(3), "3 fields, expected 4"),
        (np.eye(4)[:3], "3 rows, expected a 4x4 matrix"),
    ],
)
def test_damaged_poses_name_their_file(tmp_path, write_sevenscenes, pose, message):
    folder = write_sevenscenes(tmp_path / "seq-01")
    np.savetxt(folder / "frame-000001.pose.txt", pose)
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    assert str(caught.value).startswith(f"{folder / 'frame-000001.pose.txt'}:")
    assert message in str(caught.value)


@pytest.mark.parametrize("unknown", ["nan", "-1.#IND", "1.#QNAN0", "-inf", "1.#INF"])
def test_a_frame_without_a_pose_is_kept(tmp_path, write_sevenscenes, unknown):
    folder = write_sevenscenes(tmp_path / "seq-01")
    (folder / "frame-000001.pose.txt").write_text(f"{unknown} 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    sequence = only(tmp_path)
    assert np.isnan(sequence.world_from_camera[1]).all()
    np.testing.assert_array_equal(sequence.world_from_camera[2, :3, 3], (0.2, 0.0, 0.0))


def test_poses_may_outnumber_images(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01", frames=4)
    for kind in ("color", "depth"):
        (folder / f"frame-000003.{kind}.png").unlink()
    assert len(only(tmp_path)) == 3


@pytest.mark.parametrize("missing", [1, 2])
def test_a_missing_image_is_named_and_not_skipped(tmp_path, write_sevenscenes, missing):
    folder = write_sevenscenes(tmp_path / "seq-01", frames=3)
    (folder / f"frame-{missing:06d}.color.png").unlink()
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    image = folder / f"frame-{missing:06d}.color.png"
    assert str(caught.value) == f"{image}: missing image, expected images 0 to 2 without a gap"


def test_depth_without_image_and_pose(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01", frames=3)
    (folder / "frame-000002.color.png").unlink()
    (folder / "frame-000002.pose.txt").unlink()
    with pytest.raises(DataError, match=r"frame-000002\.color\.png: missing image, expected images 0 to 2"):
        only(tmp_path)


def test_two_images_of_one_frame(tmp_path, write_sevenscenes):
    write_sevenscenes(tmp_path / "seq-01", suffix="jpg")
    folder = write_sevenscenes(tmp_path / "seq-01", frames=1)
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    found = "the number of frame-000000.color.jpg again, expected one file for each frame"
    assert str(caught.value) == f"{folder / 'frame-000000.color.png'}: {found}"


def test_files_may_begin_with_a_byte_order_mark(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01", frames=1)
    np.savetxt(folder / "camera-intrinsics.txt", [[50, 0, 31], [0, 51, 23], [0, 0, 1]])
    for file in folder.glob("*.txt"):
        file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
    assert only(tmp_path).camera.fx == 50


def test_fewer_poses_than_images(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01", frames=3)
    (folder / "frame-000002.pose.txt").unlink()
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    pose = folder / "frame-000002.pose.txt"
    assert str(caught.value) == f"{pose}: 2 poses, expected at least 3, one for each image"


def test_poses_without_images(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01", frames=2)
    for image in folder.glob("*.color.png"):
        image.unlink()
    with pytest.raises(DataError) as caught:
        only(tmp_path)
    found = "no images, but files such as frame-000000.depth.png"
    assert str(caught.value) == f"{folder}: {found}, expected files such as frame-000000.color.png"


def test_frames_without_depth_are_counted(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01")
    (folder / "frame-000001.depth.png").unlink()
    sequence = only(tmp_path)
    assert sequence.depth(1) is None
    assert sequence.depth(2) is not None
    assert "1 of 3 frames has no depth" in sequence.notes


def test_a_recording_may_start_at_any_number(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01")
    for file in folder.glob("frame-000000.*"):
        file.unlink()
    sequence = only(tmp_path)
    assert len(sequence) == 2
    assert sequence.world_from_camera[0, 0, 3] == pytest.approx(0.1)


def test_one_frame(tmp_path, write_sevenscenes):
    write_sevenscenes(tmp_path / "seq-01", frames=1)
    assert len(only(tmp_path)) == 1


def test_depth_of_another_size(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01", frames=1)
    file = folder / "frame-000000.depth.png"
    cv2.imwrite(str(file), np.ones((240, 320), np.uint16))
    with pytest.raises(DataError) as caught:
        only(tmp_path).depth(0)
    assert str(caught.value) == f"{file}: size 320x240, expected the camera's 640x480"


def test_truncated_image(tmp_path, write_sevenscenes):
    folder = write_sevenscenes(tmp_path / "seq-01", frames=2, suffix="jpg")
    file = folder / "frame-000001.color.jpg"
    os.truncate(file, 20_000)
    with pytest.raises(DataError) as caught:
        only(tmp_path).image(1)
    found = "truncated or damaged image of 20000 bytes"
    assert str(caught.value) == f"{file}: {found}, expected a whole PNG, JPEG or BMP image"


def test_no_scene_and_unknown_scene(tmp_path, write_sevenscenes):
    with pytest.raises(DataError, match=r"no scene, expected folders of frame-NNNNNN\.pose\.txt files"):
        SevenScenes(tmp_path).sequences()
    write_sevenscenes(tmp_path / "chess/seq-01", frames=1)
    with pytest.raises(UnknownNameError, match=r"unknown scene 'chess/seq-1' \(did you mean 'chess/seq-01'\?\)"):
        SevenScenes(tmp_path).open(SequenceId("sevenscenes", "chess/seq-1"))


def test_the_real_sample(sample):
    sequence = open_sequence("sevenscenes", sample("sevenscenes"))
    assert len(sequence) == 120
    assert sequence.id.scene == "seq-01"
    assert (sequence.camera.fx, sequence.camera.cx, sequence.camera.cy) == (525.0, 319.5, 239.5)
    assert sequence.image(0).shape == (480, 640)
    depth = sequence.depth(0)
    assert 0.6 < depth.valid.mean() < 0.81  # the depth camera sees 81 % of the image
    assert 0.3 < depth.depth_m[depth.valid].min() < depth.depth_m[depth.valid].max() < 10.0


def test_the_real_sample_as_recorded(sample):
    sequence = open_sequence("sevenscenes", sample("sevenscenes"), calibration="raw")
    assert (sequence.camera.fx, sequence.camera.cx, sequence.camera.cy) == (585.0, 320.0, 240.0)
    depth = sequence.depth(0)
    assert 0.8 < depth.valid.mean() < 1.0
    assert 0.3 < depth.depth_m[depth.valid].min() < depth.depth_m[depth.valid].max() < 10.0


def test_registered_truth_has_no_bias(sample):
    """The focal length of the depth camera makes a mean error of -1 px at age 12 in the first 28 frames."""
    mean = {}
    for calibration in Calibration:
        sequence = open_sequence("sevenscenes", sample("sevenscenes"), calibration=str(calibration))
        measured = measure(sequence, ["lucas-kanade"], max_frames=28).observations
        of_age = measured.filter(pl.col("kept") & (pl.col("age") == 12) & (pl.col("truth") == "valid"))
        mean[calibration] = of_age["du_px"].mean()
    assert mean[Calibration.raw] < -0.6
    assert abs(mean[Calibration.registered]) < 0.4
