"""Long recordings are measured in parts, and what is said of them is what is said of all of their observations."""

import cv2
import polars as pl
import pytest
from polars.testing import assert_frame_equal, assert_series_equal
from tests.lean import measured_only

from tracknoise.experiments.execute import execute, remake
from tracknoise.experiments.load import load_experiment, resolve
from tracknoise.experiments.parts import ranges_of
from tracknoise.experiments.settings import TrackerChoice, TruthSettings, ViewSettings
from tracknoise.statistics.lifetimes import lifetimes
from tracknoise.statistics.summarise import summarise_sequence
from tracknoise.tables.schema import ORIGIN
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.imported import Imported

KEY = "seq-01@default"


def in_parts(file, *, frames=10, **changes):
    trackers = [
        TrackerChoice(
            kind="oracle", options={"n_features": 20, "margin_px": 2, "loss_rate": 0.1, "walk_px_per_sqrt_frame": 0.1}
        ),
        TrackerChoice(kind="lucas-kanade"),
    ]
    truth = TruthSettings(poses="refined")
    changes = {"part_frames": frames, "trackers": trackers, "speeds": [1, 2], "truth": truth, **changes}
    return load_experiment(file).model_copy(update=changes)


def quickly(file):
    """The same with what does not matter to a test left out: one tracker at one speed, and poses as stated."""
    experiment = in_parts(file, speeds=[1], truth=TruthSettings(poses="stated"))
    return experiment.model_copy(update={"trackers": experiment.trackers[:1]})


@pytest.fixture(scope="module")
def recording(made_once):
    from tests.experiments.conftest import write_experiment

    return made_once("recording-30", lambda path: write_experiment(path, 1, 30)) / "x.toml"


@pytest.fixture(scope="module")
def joined(recording, made_once):
    from tests.experiments.conftest import Told

    def measure(path):
        with measured_only():
            assert not execute(in_parts(recording), RunFolder(path), listener=Told()).failures

    return RunFolder(made_once("joined-30", measure))


@pytest.mark.parametrize(
    ("n_frames", "speeds", "wanted", "expected"),
    [
        (350, [1], 300, ()),
        (400, [1], 300, (range(200), range(200, 400))),
        (1000, [1], 300, (range(333), range(333, 667), range(667, 1000))),
        (100, [1, 2, 4], 30, (range(32), range(32, 68), range(68, 100))),
        (11, [8], 9, ()),
        (1000, [1, 100], 60, (range(200), range(200, 400), range(400, 600), range(600, 800), range(800, 1000))),
        (100, [1, 7, 11], 50, (range(50), range(50, 100))),
    ],
)
def test_parts_are_alike_and_begin_where_all_speeds_see_a_frame(recording, n_frames, speeds, wanted, expected):
    experiment = in_parts(recording, frames=wanted)
    assert ranges_of(n_frames, experiment, speeds, pixels=640 * 480) == expected


@pytest.mark.parametrize(("n_frames", "lengths"), [(250, [250]), (500, [250] * 2), (750, [188] * 4), (350, [175] * 2)])
def test_two_cores_have_as_many_parts_each_unless_a_length_is_stated(recording, n_frames, lengths):
    found = ranges_of(n_frames, in_parts(recording, frames=None), [1], pixels=640 * 480)
    assert [len(frames) for frames in found or [range(n_frames)]] == pytest.approx(lengths, abs=1)


def test_clips_are_spread_over_the_recording(recording):
    experiment = in_parts(recording, frames=60, clips=5)
    found = ranges_of(1000, experiment, [1], pixels=640 * 480)
    gaps = [
        after.start - before.stop for before, after in zip((range(0), *found), (*found, range(1000, 1001)), strict=True)
    ]
    assert [len(frames) for frames in found] == [60] * 5
    assert max(gaps) - min(gaps) <= 1


