"""Tables and sentences of audits."""

import re
import tomllib
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.audit_worlds import World, make_samples, theta_of

from tracknoise.inference.units import NO_GROUPS
from tracknoise.report.truth_section import curve_cells, parameter_cells
from tracknoise.tables.findings_schema import AUDIT_SAMPLES, CAMERAS
from tracknoise.tables.schema import POSES, empty
from tracknoise.tables.truth_audit import AuditVerdict
from tracknoise.truth_faults.audit_summary import (
    NO_FAULT,
    Estimate,
    audit_sentences,
    corrections_toml,
    other_text,
    recorded_step,
)
from tracknoise.truth_faults.audit_tables import AuditedTables, read_samples, tables_of
from tracknoise.truth_faults.explained import NAMED_FAULTS
from tracknoise.truth_faults.fault_parameters import Family, Parameter, shown
from tracknoise.words import SPACE

WORLD = World(per_scene=100, n_frames=60)


@pytest.fixture(scope="module")
def faulty():
    """A focal length of 525 px where 597 would be right, and a readout of 0.8 frames."""
    theta = theta_of({Parameter.focal_length: -0.12, Parameter.readout: 0.8})
    return tables_of(make_samples(np.random.default_rng(1), WORLD, theta), "made-up")


@pytest.fixture(scope="module")
def exact():
    return tables_of(make_samples(np.random.default_rng(1), WORLD, theta_of({})), "made-up")


def test_the_answer_comes_first_with_its_numbers(faulty) -> None:
    first, second = audit_sentences(faulty.audit)[:2]
    pattern = (
        rf"The stated focal length is 1[34]\.\d{SPACE}% too long \(46\d(\.\d+)? ± [\d.]+{SPACE}px instead of 525\): "
        r"after its correction, "
        r"the (mean error|second moment) .* falls from .*\."
    )
    assert re.fullmatch(pattern, first), first
    assert second.startswith("The readout time of the shutter is wrong (26.")
    assert f"{SPACE}ms instead of 0): after its correction, too, " in second


def test_another_value_beside_parameters_of_its_kind_is_stated() -> None:
    """An offset of the depths that is too small to be named moves their scale, if this is fitted alone."""
    theta = theta_of({Parameter.depth_scale: 0.06, Parameter.depth_offset: 0.02})
    audit = tables_of(make_samples(np.random.default_rng(1), WORLD, theta), "made-up").audit
    assert audit.filter(pl.col("rank").is_not_null())["parameter"].to_list() == ["depth_scale"]
    sentence = audit_sentences(audit)[0]
    found = re.search(r"Fitted together with the offset of the depths, it is ([\d.]+) ± ([\d.]+)\.$", sentence)
    assert found, sentence
    assert abs(float(found[1]) - 1.06) < 2.0 * float(found[2])


def test_the_corrections_are_a_block_of_toml_that_undoes_the_faults(faulty, exact) -> None:
    block = tomllib.loads(corrections_toml(faulty.audit))["truth"]["corrections"]
    assert block == {"focal_scale": pytest.approx(0.88, abs=0.01), "readout_s": pytest.approx(0.8 / 30.0, abs=2e-3)}
    assert corrections_toml(exact.audit) is None


def test_the_block_includes_the_corrections_of_the_run(faulty) -> None:
    """A run whose focal length was corrected by 0.9 before: the block takes the place of the one it has."""
    present = {"focal_scale": 0.9, "readout_s": 0.0, "k1": -0.1, "mounting_rotation_deg": [0.0, 0.0, 0.0]}
    first, again = (
        tomllib.loads(corrections_toml(faulty.audit, settings))["truth"]["corrections"]
        for settings in ({}, {"truth": {"corrections": present}})
    )
    assert again["focal_scale"] == pytest.approx(0.9 * first["focal_scale"], abs=1e-4)
    assert again["readout_s"] == first["readout_s"]
    assert again["k1"] == -0.1
    assert set(again) == {"focal_scale", "readout_s", "k1"}


