"""Recordings in which nothing moves, or nothing is seen: `check` says so, without numbers that mean nothing."""

import json
from dataclasses import asdict, replace

import cv2
import numpy as np
from benchmarks.validity.audit_worlds import World, make_samples, theta_of

from tracknoise.experiments.doubts import doubts
from tracknoise.experiments.measure import measure
from tracknoise.sequences.arrays import Sequence
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.enumerations import Trust
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.truth_faults.audit_tables import enough
from tracknoise.truth_faults.check_recording import check_sequence
from tracknoise.truth_faults.check_report import SequenceReport
from tracknoise.truth_faults.pose_errors import REACH, Normal

K = np.array([[200.0, 0, 79.5], [0, 200.0, 59.5], [0, 0, 1]])
TEXTURE = cv2.GaussianBlur(np.random.default_rng(3).uniform(0, 255, (120, 160)).astype(np.float32), (0, 0), 1.5)


GREY = cv2.normalize(TEXTURE, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
MOVING = [np.roll(GREY, (frame, 2 * frame), axis=(0, 1)) for frame in range(12)]


def still(images: list[np.ndarray]) -> Sequence:
    return Sequence.from_arrays(images, [np.eye(4)] * 12, K, [np.full((120, 160), 4.0)] * 12)


def checked(image: np.ndarray) -> SequenceReport:
    return check_sequence(still([image] * 12))


def texts(report: SequenceReport) -> dict[str, str]:
    return {item.topic: item.text for item in report.items}


def test_the_same_image_at_the_same_place_has_no_errors_and_no_share_of_them() -> None:
    report = checked(GREY)
    assert report.truth.verdict is Trust.unknown
    assert texts(report)["pose jumps"].startswith("The median step is 0 m and 0 deg;")
    assert texts(report)["usual mistakes"].startswith("All poses are the same, and the images do not move")
    json.dumps(asdict(report), allow_nan=False)


def test_images_that_move_where_poses_do_not_are_a_mistake_to_the_check_and_to_a_run() -> None:
    recording = still(MOVING)
    report = check_sequence(recording)
    assert report.truth.verdict is Trust.not_trusted
    assert "All poses are the same, but the images move by " in report.truth.text
    mistake = doubts(measure(recording, LucasKanade()), {"lucas-kanade": "lucas-kanade"}).mistakes[0]
    assert mistake.startswith("All poses are the same, but the images move by ")


def test_a_tripod_is_no_mistake_to_a_run() -> None:
    assert doubts(measure(still([GREY] * 12), LucasKanade()), {"lucas-kanade": "lucas-kanade"}).mistakes == ()


def test_where_nothing_is_followed_depths_are_not_to_blame() -> None:
    report = checked(np.full((120, 160), 128, np.uint8))
    assert "has a depth" not in report.truth.text


def test_true_positions_that_stand_still_are_not_audited() -> None:
    samples = make_samples(np.random.default_rng(0), World(n_scenes=8, per_scene=100), theta_of({}))
    assert enough(samples) is samples
    found = enough(replace(samples, stated=samples.uv_at_birth))
    assert isinstance(found, str)
    assert found.startswith("no true position moves in the images")


def test_a_pose_a_million_kilometres_away_is_named_and_ends_no_check() -> None:
    made = open_sequence("simulated", motions=["sideways"], frames=60, width=160, height=120, supersampling=1)
    poses = made.world_from_camera.copy()
    poses[30, 0, 3] += 1e9 - 10.0
    images, depths = ([getattr(made, kind)(index) for index in range(60)] for kind in ("image", "depth"))
    report = check_sequence(Sequence.from_arrays(images, poses, made.camera, [one.depth_m for one in depths]))
    assert "Poses jump in 1 place" in texts(report)["pose jumps"]
    assert report.truth.verdict is Trust.unknown
    assert "too large or too small beside the others. Poses jump in 1 place" in report.truth.text
    assert report.truth.step.startswith("Correct the data")


def test_pose_errors_of_equations_without_a_solution_are_unknown() -> None:
    normal = Normal(np.full((6 * (REACH + 1), 12), -1e9), np.ones((2, 6)), np.full(2, 100))
    assert np.isnan(normal.solve(np.tile(np.eye(6), (2, 1, 1)))).all()
