"""What a measured sequence keeps for the audit: true positions are reproduced from it, for every kind of truth."""

from dataclasses import dataclass, replace

import numpy as np
import polars as pl
import pytest

from tracknoise.experiments import run_truth
from tracknoise.experiments.measure import measure
from tracknoise.experiments.settings import parse_experiment
from tracknoise.experiments.task import tables_to_keep, write_measurement, write_settings
from tracknoise.geometry.cameras import Camera, EquidistantCamera
from tracknoise.geometry.corrections import Corrections
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.inference.units import NO_GROUPS
from tracknoise.sequences.corrected import corrected
from tracknoise.sequences.reader_registry import make_reader
from tracknoise.sequences.sequence import Scan
from tracknoise.sequences.views import View, chosen_frames, turned
from tracknoise.tables.findings_schema import AUDIT_SAMPLES, CAMERAS, PATH
from tracknoise.tables.schema import check
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.oracle import Oracle
from tracknoise.truth_faults.audit_tables import AuditedTables, read_samples
from tracknoise.truth_faults.corrected_positions import predict
from tracknoise.truth_faults.fault_parameters import COUNT

EXPERIMENT = parse_experiment(
    'name = "x"\nspeeds = [1, 2]\n[dataset]\nreader = "simulated"\n[[trackers]]\nkind = "oracle"\n', place="x"
)
ORACLE = Oracle(n_features=200, covariance_px2=((0.04, 0.0), (0.0, 0.04)))


@pytest.fixture(scope="module")
def sequence():
    size = {"frames": 12, "width": 160, "height": 120, "supersampling": 1}
    reader = make_reader("simulated", None, {"motions": ["arvr"], **size})
    return reader.open(reader.sequences()[0])


def audited(sequence, **options) -> AuditedTables:
    measured = measure(sequence, {"oracle": ORACLE, "lucas-kanade": "lucas-kanade"}, speeds=(1, 2), **options)
    tables = tables_to_keep(EXPERIMENT, measured)
    return kept(tables)


def kept(tables) -> AuditedTables:
    return AuditedTables(*(tables[name] for name in ("audit_samples", "cameras", "poses")), tables.get("path"))


def require_reproduced(tables: AuditedTables) -> None:
    samples = read_samples([tables], NO_GROUPS)
    assert not isinstance(samples, str), samples
    assert len(samples.age) == tables.samples.height
    np.testing.assert_allclose(predict(samples, np.zeros(COUNT)).uv, samples.stated, atol=1e-9)


@dataclass(frozen=True, eq=False, slots=True)
class Changed(View):
    """The sequence with another truth, or other times and cameras."""

    truths: tuple[str, ...] = ()
    scan: Scan | None = None
    timestamps_s: np.ndarray | None = None
    camera: Camera | None = None

    def camera_at(self, index):
        return self.camera or self.sequence.camera


@pytest.mark.parametrize("truth", ["birth", "raycast"])
def test_true_positions_are_reproduced(sequence, truth) -> None:
    tables = audited(sequence, truth=truth)
    check(tables.samples, AUDIT_SAMPLES, "audit_samples")
    check(tables.cameras, CAMERAS, "cameras")
    require_reproduced(tables)
    assert tables.samples["speed"].unique().to_list() == [1]
    assert tables.samples["tracker"].unique().sort().to_list() == ["lucas-kanade", "oracle"]
    per_track = tables.samples.group_by("tracker", "track").len()["len"]
    assert per_track.max() == 2
    assert set(tables.samples["age"].unique().to_list()) == {1, 2, 3, 4, 6, 8}
    assert (tables.samples["frame"] == tables.samples["birth_frame"] + tables.samples["age"]).all()


def test_points_of_a_scan_are_anchored_in_the_key_frame(sequence) -> None:
    """Also tracks that began before it: their position there, and their depth there, are those of the audit."""
    u, v = np.meshgrid(np.arange(0.0, 159.0, 0.3), np.arange(0.0, 119.0, 0.3))
    points, hit = sequence.surface.cast(3, np.stack([u.ravel(), v.ravel()], axis=1))
    scanned = Changed(sequence, truths=("scan",), scan=Scan(points[hit], 3), camera=sequence.camera)
    measured = measure(scanned, "lucas-kanade")
    tables = tables_to_keep(EXPERIMENT, measured)
    assert kept(tables).samples["birth_frame"].unique().to_list() == [3]
    assert kept(tables).samples["frame"].min() < 3 < kept(tables).samples["frame"].max()
    require_reproduced(kept(tables))


