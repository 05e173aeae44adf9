import numpy as np
import polars as pl
import pytest

import tracknoise
from tracknoise.exceptions import DataError, SettingsError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.measurement.sequence_tables import SequenceTables, measure_sequences
from tracknoise.measurement.tracking import TrackerSetup
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.sequences.views import view
from tracknoise.tables.files import read_parquet, write_parquet
from tracknoise.tables.identity import Direction, SequenceId
from tracknoise.tables.schema import OBSERVATIONS
from tracknoise.trackers.imported import Imported


class Wall:
    """Five frames of a camera that stands 2 m before a wall."""

    id = SequenceId("case", "wall")
    source = "the wall"
    camera = Camera(40, 30, 100.0, 100.0, 19.5, 14.5)
    world_from_camera = np.tile(np.eye(4), (5, 1, 1))
    truths = (TruthKind.birth,)
    notes = ()
    surface = None

    def __len__(self) -> int:
        return 5

    def image(self, index: int) -> np.ndarray:
        return np.zeros((30, 40), np.uint8)

    def depth(self, index: int) -> DepthMap:
        return DepthMap(np.full((30, 40), 2.0), np.full((30, 40), fill_value=True))


def measure_one(sequence: object, setups: list[TrackerSetup], **options: object) -> SequenceTables:
    return next(measure_sequences([sequence], setups, **options))


def measured(tmp_path, last_frame: int):
    path = tmp_path / "tracks.csv"
    path.write_text("track,frame,u_px,v_px\n" + "".join(f"0,{k},9.0,9.0\n" for k in range(last_frame + 1)))
    return measure_one(Wall(), [TrackerSetup("imported", Imported(str(path)), 1)], max_frames=2)


def test_a_tracker_is_told_the_length_of_the_sequence_not_of_the_part_that_is_read(tmp_path):
    assert measured(tmp_path, last_frame=4).observations["frame"].to_list() == [0, 1]
    with pytest.raises(DataError, match=r"tracks.csv:7: frame 5, expected a frame from 0 to 4 of the sequence$"):
        measured(tmp_path, last_frame=5)


class Scanned(Wall):
    """The wall, with a point of it seen in the middle of pixel (9, 9) of frame 1."""

    truths = (TruthKind.scan,)
    scan = Scan(np.array([[-0.21, -0.11, 2.0]]), 1)


