"""7-Scenes has two cameras: what the reader makes of depth and poses of the one for images of the other."""

import pickle

import numpy as np
import pytest
from tests.writers.sevenscenes import colour_poses, depth_poses, wall_depth, write_sevenscenes, write_sfm

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.reader_registry import open_sequence

COLOUR = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
FRAMES = 3


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    root = tmp_path_factory.mktemp("chess")
    write_sevenscenes(root / "seq-01", FRAMES)
    return root


@pytest.fixture
def sfm_file(tmp_path):
    poses = {f"seq-01/frame-{index:06d}.color.png": pose for index, pose in enumerate(colour_poses(FRAMES))}
    return write_sfm(tmp_path / "poses" / "chess_train.txt", dict(reversed(poses.items())), 526.25)


def opened(root, **options):
    return open_sequence("sevenscenes", root, **options)


def require_wall(sequence, poses):
    """Depth of the wall to within the millimetre in which depth is written, wherever there is any."""
    matrix = sequence.camera.matrix
    for index in range(FRAMES):
        depth = sequence.depth(index)
        expected = wall_depth(matrix, poses[index])
        assert depth.valid.mean() > 0.7
        assert np.abs(depth.depth_m - expected)[depth.valid].max() < 0.7e-3
        assert np.abs(np.mean((depth.depth_m - expected)[depth.valid])) < 2e-5


def test_depth_and_poses_are_those_of_the_colour_camera(recording):
    sequence = opened(recording)
    assert sequence.camera == COLOUR
    np.testing.assert_allclose(sequence.world_from_camera, colour_poses(FRAMES), atol=1e-8)
    require_wall(sequence, colour_poses(FRAMES))
    assert any("525 px" in note and "585 px" in note for note in sequence.notes)
    assert pickle.loads(pickle.dumps(sequence)).depth(1).valid.any()


def test_raw_takes_colour_and_depth_as_one_camera(recording):
    sequence = opened(recording, calibration="raw")
    assert sequence.camera == Camera(640, 480, 585.0, 585.0, 320.0, 240.0)
    np.testing.assert_allclose(sequence.world_from_camera, depth_poses(FRAMES), atol=1e-8)
    require_wall(sequence, depth_poses(FRAMES))
    assert "colour and depth are assumed to share one camera" in sequence.notes


@pytest.mark.parametrize("focal", [585.0, 587.3])
def test_a_file_of_the_depth_camera_s_intrinsics_is_that_of_the_depth_camera(tmp_path, focal):
    write_sevenscenes(tmp_path / "seq-01", 1)
    np.savetxt(tmp_path / "camera-intrinsics.txt", [[focal, 0, 321], [0, focal, 241], [0, 0, 1]])
    sequence = opened(tmp_path)
    assert sequence.camera == COLOUR
    assert sequence.depths.depth == Camera(640, 480, focal, focal, 321.0, 241.0)


def test_a_file_of_another_camera_is_that_of_both(tmp_path):
    """Whoever wrote 525 px there has decided: nothing is registered, and a note says so."""
    write_sevenscenes(tmp_path / "seq-01", 1)
    np.savetxt(tmp_path / "camera-intrinsics.txt", [[525, 0, 320], [0, 525, 240], [0, 0, 1]])
    sequence = opened(tmp_path)
    assert sequence.camera == Camera(640, 480, 525.0, 525.0, 320.0, 240.0)
    np.testing.assert_allclose(sequence.world_from_camera, depth_poses(1), atol=1e-8)
    assert any("does not give the depth camera's 585 px" in note for note in sequence.notes)


def test_times_are_assumed_and_said(recording):
    sequence = opened(recording)
    np.testing.assert_allclose(sequence.timestamps_s, np.arange(FRAMES) / 30)
    assert any("30 frames per second are assumed" in note for note in sequence.notes)


def test_poses_of_structure_from_motion(recording, sfm_file):
    sequence = opened(recording, poses="sfm", sfm_file=str(sfm_file))
    np.testing.assert_allclose(sequence.world_from_camera, colour_poses(FRAMES), atol=1e-8)
    assert sequence.camera == Camera(640, 480, 526.25, 526.25, 319.5, 239.5)
    require_wall(sequence, colour_poses(FRAMES))
    assert any("structure from motion" in note and str(sfm_file) in note for note in sequence.notes)


def test_a_folder_of_files_has_those_of_every_place(tmp_path, sfm_file):
    write_sevenscenes(tmp_path / "data/chess/seq-01", FRAMES)
    write_sfm(sfm_file.with_name("chess_test.txt"), {"seq-03/frame-000000.color.png": np.eye(4)}, 526.25)
    write_sfm(sfm_file.with_name("fire_train.txt"), {"seq-01/frame-000000.color.png": np.eye(4)}, 400.0)
    sequence = opened(tmp_path / "data", poses="sfm", sfm_file=str(sfm_file.parent))
    np.testing.assert_allclose(sequence.world_from_camera, colour_poses(FRAMES), atol=1e-8)
    assert sequence.camera.fx == 526.25


def test_images_that_structure_from_motion_left_out_have_no_pose(recording, sfm_file):
    kept = [line for line in sfm_file.read_text().splitlines() if "frame-000001" not in line]
    sfm_file.write_text("\n".join(["# made by hand", "", *kept]))
    sequence = opened(recording, poses="sfm", sfm_file=str(sfm_file))
    assert np.isnan(sequence.world_from_camera[1]).all()
    np.testing.assert_allclose(sequence.world_from_camera[2], colour_poses(FRAMES)[2], atol=1e-8)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("seq-01/frame-000000.color.png 1 0 0 0 0 0 0 526", "chess_train.txt:4: seq-01/frame-000000 again"),
        ("seq-02/frame-000000.color.png 1 0 0 0 0 0 0", "chess_train.txt:4: 7 fields, expected 8"),
        ("seq-02/frame-000000.color.png 1 0 0 0 0 zero 0 526", "chess_train.txt:4: 'zero', expected a number"),
    ],
)
def test_rows_that_cannot_be_used_are_named(recording, sfm_file, row, message):
    sfm_file.write_text(sfm_file.read_text() + row + "\n")
    with pytest.raises(DataError, match=message.replace(".", r"\.")):
        opened(recording, poses="sfm", sfm_file=str(sfm_file))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (("526.25", "-5"), "a focal length of -5, expected a number above 0"),
        (("seq-01", "seq-02"), "0 of the images of"),
    ],
)
def test_files_that_do_not_fit_the_recording(recording, sfm_file, changed, message):
    sfm_file.write_text(sfm_file.read_text().replace(*changed))
    with pytest.raises(DataError, match=message):
        opened(recording, poses="sfm", sfm_file=str(sfm_file))


def test_a_folder_without_files_of_the_place(recording, sfm_file):
    sfm_file.rename(sfm_file.with_name("fire_train.txt"))
    with pytest.raises(DataError, match=r"no file .*_\*\.txt, expected files such as chess_train\.txt"):
        opened(recording, poses="sfm", sfm_file=str(sfm_file.parent))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"poses": "sfm"}, "sfm_file is None, expected a file with poses = 'sfm'"),
        ({"sfm_file": "poses.txt"}, "expected a file with poses = 'sfm', else none"),
        (
            {"poses": "sfm", "sfm_file": "poses.txt", "calibration": "raw"},
            "calibration is 'raw', expected 'registered'",
        ),
    ],
)
def test_options_that_contradict_each_other(recording, options, message):
    with pytest.raises(SettingsError, match=message):
        opened(recording, **options)