def test_turned_views_are_not_audited_again(sequence) -> None:
    view = turned(sequence, 90)
    measured = measure(view, {"oracle": ORACLE})
    assert tables_to_keep(EXPERIMENT, measured)["audit_samples"].is_empty()


def test_times_and_fisheye_lenses_are_kept(sequence) -> None:
    """Lenses are made again from their numbers."""
    fisheye = EquidistantCamera(160, 120, 80.0, 80.0, 79.5, 59.5, (0.01, 0.0, 0.0, 0.0))
    times = 5.0 + 0.1 * np.arange(12.0)
    changed = Changed(sequence, truths=("birth",), timestamps_s=times, camera=fisheye)
    measured = measure(changed, {"oracle": ORACLE})
    tables = tables_to_keep(EXPERIMENT, measured)
    assert tables["cameras"]["time_s"].to_list() == times.tolist()
    samples = read_samples([kept(tables)], NO_GROUPS)
    assert samples.cameras == (fisheye,)
    assert samples.interval_s == pytest.approx(0.1)
    np.testing.assert_allclose(predict(samples, np.zeros(COUNT)).uv, samples.stated, atol=1e-9)


@dataclass(frozen=True, eq=False, slots=True)
class Shuttered(View):
    """The sequence with a rolling shutter and times."""

    timestamps_s: np.ndarray | None = None
    shutter: RollingShutter | None = None


@pytest.fixture(scope="module")
def shuttered(sequence):
    return Shuttered(sequence, timestamps_s=5.0 + np.arange(12.0) / 30.0, shutter=RollingShutter(0.03))


@pytest.fixture(scope="module")
def of_shuttered(shuttered):
    return audited(shuttered)


@pytest.fixture(scope="module")
def of_births(sequence):
    return audited(sequence, truth="birth")


@pytest.mark.parametrize("frames", [(0, 12, 2), (2, 9, 1)])
def test_chosen_frames_of_a_rolling_shutter_keep_the_poses_between_them(shuttered, frames) -> None:
    """The truth interpolates between the poses of all frames of the recording, and so does the audit."""
    tables = audited(chosen_frames(shuttered, frames))
    assert tables.path is not None
    check(tables.path, PATH, "path")
    with pytest.raises(AssertionError):
        require_reproduced(replace(tables, path=None))
    assert tables.path.height == 12 - tables.poses.height
    require_reproduced(tables)


def test_poses_of_a_clock_offset_lie_between_those_of_the_frames(shuttered) -> None:
    moved = corrected(shuttered, Corrections(clock_offset_s=0.4 / 30.0))
    require_reproduced(audited(moved))


def test_recordings_whose_poses_are_those_of_their_frames_keep_no_others(shuttered, of_shuttered, of_births) -> None:
    whole_frame = corrected(shuttered, Corrections(clock_offset_s=1.0 / 30.0))
    assert of_shuttered.path is None
    assert of_births.path is None
    assert audited(whole_frame).path.height == 1  # the frame whose time lies before all of them


def test_an_audit_whose_poses_do_not_give_the_stated_positions_says_so(of_births) -> None:
    tables = of_births
    moved = tables.poses.with_columns(pl.col("x_m") + 0.1 * pl.col("frame"))
    found = read_samples([replace(tables, poses=moved)], NO_GROUPS)
    assert isinstance(found, str)
    assert f"poses and cameras of the run give other true positions of {tables.samples.height} more" in found


def test_a_readout_in_seconds_is_not_audited_where_only_some_recordings_have_timestamps(of_shuttered, sequence) -> None:
    both = [of_shuttered, audited(Changed(sequence, truths=("birth",), camera=sequence.camera))]
    found = read_samples(both, NO_GROUPS)
    assert found == "a readout in seconds is stated, and some recordings have timestamps while others have none"


def test_the_audit_of_a_run_reads_the_poses_between_its_frames(shuttered, sequence, tmp_path, monkeypatch) -> None:
    given = []

    def read_once(tables, *_, **__):
        given.extend(tables)
        return "it is not asked for"

    monkeypatch.setattr(run_truth, "read_samples", read_once)
    for name, source, has_path in (("some", chosen_frames(shuttered, (0, 12, 2)), True), ("all", sequence, False)):
        folder = RunFolder(tmp_path / name)
        entry = write_measurement(folder, EXPERIMENT, measure(source, {"oracle": ORACLE}))
        write_settings(folder, EXPERIMENT, [entry])
        assert folder.has_sequence(entry)
        run_truth.run_audit(folder, folder.manifest(), EXPERIMENT)
        assert (given.pop().path is not None) == has_path
