"""Offsets between the clocks of images and poses, of known size."""

from dataclasses import replace

import numpy as np
import pytest
from tests.truth_faults.planted import shifted, without_depth

from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.views import chosen_frames
from tracknoise.truth_faults import clock_check
from tracknoise.truth_faults.check_report import Severity
from tracknoise.truth_faults.clock_check import Rates, clock, estimate_offset, measured_offset
from tracknoise.truth_faults.image_evidence import Evidence, Flow

N_FRAMES = 60
"""Of the hand-held recording."""


@pytest.fixture(scope="module")
def handheld(sample):
    sequence = open_sequence("sevenscenes", sample("sevenscenes"), calibration="raw")
    return Evidence.measured(chosen_frames(sequence, (0, N_FRAMES - 1)))


@pytest.fixture(scope="module")
def as_recorded(handheld):
    """What is said of the recording itself."""
    return clock(handheld, None)


@pytest.fixture
def given(as_recorded):
    """Its offset, frames."""
    return as_recorded.values["offset_frames"]


def rates(offset, *, noise=1e-4, n=90):
    """A hand-held camera's rotation rate, sampled exactly at shifted times."""
    steps, rng = np.arange(n, dtype=float), np.random.default_rng(3)

    def rate(at):
        return 0.01 * np.stack([np.sin(at / 4), np.cos(at / 7), np.sin(at / 5 + 1)], axis=1)

    return Rates(steps, rate(steps) + noise * rng.standard_normal((n, 3)), rate(steps - offset))


@pytest.mark.parametrize("offset", [-2.3, -0.4, 0.0, 1.0, 3.0])
def test_offsets_of_rates_come_out_to_a_hundredth_of_a_frame(offset):
    found = estimate_offset(rates(offset))
    assert found.frames == pytest.approx(offset, abs=0.02)
    assert found.sd_frames < 0.02


def test_the_standard_deviation_is_that_of_repeated_estimates():
    made = [estimate_offset(noisy(seed)) for seed in range(15)]
    spread = np.std([one.frames for one in made])
    assert np.median([one.sd_frames for one in made]) == pytest.approx(spread, rel=0.5)


def test_parts_in_which_the_camera_turns_about_other_axes_agree_within_their_standard_deviations():
    # the axes have offsets of 0.05, 0.2 and 0.25 frames; each part turns mostly about one of them
    made = [turning_about(axis, offsets=(0.05, 0.2, 0.25)) for axis in (0, 2)]
    first, second = map(estimate_offset, made)
    assert second.frames - first.frames == pytest.approx(0.0, abs=2 * np.hypot(first.sd_frames, second.sd_frames))
    assert all(one.frames == pytest.approx(1 / 6, abs=2 * one.sd_frames) for one in (first, second))
    alike = estimate_offset(turning_about(0, offsets=(0.2, 0.2, 0.2)))
    assert alike.sd_frames < first.sd_frames / 2


def turning_about(axis, *, offsets, n=119):
    """Rates that are three times as large about one axis as about the others, which have offsets of their own."""
    steps, rng = np.arange(n, dtype=float), np.random.default_rng(axis)
    size = np.where(np.arange(3) == axis, 0.015, 0.005)

    def rate(at):
        return size * np.stack([np.sin(at[0] / 4), np.cos(at[1] / 5), np.sin(at[2] / 4.5 + 1)], axis=1)

    by_poses = rate([steps - offset for offset in offsets])
    return Rates(steps, rate([steps] * 3) + 2e-4 * rng.standard_normal((n, 3)), by_poses)


def noisy(seed):
    exact = rates(0.4, noise=0.0)
    rng = np.random.default_rng(seed)
    return Rates(exact.steps, exact.by_image + 2e-3 * rng.standard_normal(exact.by_image.shape), exact.by_poses)


