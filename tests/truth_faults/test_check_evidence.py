"""What the points of a check say about the truth: planted faults are found in them, and exact truths have none."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.validity.rigid import CAMERA, by_hand, pose_noise
from scipy.spatial.transform import Rotation

from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import NED_AXES, OPENGL_AXES
from tracknoise.tables.identity import SequenceId
from tracknoise.truth_faults.audit_selection import select
from tracknoise.truth_faults.check_evidence import Followed, check_rigid, check_samples
from tracknoise.truth_faults.check_report import Severity
from tracknoise.truth_faults.image_evidence import Evidence, Flow, Pair
from tracknoise.truth_faults.motion_checks import mistakes, warping
from tracknoise.truth_faults.pose_accuracy import pose_share
from tracknoise.truth_faults.recording_checks import repeated_frames, repeated_images, view_changes

FRAMES = 60
EXACT = by_hand(FRAMES)


def flow(*, noise_px=0.2, n=150, depth=True, seed=0):
    """Points that a camera with exact poses sees: between consecutive frames, and four frames apart."""
    rng = np.random.default_rng(seed)
    pairs = []
    for first in range(FRAMES):
        for second in (first + 1, first + 4):
            if second >= FRAMES:
                continue
            uv, depth_m = rng.uniform((8.0, 8.0), (632.0, 472.0), (n, 2)), rng.uniform(1.0, 5.0, n)
            moved = transform(invert(EXACT[second]) @ EXACT[first], CAMERA.unproject(uv, depth_m))
            seen = CAMERA.project(moved) + noise_px * rng.standard_normal((n, 2))
            pairs.append(Pair(first, second, uv, seen, depth_m if depth else np.full(n, np.nan), moved[:, 2]))
    steps, wide = ([pair for pair in pairs if (pair.second - pair.first == 1) == short] for short in (True, False))
    return Flow(tuple(steps), tuple(wide))


def found(poses, seen=None, timestamps_s=None):
    """The evidence of stated poses, and their sequence."""
    sequence = RecordedSequence(
        id=SequenceId("made", "by-hand"),
        source="made",
        camera=CAMERA,
        world_from_camera=poses,
        images=lambda index: np.zeros((480, 640), np.uint8),
        timestamps_s=timestamps_s,
    )
    return Evidence.of(flow() if seen is None else seen, poses, CAMERA), sequence


def share(poses, seen=None):
    (row,) = pose_share([check_rigid(Followed.of(*found(poses, seen)))]).iter_rows(named=True)
    return row


def test_a_walk_of_the_poses_is_found_and_exact_poses_have_none():
    walked = EXACT @ pose_noise("walk", 0.05, 0.003, FRAMES, np.random.default_rng(1))
    honest, faulty = share(EXACT), share(walked)
    assert honest["share"] == pytest.approx(0.0, abs=0.02)
    assert faulty["low"] > 0.5
    assert faulty["fitted_to"] == "own"


def test_wild_points_do_not_move_the_share():
    seen, rng = flow(), np.random.default_rng(2)
    wild = Flow(*(tuple(_astray(pair, rng) for pair in pairs) for pairs in (seen.steps, seen.wide)))
    walked = EXACT @ pose_noise("walk", 0.02, 0.001, FRAMES, np.random.default_rng(1))
    assert share(walked, wild)["share"] == pytest.approx(share(walked)["share"], abs=0.06)
    assert share(EXACT, wild)["share"] == pytest.approx(0.0, abs=0.02)


def _astray(pair, rng):
    lost = rng.random(len(pair.uv_first)) < 0.05
    return replace(pair, uv_second=pair.uv_second + lost[:, None] * rng.normal(0.0, 60.0, pair.uv_second.shape))


def test_an_audit_names_what_was_planted_and_nothing_in_an_exact_truth():
    late = EXACT[np.minimum(np.arange(FRAMES) + 1, FRAMES - 1)]
    honest, faulty = (
        check_samples(Followed.of(*found(poses, timestamps_s=np.arange(FRAMES) / 30.0))) for poses in (EXACT, late)
    )
    assert not select(honest).named
    (first, *_) = select(faulty).named
    assert first.parameter == "clock_offset"
    assert first.estimate[0] == pytest.approx(-1.0, abs=0.1)


def test_frames_without_a_pose_and_their_neighbours_are_left_out():
    gaps = EXACT.copy()
    gaps[[7, 30]] = np.nan
    samples = check_samples(Followed.of(*found(gaps)))
    frames = set(samples.birth.tolist()) | set(samples.now.tolist())
    assert frames.isdisjoint({6, 7, 8, 29, 30, 31})
    assert share(gaps)["share"] == pytest.approx(0.0, abs=0.02)


def test_points_without_depth_say_nothing():
    assert Followed.of(*found(EXACT, flow(depth=False))) == "no point that was followed has a depth"


def test_stretches_of_a_long_recording_are_not_joined():
    seen = flow()
    some = [tuple(p for p in pairs if p.second < 20 or p.first >= 40) for pairs in (seen.steps, seen.wide)]
    rows = check_rigid(Followed.of(*found(EXACT, Flow(*some))))
    assert rows["age"].max() == 4
    assert rows["n"].sum() == 150 * (len(some[0]) + len(some[1]))


def test_passes_that_repeat_each_other_are_one_sample():
    """A recording of a third of the frames, shown three times: its blocks are those of the first pass."""
    once = FRAMES // 3
    again = np.concatenate([EXACT[:once]] * 3)
    pairs = [pair for pair in flow().steps if pair.second < once]
    starts = (0, once, 2 * once)
    passes = [replace(pair, first=pair.first + at, second=pair.second + at) for at in starts for pair in pairs]
    evidence, sequence = found(again, Flow(tuple(passes), ()))
    repeated, whole = (Followed.of(*one) for one in ((evidence, sequence), found(EXACT)))
    assert repeated.samples.n_clusters == -(-whole.samples.n_clusters // 3)
    assert check_rigid(repeated)["block"].max() <= check_rigid(whole)["block"].max() // 3
    item = repeated_frames(sequence)
    assert item.severity is Severity.caveat
    assert item.text.startswith("The recording repeats itself: 40 of 60 frames have exactly the pose of an earlier")
    assert repeated_frames(found(EXACT)[1]) is None


@pytest.mark.parametrize(("size", "walks"), [(3.0, False), (10.0, True)])
def test_positions_with_errors_above_the_parallax_are_in_no_other_unit(size, walks):
    """With depths that are larger by any factor, such errors are smaller: no unit is wrong."""
    step_m = np.median(np.linalg.norm(np.diff(EXACT[:, :3, 3], axis=0), axis=1))
    errors = np.random.default_rng(3).normal(0.0, size * step_m, (FRAMES, 3))
    poses = EXACT.copy()
    poses[:, :3, 3] += np.cumsum(errors, axis=0) if walks else errors
    item = mistakes(found(poses)[0])
    assert (item.severity, item.values["mistake"]) == (Severity.fatal, "positions")
    assert "errors of the camera's positions are larger than the parallax" in item.text
    assert "metres" not in item.text
    assert "times too" not in item.text


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (1000.0, "depths are 1000 times too small for the positions of the camera (positions are probably in millim"),
        (100.0, "depths are 100 times too small for the positions of the camera (positions are probably in centim"),
        (39.37, "depths are about 42 times too small for the positions of the camera. "),  # inches
        (0.01, "depths are 100 times too large for the positions of the camera (positions are probably divided by 100"),
        (0.8, "depths are about 1.2 times too large for the positions of the camera. "),  # no scale of its own, as SLAM
        (1.5, "depths are about 1.5 times too small for the positions of the camera. "),
    ],
)
def test_positions_in_another_unit_are_no_errors(factor, said):
    poses = EXACT.copy()
    poses[:, :3, 3] *= factor
    assert f"It looks as if {said}" in mistakes(found(poses)[0]).text


@pytest.mark.parametrize(
    ("expected", "recorded", "said"),
    [
        (
            OPENGL_AXES,
            np.eye(3),
            "recorded poses have axes of a camera image (x right, y down, z forward), where the format of the reader "
            "has axes of OpenGL (x right, y up, z backward)",
        ),
        (
            NED_AXES,
            np.diag([1.0, -1.0, -1.0]),
            "recorded poses have axes of OpenGL (x right, y up, z backward), where the format of the reader has axes "
            "of NED (x forward, y right, z down)",
        ),
        (
            NED_AXES,
            np.array([[0, 0, -1], [1, 0, 0], [0, -1, 0]]),
            "poses have the axes of OpenGL (x right, y up, z backward), not those of a camera image, once the reader "
            "has turned axes of NED (x forward, y right, z down) into those",
        ),
    ],
)
def test_axes_are_told_by_what_the_reader_expects_and_what_the_data_have(expected, recorded, said):
    """`recorded`: axes of the image in those of the recorded poses, which the reader takes for `expected`."""
    image_from_expected = {
        OPENGL_AXES: np.diag([1.0, -1.0, -1.0]),
        NED_AXES: np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    }
    read = EXACT.copy()
    read[:, :3, :3] = EXACT[:, :3, :3] @ recorded.T @ image_from_expected[expected].T
    item = mistakes(Evidence.of(flow(), read, CAMERA, None, expected))
    assert f"It looks as if {said}. " in item.text
    assert mistakes(Evidence.of(flow(), EXACT, CAMERA, None, expected)).severity is Severity.ok


def test_poses_that_were_inverted_before_their_axes_were_turned_are_inverted():
    turn = np.diag([1.0, -1.0, -1.0, 1.0])
    item = mistakes(Evidence.of(flow(), invert(EXACT @ turn) @ turn, CAMERA, None, OPENGL_AXES))
    assert item.values["mistake"] == "inverted"


def turned_by(deg):
    """Exact poses with white errors of their rotations."""
    return EXACT @ pose_noise("white", deg, 0.0, FRAMES, np.random.default_rng(1))


@pytest.mark.parametrize("noise_px", [0.05, 0.3])
def test_without_depth_small_distances_from_epipolar_lines_are_said_and_large_ones_are_wrong(noise_px):
    seen = flow(noise_px=noise_px, depth=False)
    right, wrong = (warping(found(poses, seen)[0]) for poses in (EXACT, turned_by(0.3)))
    assert (right.severity, wrong.severity) == (Severity.ok, Severity.fatal)
    assert right.values["long_residual_px"] == pytest.approx(0.674 * noise_px, rel=0.15)  # median of a half normal
    assert f"the residual is {right.values['long_residual_px']:.2f} px. Rotations of the poses" in right.text
    assert "the scale of the positions, cannot be seen" in right.text
    assert "Rotations of the poses, directions of their motion, or the intrinsics are wrong." in wrong.text


def test_without_depth_traffic_does_not_convict_the_poses():
    rng = np.random.default_rng(2)

    def with_traffic(pair):
        moves = rng.random(len(pair.uv_first)) < 0.6
        return replace(pair, uv_second=pair.uv_second + moves[:, None] * np.array([3.0, 4.0]))

    seen = flow(depth=False)
    busy = Flow(*(tuple(map(with_traffic, pairs)) for pairs in (seen.steps, seen.wide)))
    item = warping(found(EXACT, busy)[0])
    assert max(item.values["short_residual_px"], item.values["long_residual_px"]) > 1.0
    assert item.severity is not Severity.fatal


def test_without_depth_a_camera_that_is_said_to_stay_is_compared_with_its_rotation():
    turning = EXACT.copy()
    turning[:, :3, 3] = 0.0
    item = warping(found(turning, flow(depth=False))[0])
    assert item.severity is Severity.fatal
    assert np.isfinite(item.values["long_residual_px"])


def test_views_without_a_common_part_are_no_path():
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(np.radians(97.0) * np.outer(np.arange(FRAMES), [0, 1, 0])).as_matrix()
    item = view_changes(found(poses)[1])
    assert item.severity is Severity.fatal
    assert item.text.startswith(
        "No tracker can follow: neighbouring views turn by 97 degrees in the median, with a field"
    )
    assert "These are probably photos in no order" in item.text
    assert view_changes(found(EXACT)[1]) is None


def test_images_repeat_where_nothing_moves_but_the_poses():
    motion_px = dict.fromkeys(range(1, FRAMES), 2.0) | {7: 0.0, 30: 0.0}
    item = repeated_images(EXACT, motion_px)
    assert (item.severity, item.values) == (Severity.caveat, {"n_repeated": 2, "first": 7})
    waits = EXACT.copy()
    waits[[7, 30]] = EXACT[[6, 29]]
    assert repeated_images(waits, motion_px) is None
    assert repeated_images(EXACT, dict.fromkeys(range(1, FRAMES), 0.0)) is None
