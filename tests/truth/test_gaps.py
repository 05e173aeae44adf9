"""Frames without a pose: their observations have no true position, and nothing else changes."""

from dataclasses import dataclass, field

import numpy as np
import polars as pl
import pytest

import tracknoise
from tracknoise.exceptions import DataError
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.sequences.views import View, turned
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth_registry import make_truth

GAP = (3, 4, 8)


@dataclass(frozen=True, slots=True, eq=False)
class Gappy(View):
    """A sequence some of whose frames have no pose."""

    gap: tuple[int, ...] = field(default=GAP)

    @property
    def world_from_camera(self) -> np.ndarray:
        poses = self.sequence.world_from_camera.copy()
        poses[list(self.gap)] = np.nan
        return poses


@pytest.fixture(scope="module")
def sequence():
    return open_sequence("simulated", motions=["sideways"], frames=12, width=160, height=120, supersampling=1)


@pytest.fixture(scope="module")
def trackers():
    return {
        "lk": tracknoise.LucasKanade(min_features=60, max_features=90),
        "oracle": tracknoise.Oracle(n_features=40),
    }


@pytest.mark.parametrize("kind", [TruthKind.birth, TruthKind.raycast])
@pytest.mark.parametrize("speed", [1, 2])
def test_numbers_outside_of_gaps_are_those_of_the_same_sequence_without_gaps(sequence, trackers, kind, speed):
    settings = {"truth": kind, "speeds": [speed]}
    whole = tracknoise.measure(sequence, trackers["lk"], **settings)
    gappy = tracknoise.measure(Gappy(sequence), trackers["lk"], **settings)
    born = gappy.observations["frame"] - gappy.observations["age"]
    lost = gappy.observations["frame"].is_in(GAP) | born.is_in(GAP)
    assert 0 < lost.sum() < len(lost)
    without_kept = pl.exclude("kept")
    known = gappy.observations.filter(~lost)
    assert known.select(without_kept).equals(whole.observations.filter(~lost).select(without_kept))
    unknown = gappy.observations.filter(lost)
    assert unknown["truth"].unique().to_list() == ["no_pose"]
    assert unknown.select("u_true_px", "v_true_px", "du_px", "dv_px").null_count().row(0) == (len(unknown),) * 4
    seen_after = known.filter(pl.col("frame") > 4, pl.col("frame") - pl.col("age") < 3)
    assert seen_after["du_px"].drop_nulls().len() > 0
    assert gappy.frames.equals(whole.frames)


def test_the_oracle_keeps_its_features_through_a_gap(sequence, trackers):
    whole = tracknoise.measure(sequence, trackers["oracle"], truth="raycast").observations
    gappy = tracknoise.measure(Gappy(sequence), trackers["oracle"], truth="raycast").observations
    early = pl.col("frame") < GAP[0]
    assert gappy.filter(early).drop("kept").equals(whole.filter(early).drop("kept"))
    through = gappy.filter(pl.col("frame") > 4, pl.col("frame") == pl.col("age"))
    assert through.filter(truth="valid").height > 20
    assert gappy.filter(pl.col("frame").is_in(GAP))["truth"].unique().to_list() == ["no_pose"]
    assert np.std(gappy["du_px"].drop_nulls().to_numpy()) == pytest.approx(0.5, rel=0.2)


def test_views_keep_gaps(sequence):
    gappy = Gappy(sequence)
    assert has_pose(turned(gappy, 90).world_from_camera).tolist() == [index not in GAP for index in range(12)]


def test_a_track_born_in_a_gap_has_no_truth(make_room, at):
    room = make_room(at(), np.full((4, 4), np.nan), at(x=0.1))
    session = make_truth(room, TruthKind.raycast).start()
    for index, tracks in enumerate(([0], [0, 1], [0, 1])):
        born = np.array([index == (0, 1)[track] for track in tracks])
        session.observe(index, np.array(tracks, np.uint32), np.full((len(tracks), 2), 20.0), born)
    found = session.resolve()
    none = TruthStatus.no_pose
    assert found.status.tolist() == [TruthStatus.valid, none, none, TruthStatus.valid, none]
    assert np.isnan(found.depth_m).tolist() == [False, True]


def test_a_key_frame_without_a_pose_is_an_error(make_room, at):
    room = make_room(np.full((4, 4), np.nan), at(), at(), truths=(TruthKind.scan,), scan=Scan(np.ones((1, 3)), 0))
    with pytest.raises(DataError, match="no pose of the key frame 0"):
        make_truth(room)


def test_fewer_than_two_poses_are_an_error(sequence, trackers):
    with pytest.raises(DataError, match="1 pose for 12 frames, expected poses for at least 2"):
        tracknoise.measure(Gappy(sequence, tuple(range(1, 12))), trackers["lk"])
    with pytest.raises(DataError, match="1 pose for 2 frames, expected poses for at least 2"):
        tracknoise.measure(Gappy(sequence, (1,)), trackers["lk"], max_frames=2)