def test_values_stand_beside_what_is_stated(faulty) -> None:
    named = faulty.audit.filter(family=Family.named)
    focal, readout = named.filter(parameter="focal_length"), named.filter(parameter="readout")
    assert (focal["unit"].item(), focal["stated"].item()) == ("px", 525.0)
    assert focal["low"].item() < 525.0 * 0.88 < focal["high"].item()
    assert (readout["unit"].item(), readout["stated"].item()) == ("ms", 0.0)
    assert readout["value"].item() == pytest.approx(readout["in_frames"].item() * 1000.0 / 30.0)
    assert readout["correlated_with"].item() == "focal_length"


def test_named_faults_have_a_share_of_each_tracker(faulty, exact) -> None:
    shares = faulty.audit.filter(family=Family.at_most, parameter=NAMED_FAULTS)
    trackers = faulty.audit_curves["tracker"].unique()
    assert sorted(shares["component"]) == sorted(trackers)
    together = faulty.audit.filter(family=Family.named)["gain"][0]
    assert shares["gain"].min() <= together <= shares["gain"].max()
    assert exact.audit.filter(parameter=NAMED_FAULTS).is_empty()


def test_every_family_and_parameter_has_its_rows(faulty) -> None:
    alone = faulty.audit.filter(family=Family.alone)
    assert alone["parameter"].unique().sort().to_list() == sorted(Parameter)
    beside = faulty.audit.filter(family=Family.beside_bias)
    assert beside["parameter"].unique().sort().to_list() == sorted(Parameter)
    assert alone["n_units"].unique().to_list() == beside["n_units"].unique().to_list() == [8]
    assert set(alone.filter(pl.col("rank").is_not_null())["verdict"]) == {"fault"}
    assert alone["text"].null_count() == 0


def test_held_out_errors_fall_to_the_noise(faulty) -> None:
    old = faulty.audit_curves.filter(pl.col("age") == 24)
    for tracker in old["tracker"].unique():
        second = {
            row["correction"]: row["second_uu"] + row["second_vv"]
            for row in old.filter(tracker=tracker).iter_rows(named=True)
        }
        assert list(second) == ["measured", "focal_length", "readout", "all"]
        assert second["all"] < 0.2 * second["measured"]


def test_an_exact_truth_is_said_to_be_without_fault(exact) -> None:
    assert audit_sentences(exact.audit) == [NO_FAULT]
    every = audit_sentences(exact.audit, every=True)
    assert every[1].startswith("No error of the focal length was found; one above ")
    assert every[1].endswith(f"{SPACE}px would be found with a probability of 90{SPACE}%.")
    assert exact.audit_curves["correction"].unique().to_list() == ["measured"]


def test_beside_refined_poses_no_error_is_excluded() -> None:
    """Poses that were fitted to tracks with a wrong focal length hide it."""
    samples = replace(make_samples(np.random.default_rng(1), WORLD, theta_of({})), refined=True)
    found = tables_of(samples, "made-up")
    assert found.audit["visible_above"].null_count() == found.audit.height
    every = audit_sentences(found.audit, every=True)
    absorbed = "No error of the focal length was found with refined poses, which may absorb such an error."
    assert absorbed in every


def test_tables_are_shown_as_text(faulty) -> None:
    cells = parameter_cells(faulty.audit)
    assert cells.rows[0][:2] == ["alone", "focal length"]
    assert cells.rows[0][-1] == "fault"
    assert cells.caption.endswith(f"95{SPACE}% intervals from 8 scenes.")
    assert curve_cells(faulty.audit_curves).rows[0][2] == "nothing"


def test_without_samples_the_reason_is_the_only_row() -> None:
    tables = AuditedTables(empty(AUDIT_SAMPLES), empty(CAMERAS), empty(POSES))
    found = tables_of(read_samples([tables], NO_GROUPS), "x")
    assert audit_sentences(found.audit) == [
        "The truth was not audited: it is fitted to the tracks, or no track was followed."
    ]
    assert found.audit_curves.is_empty()
    assert parameter_cells(found.audit).rows == []


