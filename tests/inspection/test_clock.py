"""Offsets between the clocks of images and poses, of known size."""

import numpy as np
import pytest
from tests.inspection.planted import shifted

from tracknoise.inspection.check_report import Severity
from tracknoise.inspection.clock import clock
from tracknoise.inspection.clock_offset import Rates, estimate_offset
from tracknoise.inspection.evidence import Evidence
from tracknoise.sequences.registry import open_sequence


@pytest.fixture(scope="module")
def handheld(sample):
    sequence = open_sequence("sevenscenes", sample("sevenscenes"), calibration="raw")
    return Evidence.measured(sequence)


@pytest.fixture(scope="module")
def given(handheld):
    """The offset of the recording itself, frames."""
    return clock(handheld, None).values["offset_frames"]


def rates(offset, *, noise=1e-4, n=90):
    """A hand-held camera's rotation rate, sampled exactly at shifted times."""
    steps, rng = np.arange(n, dtype=float), np.random.default_rng(3)

    def rate(at):
        return 0.01 * np.stack([np.sin(at / 4), np.cos(at / 7), np.sin(at / 5 + 1)], axis=1)

    return Rates(steps, rate(steps) + noise * rng.standard_normal((n, 3)), rate(steps - offset))


@pytest.mark.parametrize("offset", [-2.3, -1.0, -0.4, 0.0, 0.4, 1.0, 3.0])
def test_offsets_of_rates_come_out_to_a_hundredth_of_a_frame(offset):
    found = estimate_offset(rates(offset))
    assert found.frames == pytest.approx(offset, abs=0.02)
    assert found.sd_frames < 0.02


def test_the_standard_deviation_is_that_of_repeated_estimates():
    made = [estimate_offset(noisy(seed)) for seed in range(30)]
    spread = np.std([one.frames for one in made])
    assert np.median([one.sd_frames for one in made]) == pytest.approx(spread, rel=0.5)


def noisy(seed):
    exact = rates(0.4, noise=0.0)
    rng = np.random.default_rng(seed)
    return Rates(exact.steps, exact.by_image + 2e-3 * rng.standard_normal(exact.by_image.shape), exact.by_poses)


@pytest.mark.parametrize("frames", [0.4, 1.0, -1.6])
def test_an_offset_planted_in_a_recording_is_measured_to_a_tenth_of_a_frame(handheld, given, frames):
    late = Evidence.of(handheld.flow, shifted(frames)(handheld.poses), handheld.camera)
    item = clock(late, np.arange(len(late.poses)) / 30.0)
    assert item.severity is Severity.caveat
    assert item.values["offset_frames"] - given == pytest.approx(-frames, abs=0.1)
    assert item.values["offset_s"] == pytest.approx(item.values["offset_frames"] / 30.0)
    assert ("earlier" in item.text) is (frames > 0)


def test_clocks_that_agree_are_no_caveat(handheld):
    assert clock(handheld, None).severity is Severity.ok


def test_without_rotation_no_offset_can_be_seen():
    sequence = open_sequence("simulated", motions=("sideways",), frames=12, width=160, height=120)
    assert clock(Evidence.measured(sequence), None).severity is Severity.unknown


def test_too_few_steps_give_no_estimate():
    assert estimate_offset(rates(0.0, n=6)) is None


def test_frames_without_a_pose_are_left_out():
    made = rates(0.4)
    made.by_poses[40] = np.nan
    assert estimate_offset(made).frames == pytest.approx(0.4, abs=0.02)
