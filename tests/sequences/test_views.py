"""Sequences cut short, played backward and turned: checked against the sequence itself, whose truth is exact."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import tracknoise
from tracknoise.exceptions import DataError, TracknoiseError
from tracknoise.geometry.accuracy import DepthAccuracy, PoseAccuracy
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.folder import write_folder
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import Scan, Sequence, TruthKind, clock_start_of, second_of
from tracknoise.sequences.views import View, chosen_frames, turned, view
from tracknoise.tables.identity import Direction

SIZE = {"width": 48, "height": 32, "frames": 5}


@pytest.fixture(scope="module")
def plain() -> Sequence:
    return open_sequence("simulated", motions=["arvr"], **SIZE)


def project(sequence: Sequence, index: int, points: np.ndarray) -> np.ndarray:
    return sequence.camera.project(transform(invert(sequence.world_from_camera[index]), points))


@pytest.mark.parametrize("degrees", [0, 90, 180, 270, 360, -90])
def test_a_world_point_lands_on_the_same_thing_in_the_turned_image(plain, degrees) -> None:
    """Where a point lands in the turned image, that image shows what the upright one shows where it lands there."""
    shown = turned(plain, degrees)
    assert shown.id.rotation == degrees % 360
    uv = np.random.default_rng(0).uniform(0, [47, 31], (50, 2))
    points, hit = plain.surface.cast(2, uv)
    there = project(shown, 2, points[hit])
    quarters = degrees // 90 % 4
    expected = {
        0: uv, 1: np.column_stack([uv[:, 1], 47 - uv[:, 0]]),
        2: 47 - uv + (0, -16), 3: np.column_stack([31 - uv[:, 1], uv[:, 0]]),
    }[quarters]  # fmt: skip
    np.testing.assert_allclose(there, expected[hit], atol=1e-4)
    whole = np.rint(uv).astype(int)
    turned_whole = np.rint({
        0: whole, 1: np.column_stack([whole[:, 1], 47 - whole[:, 0]]),
        2: 47 - whole + (0, -16), 3: np.column_stack([31 - whole[:, 1], whole[:, 0]]),
    }[quarters]).astype(int)  # fmt: skip
    image, upright = shown.image(2), plain.image(2)
    np.testing.assert_array_equal(image[turned_whole[:, 1], turned_whole[:, 0]], upright[whole[:, 1], whole[:, 0]])
    depth, plain_depth = shown.depth(2), plain.depth(2)
    np.testing.assert_array_equal(
        depth.depth_m[turned_whole[:, 1], turned_whole[:, 0]], plain_depth.depth_m[whole[:, 1], whole[:, 0]]
    )
    found, seen = shown.surface.cast(2, there)
    assert seen.all()
    np.testing.assert_allclose(found, points[hit], atol=1e-3)


def test_counter_clockwise_is_what_was_right_comes_to_the_top(plain) -> None:
    np.testing.assert_array_equal(turned(plain, 90).image(0)[0], plain.image(0)[:, -1])


def test_a_distorted_camera_turns_with_its_distortion() -> None:
    camera = Camera(640, 480, 500.0, 510.0, 318.3, 242.1, (0.1, -0.05, 0.003, -0.002, 0.01))
    points = np.random.default_rng(1).uniform([-0.5, -0.5, 1.0], [0.5, 0.5, 2.0], (100, 3))
    uv, around = camera.project(points), camera.turned().project(points[:, [1, 0, 2]] * (1, -1, 1))
    np.testing.assert_allclose(around, np.column_stack([uv[:, 1], 639 - uv[:, 0]]), atol=1e-10)
    again = camera.turned().turned().turned().turned()
    np.testing.assert_allclose([again.cx, again.cy, *again.distortion], [camera.cx, camera.cy, *camera.distortion])


def test_backward_is_the_same_frames_in_the_other_order(plain) -> None:
    shown = view(plain, n_frames=4, direction=Direction.backward, rotation=0)
    assert len(shown) == 4
    assert shown.id.direction is Direction.backward
    np.testing.assert_array_equal(shown.world_from_camera, plain.world_from_camera[[3, 2, 1, 0]])
    np.testing.assert_array_equal(shown.image(0), plain.image(3))
    np.testing.assert_array_equal(shown.depth(1).depth_m, plain.depth(2).depth_m)
    uv = np.array([[10.0, 20.0]])
    np.testing.assert_array_equal(shown.surface.cast(0, uv)[0], plain.surface.cast(3, uv)[0])


def test_backward_the_key_frame_lies_as_far_from_the_end(plain) -> None:
    class Scanned(View):
        truths = (TruthKind.scan,)
        scan = Scan(np.zeros((1, 3)), 1)

    assert view(Scanned(plain), n_frames=None, direction=Direction.backward, rotation=90).scan.key_frame == 3


@pytest.fixture
def timed(plain) -> Sequence:
    """Frames at uneven times, through a lens that zooms, with stated uncertainties."""
    cameras = tuple(Camera(48, 32, 40.0 + index, 40.0, 23.5, 15.5) for index in range(5))
    return RecordedSequence(
        id=plain.id,
        source="here",
        camera=cameras[0],
        world_from_camera=plain.world_from_camera,
        images=plain.image,
        time_unit_stated=True,
        timestamps_s=np.array([10.0, 11.0, 13.0, 16.0, 20.0]),
        cameras=cameras,
        pose_accuracy=PoseAccuracy(0.01, 0.002),
        depth_accuracy=DepthAccuracy(0.005, 0.01),
    )


def test_a_shortened_sequence_keeps_the_first_times(timed) -> None:
    assert view(timed, n_frames=3, direction=Direction.forward, rotation=0).timestamps_s.tolist() == [10.0, 11.0, 13.0]


def test_backward_times_increase_by_the_same_intervals_and_cameras_follow_their_frames(timed) -> None:
    shown = view(timed, n_frames=4, direction=Direction.backward, rotation=0)
    assert shown.timestamps_s.tolist() == [10.0, 13.0, 15.0, 16.0]
    assert [shown.camera_at(index).fx for index in range(4)] == [43.0, 42.0, 41.0, 40.0]
    assert shown.camera == shown.camera_at(0)


def test_the_clock_of_the_recording_is_that_of_views_whose_time_runs_forward(timed) -> None:
    clocked = replace(timed, clock_start_ns=7)
    assert clock_start_of(chosen_frames(turned(clocked, 90), [1, 4])) == 7
    assert clock_start_of(view(clocked, n_frames=4, direction=Direction.backward, rotation=0)) is None


def test_turned_cameras_turn_each(timed) -> None:
    shown = view(timed, n_frames=None, direction=Direction.backward, rotation=90)
    assert shown.camera == shown.camera_at(0) == timed.camera_at(4).turned()
    assert shown.camera_at(4) == timed.camera_at(0).turned()


def test_stated_uncertainties_are_those_of_the_sequence_shown(timed) -> None:
    shown = view(timed, n_frames=3, direction=Direction.backward, rotation=90)
    assert isinstance(shown, Sequence)
    assert (shown.pose_accuracy, shown.depth_accuracy) == (timed.pose_accuracy, timed.depth_accuracy)


def test_unknown_times_stay_unknown(plain) -> None:
    assert view(plain, n_frames=3, direction=Direction.backward, rotation=90).timestamps_s is None


def test_a_view_of_everything_is_the_sequence_itself(plain) -> None:
    assert view(plain, n_frames=9, direction=Direction.forward, rotation=0) is plain


def test_views_can_be_sent_to_another_process(plain) -> None:
    shown = view(plain, n_frames=3, direction=Direction.backward, rotation=270)
    copy = pickle.loads(pickle.dumps(shown))
    assert (copy.id, len(copy)) == (shown.id, 3)
    np.testing.assert_array_equal(copy.image(1), shown.image(1))


def test_only_quarter_turns(plain) -> None:
    with pytest.raises(ValueError, match="multiples of 90 degrees, not by 45"):
        turned(plain, 45)


def test_chosen_frames_are_numbered_from_0_and_their_source_is_noted(timed, plain) -> None:
    shown = chosen_frames(timed, [1, 3, 2])
    assert len(shown) == 2
    assert shown.timestamps_s.tolist() == [11.0, 16.0]
    assert [shown.camera_at(index).fx for index in range(2)] == [41.0, 43.0]
    assert shown.camera == shown.camera_at(0)
    assert shown.notes == (*timed.notes, "frames 1 to 3 in steps of 2 of 5 are used; here they are numbered from 0")
    np.testing.assert_array_equal(shown.world_from_camera, plain.world_from_camera[[1, 3]])
    shown = chosen_frames(plain, [1, 9])
    assert len(shown) == 4
    np.testing.assert_array_equal(shown.image(2), plain.image(3))
    np.testing.assert_array_equal(shown.depth(2).depth_m, plain.depth(3).depth_m)
    uv = np.array([[10.0, 20.0]])
    np.testing.assert_array_equal(shown.surface.cast(1, uv)[0], plain.surface.cast(2, uv)[0])
    assert "frames 1 to 4 of 5 are used; here they are numbered from 0" in shown.notes


def test_chosen_frames_combine_with_their_largest_number(plain) -> None:
    shown = view(plain, frames=[0, 4, 2], n_frames=2, direction=Direction.backward, rotation=0)
    np.testing.assert_array_equal(shown.world_from_camera, plain.world_from_camera[[2, 0]])


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ([3], r"frames = \[3\], expected first, last and step"),
        ([3, 3], "expected first, last and step"),
        ([-1, 3], "expected first, last and step"),
        ([0, 3, 0], "expected first, last and step"),
        ([0, 3, 1, 1], "expected first, last and step"),
        ([4, 9, 1], "5 frames, of which frames 4 to 9 in steps of 1 have 1, expected at least 2"),
    ],
)
def test_a_bad_range_is_an_error(plain, frames, message) -> None:
    with pytest.raises(TracknoiseError, match=message):
        chosen_frames(plain, frames)


def test_the_key_frame_is_counted_among_the_chosen_frames(plain) -> None:
    class Scanned(View):
        truths = (TruthKind.scan,)
        scan = Scan(np.zeros((1, 3)), 3)

    assert chosen_frames(Scanned(plain), [1, 4, 2]).scan.key_frame == 1
    for frames in ([0, 4, 2], [4, 9]):
        with pytest.raises(DataError, match=r"a choice with the key frame 3 in it|at least 2"):
            assert chosen_frames(Scanned(plain), frames).scan


def test_damage_outside_of_the_chosen_frames_does_not_matter(tmp_path, plain) -> None:
    write_folder(plain, tmp_path / "scene")
    for name in ("images/000000.png", "images/000004.png", "depth/000000.npy"):
        (tmp_path / "scene" / name).write_bytes(b"damaged")
    sequence = open_sequence("folder", tmp_path, frames=(1, 3, 1))
    trackers = tracknoise.LucasKanade(min_features=10, max_features=20)
    found = tracknoise.measure(sequence, trackers)
    assert found.n_frames == 3
    again = tracknoise.measure(open_sequence("folder", tmp_path), trackers, frames=[1, 4], max_frames=3)
    assert again.observations.equals(found.observations)
    with pytest.raises(DataError, match=r"000000\.png"):
        tracknoise.measure(open_sequence("folder", tmp_path), trackers)


def test_the_size_comes_from_an_image_that_can_be_read(tmp_path, write_sevenscenes) -> None:
    folder = write_sevenscenes(tmp_path / "seq-01", frames=4)
    (folder / "frame-000000.color.png").write_bytes(b"damaged")
    sequence = open_sequence("sevenscenes", tmp_path, frames=[1, 3])
    assert sequence.image(0).shape == (480, 640)
    for path in folder.glob("*.color.png"):
        path.write_bytes(b"damaged")
    with pytest.raises(DataError, match=r"frame-000000\.color\.png"):
        open_sequence("sevenscenes", tmp_path)


def test_the_second_camera_is_shown_as_the_first_is() -> None:
    """A view of a recording of both cameras is, seen by the second, the same view of a recording of the second."""
    both = open_sequence("simulated", motions=["arvr"], baseline_m=0.2, **SIZE)
    part = {"n_frames": None, "direction": Direction.backward, "rotation": 90, "frames": (1, 4, 1)}
    shown = view(both, **part)
    second = pickle.loads(pickle.dumps(second_of(shown)))
    alone = view(replace(both, world_from_camera=both.world_from_camera @ second_of(both).first_from_second), **part)
    np.testing.assert_allclose(shown.world_from_camera @ second.first_from_second, alone.world_from_camera, atol=1e-12)
    assert second.camera == alone.camera
    for index in range(len(shown)):
        seen = np.abs(second.images(index).astype(float) - alone.image(index))
        assert np.median(seen) < 6.0  # the noise of two sensors
