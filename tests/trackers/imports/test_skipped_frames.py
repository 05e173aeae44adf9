"""Frames of which a file of tracks says nothing, and ids that are slots of an array."""

import re

import numpy as np
import polars as pl
import pytest

import tracknoise as tn
from tracknoise.exceptions import DataError
from tracknoise.tables.identity import SequenceId
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.tracker import Frame, SequenceContext

SIZE, N_FRAMES, N_TRACKS = (640, 480), 30, 40


def context(speed: int = 1) -> SequenceContext:
    return SequenceContext(SequenceId("d", "s"), SIZE, N_FRAMES, speed, 0, None)


def moving() -> pl.DataFrame:
    """Tracks that move smoothly, in all frames."""
    rng = np.random.default_rng(2)
    start, speed = rng.uniform(200, 280, (N_TRACKS, 2)), rng.normal(0, 1.0, (N_TRACKS, 2))
    track, frame = (a.ravel() for a in np.meshgrid(np.arange(N_TRACKS), np.arange(N_FRAMES), indexing="ij"))
    uv = start[track] + frame[:, None] * speed[track] + rng.normal(0, 0.1, (len(track), 2))
    return pl.DataFrame({"track": track, "frame": frame, "u_px": uv[:, 0], "v_px": uv[:, 1]})


def started(tmp_path, rows: pl.DataFrame, where: SequenceContext | None = None, **options):
    rows.write_csv(tmp_path / "tracks.csv")
    return Imported(str(tmp_path / "tracks.csv"), **options).start(where or context())


def steps(tracker, speed: int = 1) -> list:
    image = np.zeros(SIZE[::-1], np.uint8)
    return [tracker.step(Frame(index, image)) for index in range(0, N_FRAMES, speed)]


PATTERNS = {
    "two of three": [frame for frame in range(N_FRAMES) if frame % 3 != 2],
    "every second, with a drop": [frame for frame in range(0, N_FRAMES, 2) if frame != 12] + [13],
    "every third, from the second on": [*range(1, N_FRAMES, 3)],
    "one is lost": [frame for frame in range(N_FRAMES) if frame != 17],
}


@pytest.mark.parametrize("pattern", PATTERNS)
def test_tracks_last_over_frames_in_which_no_track_has_a_row(pattern, tmp_path):
    frames = PATTERNS[pattern]
    tracker = started(tmp_path, moving().filter(pl.col("frame").is_in(frames)))
    reported = steps(tracker)
    assert sum(step.new for step in reported) == N_TRACKS
    assert not any(len(step.ended_ids) for step in reported)
    assert [len(step.ids) for step in reported] == [N_TRACKS * (index in frames) for index in range(N_FRAMES)]
    note = tracker.notes[-1]
    total = max(frames) - min(frames) + 1
    assert note.startswith(f"{len(frames)} of {total} frames have rows of imported tracks, not ")
    assert note.endswith("a track ends where it is absent and others are present")


def test_a_track_that_is_absent_where_others_are_present_ends(tmp_path):
    """Frames 2, 5, ... have no rows. Track 0 is absent in frame 6, and there again in frame 7."""
    rows = moving().filter(pl.col("frame") % 3 != 2, ~((pl.col("track") == 0) & (pl.col("frame") == 6)))
    reported = steps(started(tmp_path, rows))
    assert [index for index, step in enumerate(reported) if len(step.ended_ids)] == [6]
    assert [index for index, step in enumerate(reported) if step.new] == [0, 7]


def test_rows_that_say_that_nothing_was_seen_end_tracks(tmp_path):
    """Frame 9 has rows of all tracks, and each says that the track was not seen."""
    rows = moving().with_columns(visible=pl.col("frame") != 9)
    empty = pl.when(pl.col("frame") != 9).then(pl.col("u_px", "v_px"))
    for stated in (rows, moving().with_columns(empty)):
        tracker = started(tmp_path, stated)
        reported = steps(tracker)
        assert [len(step.ended_ids) for step in reported] == [N_TRACKS * (index == 9) for index in range(N_FRAMES)]
        assert not any("frames have rows" in note for note in tracker.notes)


def test_at_a_speed_only_frames_that_are_seen_count(tmp_path):
    rows = moving().filter(pl.col("frame") % 3 != 2)
    at_three = started(tmp_path, rows, context(speed=3))
    assert [len(step.ids) for step in steps(at_three, 3)] == [N_TRACKS] * 10
    assert not any("frames have rows" in note for note in at_three.notes)
    with pytest.raises(
        DataError, match=r"rows in no frame that is seen at speed 3: 1, 4, 7, ..., expected rows in some"
    ):
        started(tmp_path, moving().filter(pl.col("frame") % 3 == 1), context(speed=3))


