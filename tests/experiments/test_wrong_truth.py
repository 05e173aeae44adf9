"""A sequence with a wrong truth beside the same one with the exact truth: what a run says about poses and trackers."""

from functools import partial

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.rigid import pose_noise
from tests.lean import only_topics, without_audit
from tests.truth_faults.planted import Planted, resized

import tracknoise
from tracknoise.sequences.arrays import Sequence
from tracknoise.topics.truth_topic import DIFFERENCES

FRAMES = 16


@pytest.fixture(scope="module")
def runs():
    """The same images and trackers with exact and with wrong poses and focal length."""
    made = tracknoise.open_sequence(
        "simulated", motions=("arvr",), frames=FRAMES, width=240, height=180, supersampling=1
    )
    maps = [made.depth(index) for index in range(FRAMES)]
    exact = Sequence.from_arrays(
        [made.image(index) for index in range(FRAMES)],
        made.world_from_camera,
        made.camera,
        [np.where(one.valid, one.depth_m, 0.0) for one in maps],
    )
    noise = pose_noise("white", 0.2, 0.01, FRAMES, np.random.default_rng(0))
    wrong = Planted(exact, poses=lambda poses: poses @ noise, intrinsics=resized(1.1))
    trackers = {"one": tracknoise.LucasKanade(), "other": tracknoise.Correspondence()}
    measure = partial(tracknoise.measure, trackers=trackers, truth="birth")
    with without_audit(), only_topics(DIFFERENCES):
        return {name: tracknoise.analyse(measure(of)) for name, of in (("exact", exact), ("wrong", wrong))}


def test_differences_between_trackers_are_the_same_whatever_the_truth(runs):
    found = [run.table("tracker_differences").filter(statistic="mean", age=4) for run in runs.values()]
    assert found[0].height == 2
    assert found[0]["n"][0] > 50
    assert found[0].equals(found[1])
    errors = [
        run.table("curves").filter(statistic="Phi", at=4, weighting="features")["u"].max() for run in runs.values()
    ]
    assert errors[1] > 1.5 * errors[0]


def test_both_trackers_see_the_pose_errors_that_only_the_wrong_truth_has(runs):
    for fitted_to in ("own", "others"):
        exact, wrong = (
            run.table("rigid_share").filter(fitted_to=fitted_to, tracker="one", age=4, coordinate="both")
            for run in runs.values()
        )
        assert abs(exact["share"][0]) < 0.1
        assert wrong["low"][0] > 0.3
        assert wrong["left_px2"][0] < 0.5 * wrong["second_px2"][0]


def test_the_findings_blame_the_wrong_truth_alone(runs):
    texts = {name: run.findings().filter(topic="pose errors")["text"].to_list() for name, run in runs.items()}
    assert texts["exact"] == []
    assert "probably an error of the truth" in texts["wrong"][0]


def test_the_growth_of_white_pose_errors_is_flat(runs):
    wrong = runs["wrong"].table("pose_growth")
    assert wrong.filter(lag=1)["rotation_deg"][0] == pytest.approx(0.2 * np.sqrt(2), rel=0.4)
    assert wrong.filter(lag=3)["rotation_deg"][0] < 1.5 * wrong.filter(lag=1)["rotation_deg"][0]
    assert runs["exact"].table("pose_growth").filter(lag=1)["rotation_deg"].fill_null(0.0)[0] < 0.05


def test_numbers_that_rest_on_a_truth_that_is_not_trusted_say_so(runs):
    for run in runs.values():
        assert not run.truth.is_usable  # nothing is known of the accuracy of arrays
        results = run.results(columns="all")
        marked = results["caveats"].cast(pl.List(pl.String)).list.contains("truth not trusted")
        assert results.filter(marked, quantity="mean_error").height == results.filter(quantity="mean_error").height > 0
        assert results.filter(marked, topic="tracks").is_empty()
