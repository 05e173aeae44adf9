"""A run with a tracker of a second camera."""

import polars as pl
import pytest
from tests.experiments.conftest import Told
from tests.lean import with_findings

from tracknoise.api.finished_run import open_run
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import DataError, TracknoiseError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.settings import parse_experiment
from tracknoise.tables.schema import of_second_camera
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.tracker_registry import make_tracker

EXPERIMENT = """
name = "pair"
speeds = [1]
keep = "observations"

[dataset]
reader = "simulated"
options = { motions = ["sideways", "arvr"], frames = 16, width = 320, height = 240, baseline_m = BASELINE }

[[trackers]]
kind = "lucas-kanade"
"""
SECOND = """
[[trackers]]
kind = "second-view"
name = "second"

[[trackers]]
kind = "second-view"
name = "on-lines"
options = { search = "line" }
"""


@pytest.fixture(scope="module")
def run():
    def made(path, text):
        folder = RunFolder(path)
        with with_findings():
            execute(parse_experiment(text, place="test"), folder, listener=Told(), debug=True)
        return folder

    return made


@pytest.fixture(scope="module")
def pair(run, tmp_path_factory):
    return run(tmp_path_factory.mktemp("pair") / "run", EXPERIMENT.replace("BASELINE", "0.12") + SECOND)


def test_both_cameras_have_a_sigma_and_the_pair_its_own_numbers(pair):
    opened = open_run(pair.path)
    assert {*opened.table("second_camera")["tracker"]} == {"second", "on-lines"}
    assert opened.results(tracker="second", quantity="core").height > 0


def test_numbers_of_the_first_camera_do_not_depend_on_the_second(pair, run, tmp_path):
    alone = run(tmp_path / "run", EXPERIMENT.replace("BASELINE", "0.0"))
    key = sorted(alone.manifest().sequences)[0]
    for name in ("moments", "window_noise", "noise_sums", "audit_samples", "rigid"):
        beside = pair.sequence_table(name, key).filter(tracker="lucas-kanade")
        assert beside.equals(alone.sequence_table(name, key).filter(tracker="lucas-kanade")), name


def test_the_truth_is_asked_by_trackers_of_the_first_camera(pair):
    key = sorted(pair.manifest().sequences)[0]
    assert of_second_camera(pair.sequence_table("observations", key)) == ["on-lines", "second"]
    assert {*pair.sequence_table("audit_samples", key)["tracker"]} == {"lucas-kanade"}
    assert {*pair.sequence_table("patches", key)["tracker"]} == {"lucas-kanade"}
    assert pair.sequence_table("pair_sums", key)["n"].sum() > 500
    assert {*pair.sequence_table("noise_sums", key)["tracker"]} == {"lucas-kanade", "second", "on-lines"}


def test_findings_say_what_both_cameras_share(pair):
    said = " ".join(open_run(pair.path).findings()["text"])
    assert "Errors in both cameras have a correlation of" in said
    assert "on-lines: errors along epipolar lines have a core of" in said
    results = open_run(pair.path).results()
    shown = results.filter(pl.col("quantity").cast(pl.String).str.starts_with("pair_"))
    assert {"pair_epipolar_core", "pair_correlation_u", "pair_depth_sd_square"} <= {*shown["quantity"].cast(pl.String)}


def test_sigma_of_a_second_view_is_for_both_cameras(pair):
    both = NoiseModel.fit(pair.path, tracker="second").of_both
    assert both is not None
    assert 0.0 < both.correlation <= 1.0
    assert NoiseModel.fit(pair.path, tracker="lucas-kanade").of_both is None


def test_a_run_in_parts_has_the_errors_of_both_cameras(pair, tmp_path):
    text = (EXPERIMENT.replace("BASELINE", "0.12") + SECOND).replace("speeds = [1]", "speeds = [1]\npart_frames = 8")
    text = text.replace('["sideways", "arvr"]', '["sideways"]')
    parts = RunFolder(tmp_path / "run")
    execute(parse_experiment(text, place="test"), parts, listener=Told(), debug=True)
    key = sorted(parts.manifest().sequences)[0]
    assert parts.sequence_table("rig", key).equals(pair.sequence_table("rig", key))
    tracks = parts.sequence_table("pair_tracks", key)
    assert {*tracks["tracker"]} == {"second", "on-lines"}
    assert not tracks.select("tracker", "track", "age").is_duplicated().any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"of": "lucas-kanad"}, "unknown tracker 'lucas-kanad'"),
        ({"options": {"extra_levels": "a"}}, "tracker 'lucas-kanade': extra_levels"),
    ],
)
def test_settings_of_the_tracker_of_the_first_camera_are_checked_with_its_own(options, message):
    with pytest.raises(TracknoiseError, match=message):
        make_tracker("second-view", options)


def test_a_recording_of_one_camera_is_refused_before_anything_is_followed(tmp_path):
    text = EXPERIMENT.replace("BASELINE", "0.0") + SECOND
    with pytest.raises(DataError, match="one camera, expected a second one"):
        execute(parse_experiment(text, place="test"), RunFolder(tmp_path / "run"), listener=Told(), debug=True)
