"""What the points of a check say about the truth: planted faults are found in them, and exact truths have none."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.validity.rigid import CAMERA, by_hand, pose_noise

from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.identity import SequenceId
from tracknoise.truth_faults.audit_selection import select
from tracknoise.truth_faults.check_evidence import Followed, check_rigid, check_samples
from tracknoise.truth_faults.check_report import Severity
from tracknoise.truth_faults.image_evidence import Evidence, Flow, Pair
from tracknoise.truth_faults.pose_accuracy import pose_share
from tracknoise.truth_faults.recording_checks import repeated_frames

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
