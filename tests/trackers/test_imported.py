from contextlib import suppress
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.tracker import Frame, Step

ROWS = {
    "track": [7, 7, 7, 9, 9, 9, 4],
    "frame": [0, 1, 2, 0, 2, 3, 2],
    "u_px": [10.0, 11.0, 12.0, 20.0, 22.0, 23.0, 5.25],
    "v_px": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5],
}


def written(path, rows=ROWS, **more) -> Imported:
    table = pl.DataFrame({**rows, **more})
    table.write_parquet(path) if path.suffix == ".parquet" else table.write_csv(path)
    return Imported(str(path))


def run(settings: Imported, setting, indices: range) -> list[Step]:
    tracker = settings.start(setting)
    return [tracker.step(Frame(k, np.zeros((50, 50), np.uint8))) for k in indices]


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_tracks_are_handed_out_and_a_gap_begins_a_new_one(suffix, tmp_path, setting):
    """After the last frame with rows nothing is known of the tracks: the last one does not end."""
    steps = run(written(tmp_path / f"tracks.{suffix}"), setting(), range(5))
    assert [step.ids.tolist() for step in steps] == [[0, 1], [0], [0, 2, 3], [3], []]
    assert [step.born.tolist() for step in steps] == [[True, True], [False], [False, True, True], [False], []]
    assert steps[2].uv.tolist() == [[12.0, 3.0], [5.25, 7.5], [22.0, 5.0]]
    assert [step.ended_ids.tolist() for step in steps] == [[], [1], [], [0, 2], []]
    assert all((step.ended == TrackEnd.lost).all() for step in steps)
    assert [(step.offered, step.matched, step.alive) for step in steps] == [
        (0, 0, 2),
        (2, 1, 1),
        (1, 1, 3),
        (3, 1, 1),
        (1, 0, 1),
    ]


def test_at_another_speed_only_frames_seen_count(tmp_path, setting):
    steps = run(written(tmp_path / "tracks.csv"), setting(speed=2), range(0, 6, 2))
    assert [step.ids.tolist() for step in steps] == [[0, 1], [0, 1, 2], []]
    assert steps[1].uv.tolist() == [[12.0, 3.0], [22.0, 5.0], [5.25, 7.5]]


def test_the_order_of_rows_does_not_matter(tmp_path, setting):
    order = [6, 2, 5, 0, 3, 1, 4]
    shuffled = {name: [values[i] for i in order] for name, values in ROWS.items()}
    here = setting()
    plain = run(written(tmp_path / "a.csv"), here, range(5))
    other = run(written(tmp_path / "b.csv", shuffled), here, range(5))
    assert [step.uv.tolist() for step in plain] == [step.uv.tolist() for step in other]


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_other_usual_names_of_columns_are_understood(suffix, tmp_path, setting):
    renamed = dict(zip(("Track_ID", "frame_id", "X", "y"), ROWS.values(), strict=True))
    path = tmp_path / f"tracks.{suffix}"
    table = pl.DataFrame(renamed)
    table.write_csv(path) if suffix == "csv" else table.write_parquet(path)
    steps, plain = (
        run(settings, setting(), range(5)) for settings in (Imported(str(path)), written(tmp_path / "a.csv"))
    )
    assert [step.uv.tolist() for step in steps] == [step.uv.tolist() for step in plain]


def test_rows_without_a_position_are_frames_in_which_the_track_was_not_observed(tmp_path, setting):
    written(tmp_path / "tracks.csv")
    header, *lines = (tmp_path / "tracks.csv").read_text().splitlines()
    path = tmp_path / "dense.csv"
    path.write_text("\n".join([header, "7,0,,", "", "7,1,nan,NaN", *lines, "8,3, ,", ""]))
    steps, plain = (
        run(settings, setting(), range(5)) for settings in (Imported(str(path)), written(tmp_path / "a.csv"))
    )
    assert [step.uv.tolist() for step in steps] == [step.uv.tolist() for step in plain]
    path.write_text("\n".join([header, "", *lines[:2], "8,3,1.5,"]))
    with pytest.raises(DataError, match=r"dense\.csv:5: v_px None, expected a finite number"):
        run(Imported(str(path)), setting(), range(5))


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_response_is_kept_where_known_and_other_columns_are_ignored(suffix, tmp_path, setting):
    response = [3.0, None, None, 8.0, None, None, None]
    settings = written(tmp_path / f"tracks.{suffix}", response=response, name=["x"] * 7)
    steps = run(settings, setting(), range(3))
    assert steps[0].response.tolist() == [3.0, 8.0]
    assert np.isnan(steps[2].response).all()


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_quality_columns_belong_to_their_observations_and_may_be_empty(suffix, tmp_path, setting):
    sure = [0.5, 0.25, None, 0.75, 1.0, 2.0, 3.0]
    steps = run(written(tmp_path / f"tracks.{suffix}", quality_sure=sure, certain=sure), setting(), range(3))
    assert [list(step.quality) for step in steps] == [["sure"]] * 3
    assert [step.quality["sure"].tolist() for step in steps[:2]] == [[0.5, 0.75], [0.25]]
    np.testing.assert_array_equal(steps[2].quality["sure"], np.float32([np.nan, 3.0, 1.0]))


