"""Sizes of the errors of stated poses: planted walks and jitter come back, and what cannot be told is not stated."""

import numpy as np
import pytest
from benchmarks.validity.rigid import CAMERA, by_hand, pose_noise

from tracknoise.measurement.refined_poses import RefinedPoses, stated_errors
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import PoseFit, joined_fit

FRAMES = 200
EXACT = by_hand(FRAMES)
DEG, METRES = 0.05, 0.004


def found(stated, *, halves=(EXACT, EXACT)):
    sequence = RecordedSequence(
        id=SequenceId("made", "by-hand"),
        source="made",
        camera=CAMERA,
        world_from_camera=stated,
        images=lambda index: np.zeros((480, 640), np.uint8),
    )
    return stated_errors(RefinedPoses.of(sequence, EXACT, pose_halves=halves))


def spoilt(seed):
    return EXACT @ pose_noise("walk", DEG, METRES, FRAMES, np.random.default_rng(seed))


def test_a_planted_walk_comes_back():
    laws = [found(spoilt(seed)) for seed in range(12)]
    rms = {name: np.sqrt(np.mean([law[name] ** 2 for law in laws])) for name in laws[0]}
    assert rms["rotation_deg_per_sqrt_frame"] == pytest.approx(DEG, rel=0.15)
    assert rms["translation_m_per_sqrt_frame"] == pytest.approx(METRES, rel=0.15)
    assert rms["rotation_white_deg"] < 0.3 * rms["rotation_deg_per_sqrt_frame"]


def test_planted_jitter_comes_back():
    law = found(EXACT @ pose_noise("white", DEG, METRES, FRAMES, np.random.default_rng(4)))
    assert law["rotation_white_deg"] == pytest.approx(DEG, rel=0.15)
    assert law["translation_white_m"] == pytest.approx(METRES, rel=0.15)
    assert law["rotation_deg_per_sqrt_frame"] < 0.4 * DEG


def test_errors_as_small_as_those_of_refined_poses_are_not_stated():
    halves = spoilt(1), spoilt(2)
    assert found(EXACT, halves=halves) is None


def test_frames_without_a_pose_take_no_part():
    stated = spoilt(3)
    stated[::50] = np.nan
    assert found(stated)["translation_m_per_sqrt_frame"] > 0.0


def test_what_no_part_determined_stays_undetermined_when_parts_are_joined():
    refused = PoseFit(False, reason="Poses are not refined: no depth.")
    law = {"rotation_deg_per_sqrt_frame": 0.3}
    joined = joined_fit([PoseFit(True, 200.0, 0.1, 3.0, 10, 1.0, law), PoseFit(True, 300.0, 0.1, 4.0, 10, None, None)])
    assert joined_fit([refused]).stated_px is None
    assert joined_fit([refused]).stated_errors is None
    assert (joined.next_px, joined.stated_errors) == (1.0, law)
    assert joined.stated_px == pytest.approx(np.sqrt(12.5))