def test_errors_of_tracks_of_two_of_three_frames_are_those_of_the_same_observations(tmp_path):
    """Measured against the oracle's own errors: ages count frames of the sequence."""
    sequence = tn.open_sequence("simulated", motions=["sideways"], frames=12, width=160, height=120, supersampling=1)
    noisy = tn.measure(sequence, tn.Oracle(covariance_px2=((0.09, 0.0), (0.0, 0.09))))
    columns = ("track", "frame", "u_px", "v_px")
    rows = noisy.observations.select(columns).filter(pl.col("frame") % 3 != 2)
    rows.write_csv(tmp_path / "tracks.csv")
    found = tn.measure(sequence, tn.Imported(str(tmp_path / "tracks.csv"))).observations
    first = noisy.observations.group_by("track").agg(begin=pl.col("frame").min())
    whole = first.filter(pl.col("begin") % 3 != 2)["track"]  # tracks whose first position is in the file
    expected = noisy.observations.filter(pl.col("frame") % 3 != 2, pl.col("track").is_in(whole.implode()))
    keys = ["frame", "u_px", "v_px"]
    both = found.join(expected.select(*keys, "age", "du_px", "dv_px"), on=keys, suffix="_expected")
    assert both.height > 500
    assert (both["age"] == both["age_expected"]).all()
    np.testing.assert_allclose(both["du_px"].to_numpy(), both["du_px_expected"].to_numpy(), atol=1e-9)
    assert found["age"].max() > 8


def slots_of_redetection() -> tuple[pl.DataFrame, pl.DataFrame]:
    """All features are detected again in each sixth frame, in another order; and the same tracks with own ids."""
    rows, rng = moving(), np.random.default_rng(3)
    order = np.array([rng.permutation(N_TRACKS) for _ in range(N_FRAMES // 6)])
    episode = rows["frame"].to_numpy() // 6
    slot = order[episode, rows["track"].to_numpy()]
    own = rows.with_columns(pl.Series("track", slot + 1000 * episode))
    return rows.with_columns(pl.Series("track", slot)), own


def slots_of_replacement() -> tuple[pl.DataFrame, pl.DataFrame]:
    """Each slot gets another feature, elsewhere, at times of its own; and the same tracks with own ids."""
    rng = np.random.default_rng(4)
    rows, life = moving(), np.zeros((N_TRACKS, N_FRAMES), dtype=int)
    for track in range(N_TRACKS):
        for frame in (rng.integers(3, 14), rng.integers(16, 27)):
            life[track, frame:] += 1
    shift = np.cumsum(rng.choice([-1, 1], (N_TRACKS, 3, 2)) * rng.uniform(25, 60, (N_TRACKS, 3, 2)), axis=1)
    track, frame = rows["track"].to_numpy(), rows["frame"].to_numpy()
    of = life[track, frame]
    uv = rows.select("u_px", "v_px").to_numpy() + shift[track, of]
    moved = rows.with_columns(pl.Series("u_px", uv[:, 0]), pl.Series("v_px", uv[:, 1]))
    return moved, moved.with_columns(pl.Series("track", track + 1000 * of))


SLOTS = {"all at once": slots_of_redetection, "one by one": slots_of_replacement}


@pytest.mark.parametrize("kind", SLOTS)
def test_ids_that_are_slots_are_named_and_split_at_births_where_that_is_asked_for(kind, tmp_path):
    slots, own = SLOTS[kind]()
    (note,) = started(tmp_path, slots).notes
    jumped = re.match(r"(\d+) of 40 imported tracks jump by more than 1\d px", note)
    assert int(jumped[1]) > 30
    assert ("most of them in frames 6, 12, 18, ..." in note) == (kind == "all at once")
    assert note.endswith('if ids are slots that are used again, set ids = "slots"')
    assert started(tmp_path, own).notes == ()
    split = started(tmp_path, slots, ids="slots")
    assert split.notes[0].startswith(f"{own['track'].n_unique() - N_TRACKS} births within imported tracks")
    lives = [
        [(step.uv[~step.born].tolist(), step.new) for step in steps(one)] for one in (split, started(tmp_path, own))
    ]
    for (uv, new), (uv_own, new_own) in zip(*lives, strict=True):
        assert sorted(uv) == sorted(uv_own)
        assert new == new_own


@pytest.mark.parametrize("options", [{}, {"ids": "slots"}])
def test_wrong_positions_of_a_tracker_and_motions_of_the_camera_are_no_slots(options, tmp_path):
    """Single positions that are 40 px off, a track that slips by 5 px, and images that turn by 8 degrees at once."""
    rows = moving()
    wrong = (pl.col("frame") == 11) & (pl.col("track") % 4 == 0)
    slipped = (pl.col("frame") > 20) & (pl.col("track") == 3)
    rows = rows.with_columns(u_px=pl.col("u_px") + 40.0 * wrong.cast(float) + 5.0 * slipped.cast(float))
    uv = rows.select("u_px", "v_px").to_numpy() - 240.0
    turned = uv @ np.array([[np.cos(0.14), np.sin(0.14)], [-np.sin(0.14), np.cos(0.14)]])
    uv = np.where(rows["frame"].to_numpy()[:, None] >= 15, turned, uv) + 240.0
    rows = rows.with_columns(pl.Series("u_px", uv[:, 0]), pl.Series("v_px", uv[:, 1]))
    tracker = started(tmp_path, rows, **options)
    jumps = [note for note in tracker.notes if "births" not in note]
    assert jumps == []
    if not options:
        assert sum(step.new for step in steps(tracker)) == N_TRACKS