def test_quality_with_a_bad_name_or_a_cell_that_is_no_number_is_refused(tmp_path, setting):
    named = written(tmp_path / "named.csv", quality_Sure=[1.0] * 7)
    with pytest.raises(DataError, match=r"named.csv: column quality_Sure, expected a name of the form quality_\[a-z\]"):
        named.start(setting())
    worded = written(tmp_path / "worded.csv", quality_sure=["high"] * 7)
    with pytest.raises(DataError, match=r"worded.csv:2: quality_sure 'high', expected a finite number$"):
        worded.start(setting())


def test_placeholders_name_the_condition(tmp_path, setting):
    written(tmp_path / "scene_default_0_2.csv")
    settings = Imported(str(tmp_path / "{scene}_{lighting}_{rotation}_{speed}.csv"))
    assert run(settings, setting(speed=2), range(1))[0].alive == 2
    with pytest.raises(DataError, match=r"scene_default_0_1.csv: no such file, expected a file of tracks"):
        settings.start(setting(speed=1))


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_file_without_rows_is_refused_by_name(suffix, tmp_path, setting):
    kinds = {"track": pl.Int64, "frame": pl.Int64, "u_px": pl.Float64, "v_px": pl.Float64}
    path = tmp_path / f"tracks.{suffix}"
    pl.DataFrame(schema=kinds).write_csv(path) if suffix == "csv" else pl.DataFrame(schema=kinds).write_parquet(path)
    with pytest.raises(DataError, match=rf"tracks.{suffix}: no track, expected at least one row$"):
        Imported(str(path)).start(setting())


def test_frames_counted_from_1_are_noticed_by_the_one_beyond_the_sequence(tmp_path, setting):
    from_1 = {**ROWS, "frame": [frame + 1 for frame in ROWS["frame"]]}
    beyond = r"row 6: frame 4, expected a frame from 0 to 3 .*; frames are counted from 1: set first_frame = 1$"
    with pytest.raises(DataError, match=r"tracks.parquet: " + beyond):
        written(tmp_path / "tracks.parquet", from_1).start(setting(n_frames=4))
    with pytest.raises(DataError, match=r"tracks.csv:7: frame 4, expected a frame from 0 to 3"):
        written(tmp_path / "tracks.csv", from_1).start(setting(n_frames=4))


def test_frames_of_the_sequence_that_a_run_does_not_read_are_fine(tmp_path, setting):
    assert [step.alive for step in run(written(tmp_path / "tracks.csv"), setting(n_frames=4), range(2))] == [2, 1]


def test_names_between_spaces_and_whole_numbers_written_as_floats_are_read(tmp_path, setting):
    (tmp_path / "tracks.csv").write_text("track , frame, u_px,v_px\n 7.0, 0.0, 1,2\n9007199254740993,1,3,4\n")
    steps = run(Imported(str(tmp_path / "tracks.csv")), setting(), range(2))
    assert [step.uv.tolist() for step in steps] == [[[1.0, 2.0]], [[3.0, 4.0]]]


def test_long_names_of_tracks_are_not_rounded(tmp_path, setting):
    long = {"track": [2**53, 2**53 + 1], "frame": [0, 0], "u_px": [1.0, 2.0], "v_px": [1.0, 2.0]}
    assert run(written(tmp_path / "tracks.csv", long), setting(), range(1))[0].alive == 2


