"""Two truths of the same tracks: the second true positions are what its poses say, and the first do not change."""

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

import tracknoise
from tracknoise.exceptions import DataError
from tracknoise.geometry.pose import invert
from tracknoise.sequences.estimated_poses import with_trajectory
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.sequence import second_of
from tracknoise.sequences.stereo import with_stereo_depth
from tracknoise.sequences.views import view
from tracknoise.tables.identity import Direction
from tracknoise.tables.schema import SECOND_TRUTH

FRAMES = 8


@pytest.fixture(scope="module")
def sequence():
    return open_sequence("simulated", motions=("arvr",), frames=FRAMES, width=160, height=120, supersampling=1)


def disturbed(poses: np.ndarray, seed: int, rotation_rad: float = 0.004, translation_m: float = 0.003) -> np.ndarray:
    """Poses with white noise in the camera frame."""
    rng, noise = np.random.default_rng(seed), np.broadcast_to(np.eye(4), poses.shape).copy()
    noise[:, :3, :3] = Rotation.from_rotvec(rng.normal(0.0, rotation_rad, (len(poses), 3))).as_matrix()
    noise[:, :3, 3] = rng.normal(0.0, translation_m, (len(poses), 3))
    return poses @ noise


def moved_world() -> np.ndarray:
    moved = np.eye(4)
    moved[:3, :3] = Rotation.from_rotvec([0.4, -2.0, 0.9]).as_matrix()
    moved[:3, 3] = (3.0, -50.0, 7.0)
    return moved


def second_positions(measured) -> np.ndarray:
    return measured.observations.select(*SECOND_TRUTH).to_numpy()


@pytest.mark.parametrize("kind", ["birth", "raycast"])
def test_second_positions_are_those_of_its_poses(sequence, kind):
    poses = moved_world() @ disturbed(sequence.world_from_camera, 1)
    measured = tracknoise.measure(
        sequence, tracknoise.Oracle(n_features=60), truth=kind, second_truth=OtherPoses(sequence, poses, "made")
    )
    births = measured.observations.filter(age=0).select("track", birth="frame", u0="u_px", v0="v_px")
    table = measured.observations.join(births, on="track").join(measured.tracks.select("track", "depth_m"), on="track")
    known = table.filter(pl.col("depth_m").is_not_null())
    assert known.height > 200
    camera = sequence.camera
    start = camera.unproject(known.select("u0", "v0").to_numpy(), known["depth_m"].to_numpy())
    move = invert(poses[known["frame"].to_numpy()]) @ poses[known["birth"].to_numpy()]
    points = np.einsum("nij,nj->ni", move[:, :3, :3], start) + move[:, :3, 3]
    np.testing.assert_allclose(known.select(*SECOND_TRUTH).to_numpy(), camera.project(points), atol=1e-7)
    assert table.filter(pl.col("depth_m").is_null())["u_second_px"].null_count() == table.height - known.height


@pytest.mark.parametrize(
    ("motion", "kind"), [("arvr", "birth"), ("arvr", "raycast"), ("sideways", "birth"), ("sideways", "triangulated")]
)
def test_the_world_frame_of_the_second_truth_does_not_matter(motion, kind):
    sequence = open_sequence("simulated", motions=(motion,), frames=FRAMES, width=160, height=120, supersampling=1)
    second = OtherPoses(sequence, moved_world() @ sequence.world_from_camera, "made")
    measured = tracknoise.measure(sequence, tracknoise.LucasKanade(), truth=kind, second_truth=second)
    first = measured.observations.select("u_true_px", "v_true_px").to_numpy()
    both = ~np.isnan(first).any(axis=1)
    assert both.sum() > 50
    np.testing.assert_allclose(second_positions(measured)[both], first[both], atol=1e-6)


def test_the_first_truth_is_measured_as_without_a_second(sequence):
    trackers = {"lk": tracknoise.LucasKanade(), "oracle": tracknoise.Oracle(n_features=40)}
    alone = tracknoise.measure(sequence, trackers)
    second = OtherPoses(sequence, disturbed(sequence.world_from_camera, 2), "made")
    measured = tracknoise.measure(sequence, trackers, second_truth=second)
    assert measured.observations.drop(*SECOND_TRUTH).equals(alone.observations)
    assert measured.tracks.equals(alone.tracks)
    assert measured.moments.equals(alone.moments)
    assert "second truth: poses are from made" in measured.notes
    assert alone.pose_differences.is_empty()
    assert measured.pose_differences["n"].sum() > 0