def test_more_trackers_speeds_and_pixels_make_parts_shorter(recording):
    def length(n_trackers, speeds, pixels):
        trackers = [TrackerChoice(kind="lucas-kanade", name=f"t{number}") for number in range(n_trackers)]
        experiment = in_parts(recording, frames=None, trackers=trackers)
        return max(map(len, ranges_of(10_000, experiment, speeds, pixels=pixels)))

    assert length(1, [1], 640 * 480) == pytest.approx(500, abs=20)
    assert length(2, [1], 640 * 480) == pytest.approx(250, abs=10)
    assert length(2, [1, 2, 4, 8, 12], 640 * 480) == pytest.approx(130, abs=20)
    assert length(1, [1], 320 * 240) == length(1, [1], 640 * 480)  # with nearly as many features, and as much memory
    assert length(1, [1], 1280 * 480) == pytest.approx(250, abs=10)


def test_the_manifest_says_in_which_parts_and_the_frames_are_those_of_the_recording(joined):
    entry = joined.manifest().sequences[KEY]
    assert entry.parts == ((0, 10), (10, 20), (20, 30))
    assert entry.n_frames == 30
    assert any("3 parts of 10 to 10 frames" in note for note in entry.notes)
    frames = joined.sequence_table("frames", KEY)
    assert frames.filter(speed=2, tracker="oracle")["frame"].to_list() == list(range(0, 30, 2))
    assert joined.sequence_table("poses", KEY)["frame"].to_list() == list(range(30))
    observed = joined.sequence_table("observations", KEY)
    for _, part in observed.group_by("tracker", "speed"):
        assert part["frame"].unique().len() > 10
        assert part["track"].unique().sort().to_list() == list(range(part["track"].max() + 1))
    crossing = observed.with_columns(part=pl.col("frame") // 10).group_by("tracker", "speed", "track")
    assert crossing.agg(pl.col("part").n_unique())["part"].max() == 1


def test_parts_are_discarded_when_they_are_joined(joined):
    assert not (joined.path / "parts").exists()


@pytest.mark.parametrize(
    "name",
    [*("moments", "ends", "counts", "errors", "increments", "ratio_sums", "surroundings", "image_speeds"), "aspects"],
)
def test_sums_are_those_of_all_observations_together(joined, name):
    """Blocks and trimming belong to parts; everything else is as if the recording had been one piece."""
    observed, tracks, frames = (joined.sequence_table(table, KEY) for table in ("observations", "tracks", "frames"))
    expected = summarise_sequence(observed, tracks, frames, statistics=[name], slowest=1)[name]
    found = joined.sequence_table(name, KEY)
    if "trimming" in found.columns:
        expected, found = (table.filter(trimming="untrimmed") for table in (expected, found))
    if "block" in found.columns:
        keys = [column for column, kind in found.schema.items() if not kind.is_float() and column != "block"]
        keys = [column for column in keys if column != "n" and not column.startswith("n_")]
        values = [column for column in found.columns if column.startswith(("n", "sum", "lagged", "squares"))]
        keys += [column for column in ("low", "high") if column in found.columns]
        expected, found = (table.group_by(keys).agg(pl.col(values).sum()).sort(keys) for table in (expected, found))
    assert found.height
    assert_frame_equal(found, expected, rel_tol=1e-9, abs_tol=1e-9)


@pytest.mark.usefixtures("lean")
def test_survival_is_that_of_one_piece_as_far_as_parts_show_it(recording, joined, tmp_path):
    from tests.experiments.conftest import Told

    whole = RunFolder(tmp_path / "whole")
    execute(quickly(recording).model_copy(update={"part_frames": 100}), whole, listener=Told())
    assert not whole.manifest().sequences[KEY].parts
    in_pieces, in_one = (lifetimes(run.sequence_table("tracks", KEY)) for run in (joined, whole))
    both = in_pieces.join(in_one, on=["tracker", "speed", "lifetime"]).filter(tracker="oracle", speed=1)
    early = both.filter(pl.col("lifetime") <= 6)
    assert early.height >= 3
    assert (early["survival"] - early["survival_right"]).abs().max() < 0.15


@pytest.mark.usefixtures("lean")
def test_the_same_bytes_for_any_number_of_workers(recording, joined, files, tmp_path, told):
    two = RunFolder(tmp_path / "two")
    execute(in_parts(recording), two, listener=told(), workers=2)
    assert files(two) == files(joined)


@pytest.mark.usefixtures("lean")
def test_a_start_that_was_ended_loses_the_part_it_was_measuring(recording, joined, files, tmp_path, told):
    class Ends(told):
        def frame(self, key, done, total, first):
            if first == 20 and done == 5:
                raise KeyboardInterrupt

    class Counts(told):
        def __init__(self):
            super().__init__()
            self.frames = []

        def frame(self, key, done, total, first):
            self.frames.append((first, done))

    run = RunFolder(tmp_path / "ended")
    with pytest.raises(KeyboardInterrupt):
        execute(in_parts(recording), run, listener=Ends())
    assert sorted(path.name for path in (run.path / "parts" / KEY).iterdir()) == ["0000", "0001"]
    listener = Counts()
    assert execute(in_parts(recording), run, listener=listener).measured == [KEY]
    assert [done for first, done in listener.frames if first < 20] == [10, 10]
    assert {done for first, done in listener.frames if first == 20} == {*range(11)}
    assert files(run) == files(joined)


@pytest.mark.usefixtures("lean")
def test_a_damaged_part_is_named_and_the_others_are_kept(experiment_file, told, tmp_path):
    file = experiment_file(1, 30)
    image = tmp_path / "data" / "seq-01" / "frame-000014.color.png"
    before = image.read_bytes()
    image.write_bytes(b"no image")
    run = RunFolder(tmp_path / "run")
    outcome = execute(quickly(file), run, listener=told())
    assert outcome.failures[KEY].startswith("frames 10 to 19: ")
    assert "frame-000014" in outcome.failures[KEY]
    image.write_bytes(before)
    assert execute(quickly(file), run, listener=told()).measured == [KEY]


def test_a_part_without_depth_shows_nothing_and_fails_nothing(experiment_file, told, tmp_path):
    import numpy as np

    file = experiment_file(1, 30)
    for index in range(10, 20):
        cv2.imwrite(str(tmp_path / "data" / "seq-01" / f"frame-{index:06d}.depth.png"), np.zeros((48, 64), np.uint16))
    run = RunFolder(tmp_path / "run")
    assert execute(quickly(file), run, listener=told()).measured == [KEY]
    observed = run.sequence_table("observations", KEY)
    assert observed.filter(pl.col("frame").is_between(10, 19)).is_empty()
    assert observed.filter(pl.col("frame") >= 20).height


@pytest.mark.usefixtures("lean")
def test_a_changed_image_makes_the_recording_outdated(experiment_file, told, tmp_path):
    file = experiment_file(1, 30)
    run = RunFolder(tmp_path / "run")
    execute(quickly(file), run, listener=told())
    again = told()
    execute(quickly(file), run, listener=again)
    assert again.keys == []
    image = tmp_path / "data" / "seq-01" / "frame-000025.color.png"
    cv2.imwrite(str(image), 255 - cv2.imread(str(image), cv2.IMREAD_GRAYSCALE))
    execute(quickly(file), run, listener=again)
    assert again.keys == [KEY]


def test_conditions_are_in_the_order_of_one_piece(joined):
    observed = joined.sequence_table("observations", KEY)
    conditions = observed.select(list(ORIGIN)).unique(maintain_order=True)
    assert conditions.select("tracker", "speed").rows() == [
        *(("oracle", 1), ("oracle", 2)),
        *(("lucas-kanade", 1), ("lucas-kanade", 2)),
    ]
    assert observed["tracker"].rle().len() == 2


@pytest.mark.usefixtures("lean")
def test_another_trimming_is_that_of_measuring_again(recording, joined, tmp_path, told):
    """From the observations that are kept, of each part on its own."""
    statistics = in_parts(recording).statistics.model_copy(update={"trim_percentile": 80.0})
    experiment = in_parts(recording, statistics=statistics)
    again, measured = RunFolder(tmp_path / "again"), RunFolder(tmp_path / "measured")
    remake(joined, resolve(experiment), again)
    execute(experiment, measured, listener=told())
    assert (
        again.sequence_table("trims", KEY)["n_dropped"].sum() > joined.sequence_table("trims", KEY)["n_dropped"].sum()
    )
    for name in measured.names_of_tables(KEY):
        if name not in ("patches", "film"):
            assert_frame_equal(again.sequence_table(name, KEY), measured.sequence_table(name, KEY), rel_tol=1e-6)


def test_clips_do_not_overlap(recording):
    for n_frames in range(300, 420, 7):
        for speeds in ([1], [1, 8], [3, 4]):
            found = ranges_of(n_frames, in_parts(recording, frames=61, clips=5), speeds, pixels=640 * 480)
            frames = [frame for one in found for frame in one]
            assert len(frames) == len(set(frames))
            assert max(frames) < n_frames


def test_parts_of_an_oracle_draw_numbers_of_their_own(joined):
    moved = joined.sequence_table("observations", KEY).filter(tracker="oracle", speed=1, age=1)
    first, second = (moved.filter(pl.col("frame").is_between(low, low + 9))["du_px"].to_list() for low in (0, 10))
    assert not set(first) & set(second)


@pytest.mark.usefixtures("lean")
def test_a_part_without_poses_is_left_out_and_named(experiment_file, told, tmp_path):
    file = experiment_file(1, 30)
    for index in range(10):
        (tmp_path / "data" / "seq-01" / f"frame-{index:06d}.pose.txt").write_text("nan nan nan nan\n" * 4)
    run = RunFolder(tmp_path / "run [1]")
    outcome = execute(quickly(file), run, listener=told())
    assert outcome.measured == [KEY], outcome.failures
    assert any("nothing could be measured in frames 0 to 9" in note for note in run.manifest().sequences[KEY].notes)


@pytest.mark.usefixtures("lean")
def test_parts_of_another_version_are_measured_again(recording, told, tmp_path, monkeypatch):
    class Ends(told):
        def frame(self, key, done, total, first):
            if first == 20:
                raise KeyboardInterrupt

    run = RunFolder(tmp_path / "run")
    with pytest.raises(KeyboardInterrupt):
        execute(quickly(recording), run, listener=Ends())
    part = run.part(KEY, 0)
    manifest = part.manifest()
    manifest.versions["numpy"] = "0.1"
    part.write_manifest(manifest)
    seen = []

    class Counts(told):
        def frame(self, key, done, total, first):
            seen.append((first, done))

    execute(quickly(recording), run, listener=Counts())
    assert (0, 1) in seen
    assert (10, 1) not in seen


@pytest.fixture
def imported(tmp_path):
    """Nine tracks in frames 1 to 28 as they are played."""
    rows = (f"{k},{f},{20 + k + 0.25 * f},{20 + 2 * k}\n" for k in range(9) for f in range(1, 29))
    text = "track,frame,u,v\n" + "".join(rows)
    for direction in ("forward", "backward"):
        (tmp_path / f"{direction}.csv").write_text(text)
    return [TrackerChoice(kind="imported", options={"path": str(tmp_path / "{direction}.csv")})]


@pytest.mark.usefixtures("lean")
@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_imported_tracks_are_read_in_each_part(recording, imported, tmp_path, told, direction):
    views = [ViewSettings(direction=direction)]
    poses = TruthSettings(poses="stated")
    experiment = in_parts(recording, trackers=imported, speeds=[1, 2], views=views, truth=poses)
    run = RunFolder(tmp_path / "run")
    outcome = execute(experiment, run, listener=told())
    assert not outcome.failures
    (entry,) = run.manifest().sequences.values()
    assert entry.parts == ((0, 10), (10, 20), (20, 30))
    seen = run.sequence_table("observations", entry.key).filter(speed=1)
    k, birth = (seen["v_px"] - 20) / 2, seen["frame"] - seen["age"]
    assert_series_equal(seen["u_px"], 20 + k + 0.25 * seen["frame"], check_names=False)
    assert set(birth) == {1, 10, 20}
    assert sorted(set(seen["frame"])) == list(range(1, 29))
    assert len(set(seen["track"])) == 27


@pytest.mark.usefixtures("lean")
def test_trackers_that_need_the_whole_sequence_get_it(recording, imported, tmp_path, told, monkeypatch):
    monkeypatch.setattr(Imported, "begins_anywhere", False)
    run = RunFolder(tmp_path / "run")
    outcome = execute(in_parts(recording, trackers=imported, speeds=[1]), run, listener=told())
    assert outcome.measured == [KEY], outcome.failures
    entry = run.manifest().sequences[KEY]
    assert not entry.parts
    assert "measured in one piece, all frames: imported needs the whole sequence" in entry.notes