def test_parquet_columns_of_whole_floats_are_read(tmp_path, setting):
    frame = [float(frame) for frame in ROWS["frame"]]
    assert run(written(tmp_path / "tracks.parquet", frame=frame), setting(), range(1))[0].alive == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("track,frame,u_px\n1,0,2\n", r"no column v_px among track, frame, u_px, expected track, frame, u_px, v_px$"),
        ("track,frame,u_px,v_px\n1,0,2,3\n1,1,abc,3\n", r"tracks.csv:3: u_px 'abc', expected a finite number$"),
        ("track,frame,u_px,v_px\n1,0,2,nan\n", r"tracks.csv:2: v_px 'nan', expected a finite number$"),
        ("track,frame,u_px,v_px\n1,0,2,inf\n", r"tracks.csv:2: v_px 'inf', expected a finite number$"),
        ("track,frame,u_px,v_px\n1,0,2,\n", r"tracks.csv:2: v_px None, expected a finite number$"),
        ("track,frame,u_px,v_px\n1,0.5,2,3\n", r"tracks.csv:2: frame '0.5', expected a whole number$"),
        (
            "track,frame,u_px,v_px\n1,1e30,2,3\n",
            r"tracks.csv:2: frame '1e30', expected a whole number of at most 9223\d+$",
        ),
        ("track,frame,u_px,v_px\nnan,0,2,3\n", r"tracks.csv:2: track 'nan', expected a whole number$"),
        ("track,frame,u_px,v_px\n1,-1,2,3\n", r"tracks.csv:2: frame -1, expected a frame from 0 to 5 of the"),
        ("track, track,frame,u_px,v_px\n1,1,0,2,3\n", r"tracks.csv:1: column track twice, expected .*, each once$"),
        ("# by x, 2\ntrack,frame,u_px,v_px\n1,0,2,3\n", r"tracks.csv:1: a comment, expected a header with the columns"),
        ("track,frame,u_px,v_px\r1,0,2,3\r", r"tracks.csv:1: a carriage return within the line, expected lines that"),
        (
            'track,frame,u_px,v_px\n1,0,2,3\n"1,1,2,3\n',
            r"tracks.csv:3: no whole row .*, expected .* quotes closed$",
        ),
        ("track,frame,u_px,v_px\n1,0,2,3\n\0", r"tracks.csv:3: a null character, expected"),
        ("track,frame,u_px,v_px\n1,0,2,3\n2,0,2,3\n1,0,5,5\n", r"tracks.csv:4: track 1, expected one row for each"),
        ("track,frame,u_px,v_px,response\n1,0,2,3,high\n", r"tracks.csv:2: response 'high', expected a finite number$"),
        ("track,frame,u_px,v_px\n1,0,2,3\n\n1,1,2,3,4\n", r"tracks.csv:4: 5 columns, expected a row of 4 columns, as"),
        ("", r"tracks.csv: not readable \(.*\), expected a .csv file of tracks$"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_in_one_line(text, message, tmp_path, setting):
    (tmp_path / "tracks.csv").write_text(text)
    with pytest.raises(DataError, match=message) as caught:
        Imported(str(tmp_path / "tracks.csv")).start(setting())
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"frame": [0.0, 1.0, 2.5] + [0.0] * 4}, r"tracks.parquet: row 3: frame 2.5, expected a whole number$"),
        ({"u_px": [True] * 7}, r"column u_px of type Boolean, expected a finite number in each row$"),
        ({"v_px": [1.0, 2.0, float("nan"), 4.0, 5.0, 6.0, 7.0]}, r"tracks.parquet: row 3: v_px nan, expected"),
    ],
)
def test_what_is_wrong_with_a_parquet_file_is_said_in_one_line(more, message, tmp_path, setting):
    with pytest.raises(DataError, match=message):
        written(tmp_path / "tracks.parquet", **more).start(setting())


@pytest.mark.parametrize("name", ["tracks.parquet", "tracks.csv"])
def test_bytes_that_are_no_table_are_refused(name, tmp_path, setting):
    (tmp_path / name).write_bytes(b"\xff\xfe\x00PAR1 nonsense")
    with pytest.raises(DataError, match=name):
        Imported(str(tmp_path / name)).start(setting())


def test_text_in_utf_16_is_refused_as_such(tmp_path, setting):
    (tmp_path / "tracks.csv").write_text("track,frame,u_px,v_px\n1,0,2,3\n", encoding="utf-16")
    with pytest.raises(DataError, match=r"tracks.csv:1: a null character, expected .* in UTF-8, not UTF-16$"):
        Imported(str(tmp_path / "tracks.csv")).start(setting())


@pytest.mark.parametrize("path", ["tracks.json", "{scen}.csv", "{}.csv", "{scene.csv", "{scene.x}.csv"])
def test_impossible_paths_are_refused_by_name(path):
    with pytest.raises(ValueError, match="path is"):
        Imported(path)