def test_the_frame_kept_for_drawing_is_not_the_key_frame_but_half_way_from_it_to_the_end(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("track,frame,u_px,v_px\n" + "".join(f"0,{k},9.0,9.0\n" for k in range(5)))
    conditions = [TrackerSetup("imported", Imported(str(path)), 1)]
    assert measure_one(Scanned(), conditions).snapshot_frame == 3
    assert measure_one(Wall(), conditions).snapshot_frame == 2


def test_a_speed_that_passes_over_the_key_frame_and_a_run_that_ends_before_it_are_refused(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("track,frame,u_px,v_px\n0,0,9.0,9.0\n")
    imported = Imported(str(path))
    with pytest.raises(
        SettingsError, match="the wall: found speed 2, which skips the key frame 1, expected a speed that divides 1"
    ):
        measure_one(Scanned(), [TrackerSetup("imported", imported, 2)])
    late = Scanned()
    late.scan = Scan(Scanned.scan.points_world, 3)
    with pytest.raises(DataError, match="the wall: 3 frames, expected at least 4, to reach the key frame"):
        measure_one(late, [TrackerSetup("imported", imported, 1)], max_frames=3)
    backward = view(late, n_frames=3, direction=Direction.backward, rotation=0)
    with pytest.raises(DataError, match="the wall: 3 frames, expected at least 4, to reach the key frame"):
        measure_one(backward, [TrackerSetup("imported", imported, 1)])


def test_a_scan_that_no_feature_lies_on_is_said_to_be_the_reason(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("track,frame,u_px,v_px\n0,0,9.0,9.0\n0,1,9.0,9.0\n")
    elsewhere = Scanned()
    elsewhere.scan = Scan(-Scanned.scan.points_world, 1)
    with pytest.raises(DataError, match=r"the wall: no feature of the key frame 1 on the scan, expected .* in metres"):
        measure_one(elsewhere, [TrackerSetup("imported", Imported(str(path)), 1)])


class Striped(Wall):
    """The wall with upright stripes until frame 1, and lying ones from frame 2 on."""

    def image(self, index: int) -> np.ndarray:
        ramp = (np.arange(40) * 6 if index < 2 else np.arange(30)[:, None] * 8).astype(np.uint8)
        return np.ascontiguousarray(np.broadcast_to(ramp, (30, 40)))


def test_tracks_know_the_gradient_of_the_image_in_their_first_frame(tmp_path):
    path = tmp_path / "tracks.csv"
    rows = [(0, 0, 9, 9), (0, 1, 9, 9), (0, 2, 9, 9), (1, 2, 20, 15), (1, 3, 20, 15), (2, 2, 3, 15), (3, 4, 20, 9)]
    path.write_text("track,frame,u_px,v_px\n" + "".join(f"{t},{k},{u},{v}\n" for t, k, u, v in rows))
    conditions = [TrackerSetup("imported", Imported(str(path)), speed) for speed in (1, 2)]
    tracks = measure_one(Striped(), conditions).tracks
    across, down = 0.0, float(np.float32(np.pi / 2))
    for speed in (1, 2):
        assert tracks.filter(speed=speed)["gradient_rad"].to_list() == [across, down, None, down]


def test_observations_have_the_union_of_what_their_trackers_report_and_null_elsewhere(tmp_path):
    rows = "0,0,9.0,9.0,0.5\n0,1,9.0,9.0,\n"
    for name in ("sure", "apt"):
        (tmp_path / f"{name}.csv").write_text(f"track,frame,u_px,v_px,quality_{name}\n" + rows)
    (tmp_path / "plain.csv").write_text("track,frame,u_px,v_px\n0,0,9.0,9.0\n0,1,9.0,9.0\n")
    setups = [TrackerSetup(name, Imported(str(tmp_path / f"{name}.csv")), 1) for name in ("sure", "plain", "apt")]
    found = measure_one(Wall(), setups).observations
    assert [name for name in found.columns if name.startswith("quality_")] == ["quality_apt", "quality_sure"]
    assert found["tracker"].to_list() == ["sure"] * 2 + ["plain"] * 2 + ["apt"] * 2
    assert found["quality_sure"].to_list() == [0.5, None, None, None, None, None]
    assert found["quality_apt"].to_list() == [None, None, None, None, 0.5, None]
    assert found["quality_apt"].dtype == pl.Float32
    alone = measure_one(Wall(), setups[1:2]).observations
    assert alone.equals(found.filter(tracker="plain").select(alone.columns))


def test_the_store_keeps_quality_and_trimming_does_too(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("track,frame,u_px,v_px,quality_sure\n" + "".join(f"0,{k},9.0,9.0,{k}\n" for k in range(5)))
    measured = tracknoise.measure(Wall(), Imported(str(path)))
    assert measured.observations["quality_sure"].to_list() == [0, 1, 2, 3, 4]
    sha256 = write_parquet(tmp_path / "observations.parquet", measured.observations)
    assert read_parquet(tmp_path / "observations.parquet", OBSERVATIONS, sha256).equals(measured.observations)


@pytest.mark.parametrize(("size_px", "are_errors"), [(1e-11, False), (1e-7, True)])
def test_differences_of_rounding_are_no_errors(size_px, are_errors):
    sequence = open_sequence("simulated", motions=("sideways",), frames=4, width=160, height=120, supersampling=1)
    tracker = tracknoise.Oracle(n_features=30, bias_px=(size_px, -size_px), covariance_px2=((0.0, 0.0), (0.0, 0.0)))
    later = tracknoise.measure(sequence, tracker).observations.filter(pl.col("age") > 0).drop_nulls("du_px")
    assert later.height
    assert ((later["du_px"] != 0.0) == are_errors).all()
    assert ((later["dv_px"] != 0.0) == are_errors).all()
