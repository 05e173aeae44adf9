"""What a run says about data that are wrong, and that it says nothing about data that are right."""

from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation
from tests.lean import only_topics
from tests.truth_faults.planted import MISTAKES, Planted, scaled_positions
from tests.truth_faults.test_still import MOVING, K

import tracknoise
from tracknoise.experiments.doubts import Doubts, depth_edges, doubts
from tracknoise.experiments.measure import measure
from tracknoise.sequences.arrays import Sequence
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.views import ChosenFrames
from tracknoise.trackers.correspondence import Correspondence
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.tracker import Frame, SequenceContext

KINDS = {"lucas-kanade": "lucas-kanade", "correspondence": "correspondence"}
SEEN_IN_THE_ERRORS_OF_ALL = ("ray depth", "one frame late")
"""Mistakes that move points by less than the noise of a track in the slow world. The audit of the run names them."""
SEEN_IN_SLOW_TRACKS = ("inverted", "ned", "wxyz read as xyzw", "poses in mm", "half the size", "two frames late")
SEEN_IN_A_RECORDING = ("opengl", "depth in mm", "ray depth", "twice the size")
"""One of each kind. `tests/truth_faults/test_mistakes.py` plants all."""
FEW_FRAMES = 12
"""Recordings are cut to this length."""
FEW_FEATURES = LucasKanade(min_features=250, max_features=300)
"""Where many add nothing but the time it takes to find their true positions."""


class Followed:
    """Lucas-Kanade's tracks in the images of a sequence, which no planted mistake changes: followed once."""

    kind, description = LucasKanade.kind, LucasKanade.description

    def __init__(self, sequence, n_frames):
        size = sequence.camera.width, sequence.camera.height
        tracker = LucasKanade().start(SequenceContext(sequence.id, size, n_frames, 1, 0, None))
        self._steps = [tracker.step(Frame(index, sequence.image(index))) for index in range(n_frames)]

    def start(self, _):
        return self

    def step(self, frame):
        return self._steps[frame.index]


@cache
def simulated():
    """A simulated sequence in memory, so that its images are rendered once."""
    made = open_sequence("simulated", motions=("arvr",), frames=30, width=320, height=240, supersampling=1)
    maps = [made.depth(index) for index in range(len(made))]
    return Sequence.from_arrays(
        [made.image(index) for index in range(len(made))],
        made.world_from_camera,
        made.camera,
        [np.where(one.valid, one.depth_m, 0.0) for one in maps],
    )


@cache
def followed():
    return Followed(simulated(), 30)


@pytest.fixture(scope="module", autouse=True)
def let_go():
    """The sequence is in memory as long as these tests need it, which look at the verdict on the truth alone."""
    with only_topics():
        yield
    simulated.cache_clear()
    followed.cache_clear()


def measured(sequence, most=30, tracker=None):
    # a ray cast from wrong poses would give other depths
    return measure(sequence, tracker or followed(), truth="birth", max_frames=most)


@pytest.mark.parametrize("name", SEEN_IN_SLOW_TRACKS)
def test_a_planted_mistake_is_named(name):
    plant, _, words = MISTAKES[name]
    found = doubts(measured(plant(simulated())), KINDS)
    assert any(words in sentence for sentence in sentences(found)), found


def test_a_planted_mistake_is_named_where_the_camera_changes():
    """By a thousandth of the focal length from image to image, as where each image was calibrated by itself."""
    made = simulated()
    focal = made.camera.fx * (1.0 + 1e-3 * np.sin(np.arange(len(made))))
    changing = replace(made, cameras=tuple(replace(made.camera, fx=fx, fy=fx) for fx in focal.tolist()))
    plant, _, words = MISTAKES["inverted"]
    assert any(words in sentence for sentence in doubts(measured(plant(changing)), KINDS).mistakes)
    assert doubts(measured(changing), KINDS) == Doubts()


def test_gaps_between_images_are_named():
    """Where frames were lost, ages count others than the times of images."""
    times = np.cumsum(np.where(np.arange(30) % 5 == 0, 0.2, 0.05))
    found = doubts(measured(replace(simulated(), timestamps_s=times)), KINDS)
    assert any("Ages count frames, not time." in sentence for sentence in found.cautions), found