def test_parquet_that_makes_polars_abort_or_panic_is_refused(tmp_path, setting, capfd):
    """Found by one-byte edits; without a child process the first of them ends the program."""
    whole = written(tmp_path / "whole.parquet")
    data = Path(whole.path).read_bytes()
    path = tmp_path / "tracks.parquet"
    for position in range(4, len(data) // 3, 7):
        path.write_bytes(data[:position] + bytes([data[position] ^ 0xFF]) + data[position + 1 :])
        with suppress(DataError):
            Imported(str(path)).start(setting())
    assert capfd.readouterr() == ("", "")


def test_more_rows_than_bytes_are_refused(tmp_path, setting):
    rows = {name: np.zeros(2_000_000, np.int64) for name in ("track", "frame", "u_px", "v_px")}
    settings = written(tmp_path / "tracks.parquet", rows)
    with pytest.raises(
        DataError, match=r"tracks.parquet: 2000000 rows in \d+ bytes, expected at most one row per byte$"
    ):
        settings.start(setting())


def test_columns_that_are_not_used_are_not_read_and_lists_are_refused(tmp_path, setting):
    lists = [[1.0]] * 7
    assert run(written(tmp_path / "tracks.parquet", other=lists), setting(), range(1))[0].alive == 2
    with pytest.raises(DataError, match=r"column u_px of type List\(Float64\), expected a finite number in each row$"):
        written(tmp_path / "lists.parquet", u_px=lists).start(setting())


def test_too_many_columns_and_too_large_numbers_are_refused(tmp_path, setting):
    (tmp_path / "wide.csv").write_text("," * 100_000 + "\n")
    with pytest.raises(DataError, match=r"wide.csv: 100001 columns, expected at most 1000$"):
        Imported(str(tmp_path / "wide.csv")).start(setting())
    settings = written(tmp_path / "large.csv", response=[1e300] * 7)
    with pytest.raises(
        DataError, match=r"large.csv:2: response '1e\+?300', expected a number within the range of float32"
    ):
        settings.start(setting())


def test_names_that_look_like_patterns_are_files(tmp_path, setting):
    for suffix in ("csv", "parquet"):
        assert run(written(tmp_path / f"tracks[1]*.{suffix}"), setting(), range(1))[0].alive == 2


@pytest.mark.parametrize(
    "path",
    [
        "{scene:d}.csv",
        "{scene!r}.csv",
        "{scene.__class__}.csv",
        "{scene[0]}.csv",
        "{0}.csv",
        "{}.csv",
        "{scene:{speed}}.csv",
    ],
)
def test_only_names_of_placeholders_are_between_braces(path):
    with pytest.raises(ValueError, match=r"expected no placeholders but \{dataset\}, \{scene\}"):
        Imported(path)
    assert SequenceId("d", "s").expand("{{{scene}}}_{speed}.csv", speed=2) == Path("{s}_2.csv")


def test_quality_that_is_no_dictionary_is_refused():
    with pytest.raises(SettingsError, match="found quality of type list, expected a dictionary of arrays"):
        Imported.from_arrays([0], [0], [1.0], [1.0], quality=[1.0])


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (
            {"quality": {"cov_uu": [1e300]}},
            r"quality cov_uu\[0\] is 1e\+300, expected a number within the range of float32",
        ),
        ({"response": [-1e39]}, r"response\[0\] is -1e\+39, expected a number within the range of float32"),
        ({"u_px": np.ma.masked_array([1.0], [True])}, "u_px has masked elements, expected an array without them"),
        ({"u_px": np.array([np.longdouble("1e400")])}, r"u_px\[0\] is inf, expected a finite number"),
        (
            {"frame": np.array([2**63], np.uint64)},
            rf"frame\[0\] is {2**63}, expected a whole number of at most {2**63 - 1}",
        ),
        ({"track": [0.5]}, r"track\[0\] is 0.5, expected a whole number"),
        ({"track": [2.0**60]}, r"track\[0\] is 1.15\d+e\+18, expected integers where numbers are so large"),
    ],
)
def test_numbers_that_cannot_be_held_are_refused(arrays, message):
    with pytest.raises(SettingsError, match=rf"^imported arrays: {message}$"):
        Imported.from_arrays(**{"track": [0], "frame": [0], "u_px": [1.0], "v_px": [1.0]} | arrays)


def test_a_path_and_a_list_are_taken_as_text_and_pair(tmp_path, setting):
    path, here = written(tmp_path / "a.csv").path, setting()
    as_text, as_given = Imported(path), Imported(Path(path), raster=[*here.size])
    assert as_given.path == path
    assert [step.uv.tolist() for step in run(as_given, here, range(5))] == [
        step.uv.tolist() for step in run(as_text, here, range(5))
    ]
