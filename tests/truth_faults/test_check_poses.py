"""The check refines poses as a run does: spoilt ones are found, exact ones stay, and trajectories are better."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from benchmarks.validity.rigid import pose_noise

from tracknoise.exceptions import DataError
from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.sequences.estimated_poses import with_trajectory
from tracknoise.sequences.other_poses import trajectory_text
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.views import View
from tracknoise.tables.enumerations import Trust
from tracknoise.truth_faults import check_poses
from tracknoise.truth_faults.check_poses import refined_trajectory
from tracknoise.truth_faults.check_recording import check_sequence
from tracknoise.truth_faults.check_report import Severity

FRAMES = 24


@dataclass(frozen=True, slots=True, eq=False)
class Spoilt(View):
    """A simulated sequence with other poses, as one with depth maps of which only the depth is stated to be exact."""

    keeps_kind_of_depth = True

    poses: np.ndarray
    accuracy: TruthAccuracy = TruthAccuracy(depth_m=0.0)  # noqa: RUF009
    truths = ("birth",)
    pose_accuracy = depth_accuracy = None
    surface = None

    @property
    def world_from_camera(self):
        return self.poses

    @property
    def truth_accuracy(self):
        return self.accuracy


@pytest.fixture(scope="module")
def exact():
    return open_sequence("simulated", motions=["arvr"], frames=FRAMES, width=320, height=240, supersampling=1)


@pytest.fixture(scope="module")
def spoilt(exact):
    noise = pose_noise("walk", 0.1, 0.01, FRAMES, np.random.default_rng(5))
    return Spoilt(exact, exact.world_from_camera @ noise)


def worst_deg(sequence, exact, lag=5):
    """RMS of the errors of relative rotations, degrees."""
    given, true = (one.world_from_camera[:, :3, :3] for one in (sequence, exact))
    apart = [
        (a.T @ b).T @ (c.T @ d) for a, b, c, d in zip(given[:-lag], given[lag:], true[:-lag], true[lag:], strict=True)
    ]
    return np.degrees(np.sqrt(np.mean([np.arccos(np.clip((np.trace(one) - 1) / 2, -1, 1)) ** 2 for one in apart])))


def item_of(report, topic):
    (item,) = (item for item in report.items if item.topic == topic)
    return item


def test_spoilt_poses_are_refined_and_the_check_says_how_wrong_they_were(spoilt):
    report = check_sequence(spoilt)
    values = item_of(report, "poses").values
    assert values["are_refined"]
    assert values["left_px"] < 0.3 * values["stated_px"]
    assert values["stated_next_px"] < values["stated_px"]
    law = values["stated_rotation_deg_per_sqrt_frame"], 2**0.5 * values["stated_rotation_white_deg"]
    assert np.hypot(*law) == pytest.approx(0.1, rel=0.5)
    assert report.truth.stated.startswith("Stated poses: not trusted. ")
    assert report.truth.poses.count("The stated poses would add") == 1
    assert "The stated poses would add" not in report.truth.stated
    assert report.truth.verdict is not Trust.not_trusted


def test_corrected_depths_are_those_that_are_judged(exact):
    """Inverse depths are off by a constant, which reference tracks find: what is left says nothing of it."""
    report = check_sequence(Shifted(exact, exact.world_from_camera, TruthAccuracy()))
    assert item_of(report, "poses").values["inverse_depth_offset_per_m"] == pytest.approx(0.02, rel=0.3)
    assert report.truth.verdict is not Trust.not_trusted
    assert "off by a constant" not in report.truth.text


@dataclass(frozen=True, slots=True, eq=False)
class Shifted(Spoilt):
    """With inverse depths that are too small by .02 1/m."""

    def depth(self, index):
        found = self.sequence.depth(index)
        return replace(found, depth_m=1.0 / (1.0 / found.depth_m - 0.02), valid=found.valid & (found.depth_m < 45.0))


def test_an_exact_truth_is_not_adjusted(exact):
    stated = TruthAccuracy(depth_m=0.0, rotation_white_deg=0.0, translation_white_m=0.0)
    exact = Spoilt(exact, exact.world_from_camera, stated)
    report = check_sequence(exact)
    assert item_of(report, "poses").text == "The stated poses are exact."
    assert (report.truth.poses, report.truth.stated) == ("", "")
    with pytest.raises(DataError, match="The stated poses are exact, expected poses that reference tracks refine"):
        refined_trajectory(exact)


def test_a_trajectory_that_is_as_good_as_a_refined_one_stays_as_stated(exact):
    unknown = Spoilt(exact, exact.world_from_camera, TruthAccuracy())
    trajectory, (note,) = refined_trajectory(unknown)
    assert note.endswith("The stated poses differ from refined ones by less than reference tracks can resolve.")
    assert trajectory.world_from_camera == pytest.approx(exact.world_from_camera)


def test_a_trajectory_of_several_windows_is_better_than_the_stated_one(spoilt, exact, monkeypatch):
    whole, notes = refined_trajectory(spoilt)
    assert notes == ()
    monkeypatch.setattr(check_poses, "_LONGEST", 14)
    joined, _ = refined_trajectory(spoilt)
    assert worst_deg(whole, exact) < 0.3 * worst_deg(spoilt, exact)
    assert worst_deg(joined, exact) < 0.4 * worst_deg(spoilt, exact)


def test_a_usual_mistake_is_named_and_no_poses_are_fitted_to_it(spoilt):
    inverted = Spoilt(spoilt.sequence, np.linalg.inv(spoilt.sequence.world_from_camera))
    report = check_sequence(inverted)
    assert report.truth.verdict is Trust.not_trusted
    assert item_of(report, "usual mistakes").severity is Severity.fatal
    assert not [item for item in report.items if item.topic == "poses"]


@pytest.mark.parametrize("timed", [True, False])
def test_a_written_trajectory_gives_the_same_poses_when_it_is_read(spoilt, tmp_path, timed):
    poses = spoilt.world_from_camera.copy()
    poses[3] = np.nan

    @dataclass(frozen=True, slots=True, eq=False)
    class Gap(Spoilt):
        @property
        def timestamps_s(self):
            return np.arange(FRAMES) / 3 if timed else None

    sequence = Gap(spoilt.sequence, poses)
    path = tmp_path / "refined.txt"
    path.write_text(trajectory_text(sequence, "refined poses of it"))
    found = with_trajectory(sequence, path)
    np.testing.assert_allclose(found.world_from_camera, poses, atol=1e-12)


def test_some_poses_that_are_wrong_are_refined_however_few_and_however_they_repeat(exact):
    """Every fifth pose is that of the frame before: two frames that are ten apart are both right, or both wrong."""
    poses = exact.world_from_camera.copy()
    poses[4::5] = poses[3:-1:5]
    report = check_sequence(Spoilt(exact, poses))
    values = item_of(report, "poses").values
    assert values["are_refined"]
    assert values["stated_next_px"] > 2.0 * values["stated_px"]
    assert report.truth.stated.startswith("Stated poses: not trusted. ")
