"""A finished run, read from its folder."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import tracknoise as tn
from tracknoise.exceptions import DataError, SettingsError, StoreError, UnknownNameError
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.findings_schema import INTERVALS, OUTLIERS, SUMMARY
from tracknoise.tables.manifest import FailureEntry, Manifest
from tracknoise.tables.schema import OBSERVATIONS, POSES, TRACKS
from tracknoise.tables.store import RunFolder

ONE = {"scene": "forward-00", "tracker": "lucas-kanade", "speed": 1}


def test_a_run_says_what_it_is(run, place):
    assert run.path == place / "runs" / "demo"
    assert repr(run).endswith("runs/demo; sequences: 2; trackers: lucas-kanade; speeds: 1, 2>")


def test_sequences_are_those_that_were_measured(run):
    sequences = run.sequences()
    assert sequences["scene"].to_list() == ["forward-00", "sideways-00"]
    assert sequences["sequence"].to_list() == ["forward-00@default", "sideways-00@default"]
    assert sequences.select("n_frames", "width", "height").unique().row(0) == (8, 200, 150)
    assert sequences["truth"].to_list() == ["raycast"] * 2
    assert run.failures().is_empty()


def test_findings_come_in_the_order_of_their_rank(run):
    findings = run.findings()
    assert findings["rank"].to_list() == list(range(1, findings.height + 1))
    assert findings["topic"][:3].to_list() == ["estimator", "depth noise", "scenes"]
    assert "only 2 scenes" in findings["text"][2]
    noise = findings.filter(topic="noise").row(0, named=True)
    assert noise["low"] < noise["value"] < noise["high"]


def test_intervals_are_chosen_by_their_columns(run):
    wanted = {"statistic": ["nu", "eta"], "trimming": "untrimmed", "at": range(1, 4), "tracker": "lucas-kanade"}
    found = run.intervals(**wanted, speed=1, coordinate="u")
    assert found.schema == INTERVALS
    assert set(found["statistic"]) == {"nu", "eta"}
    assert set(found["at"]) == {1, 2, 3}
    assert found.equals(run.intervals(**wanted | {"at": np.arange(1, 4)}, speed=np.int64(1), coordinate="u"))
    assert found.height < run.intervals(**wanted).height < run.intervals().height
    assert (found["low"] <= found["value"]).all()


def test_observations_of_the_sequences_that_are_asked_for_are_read_and_no_others(run, tmp_path):
    copy = tmp_path / "run"
    for folder in (run.path, run.path / "statistics", run.path / "observations"):
        for file in folder.iterdir():
            if file.is_file() and file.name != "sideways-00@default.parquet":
                target = copy / file.relative_to(run.path)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(file.read_bytes())
    partial = tn.open_run(copy)
    assert partial.observations(**ONE).equals(run.observations(**ONE))
    with pytest.raises(StoreError, match="missing"):
        partial.observations(tracker="lucas-kanade")


def test_observations_have_the_names_that_are_asked_for(run):
    found = run.observations(**ONE)
    assert list(found.schema.items())[: len(OBSERVATIONS)] == list(OBSERVATIONS.items())
    assert found.select(*ONE).unique().rows() == [tuple(ONE.values())]
    every = run.observations()
    assert every.filter(**ONE).equals(found)
    assert set(every["scene"]) == {"forward-00", "sideways-00"}


def test_tracks_and_their_observations_agree(run):
    tracks = run.tracks(**ONE)
    assert tracks.schema == TRACKS
    longest = tracks.sort("lifetime").row(-1, named=True)
    track = run.track(longest["track"], **ONE)
    assert track.height == longest["lifetime"]
    assert track["frame"].is_sorted()
    assert track["frame"][0] == longest["first_frame"]
    assert track["track"].unique().to_list() == [longest["track"]]


def test_any_table_can_be_had(run):
    for name in run.tables():
        assert isinstance(run.table(name), pl.DataFrame)
    assert run.table("poses", scene="forward-00").schema == POSES
    assert run.table("poses", scene="forward-00").height == 8
    assert set(run.table("observations", truth="valid", **ONE)["truth"]) == {"valid"}
    assert run.table("trims").height == 4, "as it is of the whole run"


def test_none_stands_for_a_missing_value(run):
    assert run.table("zero_mean", at=None)["at"].is_null().all()
    assert run.table("effects", speed=None)["factor"].unique().to_list() == ["speed"]


def test_a_category_that_no_row_has_gives_no_rows(run):
    assert run.table("dependence", verdict="no").is_empty()


def test_tables_are_arrow_streams(run):
    for table in (run.findings(), run.observations(**ONE)):
        capsule = table.__arrow_c_stream__()
        assert type(capsule).__name__ == "PyCapsule"


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({"scene": "forward-0"}, r"unknown scene 'forward-0' \(did you mean 'forward-00'\?\); known: forward-00, side"),
        ({"tracker": "lk"}, "unknown tracker 'lk'; known: lucas-kanade"),
        ({"speed": [1, 3]}, "unknown speed 3; known: 1, 2"),
        ({"lighting": "dim"}, "unknown lighting 'dim'; known: default"),
        ({"colour": 3}, "unknown column 'colour'; known: age, "),
    ],
)
def test_unknown_names_list_the_known_ones(run, wanted, message):
    with pytest.raises(UnknownNameError, match=message):
        run.observations(**wanted)


def test_unknown_statistics_tables_and_categories_list_the_known_ones(run):
    with pytest.raises(UnknownNameError, match=r"unknown statistic 'mean'; known: .*median_lifetime"):
        run.intervals(statistic="mean")
    with pytest.raises(UnknownNameError, match=r"unknown table 'curve' \(did you mean 'curves'\?\)"):
        run.table("curve")
    with pytest.raises(UnknownNameError, match=r"unknown trimming 'no'; known: trimmed, untrimmed$"):
        run.table("curves", trimming="no")
    with pytest.raises(UnknownNameError, match="unknown column 'tracker'; known: camera, dataset"):
        run.table("poses", tracker="lucas-kanade")
    for ask, what in (
        (run.table, "table"),
        (run.figure, "figure"),
        (run.sigma, "estimator"),
        (run.findings, "tracker"),
    ):
        with pytest.raises(UnknownNameError) as caught:
            ask(5)
        assert str(caught.value).startswith(f"unknown {what} 5; known: ")


@pytest.mark.parametrize(
    ("name", "wanted", "expected"),
    [
        ("intervals", {"speed": "1"}, "speed is '1', expected a whole number"),
        ("observations", {"speed": 1.0}, "speed is 1.0, expected a whole number"),
        ("intervals", {"at": True}, "at is True, expected a whole number"),
        ("curves", {"u": "0"}, "u is '0', expected a number"),
        ("curves", {"cut": 1}, "cut is 1, expected True or False"),
    ],
)
def test_values_of_another_type_than_the_column_are_refused(run, name, wanted, expected):
    with pytest.raises(SettingsError) as caught:
        run.table(name, **wanted)
    assert str(caught.value) == expected


def test_whole_numbers_are_numbers_of_any_column(run):
    curves = run.table("curves")
    assert run.table("curves", u=0).equals(curves.filter(u=0.0))
    assert run.table("curves", at=np.int64(1)).equals(curves.filter(at=1))


def test_a_choice_that_no_sequence_has_gives_no_rows(run):
    found = run.observations(scene=[])
    assert found.is_empty()
    assert list(found.columns) == list(OBSERVATIONS)


def test_observations_of_trackers_that_report_other_qualities_are_put_together(tmp_path):
    """Only one of two sequences has been measured with a tracker that reports a quality."""
    options = {"frames": 4, "width": 64, "height": 48, "supersampling": 1}
    trackers = {"forward": tn.LucasKanade(), "sideways": tn.Oracle(n_features=20, margin_px=2)}
    measured = [
        tn.measure(tn.open_sequence("simulated", motions=[motion], **options), {"one": tracker})
        for motion, tracker in trackers.items()
    ]
    observations = tn.analyse(measured).observations()
    assert observations.height == sum(one.observations.height for one in measured)
    assert observations["quality_lk_residual"].is_null().sum() >= measured[1].observations.height
    assert observations.columns == measured[0].observations.columns


def test_the_cameras_of_a_rig_are_chosen_by_their_names():
    sequence = tn.open_sequence("simulated", frames=4, width=64, height=48, supersampling=1)
    rig = [
        RecordedSequence(
            id=replace(sequence.id, camera=name),
            source=name,
            camera=sequence.camera,
            world_from_camera=sequence.world_from_camera,
            images=sequence.image,
            depths=sequence.depth,
        )
        for name in ("left", "right")
    ]
    measured = [tn.measure(one, tn.Oracle(n_features=20, margin_px=2)) for one in rig]
    run = tn.analyse(measured)
    assert run.sequences()["camera"].to_list() == ["left", "right"]
    for name, one in zip(("left", "right"), measured, strict=True):
        assert run.observations(camera=name).equals(one.observations)
    with pytest.raises(SettingsError, match=r"several values of camera match \(left, right\), expected one"):
        run.track(0)


def test_a_track_needs_one_sequence_and_condition(run):
    with pytest.raises(SettingsError, match=r"several values of scene match \(forward-00, sideways-00\), expected one"):
        run.track(1, tracker="lucas-kanade", speed=1)
    with pytest.raises(SettingsError, match=r"several values of speed match \(1, 2\), expected one"):
        run.track(1, scene="forward-00", tracker="lucas-kanade")
    with pytest.raises(DataError, match=r"no track 99999, expected one of \d+ tracks"):
        run.track(99999, **ONE)
    with pytest.raises(SettingsError, match="track is '1', expected a whole number"):
        run.track("1", **ONE)


def test_a_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(StoreError, match="no run found, expected the folder of a finished run"):
        tn.open_run(tmp_path / "none")
    with pytest.raises(SettingsError, match="run is None, expected a path"):
        tn.open_run(None)


def test_a_run_that_is_not_finished_is_refused(run, tmp_path):
    unfinished = RunFolder(tmp_path / "run")
    unfinished.create("name = 'x'", Manifest("hash", {}, {}, 0))
    with pytest.raises(StoreError, match="no finished run"):
        tn.open_run(unfinished.path)


def test_a_run_that_keeps_statistics_alone_has_no_observations(bare_run):
    assert bare_run.table("moments").height > 0
    for ask in (bare_run.observations, bare_run.tracks, lambda: bare_run.track(1)):
        with pytest.raises(StoreError, match='expected a run with keep = "observations"'):
            ask()


def test_what_could_not_be_measured_is_listed(bare_run):
    folder = RunFolder(bare_run.path)
    manifest = folder.manifest()
    manifest.failures["sideways-00@default"] = "no image"
    folder.write_manifest(manifest)
    folder.write_failures({"sideways-00@default": FailureEntry("no image", None, 1)})
    assert bare_run.failures().rows() == [("sideways-00@default", "no image")]
    assert "sequences: 1; failed: 1;" in repr(bare_run)


def test_a_run_without_findings_says_so(bare_run, tmp_path):
    old = RunFolder(tmp_path / "old")
    manifest = bare_run._folder.manifest()
    old.create(bare_run._folder.experiment_toml(), Manifest("hash", {}, {}, 0, sequences=manifest.sequences))
    old.write_statistics({table: bare_run.table(table.name) for table in (SUMMARY, OUTLIERS)})
    with pytest.raises(StoreError, match="holds no findings"):
        tn.open_run(old.path).findings()