def test_runs_without_an_upright_view_are_not_taken_for_fitted_ones() -> None:
    found = tables_of(read_samples([], NO_GROUPS), "x")
    assert audit_sentences(found.audit) == ["The truth was not audited: no sequence was measured upright and forward."]


def test_unknown_lenses_are_named_as_the_reason() -> None:
    camera = dict.fromkeys(CAMERAS) | {"frame": 0, "width": 4, "height": 3}
    cameras = pl.DataFrame([camera], schema=dict(CAMERAS))
    found = read_samples([AuditedTables(empty(AUDIT_SAMPLES), cameras, empty(POSES))], NO_GROUPS)
    assert found == "the camera model is not known"


def test_times_in_frames_are_called_so() -> None:
    theta = theta_of({Parameter.clock_offset: 0.5})
    samples = replace(make_samples(np.random.default_rng(2), WORLD, theta), interval_s=None)
    found = tables_of(samples, "made-up").audit
    assert "clock_offset_frames = 0.5" in corrections_toml(found) or "clock_offset_frames = 0.4" in corrections_toml(
        found
    )
    assert f"{SPACE}frames instead of 0)" in audit_sentences(found)[0]
    every, second = ({"dataset": {"frames": [0, 99, step]}} for step in (1, 2))
    once, twice = (tomllib.loads(corrections_toml(found, one))["truth"]["corrections"] for one in (every, second))
    assert twice["clock_offset_frames"] == pytest.approx(2.0 * once["clock_offset_frames"], abs=1e-4)


@pytest.mark.parametrize(("frames", "step"), [(None, 1), ([3, 9], 1), ([0, 9, 3], 3)])
def test_settings_say_how_far_apart_measured_frames_are(frames, step) -> None:
    assert recorded_step({"dataset": {} if frames is None else {"frames": frames}}) == step


def test_what_cannot_be_determined_is_told_beside_that_no_fault_was_found() -> None:
    """Without turns, nothing is known of the translation between camera and poses."""
    still = replace(WORLD, wobble=(0.0, 0.02))
    found = tables_of(make_samples(np.random.default_rng(6), still, theta_of({})), "made-up").audit
    first, *others = audit_sentences(found)
    assert first == NO_FAULT
    assert re.fullmatch(
        r"Whether .*the translation between camera and poses.* right cannot be determined here\.", others[-1]
    )
    assert len(audit_sentences(found, every=True)) == 1 + len(Parameter)


@pytest.mark.parametrize("verdict", [AuditVerdict.disagreement, AuditVerdict.explained, AuditVerdict.undetermined])
def test_what_is_not_established_is_not_denied(verdict) -> None:
    """The truth may be wrong where a tracker has a bias besides, and where little is left for a test."""
    samples = make_samples(np.random.default_rng(1), WORLD, theta_of({}))
    found = Estimate(shown(samples, Parameter.k1), np.array([0.2]), np.array([0.1]))
    named = [Parameter.readout]
    text = other_text(Parameter.k1, verdict, "1", condition=1.0, found=found, named=named, samples=samples)
    assert re.search(r"no .*is established", text)


def test_a_stated_value_is_not_rounded() -> None:
    samples = make_samples(np.random.default_rng(1), WORLD, theta_of({}))
    centre = replace(shown(samples, Parameter.principal_point), stated=(127.5, 95.5))
    assert Estimate(centre, np.array([127.2, 95.1]), np.array([0.7, 0.4])).stated == "(127.5, 95.5)"


def test_a_value_that_fits_a_little_better_is_told() -> None:
    samples = make_samples(np.random.default_rng(1), WORLD, theta_of({}))
    found = Estimate(shown(samples, Parameter.focal_length), np.array([524.0]), np.array([0.4]))
    text = other_text(
        Parameter.focal_length, AuditVerdict.small, "1", condition=1.0, found=found, named=[], samples=samples
    )
    better = f"The focal length fits a little better as 524.0 ± 0.4{SPACE}px instead of 525"
    assert text == f"{better}, but this difference explains too little to matter."
