"""Which faults are named: small versions of `benchmarks.validity.audit`."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.validity.audit import SIZES, holds_finally, is_seen
from benchmarks.validity.audit_worlds import World, make_samples, theta_of

from tracknoise.inference.robust_fits import jackknife
from tracknoise.tables.truth_audit import AuditVerdict
from tracknoise.truth_faults.audit_fit import fit
from tracknoise.truth_faults.audit_selection import Basis, assess, judge, select
from tracknoise.truth_faults.corrected_positions import predict
from tracknoise.truth_faults.fault_parameters import COUNT, FAULTS, Parameter

WORLD = World(per_scene=100, n_frames=60)


def samples(world: World = WORLD, seed: int = 0, **faults):
    theta = theta_of({Parameter(name): value for name, value in faults.items()})
    return make_samples(np.random.default_rng(seed), world, theta)


@pytest.mark.parametrize("parameter", Parameter)
def test_a_planted_fault_is_named_first_and_its_size_is_held(parameter) -> None:
    size = SIZES[parameter][1]
    found = select(samples(seed=1, **{parameter: size}))
    assert [one.parameter for one in found.named] == [parameter]
    assert all(holds_finally(found, parameter, size))
    assert found.named[0].assessment.gain.low > 0.1


def test_two_faults_are_named_and_corrected_together() -> None:
    planted = {"focal_length": -0.08, "readout": 0.8}
    found = select(samples(seed=1, **planted))
    assert {one.parameter for one in found.named} == {Parameter.focal_length, Parameter.readout}
    assert all(all(holds_finally(found, Parameter(name), size)) for name, size in planted.items())


@pytest.mark.parametrize(("parameter", "size"), [("clock_offset", 0.5), ("readout", 0.8)])
def test_a_fault_that_two_of_eight_scenes_show_is_named(parameter, size) -> None:
    few = replace(WORLD, per_scene=200, lively=2, steady_m=(0.02, 0.0, 0.02))
    found = select(samples(few, seed=3, **{parameter: size}))
    assert [one.parameter for one in found.named] == [parameter]
    assert all(holds_finally(found, Parameter(parameter), size))
    one = found.named[0].assessment
    assert 1.0 < one.resampled.moves.effective(one.places) < 3.0
    by_blocks = one.resampled.by_blocks
    assert one.half_widths[0] > 1.5 * by_blocks.half_widths[one.places][0]


def test_what_is_certain_but_explains_next_to_nothing_is_small() -> None:
    many = replace(WORLD, per_scene=200)
    found = select(samples(many, seed=1, focal_length=0.002))
    judged = {one.parameter: one for one in judge(found)}
    assert not found.named
    focal, beside = judged[Parameter.focal_length], found.last.assessed[Parameter.focal_length]
    assert focal.verdict == AuditVerdict.small
    assert focal.visible_above[0] >= abs(beside.estimate[0]) > beside.half_widths[0]


def test_errors_that_would_be_seen_are_named_and_much_smaller_ones_are_not() -> None:
    """`python -m benchmarks.validity audit` does this to all parameters, and more often."""
    seed = 0
    judged = {one.parameter: one for one in judge(select(samples(seed=seed)))}
    for parameter in (Parameter.focal_length, Parameter.clock_offset):
        found = judged[parameter]
        assert is_seen(WORLD, found, seed)
        assert not is_seen(WORLD, replace(found, visible_above=0.3 * found.visible_above), seed)


def test_an_exact_truth_has_no_fault() -> None:
    verdicts = {one.parameter: one for one in judge(select(samples(seed=5)))}
    assert {one.verdict for one in verdicts.values()} <= {AuditVerdict.none, AuditVerdict.undetermined}
    focal = verdicts[Parameter.focal_length]
    assert focal.verdict == AuditVerdict.none
    assert 0.0 < focal.visible_above[0] < 0.02


@pytest.mark.parametrize("n_trackers", [1, 2])
def test_a_common_bias_of_the_trackers_is_no_fault_of_the_truth(n_trackers) -> None:
    """The camera always moves to the right, as what a drift of the trackers to the right can be mistaken for."""
    biased = replace(
        WORLD,
        noise_px=(0.3,) * n_trackers,
        bias_px=((0.0, 0.0),) * n_trackers,
        drift_px_per_frame=((0.2, 0.0),) * n_trackers,
        wobble=(0.002, 0.004),
        steady_m=(0.05, 0.0, 0.0),
        depth_m=(3.0, 4.0),
    )
    found = select(samples(biased, seed=2))
    assert not found.named
    assert found.final.fitted.with_bias
    verdicts = {one.parameter: one for one in judge(found)}
    like_bias = {name for name, one in verdicts.items() if one.verdict == AuditVerdict.like_bias}
    assert like_bias & {Parameter.focal_length, Parameter.depth_scale, Parameter.depth_offset}
    assert all(verdicts[name].condition > 5.0 for name in like_bias)


def test_trackers_that_contradict_each_other_do_not_convict_the_truth() -> None:
    """One tracker sees what a clock offset would do, the other does not."""
    equal = replace(WORLD, noise_px=(0.3, 0.3))
    exact, late = samples(equal, seed=4), samples(equal, seed=4, clock_offset=0.1)
    rows = np.arange(min(len(exact.age), len(late.age)))
    one, two = exact.chosen(rows), late.chosen(rows)
    assert np.array_equal(one.uv_at_birth, two.uv_at_birth)
    mixed = replace(one, observed=np.where(one.tracker[:, None] == 0, two.observed, one.observed))
    found = select(mixed)
    assert not found.named
    verdicts = {fault.parameter: fault.verdict for fault in judge(found)}
    assert verdicts[Parameter.clock_offset] == AuditVerdict.disagreement


def test_a_tracker_that_was_in_one_scene_only_has_no_say() -> None:
    """Such as imported tracks: its own error is not known from one scene, so that it contradicts nobody."""
    world = replace(WORLD, noise_px=(0.3, 1.5), bias_px=((0.0, 0.0), (0.5, 0.5)))
    every = samples(world, seed=1, focal_length=-0.008)
    some = every.chosen(np.flatnonzero((every.tracker == 0) | (every.cluster == 0)))
    basis = Basis.of(some, (), predict(some, np.zeros(COUNT)), with_bias=True)
    found = assess(some, basis, Parameter.focal_length)
    assert found.explains
    assert found.shares == []
    assert found.is_agreed


def test_one_step_of_the_jackknife_is_close_to_a_new_fit() -> None:
    every = samples(seed=6, focal_length=0.02)
    start = predict(every, np.zeros(COUNT))
    whole = fit(every, [Parameter.focal_length], start)
    moves = jackknife(whole.equations)
    for cluster in (0, 5):
        rest = every.chosen(np.flatnonzero(every.cluster != cluster))
        again = fit(rest, [Parameter.focal_length], predict(rest, np.zeros(COUNT)))
        move = again.estimate[0] - whole.estimate[0]
        assert abs(move - moves.moves[cluster, 0]) < 0.3 * moves.standard_errors[0]


def test_what_nothing_determines_stays_where_it_was() -> None:
    """Without turns, the translation between camera and poses changes nothing."""
    still = replace(WORLD, wobble=(0.0, 0.02))
    some = samples(still)
    found = fit(some, [Parameter.mounting_translation], predict(some, np.zeros(COUNT)))
    assert np.abs(found.estimate).max() < 1e-3
    verdicts = {one.parameter: one.verdict for one in judge(select(some))}
    assert verdicts[Parameter.mounting_translation] == AuditVerdict.undetermined


def test_depth_and_focal_length_cannot_be_told_apart_where_the_camera_only_shifts() -> None:
    """Sideways, all positions depend on the focal length over the depth."""
    narrow = replace(WORLD, wobble=(0.0, 0.03), freedom=(1.0, 1.0, 0.0))
    found = select(samples(narrow, focal_length=0.1))
    first = found.named[0]
    rivals = {first.parameter, *first.rivals}
    assert Parameter.focal_length in rivals
    assert rivals & {Parameter.depth_scale, Parameter.depth_offset}


@pytest.mark.parametrize("planted", [{"clock_offset": 0.5}, {"rotation_delay": (0.5, 0.5, 0.5)}])
def test_of_faults_that_explain_as_much_the_one_with_the_fewest_numbers_is_named(planted) -> None:
    """Where the camera turns and does not move, late rotations are what a late clock is."""
    turning = replace(WORLD, wobble=(0.01, 0.0))
    found = select(samples(turning, seed=1, **planted))
    assert [one.parameter for one in found.named] == [Parameter.clock_offset]
    assert Parameter.rotation_delay in found.named[0].rivals


def test_the_basis_of_no_parameter_costs_no_position() -> None:
    some = samples()
    start = predict(some, np.zeros(COUNT))
    basis = Basis.of(some, (), start, with_bias=False)
    assert basis.fitted.free.size == 0
    np.testing.assert_array_equal(basis.fitted.residual, some.observed - start.uv)
    assert sum(fault.count for fault in FAULTS.values()) == COUNT
