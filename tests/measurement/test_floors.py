"""Floors against what planted faults of the truth do, and in runs of trackers."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.floor import FAULTS, compared, exact_tracks, exact_world

import tracknoise
from tracknoise.geometry.accuracy import EXACT_DEPTH, EXACT_POSE, PoseAccuracy, TruthAccuracy
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.statistics.truth_errors import truth_floor
from tracknoise.tables import schema
from tracknoise.tables.identity import SequenceId
from tracknoise.truth.accuracies import AccuracyRule


@pytest.fixture(scope="module")
def world():
    return exact_world(frames=40)


@pytest.fixture(scope="module")
def tracks(world):
    return exact_tracks(world, per_frame=6)


@pytest.mark.parametrize("name", [name for name in FAULTS if "small" not in name])
def test_the_floor_is_what_a_fault_adds(world, tracks, name) -> None:
    few = 2 if name.startswith(("clock", "focal")) else 24
    found = compared(world, tracks, FAULTS[name], seeds=few)
    assert found["at"].to_list() == list(range(1, 25))
    ratio = found.select(
        (pl.col("floor_u") + pl.col("floor_v")) / (pl.col("second_u") + pl.col("second_v"))
    ).to_series()
    assert ratio.is_between(0.8, 1.25).mean() > 0.9
    assert ratio.median() == pytest.approx(1.0, abs=0.15)
    means = found.select(
        (pl.col("sd_u").pow(2) + pl.col("sd_v").pow(2)).sqrt()
        / (pl.col("mean_u").pow(2) + pl.col("mean_v").pow(2)).sqrt()
    ).to_series()
    assert means.median() == pytest.approx(1.0, abs=0.25)


@pytest.fixture(scope="module")
def images():
    size = {"frames": 12, "width": 160, "height": 120, "supersampling": 1}
    return tracknoise.open_sequence("simulated", motions=["sideways"], **size)


def recording(images):
    """The same as a recording that states nothing."""
    return RecordedSequence(
        id=SequenceId("made", "up"),
        source="made up",
        camera=images.camera,
        world_from_camera=images.world_from_camera,
        images=images.image,
        depths=images.depth,
    )


def measured(sequence, figures=None, **options):
    rule = AccuracyRule(figures or TruthAccuracy(), shipped=False)
    return tracknoise.measure(
        sequence, tracknoise.LucasKanade(min_features=50, max_features=80), accuracy=rule, **options
    )


def test_exact_data_have_a_floor_of_zero_and_unchanged_observations(images) -> None:
    found = measured(images, truth="birth")
    assert not {*schema.TRUE_COVARIANCE} & {*found.observations.columns}
    assert found.floors["n"].sum() == (found.observations["truth"] == "valid").sum()
    numbers = ("sum_uu", "sum_vv", "own_uu", "own_vv", "shared_u", "shared_v")
    assert not found.floors.select(numbers).to_numpy().any()
    assert found.notes == ()


def test_nothing_is_known_of_data_that_state_nothing(images) -> None:
    recorded = recording(images)
    found = measured(recorded)
    assert found.floors.is_empty()
    assert not {*schema.TRUE_COVARIANCE} & {*found.observations.columns}


def test_an_exact_depth_beside_unknown_poses_is_no_exact_truth(images) -> None:
    assert measured(replace(recording(images), depth_accuracy=EXACT_DEPTH)).floors.is_empty()
    exact = replace(recording(images), depth_accuracy=EXACT_DEPTH, pose_accuracy=EXACT_POSE)
    assert not measured(exact).floors.is_empty()


def test_planted_faults_are_not_called_exact() -> None:
    faulty = tracknoise.open_sequence(
        "simulated", motions=["sideways"], frames=6, width=160, height=120, faults={"poses": {"rotation_deg": 0.2}}
    )
    assert measured(faulty).floors.is_empty()
    assert set(measured(faulty, TruthAccuracy(rotation_white_deg=0.2)).floors["source"]) == {"poses", "depth"}


def test_covariances_add_up_to_the_floor(images) -> None:
    figures = TruthAccuracy(rotation_white_deg=0.1, depth_m=0.05, focal_relative=0.01)
    plain, found = measured(images, truth="birth"), measured(images, figures, truth="birth")
    assert found.observations.select(plain.observations.columns).equals(plain.observations)
    seen = found.observations.filter(truth="valid")
    assert seen["cov_true_uu"].null_count() == 0
    totals = seen.group_by("age").agg(pl.col("cov_true_uu", "cov_true_uv", "cov_true_vv").sum(), n=pl.len()).sort("age")
    floors = truth_floor(found.floors).filter(source="all").sort("at")
    assert floors["n"].to_list() == totals["n"].to_list()
    for entry in ("uu", "uv", "vv"):
        np.testing.assert_allclose(floors[f"floor_{entry}"], totals[f"cov_true_{entry}"] / totals["n"], atol=1e-12)
    assert found.notes == (
        "error of the truth, rotation: 0.1 deg in each pose (stated)",
        "error of the truth, depth: 0.05 m (stated)",
        "error of the truth, focal: 0.01 of the focal length (stated)",
    )


def test_ray_cast_truth_has_no_error_of_depth(images) -> None:
    found = measured(images, TruthAccuracy(depth_m=0.05, rotation_white_deg=0.1), truth="raycast")
    assert found.floors["source"].unique().to_list() == ["poses"]
    assert found.notes == ("error of the truth, rotation: 0.1 deg in each pose (stated)",)


def test_a_clock_without_times_and_a_fitted_truth_have_no_floor(images) -> None:
    assert set(measured(images, TruthAccuracy(clock_ms=5.0), truth="birth").floors["source"]) == {"all"}
    fitted = measured(images, TruthAccuracy(rotation_white_deg=0.1), truth="triangulated")
    assert fitted.floors.is_empty()
    assert {*schema.LEVERAGE} <= {*fitted.observations.columns}
    assert not {*schema.TRUE_COVARIANCE} & {*fitted.observations.columns}


def test_steps_between_frames_make_errors_of_poses_grow(images) -> None:
    walk = TruthAccuracy(rotation_deg_per_sqrt_frame=0.1)
    every, second = (measured(images, walk, truth="birth", frames=frames) for frames in (None, [0, 11, 2]))
    at_one = [truth_floor(one.floors).filter(source="all", at=1)["floor_uu"].item() for one in (every, second)]
    assert at_one[1] == pytest.approx(2.0 * at_one[0], rel=0.05)


def test_a_floor_of_several_scenes_pools_features() -> None:
    row = {name: 0 if kind == schema.ORIGIN["speed"] else "a" for name, kind in schema.ORIGIN.items()}
    row |= {"rotation": 0, "speed": 1, "source": "clock", "axis": "age", "at": 5}
    scenes = [
        {**row, "scene": "one", "n": 10, "sum_uu": 20.0, "own_uu": 0.0, "shared_u": 10.0},
        {**row, "scene": "two", "n": 30, "sum_uu": 60.0, "own_uu": 0.0, "shared_u": -30.0},
        {**row, "scene": "one", "source": "poses", "n": 10, "sum_uu": 40.0, "own_uu": 300.0, "shared_u": 0.0},
        {**row, "scene": "two", "source": "poses", "n": 30, "sum_uu": 0.0, "own_uu": 100.0, "shared_u": 0.0},
    ]
    rest = dict.fromkeys(("sum_uv", "sum_vv", "own_vv", "shared_v"), 0.0)
    found = truth_floor(pl.DataFrame([{**one, **rest} for one in scenes], schema=dict(schema.FLOORS)))
    by_source = {one["source"]: one for one in found.to_dicts()}
    assert set(by_source) == {"all", "poses", "clock"}
    assert {one["n"] for one in by_source.values()} == {40}
    assert {one["n_scenes"] for one in by_source.values()} == {2}
    assert [by_source[name]["floor_uu"] for name in ("clock", "poses", "all")] == [2.0, 1.0, 3.0]
    assert by_source["clock"]["mean_u_px"] == 20.0 / 40
    assert by_source["poses"]["mean_u_px"] == 20.0 / 40
    assert by_source["all"]["mean_u_px"] == pytest.approx(np.sqrt(400.0 + 400.0) / 40)


def test_what_a_sequence_states_counts_unless_the_user_says_otherwise(images) -> None:
    assert (images.pose_accuracy, images.depth_accuracy) == (EXACT_POSE, EXACT_DEPTH)
    recorded = recording(images)
    stated = replace(recorded, pose_accuracy=PoseAccuracy(None, np.radians(0.1)))
    floors = [
        truth_floor(measured(one, figures).floors).filter(source="all", at=4)["floor_uu"].item()
        for one, figures in ((stated, None), (stated, TruthAccuracy(rotation_white_deg=0.2)))
    ]
    assert floors[1] == pytest.approx(4.0 * floors[0])