def test_images_that_repeat_while_the_poses_move_are_named():
    """A driver that hands out a frame twice; where its pose comes twice too, nothing is wrong."""
    made = simulated()
    shown = np.where(np.arange(30) % 5 == 4, np.arange(30) - 1, np.arange(30))
    images, maps = [made.image(place) for place in shown], [made.depth(place) for place in shown]

    def recorded(poses):
        depths = [np.where(one.valid, one.depth_m, 0.0) for one in maps]
        again = Sequence.from_arrays(images, poses, made.camera, depths)
        return doubts(measured(again, tracker=Followed(again, 30)), KINDS)

    found = recorded(made.world_from_camera)
    assert any("Images repeat: 6 of 29" in one and "The first is frame 4" in one for one in found.cautions), found
    assert recorded(made.world_from_camera[shown]) == Doubts()


def test_clipped_depths_are_named():
    first = simulated().depth(0)
    largest = float(np.quantile(first.depth_m[first.valid], 0.6))
    found = doubts(measured(Planted(simulated(), depths=lambda depth_m, _: np.minimum(depth_m, largest))), KINDS)
    assert any("Their depths were probably clipped" in sentence for sentence in found.cautions), found


def sentences(found):
    return [*found.mistakes, *found.cautions]


def what_a_run_says(measurement):
    """Mistakes in the data, with which findings and report begin."""
    return tracknoise.analyse(measurement).table("trust").filter(cause="mistakes")["text"].to_list()


@pytest.mark.parametrize("name", SEEN_IN_THE_ERRORS_OF_ALL)
def test_a_mistake_below_the_noise_is_named_by_the_errors_of_all_tracks(name):
    plant, _, words = MISTAKES[name]
    found = tracknoise.analyse(measured(plant(simulated())))
    assert found.truth.verdict == "not trusted"
    assert words in found.truth.sentence
    assert not found.truth.is_usable


def test_the_errors_of_all_tracks_say_nothing_about_a_recording_that_is_right():
    assert what_a_run_says(measured(simulated())) == []


@pytest.fixture(scope="module")
def slow(sample):
    """A slow recording whose depth maps are registered once."""
    recorded = open_sequence("sevenscenes", sample("sevenscenes"))
    return replace(recorded, depths=cache(recorded.depths))


@pytest.fixture(scope="module")
def slow_tracks(slow):
    return Followed(slow, 20)


@pytest.fixture(scope="module")
def tartanair(sample):
    """A recording, and the tracks in its images."""
    recorded = open_sequence("tartanair", sample("tartanair_v2"))
    return recorded, Followed(recorded, len(recorded))


@pytest.mark.parametrize("name", ["one frame late", "one frame early"])
def test_poses_of_the_wrong_frame_are_named_in_a_slow_recording(name, slow, slow_tracks):
    plant, _, words = MISTAKES[name]
    found = doubts(measure(plant(slow), slow_tracks, max_frames=20), KINDS)
    assert any(words in sentence for sentence in sentences(found)), found


@pytest.mark.parametrize("name", SEEN_IN_A_RECORDING)
def test_a_mistake_in_a_real_recording_is_named(name, tartanair):
    plant, _, words = MISTAKES[name]
    recorded, tracks = tartanair
    found = doubts(measured(plant(recorded), len(recorded), tracks), KINDS)
    assert any(words in sentence for sentence in sentences(found)), found


@pytest.fixture
def recorded(sample, slow):
    return lambda name: slow if name == "sevenscenes" else open_sequence(name.split("_")[0], sample(name))


@pytest.mark.parametrize("name", ["tartanair_v1", "sevenscenes", "kitti"])
def test_nothing_is_said_about_recordings_that_are_right(name, recorded):
    """Neither by single tracks, nor by the errors of all of them."""
    found = measure(recorded(name), LucasKanade(), max_frames=FEW_FRAMES)
    assert doubts(found, KINDS) == Doubts()
    assert what_a_run_says(found) == []


def test_nothing_is_said_where_two_trackers_see_a_recording_that_is_right(recorded):
    found = measure(recorded("tartanair_v2"), [LucasKanade(), Correspondence(max_features=500)], max_frames=FEW_FRAMES)
    assert doubts(found, KINDS) == Doubts()


def test_small_errors_of_poses_on_a_straight_path_without_depth_are_no_mistake(sample):
    """The drive begins straight, where turned poses would fit epipolar lines better than the stated ones."""
    drive = open_sequence("kitti-odometry", sample("kitti_odometry"))
    assert doubts(measure(drive, FEW_FEATURES, max_frames=8), KINDS).mistakes == ()


