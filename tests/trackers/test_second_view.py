"""Features of a tracker in the images of a second camera."""

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import DataError, SettingsError, TrackerError
from tracknoise.experiments.measure import measure
from tracknoise.sequences.kept_frames import KeptFrames
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.schema import PAIR, of_first_camera, of_second_camera
from tracknoise.trackers.second_view import SecondView
from tracknoise.trackers.tracker_registry import make_tracker

FRAMES = 10
ERROR = pl.col("du_px").abs().median(), pl.col("dv_px").abs().median()


def sequence(baseline_m: float = 0.12):
    options = {"motions": ["sideways"], "frames": FRAMES, "width": 320, "height": 240, "baseline_m": baseline_m}
    return KeptFrames(open_sequence("simulated", seed=2, imaging={"rate_hz": 30.0}, **options))


@pytest.fixture(scope="module")
def measured():
    trackers = {"first": "lucas-kanade", "anew": SecondView(), "last": SecondView(search="last")}
    return measure(sequence(), trackers, truth="raycast")


def test_features_are_found_where_their_points_are(measured):
    for name in ("anew", "last"):
        seen = measured.observations.filter(tracker=name, truth="valid")
        assert seen.height > 1000
        assert max(seen.select(ERROR).row(0)) < 0.2


def test_what_a_tracker_of_the_first_camera_does_is_the_same_beside_one_of_the_second(measured):
    alone = measure(sequence(0.0), {"first": "lucas-kanade"}, truth="raycast")
    beside = of_first_camera(measured.observations).select(alone.observations.columns)
    assert beside.equals(alone.observations)
    assert of_second_camera(measured.observations) == ["anew", "last"]


def test_observations_have_the_errors_of_the_first_camera_and_both_depths(measured):
    first = measured.observations.filter(tracker="first").select("frame", "u_px", "v_px", "du_px", "dv_px")
    second = measured.observations.filter(tracker="anew").drop_nulls(list(PAIR))
    assert second.filter(age=0).select(pl.col("first_du_px", "first_dv_px").abs().max()).row(0) == (0.0, 0.0)
    errors = {tuple(np.round(row, 9)) for row in first.select("du_px", "dv_px").drop_nulls().rows()}
    assert all(tuple(np.round(row, 9)) in errors for row in second.select("first_du_px", "first_dv_px").rows()[:200])
    ratio = (second["pair_depth_m"] / second["first_depth_m"]).log().abs()
    assert ratio.median() < 0.05
    assert second["across_px"].abs().median() < 0.05


def test_errors_grow_only_where_features_are_followed_from_image_to_image(measured):
    late = measured.observations.filter(truth="valid", age=FRAMES - 1)
    cores = {name: late.filter(tracker=name)["across_px"].abs().median() for name in ("anew", "last")}
    assert cores["last"] > 1.3 * cores["anew"]


def test_a_feature_ends_where_it_is_not_found(measured):
    of_first, of_second = (measured.tracks.filter(tracker=name).height for name in ("first", "anew"))
    assert 0.5 * of_first < of_second < of_first
    ends = measured.tracks.filter(tracker="anew")["end"].cast(pl.String)
    assert {"lost", "outlier", "sequence_end"} >= {*ends.drop_nulls()} - {"masked", "displaced"}


def test_matches_far_from_their_epipolar_line_are_outliers(measured):
    strict = measure(sequence(), {"strict": SecondView(epipolar_px=0.05)}, truth="raycast")
    assert strict.frames["outliers"].sum() > measured.frames.filter(tracker="anew")["outliers"].sum()
    assert strict.observations["across_px"].abs().max() <= 0.05 + 1e-9


def test_one_camera_is_refused():
    with pytest.raises(DataError, match="one camera"):
        measure(sequence(0.0), {"second": SecondView()}, truth="raycast")


def test_truth_that_is_fitted_to_tracks_is_refused():
    with pytest.raises(SettingsError, match="second camera"):
        measure(sequence(), {"second": SecondView()}, truth="triangulated")


def test_a_tracker_of_the_second_camera_of_itself_is_refused():
    with pytest.raises(SettingsError, match="one camera"):
        measure(sequence(), {"second": SecondView(of="second-view")}, truth="raycast")


def test_positions_in_the_first_camera_are_one_for_each_feature():
    class Wrong:
        kind, description, of_second_camera = "wrong", "reports too few positions", True

        def start(self, context):
            tracker = SecondView().start(context)

            class Cut:
                def step(self, frame):
                    step = tracker.step(frame)
                    object.__setattr__(step, "first_uv", step.first_uv[1:])
                    return step

            return Cut()

    with pytest.raises(TrackerError, match="first_uv of shape"):
        measure(sequence(), {"wrong": Wrong()}, truth="raycast")


@pytest.mark.parametrize("name", ["vins-fusion-stereo", "openvins-stereo"])
def test_presets_find_features_in_the_second_camera(name):
    found = measure(sequence(), {name: make_tracker(name)}, truth="raycast")
    seen = found.observations.filter(truth="valid")
    assert seen.height > 100
    assert max(seen.select(ERROR).row(0)) < 0.15
