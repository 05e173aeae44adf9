"""Recordings in which nothing moves, or nothing is seen: `check` says so, without numbers that mean nothing."""

import json
from dataclasses import asdict, replace

import cv2
import numpy as np
from benchmarks.validity.audit_worlds import World, make_samples, theta_of

from tracknoise.sequences.arrays import Sequence
from tracknoise.truth_faults.audit_tables import enough
from tracknoise.truth_faults.check_recording import check_sequence
from tracknoise.truth_faults.check_report import SequenceReport

K = np.array([[200.0, 0, 79.5], [0, 200.0, 59.5], [0, 0, 1]])
TEXTURE = cv2.GaussianBlur(np.random.default_rng(3).uniform(0, 255, (120, 160)).astype(np.float32), (0, 0), 1.5)


def checked(image: np.ndarray) -> SequenceReport:
    return check_sequence(Sequence.from_arrays([image] * 12, [np.eye(4)] * 12, K, [np.full((120, 160), 4.0)] * 12))


def texts(report: SequenceReport) -> dict[str, str]:
    return {item.topic: item.text for item in report.items}


def test_the_same_image_at_the_same_place_has_no_errors_and_no_share_of_them() -> None:
    report = checked(cv2.normalize(TEXTURE, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8))
    assert "the camera does not move" in report.truth.text
    assert texts(report)["pose jumps"].startswith("The median step is 0 m and 0 deg;")
    assert "no pair of images with motion" in texts(report)["usual mistakes"]
    json.dumps(asdict(report), allow_nan=False)


def test_where_nothing_is_followed_depths_are_not_to_blame() -> None:
    report = checked(np.full((120, 160), 128, np.uint8))
    assert "has a depth" not in report.truth.text


def test_true_positions_that_stand_still_are_not_audited() -> None:
    samples = make_samples(np.random.default_rng(0), World(n_scenes=8, per_scene=100), theta_of({}))
    assert enough(samples) is samples
    found = enough(replace(samples, stated=samples.uv_at_birth))
    assert isinstance(found, str)
    assert found.startswith("no true position moves in the images")