@pytest.mark.parametrize(("reader", "name", "first", "count"), [("tum", "tum_rgbd", 30, 10), ("kitti", "kitti", 27, 6)])
def test_errors_of_a_few_poses_are_no_mistake(reader, name, first, count, sample):
    """Of 81 mistakes, one would undo the errors of a few poses by chance."""
    cut = ChosenFrames(open_sequence(reader, sample(name)), range(first, first + count))
    found = doubts(measure(cut, LucasKanade()), KINDS)
    assert not any("It looks as if" in sentence for sentence in sentences(found)), found


@pytest.mark.parametrize("motion", ["sideways", "fixating", "forward"])
def test_nothing_is_said_about_simulated_motions(motion):
    made = open_sequence("simulated", motions=(motion,), frames=FEW_FRAMES, width=240, height=180, supersampling=1)
    assert doubts(measured(made, tracker=LucasKanade()), KINDS) == Doubts()


def test_errors_that_all_features_share_are_said_to_be_of_the_truth(sample):
    sequence = open_sequence("tum", sample("tum_rgbd"))
    found = tracknoise.analyse(measure(sequence, FEW_FEATURES, max_frames=FEW_FRAMES))
    assert found.truth.verdict == "not trusted"


def test_positions_that_were_made_up_say_nothing_about_data():
    wrong = measured(Planted(simulated(), poses=scaled_positions(1000)))
    assert doubts(wrong, KINDS).mistakes
    assert doubts(wrong, {"lucas-kanade": "oracle"}) == Doubts()


def test_depths_that_cannot_be_metres_are_named():
    right = measured(simulated())
    far = replace(right, tracks=right.tracks.with_columns(pl.col("depth_m") * 1e4))
    assert any("not metres" in sentence for sentence in doubts(far, KINDS).mistakes)


def test_noise_of_depths_looks_like_edges():
    exact = simulated()
    rng = np.random.default_rng(1)
    noisy = replace(
        measured(exact, most=2),
        sequence=Sequence.from_arrays(
            [exact.image(index) for index in range(4)],
            exact.world_from_camera[:4],
            exact.camera,
            [exact.depth(index).depth_m * (1.0 + 0.015 * rng.normal(size=(240, 320))) for index in range(4)],
        ),
    )
    assert depth_edges(noisy) > 0.7
    assert depth_edges(measured(exact, most=2)) < 0.2
    assert depth_edges(replace(noisy, truth="raycast")) == 0.0


@pytest.mark.parametrize(
    ("errors_deg", "said"),
    [
        (0.0, "The unit of the positions is not metres, or the parallax is too small to show depths."),
        (1.0, "px in the median. Errors of the poses are probably larger than the parallax."),
    ],
)
def test_fitted_points_that_are_too_near_are_told_from_poses_with_errors_above_the_parallax(errors_deg, said):
    """The camera moves by micrometres for pixels, or by so little that errors of its rotation are larger."""
    poses = np.tile(np.eye(4), (len(MOVING), 1, 1))
    poses[:, :2, 3] = 1e-5 * np.outer(np.arange(len(MOVING)), (-2.0, -1.0))
    errors = np.random.default_rng(2).normal(0.0, np.radians(errors_deg), (len(MOVING), 3))
    poses[:, :3, :3] = Rotation.from_rotvec(errors).as_matrix()
    found = measure(Sequence.from_arrays(MOVING, poses, K), LucasKanade(), truth="triangulated")
    (mistake,) = doubts(found, KINDS).mistakes
    assert mistake.startswith("The median depth of points that are fitted to the tracks is 0.00")
    assert mistake.endswith(said)


def test_views_that_no_tracker_can_follow_are_said_to_be_and_nothing_else_is_blamed():
    poses = np.tile(np.eye(4), (len(MOVING), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(np.radians(97.0) * np.outer(np.arange(len(MOVING)), (0, 1, 0))).as_matrix()
    depth = [np.full(MOVING[0].shape, 4.0)] * len(MOVING)
    found = doubts(measure(Sequence.from_arrays(MOVING, poses, K, depth), LucasKanade()), KINDS)
    (mistake,) = found.mistakes
    assert mistake.startswith("No tracker can follow: neighbouring views turn by 97 degrees")
    assert found.cautions == ()