@pytest.mark.parametrize(("direction", "rotation"), [(Direction.backward, 0), (Direction.forward, 90)])
def test_views_show_the_other_poses(sequence, direction, rotation):
    poses = moved_world() @ sequence.world_from_camera
    views = [
        view(one, n_frames=None, direction=direction, rotation=rotation)
        for one in (sequence, OtherPoses(sequence, poses, "made"))
    ]
    measured = tracknoise.measure(views[0], tracknoise.Oracle(n_features=40), truth="raycast", second_truth=views[1])
    seen = measured.observations.filter(truth="valid")
    second = seen.select(*SECOND_TRUTH).to_numpy()
    np.testing.assert_allclose(second, seen.select("u_true_px", "v_true_px").to_numpy(), atol=1e-6)


def test_frames_without_a_second_pose_have_no_second_position(sequence):
    poses = disturbed(sequence.world_from_camera, 3)
    poses[4] = np.nan
    second = OtherPoses(sequence, poses, "made")
    measured = tracknoise.measure(sequence, tracknoise.Oracle(n_features=40), truth="raycast", second_truth=second)
    in_gap = measured.observations.filter(frame=4)
    assert in_gap["u_second_px"].null_count() == in_gap.height > 0
    assert in_gap["u_true_px"].null_count() < in_gap.height


def test_depth_from_stereo_has_the_second_camera():
    options = {"motions": ("sideways",), "frames": 3, "width": 160, "height": 120, "supersampling": 1}
    sequence = open_sequence("simulated", baseline_m=0.1, **options)
    other = OtherPoses(sequence, moved_world() @ sequence.world_from_camera, "made")
    assert second_of(other).first_from_second[0, 3] == 0.1
    assert with_stereo_depth(other).depth(1) is not None


def test_a_second_truth_of_another_length_is_refused(sequence):
    other = view(sequence, n_frames=5, direction=Direction.forward, rotation=0)
    with pytest.raises(DataError, match="a second truth of 5 frames of 160x120, expected 8 frames of 160x120"):
        tracknoise.measure(sequence, tracknoise.LucasKanade(), second_truth=other)


def rows(times: np.ndarray, poses: np.ndarray) -> str:
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    values = np.column_stack([times, poses[:, :3, 3], quaternions])
    return "".join(" ".join(f"{value:.15g}" for value in row) + "\n" for row in values)


class TestTrajectories:
    def timed(self, times):
        images = np.zeros((FRAMES, 12, 16), np.uint8)
        poses = np.broadcast_to(np.eye(4), (FRAMES, 4, 4))
        return tracknoise.Sequence.from_arrays(images, poses, np.diag([20.0, 20.0, 1.0]), timestamps_s=times)

    def test_poses_are_taken_at_the_times_of_frames(self, tmp_path, sequence):
        times, path = np.arange(FRAMES) / 30, tmp_path / "poses.txt"
        path.write_text("# by another program\n" + rows(times + 100.0, sequence.world_from_camera))
        found = with_trajectory(self.timed(times), path, time_shift_s=100.0)
        np.testing.assert_allclose(found.world_from_camera, sequence.world_from_camera, atol=1e-9)
        assert f"poses are from {path}" in found.notes

    def test_without_times_each_row_is_a_frame(self, tmp_path, sequence):
        path = tmp_path / "poses.txt"
        path.write_text(rows(np.arange(FRAMES) * 7.0, sequence.world_from_camera))
        found = with_trajectory(self.timed(None), path)
        np.testing.assert_allclose(found.world_from_camera, sequence.world_from_camera, atol=1e-12)
        path.write_text(rows(np.arange(5) * 0.5, sequence.world_from_camera[:5]))
        with pytest.raises(DataError, match="5 poses for 8 frames without times, expected one row per frame"):
            with_trajectory(self.timed(None), path)

    def test_times_of_another_clock_are_refused(self, tmp_path, sequence):
        path = tmp_path / "poses.txt"
        path.write_text(rows(np.arange(FRAMES) / 30 + 100.0, sequence.world_from_camera))
        with pytest.raises(DataError, match="expected poses at the times of images"):
            with_trajectory(self.timed(np.arange(FRAMES) / 30), path)
