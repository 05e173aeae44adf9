"""Whether scenes are pieces of one recording, from their poses and times."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.truth_faults.planted import Planted
from tests.writers.tum import write_tum

from tracknoise.sequences.reader_registry import make_reader
from tracknoise.truth_faults import recording_checks
from tracknoise.truth_faults.check_report import Severity
from tracknoise.truth_faults.recording_checks import independence

N_FRAMES = 12
CAMERA = '{"width": 64, "height": 48, "fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5}'


def walk(start: float) -> np.ndarray:
    at = start + np.arange(N_FRAMES) / 30
    poses = np.broadcast_to(np.eye(4), (N_FRAMES, 4, 4)).copy()
    poses[:, :3, :3] = Rotation.from_rotvec(np.outer(at, (0.5, -1.0, 0.3))).as_matrix()
    poses[:, :3, 3] = np.outer(at, (1.0, 2.0, -0.5)) + np.array([4.0, -2.0, 1.0])
    return poses


def noise(seed: int) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).integers(0, 256, (N_FRAMES, 48, 64), dtype=np.uint8))


def recordings(folder, poses, starts_s, images=None):
    """Recordings whose readers count times from the first image of each."""
    images = images or [[np.zeros((48, 64), np.uint8)] * N_FRAMES] * len(poses)
    for number, (part, start_s, seen) in enumerate(zip(poses, starts_s, images, strict=True)):
        write_tum(folder / f"part{number}", seen, part, start_s=start_s)
        (folder / f"part{number}/camera.json").write_text(CAMERA)
    reader = make_reader("tum", folder)
    return [reader.open(one) for one in reader.sequences()]


def found(folder, poses, starts_s, images=None):
    return independence(recordings(folder, poses, starts_s, images))


@pytest.mark.parametrize("pause_frames", [1, 2])
def test_pieces_of_one_recording_are_named_although_their_times_begin_at_0(tmp_path, pause_frames):
    later = (N_FRAMES - 1 + pause_frames) / 30
    item = found(tmp_path, [walk(0.0), walk(later)], [1305031241.0, 1305031241.0 + later])
    assert item.severity is Severity.caveat
    assert "part1 continues part0" in item.text


def test_recordings_in_different_places_are_not_pieces_of_one(tmp_path):
    item = found(tmp_path, [walk(0.0), walk(5.0)], [1305031241.0, 1305041241.0])
    assert item.severity is Severity.ok


def test_scenes_without_two_poses_in_a_row_continue_none(tmp_path):
    def at_both_ends(poses):
        return np.where(np.isin(np.arange(N_FRAMES), (0, N_FRAMES - 1))[:, None, None], poses, np.nan)

    later = N_FRAMES / 30
    opened = recordings(tmp_path, [walk(0.0), walk(later)], [1305031241.0, 1305031241.0 + later])
    assert independence(opened).severity is Severity.caveat
    assert independence([Planted(one, poses=at_both_ends) for one in opened]).severity is Severity.ok


@pytest.mark.parametrize("most_read", [100, 1])
@pytest.mark.parametrize("n_copied", [N_FRAMES, N_FRAMES - 4])
def test_a_copy_of_a_recording_is_named_even_if_its_end_is_missing(tmp_path, monkeypatch, most_read, n_copied):
    monkeypatch.setattr(recording_checks, "_MOST_READ", most_read)
    images = [noise(0), noise(1), noise(0)[:n_copied]]
    item = found(tmp_path, [walk(0.0), walk(5.0), walk(0.0)[:n_copied]], [0.0, 100.0, 0.0], images)
    assert item.severity is Severity.caveat
    assert item.values["n_copies"] == 1
    assert "1 of 3 scenes is a copy, with the images of another (part2 those of part0)." in item.text


def test_the_same_images_with_other_poses_are_a_copy(tmp_path):
    item = found(tmp_path, [walk(0.0), walk(5.0)], [0.0, 100.0], [noise(0), noise(0)])
    assert "part1 those of part0" in item.text


@pytest.mark.parametrize("seeds", [(0, 1), (None, None)])
def test_scenes_that_share_a_motion_are_no_copies(tmp_path, seeds):
    """Nor are scenes whose images are of one gray value."""
    images = None if None in seeds else [noise(seed) for seed in seeds]
    item = found(tmp_path, [walk(0.0), walk(0.0)], [0.0, 0.0], images)
    assert item.severity is Severity.ok
    assert item.values["n_copies"] == 0


@pytest.mark.parametrize("most_read", [100, 1])
def test_a_copy_is_found_among_scenes_that_share_its_motion(tmp_path, monkeypatch, most_read):
    monkeypatch.setattr(recording_checks, "_MOST_READ", most_read)
    item = found(tmp_path, [walk(0.0)] * 3, [0.0] * 3, [noise(0), noise(1), noise(1)])
    assert "1 of 3 scenes is a copy, with the images of another (part2 those of part1)." in item.text