@pytest.mark.parametrize("frames", [0.4, -1.6])
def test_an_offset_planted_in_a_recording_is_measured_to_a_tenth_of_a_frame(handheld, given, frames):
    late = Evidence.of(handheld.flow, shifted(frames)(handheld.poses), handheld.camera)
    item = clock(late, np.arange(len(late.poses)) / 30.0)
    assert item.severity is Severity.caveat
    assert item.values["offset_frames"] - given == pytest.approx(-frames, abs=0.1)
    assert item.values["offset_s"] == pytest.approx(item.values["offset_frames"] / 30.0)
    assert ("earlier" in item.text) is (frames > 0)


def test_clocks_that_agree_are_no_caveat(as_recorded):
    assert as_recorded.severity is Severity.ok


def test_a_clear_offset_that_moves_points_little_is_said_and_is_no_caveat(handheld, monkeypatch):
    monkeypatch.setattr(clock_check, "LEAST_EFFECT_PX", 100.0)
    item = clock(Evidence.of(handheld.flow, shifted(0.4)(handheld.poses), handheld.camera), None)
    assert item.severity is Severity.ok
    assert "Poses and images differ in time" in item.text
    assert "moves points by less than 100 px" in item.text


def test_without_rotation_no_offset_can_be_seen():
    sequence = open_sequence("simulated", motions=("sideways",), frames=12, width=160, height=120, supersampling=1)
    assert clock(Evidence.measured(sequence), None).severity is Severity.unknown


def test_too_few_steps_give_no_estimate():
    assert estimate_offset(rates(0.0, n=6)) is None


def test_frames_without_a_pose_are_left_out():
    made = rates(0.4)
    made.by_poses[40] = np.nan
    assert estimate_offset(made).frames == pytest.approx(0.4, abs=0.02)


def test_frames_without_a_pose_are_left_out_where_translations_are_those_of_poses(handheld, given):
    poses = handheld.poses.copy()
    poses[[0, 20, 21, 45, N_FRAMES - 1]] = np.nan
    item = clock(Evidence.of(handheld.flow, poses, handheld.camera), None)
    assert item.severity is not Severity.unknown
    assert item.values["offset_frames"] == pytest.approx(given, abs=0.05)


@pytest.mark.parametrize("kept", [[40, 41], [0, N_FRAMES - 1]])
def test_the_clock_of_two_poses_is_not_known(handheld, kept):
    poses = np.full_like(handheld.poses, np.nan)
    poses[kept] = handheld.poses[kept]
    assert clock(Evidence.of(handheld.flow, poses, handheld.camera), None).severity is Severity.unknown


@pytest.fixture(scope="module")
def rendered(sample):
    """Exact images and poses, whose rotation is next to impossible to see without depth."""
    return Evidence.measured(open_sequence("tartanair", sample("tartanair_v1")))


@pytest.mark.parametrize("frames", [0.0, 0.5])
def test_searches_that_all_end_at_the_same_bound_have_found_no_offset(rendered, frames):
    late = shifted(frames)(rendered.poses)
    item = clock(Evidence.of(without_depth(rendered.flow), late, rendered.camera), None)
    assert item.severity is Severity.unknown


@pytest.mark.parametrize("frames", [-1.0, 3.0])
def test_with_depth_offsets_of_these_images_are_found(rendered, frames):
    item = clock(Evidence.of(rendered.flow, shifted(frames)(rendered.poses), rendered.camera), None)
    assert item.severity is Severity.caveat
    assert item.values["offset_frames"] == pytest.approx(-frames, abs=3 * item.values["sd_frames"])


def test_a_minimum_beyond_the_bound_of_the_first_search_is_found(handheld):
    part = slice(20, 40)
    steps = [replace(one, first=one.first - 20, second=one.second - 20) for one in handheld.flow.steps[part][:-1]]
    early = shifted(-3)(handheld.poses)[part]
    found = measured_offset(Evidence.of(without_depth(Flow(tuple(steps), ())), early, handheld.camera))
    assert np.isfinite(found.sd_frames)
    assert found.frames == pytest.approx(3.0, abs=3 * found.sd_frames)


@pytest.mark.parametrize("offset", [-3.0, 3.0])
def test_an_offset_of_few_steps_has_a_spread_that_covers_its_error(offset):
    found = estimate_offset(rates(offset, n=10, noise=2e-4))
    assert abs(found.frames - offset) < 4 * found.sd_frames
