"""The covariance of each observation of tracks."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.estimators.exports.models import detections, interval, lucas_kanade

from tracknoise.estimators.export_render import export
from tracknoise.estimators.exports import FocalChange, Target
from tracknoise.estimators.model import Bias, BiasKind, Factor
from tracknoise.estimators.observation_noise import COLUMNS, observation_noise, read_tracks
from tracknoise.exceptions import DataError, SettingsError

TRACKS = pl.DataFrame(
    {
        "sequence": ["s"] * 5,
        "track": [7, 7, 7, 3, 3],
        "frame": [4, 5, 7, 1, 2],
        "u_px": [10.0, 12.0, 14.0, 50.0, 50.0],
        "v_px": [20.0, 20.0, 20.0, 60.0, 63.0],
        "quality_texture": [1.0, 100.0, None, 1.0, 1.0],
    }
)
AGES = [0, 1, 0, 1, 3]
"""In the order of the result: track 3, then track 7."""


def test_detections_have_the_same_covariance_in_every_frame():
    found = observation_noise(detections(), TRACKS)
    assert found.columns == list(COLUMNS)
    assert found["track"].to_list() == [3, 3, 7, 7, 7]
    np.testing.assert_allclose(found.select("cov_uu", "cov_vv"), 0.16)
    np.testing.assert_allclose(found.select("cov_uv", "bias_u", "bias_v"), 0.0)


def test_a_walk_grows_with_age_and_no_observation_is_exact():
    found = observation_noise(lucas_kanade(), TRACKS)
    age = np.maximum(AGES, 1)
    np.testing.assert_allclose(found["cov_uu"], 0.016 + 0.0064 * age)
    np.testing.assert_allclose(found["cov_vv"], 0.004 + 0.0064 * age)


def test_no_observation_is_exact_along_one_axis():
    """A fitted covariance may have an eigenvalue of 0; a front end inverts each covariance by itself."""
    along_u = replace(detections().first, covariance=np.diag([0.32, 0.0]))
    found = observation_noise(detections(first=along_u), TRACKS)
    first = found.filter(pl.Series(AGES) == 0)
    np.testing.assert_allclose(first.select("cov_uu", "cov_uv", "cov_vv"), [[0.32, 0.0, 1e-4]] * 2)
    np.testing.assert_allclose(found.filter(pl.Series(AGES) > 0).select("cov_uu", "cov_vv"), 0.16)
    across = replace(detections().white, covariance=np.array([[0.1, 0.1], [0.1, 0.1]]))
    whole = observation_noise(detections(white=across), TRACKS)
    assert (whole["cov_uu"] * whole["cov_vv"] - whole["cov_uv"] ** 2).min() > 1e-5


def test_conditions_that_are_known_count():
    knots = {"log_knots": (0.0, np.log(100.0)), "log_factor": (0.0, np.log(3.0)), "gain": interval(0.1)}
    texture = observation_noise(detections(conditions=(Factor(of="texture", **knots),)), TRACKS)
    np.testing.assert_allclose(texture["cov_uu"], 0.16 * np.array([1.0, 1.0, 1.0, 3.0, 1.0]))
    motion = observation_noise(detections(conditions=(Factor(of="motion_px", **knots),)), TRACKS)
    factor = np.exp(np.log([1.0, 3.0, 1.0, 2.0, 1.0]) * np.log(3.0) / np.log(100.0))
    np.testing.assert_allclose(motion["cov_uu"], 0.16 * factor)


def test_motion_is_that_between_two_frames_of_the_tracker():
    """What models are fitted to: a tracker that sees every second frame sees twice the motion."""
    knots = {"log_knots": (0.0, np.log(100.0)), "log_factor": (0.0, np.log(100.0)), "gain": interval(0.1)}
    along = Bias(kind=BiasKind.ALONG_MOTION, why="scenes agree", per_motion=-0.1)
    slow = detections(conditions=(Factor(of="motion_px", **knots),), bias=along)
    fast = replace(slow, training=replace(slow.training, speed=2.0))
    seen = TRACKS.with_columns(frame=2 * pl.col("frame"))
    for model, tracks in ((slow, TRACKS), (fast, seen)):
        found = observation_noise(model, tracks)
        np.testing.assert_allclose(found["cov_uu"], 0.16 * np.array([1.0, 3.0, 1.0, 2.0, 1.0]))
        np.testing.assert_allclose(found["bias_u"], [0.0, 0.0, 0.0, -0.2, -0.1])


def test_a_bias_is_what_the_model_corrects():
    along = Bias(kind=BiasKind.ALONG_MOTION, why="scenes agree", per_motion=-0.1)
    found = observation_noise(detections(bias=along), TRACKS)
    np.testing.assert_allclose(found["bias_u"], [0.0, 0.0, 0.0, -0.2, -0.1])
    np.testing.assert_allclose(found["bias_v"], [0.0, -0.3, 0.0, 0.0, 0.0])
    by_age = Bias(kind=BiasKind.BY_AGE, why="scenes agree", ages=(1, 3), mean_px=((0.1, 0.0), (0.3, 0.2)))
    np.testing.assert_allclose(observation_noise(detections(bias=by_age), TRACKS)["bias_u"], [0.0, 0.1, 0.0, 0.1, 0.3])


def test_csv_of_a_file_of_tracks(tmp_path):
    path = tmp_path / "mine.csv"
    TRACKS.drop("sequence").write_csv(path)
    model = detections()
    text = observation_noise(model, read_tracks(path, model)).write_csv()
    found = export(model, "csv", observations=text).files["observations.csv"]
    assert found == text
    assert found.splitlines()[0] == "sequence,track,frame,cov_uu,cov_uv,cov_vv,bias_u,bias_v"
    assert found.splitlines()[1].startswith("mine,3,1,0.16")


def test_times_become_frames_by_the_rate_of_the_model(tmp_path):
    path = tmp_path / "timed.csv"
    TRACKS.select("track", time_s=5.0 + pl.col("frame") / 20.0, u_px="u_px", v_px="v_px").write_csv(path)
    found = observation_noise(lucas_kanade(), read_tracks(path, lucas_kanade()))
    assert found["frame"].to_list() == [0, 1, 3, 4, 6]
    np.testing.assert_allclose(found["cov_uu"], 0.016 + 0.0064 * np.maximum(AGES, 1))
    without = lucas_kanade(camera=replace(lucas_kanade().camera, rate_hz=None))
    with pytest.raises(DataError, match="does not know the rate of its recordings, expected frames"):
        read_tracks(path, without)


def test_rows_of_features_that_were_not_seen_are_no_observations(tmp_path):
    path = tmp_path / "mine.csv"
    rows = TRACKS.drop("sequence")
    rows.with_columns(lost=pl.Series([0, 1, 0, 0, 0])).write_csv(path)
    found = observation_noise(detections(), read_tracks(path, detections()))
    assert found.select("track", "frame").rows() == sorted(rows.select("track", "frame")[[0, 2, 3, 4]].rows())


def test_two_rows_of_one_track_in_one_frame_are_refused(tmp_path):
    path = tmp_path / "twice.csv"
    pl.concat([TRACKS, TRACKS]).drop("sequence").write_csv(path)
    with pytest.raises(DataError, match="expected one row per track and frame"):
        read_tracks(path, detections())


def test_of_a_run_only_the_view_is_written_that_models_are_of(tmp_path, monkeypatch):
    """Noise of turned images has other axes."""
    views = {"upright": (0, "forward"), "back": (0, "backward"), "turned": (90, "forward")}
    training = detections().training

    class Run:
        def __init__(self, path):
            self.sequences = dict.fromkeys(views)

        def manifest(self):
            return self

        def rows(self, name, key, *chosen):
            rotation, direction = views[key]
            constant = {"tracker": training.tracker, "speed": int(training.speed)}
            view = {"rotation": rotation, "direction": direction}
            return TRACKS.drop("sequence").with_columns(
                pl.lit(value).alias(of) for of, value in (constant | view).items()
            )

    monkeypatch.setattr("tracknoise.estimators.observation_noise.RunFolder", Run)
    found = observation_noise(detections(), read_tracks(tmp_path, detections()))
    assert found["sequence"].unique().to_list() == ["upright"]
    assert found.height == TRACKS.height


def test_data_are_not_converted():
    target = Target(focal_px=229.3, focal_change=FocalChange.RESAMPLED)
    for name in ("csv", "json"):
        with pytest.raises(SettingsError, match="another focal length or rate, expected those of the model"):
            export(detections(), name, target=target, observations="")


def test_csv_needs_tracks_and_json_needs_nothing():
    with pytest.raises(SettingsError, match="no observations, expected tracks, with `--tracks`"):
        export(detections(), "csv")
    bare = detections(equivalents=())
    assert export(bare, "json").files["noise.json"] == bare.text
