"""Corrections one after the other, and as one."""

import numpy as np
import pytest

import tracknoise as tn
from tracknoise.geometry.corrections import Corrections
from tracknoise.sequences.corrected import corrected
from tracknoise.truth_faults.audit_summary import joined

ONE = {
    "focal_scale": 0.9, "principal_point_px": [1.0, -2.0],
    "depth_scale": 1.1, "depth_offset_m": 0.05, "inverse_depth_offset_per_m": 0.02,
    "clock_offset_frames": 0.25, "mounting_rotation_deg": [10.0, 0.0, -5.0], "mounting_translation_m": [0.1, 0.0, 0.2],
}  # fmt: skip
OTHER = {
    "focal_scale": 1.05, "clock_offset_frames": -0.5, "k1": 0.01,
    "depth_scale": 0.95, "depth_offset_m": -0.02, "inverse_depth_offset_per_m": -0.05,
    "mounting_rotation_deg": [0.0, 20.0, 0.0], "mounting_translation_m": [0.0, 0.3, 0.0],
}  # fmt: skip


@pytest.fixture(scope="module")
def sequence():
    return tn.open_sequence("simulated", motions=["arvr"], frames=8, width=32, height=24)


@pytest.mark.parametrize(("first", "then"), [(ONE, OTHER), (OTHER, ONE), (ONE, {}), ({}, OTHER)])
def test_one_block_does_what_two_do_one_after_the_other(sequence, first, then) -> None:
    twice = corrected(corrected(sequence, Corrections(**first)), Corrections(**then))
    once = corrected(sequence, Corrections(**joined(first, then)))
    inner = slice(2, -2)  # poses between frames are on straight lines, and beyond the first and the last there are none
    moved = once.world_from_camera[inner] - twice.world_from_camera[inner]
    assert np.abs(moved[:, :3, :3]).max() < 1e-3
    assert np.abs(moved[:, :3, 3]).max() < 0.01
    assert (once.camera.fx, once.camera.cx) == pytest.approx((twice.camera.fx, twice.camera.cx))
    assert once.camera.distortion == pytest.approx(twice.camera.distortion)
    one, two = once.depth(3), twice.depth(3)
    assert two.valid.mean() > 0.5
    assert one.valid[two.valid].all()
    np.testing.assert_allclose(one.depth_m[two.valid], two.depth_m[two.valid])


def test_clocks_one_after_the_other_are_one_clock() -> None:
    timed = tn.open_sequence("simulated", motions=["arvr"], frames=20, width=32, height=24, imaging={"rate_hz": 30.0})
    first, then = {"clock_offset_s": 0.02, "clock_drift": 0.1}, {"clock_offset_s": -0.01, "clock_drift": -0.3}
    twice = corrected(corrected(timed, Corrections(**first)), Corrections(**then)).path
    once = corrected(timed, Corrections(**joined(first, then))).path
    np.testing.assert_allclose(once.times, twice.times, atol=1e-12)


def test_corrections_that_undo_each_other_are_none() -> None:
    assert joined({"focal_scale": 0.5, "k1": 0.1, "depth_along_ray": False}, {"focal_scale": 2.0, "k1": -0.1}) == {}
    assert joined({"depth_along_ray": True}, {"depth_along_ray": True}) == {"depth_along_ray": True}
