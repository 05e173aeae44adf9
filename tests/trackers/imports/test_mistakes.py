"""Mistakes in files of tracks are recognised and named."""

import gzip
import sqlite3
from contextlib import closing
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.writers.track_files import Observed, colmap, events, tap, xivo

from tracknoise.exceptions import DataError, InvalidValueError, SettingsError
from tracknoise.tables.identity import SequenceId
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.imported_rows import PixelOrigin
from tracknoise.trackers.track_files import TrackFormat
from tracknoise.trackers.tracker import Frame, SequenceContext

SIZE, N_FRAMES = (320, 240), 10


def context(speed=1, times=None, size=SIZE) -> SequenceContext:
    return SequenceContext(SequenceId("d", "s"), size, N_FRAMES, speed, 0, None, timestamps_s=times)


def table(n_tracks=6, seed=0) -> pl.DataFrame:
    rng = np.random.default_rng(seed)
    track, frame = (a.ravel() for a in np.meshgrid(np.arange(n_tracks), np.arange(N_FRAMES), indexing="ij"))
    u, v = rng.uniform(0, 319, len(track)), rng.uniform(0, 239, len(track))
    return pl.DataFrame({"track": track, "frame": frame, "u_px": u, "v_px": v})


def start(tmp_path, rows: pl.DataFrame, where: SequenceContext | None = None, **options):
    rows.write_csv(tmp_path / "tracks.csv")
    return Imported(str(tmp_path / "tracks.csv"), **options).start(where or context())


def positions(tracker, index: int) -> np.ndarray:
    return tracker.step(Frame(index, np.zeros(SIZE[::-1], np.uint8))).uv


def test_frames_counted_from_1_are_named_and_the_option_corrects_them(tmp_path):
    rows = table().with_columns(pl.col("frame") + 1)
    with pytest.raises(DataError, match=r"frame 10, .* counted from 1: set first_frame = 1"):
        start(tmp_path, rows)
    tracker = start(tmp_path, rows, first_frame=1)
    np.testing.assert_array_equal(positions(tracker, 0), table().filter(frame=0).select("u_px", "v_px").to_numpy())
    (note,) = start(tmp_path, rows.filter(pl.col("frame") < 9)).notes
    assert "no row in frame 0: if their frames are counted from 1, set first_frame = 1" in note


@pytest.mark.parametrize("junk", ["ERROR tracker crashed", "77,0", "5,", "foo,bar", "5,0,10.5"])
@pytest.mark.parametrize("after", [2, 9, 61])
def test_a_line_that_is_junk_or_cut_off_is_refused(junk, after, tmp_path):
    lines = table().write_csv().splitlines()
    (tmp_path / "tracks.csv").write_text("\n".join([*lines[:after], junk, *lines[after:]]))
    columns = rf"{junk.count(',') + 1} columns?, expected a row of 4 columns"
    with pytest.raises(DataError, match=rf"tracks.csv:{after + 1}: {columns}"):
        Imported(str(tmp_path / "tracks.csv")).start(context())


@pytest.mark.parametrize("line", ["", "  ", "5,11,,", ",,,"])
def test_a_blank_line_or_a_row_without_a_position_is_no_observation(line, tmp_path):
    (tmp_path / "tracks.csv").write_text(f"{table().write_csv()}{line}\n")
    assert len(positions(Imported(str(tmp_path / "tracks.csv")).start(context()), 0)) == 6


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_normalised_coordinates_are_named_and_a_raster_corrects_them(scale, tmp_path):
    """From 0 to 1, and from -1 to 1."""
    shift = (scale - 1) / 2
    unit = {"u_px": (pl.col("u_px") + 0.5) / 320, "v_px": (pl.col("v_px") + 0.5) / 240}
    rows = table().with_columns(**{name: scale * value - 2 * shift for name, value in unit.items()})
    with pytest.raises(DataError, match=r"in images of 320 x 240 px, expected pixels, .* raster = \[1, 1\] and origin"):
        start(tmp_path, rows)
    if scale == 1.0:
        tracker = start(tmp_path, rows, raster=(1.0, 1.0), origin=PixelOrigin.corner)
        np.testing.assert_allclose(positions(tracker, 0), table().filter(frame=0)[["u_px", "v_px"]].to_numpy())


def test_tracks_of_resized_images_are_scaled(tmp_path):
    rows = table().with_columns((pl.col("u_px") + 0.5) * 256 / 320 - 0.5, (pl.col("v_px") + 0.5) * 256 / 240 - 0.5)
    tracker = start(tmp_path, rows, raster=(256.0, 256.0))
    np.testing.assert_allclose(positions(tracker, 0), table().filter(frame=0)[["u_px", "v_px"]].to_numpy())


def test_swapped_columns_are_named(tmp_path):
    rows = table().rename({"u_px": "v_px", "v_px": "u_px"})
    with pytest.raises(DataError, match=r"\d\d% of positions inside .*: the columns are swapped, or width and height"):
        start(tmp_path, rows)


def test_positions_outside_the_image_are_noted_with_their_share(tmp_path):
    rows = table().with_columns(u_px=pl.when(pl.col("track") == 0).then(-20.0).otherwise("u_px"))
    assert start(tmp_path, rows).notes == ("16.7% of imported positions are outside the image",)
    assert start(tmp_path, table()).notes == ()


def test_positions_that_are_all_outside_the_image_are_refused(tmp_path):
    rows = table().with_columns(pl.col("u_px", "v_px") + 400.0)
    with pytest.raises(DataError, match=r"no position inside images of 320 x 240 px, .* raster = \[width, height\]"):
        start(tmp_path, rows)


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_what_programs_write_for_features_that_were_not_seen_is_refused(value, tmp_path):
    lost = (pl.col("track") == 2) & (pl.col("frame") > 6)
    padded = [pl.when(lost).then(value).otherwise(name).alias(name) for name in ("u_px", "v_px")]
    with pytest.raises(DataError, match=r"tracks.csv:29: position .*: 3 rows have this one; leave them out, or add"):
        start(tmp_path, table().with_columns(padded))
    seen = table().with_columns(*padded, visible=~lost)
    assert len(positions(start(tmp_path, seen), 7)) == 5
    once = table().with_columns(pl.when(pl.int_range(pl.len()) == 7).then(value).otherwise("u_px").alias("u_px"))
    start(tmp_path, once)  # on an edge of the image


def test_variances_without_a_covariance_are_of_independent_coordinates(tmp_path):
    both = table().with_columns(cov_uu=pl.lit(0.04), cov_vv=pl.lit(0.09))
    quality = start(tmp_path, both).step(Frame(0, np.zeros(SIZE[::-1], np.uint8))).quality
    assert {name: float(values[0]) for name, values in quality.items()} == pytest.approx(
        {"cov_uu": 0.04, "cov_uv": 0.0, "cov_vv": 0.09}
    )


def test_a_unit_of_times_that_contradicts_the_column_is_refused(tmp_path):
    timed = table().drop("frame").with_columns(time_ns=10**8 * pl.Series([*range(N_FRAMES)] * 6))
    where = context(times=0.1 * np.arange(N_FRAMES))
    assert len(positions(start(tmp_path, timed, where, time_unit="ns"), 3)) == 6
    with pytest.raises(DataError, match="column time_ns with time_unit = 'ms', expected no time_unit where"):
        start(tmp_path, timed, where, time_unit="ms")


@pytest.mark.parametrize("raster", [(320,), (320, 240, 1), 320.0])
def test_a_raster_has_two_numbers(raster):
    with pytest.raises(InvalidValueError, match=r"raster is .*, expected 2 values"):
        Imported("tracks.csv", raster=raster)


@pytest.mark.parametrize("u", [1e9, -420.0])
def test_a_position_that_no_feature_has_is_refused_with_its_row(u, tmp_path):
    rows = table(30).with_columns(u_px=pl.when(pl.int_range(pl.len()) == 7).then(u).otherwise("u_px"))
    with pytest.raises(DataError, match=r"tracks.csv:9: position \[.*\], expected at most 400 px, the diagonal, from"):
        start(tmp_path, rows)


@pytest.mark.parametrize(("uu", "uv"), [(-1.0, 0.0), (1.0, 2.0)])
def test_covariances_with_negative_eigenvalues_are_refused(uu, uv, tmp_path):
    rows = table().with_columns(cov_uu=pl.lit(uu), cov_uv=pl.lit(uv), cov_vv=pl.lit(1.0))
    with pytest.raises(DataError, match=rf"csv:2: cov_uu, cov_uv, cov_vv \[{uu}, {uv}, 1.0\], expected no neg"):
        start(tmp_path, rows)


def test_where_there_is_no_covariance_a_cell_can_be_nan(tmp_path):
    rows = table().with_columns(cov_uu=pl.lit(np.nan), cov_uv=pl.lit(0.0), cov_vv=pl.lit(1.0))
    assert np.isnan(start(tmp_path, rows).step(Frame(0, np.zeros(SIZE[::-1], np.uint8))).quality["cov_uu"]).all()


def test_frames_that_are_skipped_are_named_unless_the_speed_is_theirs(tmp_path):
    rows = table().filter(pl.col("frame") % 3 == 0)
    with pytest.raises(DataError, match=r"rows in one of 3 frames only: 0, 3, 6, .* set speeds = \[3\]"):
        start(tmp_path, rows)
    assert len(positions(start(tmp_path, rows, context(speed=3)), 3)) == 6


def test_tracks_of_every_third_frame_are_those_of_speed_three(tmp_path):
    assert start(tmp_path, table().filter(pl.col("frame") % 3 == 0), context(speed=3)).notes == ()


def test_a_higher_speed_of_the_same_file_is_noted(tmp_path):
    assert "subsampled" in start(tmp_path, table(), context(speed=2)).notes[0]
    table().write_csv(tmp_path / "tracks-2.csv")
    assert Imported(str(tmp_path / "tracks-{speed}.csv")).start(context(speed=2)).notes == ()


@pytest.mark.parametrize(("name", "value"), [("rotation", 90), ("direction", "backward")])
def test_a_file_of_upright_forward_images_is_not_taken_for_other_views(name, value, tmp_path):
    other = replace(context(), sequence=SequenceId("d", "s", **{name: value}))
    with pytest.raises(SettingsError, match=rf"for {name} {value}, expected {{{name}}} in it, and one file for each"):
        start(tmp_path, table(), other)
    table().write_csv(tmp_path / f"tracks-{value}.csv")
    assert Imported(str(tmp_path / f"tracks-{{{name}}}.csv")).start(other).notes == ()


TIMES = 100.0 + 0.1 * np.arange(N_FRAMES)


def timed(shift=0.0) -> pl.DataFrame:
    return table().with_columns(time_s=100.0 + 0.1 * pl.col("frame") + shift).drop("frame")


def test_times_belong_to_the_nearest_frame_and_far_ones_are_left_out_and_counted(tmp_path):
    tracker = start(tmp_path, timed(0.03), context(times=TIMES))
    np.testing.assert_array_equal(positions(tracker, 4), table().filter(frame=4)[["u_px", "v_px"]].to_numpy())
    (note,) = start(tmp_path, timed(0.2), context(times=TIMES)).notes
    assert note == "20.0% of imported rows are too far in time from every frame, and were left out"


@pytest.mark.parametrize(("per_s", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
def test_times_in_another_unit_are_named_and_the_option_corrects_them(per_s, unit, tmp_path):
    rows = timed().with_columns(time=pl.col("time_s") * per_s).drop("time_s")
    symbol = {"milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"}[unit]
    corrected = rf'these look like {unit}: set time_unit = "{symbol}"$'
    with pytest.raises(DataError, match=rf"times of the frames, from 100 to 100.9 s; {corrected}"):
        start(tmp_path, rows, context(times=TIMES))
    tracker = start(tmp_path, rows, context(times=TIMES), time_unit=symbol)
    np.testing.assert_array_equal(positions(tracker, 0), table().filter(frame=0)[["u_px", "v_px"]].to_numpy())
    since_start = rows.with_columns(pl.col("time") - 100.0 * per_s)
    assert f"left out; their times look like {unit}" in " ".join(
        start(tmp_path, since_start, context(times=TIMES - 100.0)).notes
    )


def test_microseconds_that_look_like_nanoseconds_are_named(tmp_path):
    rows = table().with_columns(timestamp=1_700_000_000_000_000 + 100_000 * pl.col("frame")).drop("frame")
    with pytest.raises(DataError, match=r'these look like microseconds: set time_unit = "us"$'):
        start(tmp_path, rows, context(times=1.7e9 + 0.1 * np.arange(N_FRAMES)))


def test_of_several_rows_near_a_frame_the_nearest_counts(tmp_path):
    rows = {"track": [1, 1, 1], "time_s": [100.0, 100.04, 100.12], "u_px": [1.0, 2.0, 3.0], "v_px": [5.0, 5.0, 5.0]}
    tracker = start(tmp_path, pl.DataFrame(rows), context(times=TIMES))
    assert [positions(tracker, k).tolist() for k in range(3)] == [[[1.0, 5.0]], [[3.0, 5.0]], []]
    (note,) = tracker.notes
    assert note.startswith("1 of 3 imported rows was left out: another of the same track is as near or nearer in time")


def test_two_positions_of_a_track_at_one_time_are_refused(tmp_path):
    rows, again = timed(), timed()[7:8]
    with pytest.raises(DataError, match=r"csv:62: track 0, expected one row for each track and time$"):
        start(tmp_path, pl.concat([rows, again.with_columns(u_px=99.0)]), context(times=TIMES))
    (note,) = start(tmp_path, pl.concat([rows, again]), context(times=TIMES)).notes
    assert note.startswith("1 of 61 imported rows was left out")


def test_another_clock_is_named_with_the_offset_that_corrects_it(tmp_path):
    with pytest.raises(DataError, match=r"times from 900 to 900.9 s, .* 100 to 100.9 s; .*time_offset_s.*: -800.0"):
        start(tmp_path, timed(800.0), context(times=TIMES))
    assert len(positions(start(tmp_path, timed(800.0), context(times=TIMES), time_offset_s=-800.0), 0)) == 6
    with pytest.raises(DataError, match="times, expected frame numbers, because the times of the sequence's frames"):
        start(tmp_path, timed())


def test_events_are_interpolated_between_their_updates_but_not_over_gaps(tmp_path):
    lines = ["1 99.95 10 20", "1 100.05 12 20", "1 100.17 14 26", "1 100.6 20 20", "2 100.1 5 6"]
    (tmp_path / "tracks.txt").write_text("\n".join(lines))
    tracker = Imported(str(tmp_path / "tracks.txt")).start(context(times=TIMES))
    found = [positions(tracker, k) for k in range(N_FRAMES)]
    np.testing.assert_allclose(found[0], [[11.0, 20.0]])
    np.testing.assert_allclose(found[1], [[12 + 2 * 5 / 12, 20 + 6 * 5 / 12], [5.0, 6.0]])
    assert [len(one) for one in found] == [1, 2, 0, 0, 0, 0, 1, 0, 0, 0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 0.0 5\n", r"tracks.txt:1: 3 columns, expected at least 4: id, t, x, y$"),
        ("# id t x y\n\n1 0.0 5 x\n", r"tracks.txt:3: y 'x', expected a finite number$"),
        ("1.5 0.0 5 6\n", r"tracks.txt:1: id 1.5, expected a whole number$"),
        ("1_000 0.0 5 6\n", r"tracks.txt:1: id '1_000', expected a finite number$"),
        ("1 0.0 \u0663 6\n", r"tracks.txt:1: x '\u0663', expected a finite number$"),
        (
            "1 0 5 6\n1 0.05 1e308 6\n1 0.1 -1e308 6\n",
            r"tracks.txt:2: position .*, expected numbers of at most 1e\+30$",
        ),
        ("1 1e308 5 6\n1 -1e308 5 6\n", r"times from -1e\+308 to 1e\+308 s, expected times of the frames"),
        (
            f"{2**53} 0.0 5 6\n",
            r"tracks.txt:1: id 9007199254740992.0, expected a whole number of at most 9007199254740991$",
        ),
        ("1 123456789012 5 6\n", r"times of the frames, from .* s; these are no seconds: set time_unit"),
        ("1 0 5 6\n1 0 7 8\n", r"tracks.txt:2: track 1, expected one row for each track and time$"),
        ("# nothing\n", r"no track, expected at least one row$"),
        ("1 0.0 5 6" + " 7" * 40000, r"tracks.txt:1: a line of 65536 characters or more"),
    ],
)
def test_bad_lines_of_event_text_are_named(text, message, tmp_path):
    (tmp_path / "tracks.txt").write_text(text)
    with pytest.raises(DataError, match=message):
        Imported(str(tmp_path / "tracks.txt")).start(context(times=TIMES - 100))


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"occluded": np.zeros((2, 10), bool)}, "no array tracks"),
        ({"tracks": np.zeros((2, 10, 2))}, "no array occluded or visible"),
        ({"tracks": np.zeros((10, 40, 2)), "occluded": np.zeros((10, 40), bool)}, "transpose the first two axes"),
        ({"tracks": np.zeros((10, 4, 2)), "occluded": np.zeros((10, 4), bool)}, "transpose the first two axes"),
        (
            {"tracks": np.zeros((2, 10)), "occluded": np.zeros((2, 10))},
            r"expected numbers of shape \(points, frames, 2",
        ),
        ({"tracks": np.zeros((2, 10, 2)), "occluded": np.full((2, 10), 0.5)}, "the option visible_above"),
        ({"tracks": np.full((2, 10, 2), np.nan), "occluded": np.zeros((2, 10))}, "tracks of point 0 in frame 0"),
        ({"tracks": np.zeros((2, 10, 2)), "occluded": np.ones((2, 10))}, "no visible point"),
        (
            {"tracks": np.zeros((2, 10, 2)), "occluded": np.zeros((2, 10)), "query_points": np.zeros((3, 3))},
            r"expected finite numbers of shape \(2, 3\)",
        ),
        ({"tracks": np.array([{}]), "occluded": np.zeros(1)}, "not readable"),
    ],
)
def test_bad_tap_archives_are_refused(arrays, message, tmp_path):
    np.savez(tmp_path / "points.npz", **arrays)
    with pytest.raises(DataError, match=message):
        Imported(str(tmp_path / "points.npz")).start(context())


TAP = np.random.default_rng(2).uniform(20.0, 200.0, (3, N_FRAMES, 2)).astype(np.float32)
HIDDEN = np.arange(3 * N_FRAMES).reshape(3, N_FRAMES) % 4 == 3


@pytest.mark.parametrize(
    "arrays",
    [
        {"tracks": TAP, "occluded": HIDDEN.astype(np.uint8)},
        {"tracks": TAP, "visibles": ~HIDDEN},
        {"points": TAP, "occluded": HIDDEN, "video": np.zeros((N_FRAMES, 2, 2, 3), np.uint8)},
        {"target_points": TAP[None], "occluded": HIDDEN[None], "query_points": np.zeros((1, 3, 3))},
        {"pred_tracks": TAP.swapaxes(0, 1)[None], "pred_visibility": ~HIDDEN.T[None, :, :, None]},
        {"tracks": TAP, "visibility": (~HIDDEN).astype(np.float32), "queries": np.zeros((3, 3))},
    ],
)
def test_names_and_shapes_of_other_models_mean_the_same(arrays, tmp_path):
    np.savez(tmp_path / "points.npz", **arrays)
    tracker = Imported(str(tmp_path / "points.npz")).start(context())
    for index in range(N_FRAMES):
        found = positions(tracker, index)
        np.testing.assert_array_equal(found[found[:, 0].argsort()], sorted(TAP[~HIDDEN[:, index], index].tolist()))


def as_other_programs_write(rows: pl.DataFrame) -> dict[str, bytes]:
    """The same table by other programs' habits."""
    plain = rows.write_csv()
    header, body = plain.split("\n", 1)
    return {
        "Windows": b"\xef\xbb\xbf" + plain.replace("\n", "\r\n").encode(),
        "an index": "".join(
            f"{index - 1 if index else ''},{line}\n" for index, line in enumerate(plain.split())
        ).encode(),
        "semicolons": plain.replace(",", ";").encode(),
        "tabs": plain.replace(",", "\t").encode(),
        "spaces": (", ".join(f'"{name}"' for name in header.split(",")) + "\n" + body.replace(",", ", ")).encode(),
        "NumPy": f"# {header}\n{body}".encode(),
    }


@pytest.mark.parametrize("habit", as_other_programs_write(table()))
def test_tables_are_read_as_other_programs_write_them(habit, tmp_path):
    (tmp_path / "tracks.csv").write_bytes(as_other_programs_write(table())[habit])
    tracker = Imported(str(tmp_path / "tracks.csv")).start(context())
    np.testing.assert_array_equal(positions(tracker, 0), table().filter(frame=0).select("u_px", "v_px").to_numpy())


@pytest.mark.parametrize("name", ["tracks.txt", "tracks.csv"])
@pytest.mark.parametrize("write", [events, xivo])
def test_text_may_begin_with_a_byte_order_mark(write, name, tmp_path):
    write(tmp_path / name, observed())
    options = {"format": TrackFormat.events} if write is events else {}
    plain = positions(Imported(str(tmp_path / name), **options).start(context(times=TIMES)), 0)
    (tmp_path / name).write_bytes(b"\xef\xbb\xbf" + (tmp_path / name).read_bytes())
    marked = Imported(str(tmp_path / name), **options).start(context(times=TIMES))
    np.testing.assert_array_equal(positions(marked, 0), plain)


@pytest.mark.parametrize("name", ["tracks.txt", "tracks.csv"])
def test_a_compressed_file_is_named(name, tmp_path):
    (tmp_path / name).write_bytes(gzip.compress(table().write_csv().encode()))
    with pytest.raises(
        DataError, match=rf"{name}: a gzip file, expected a .{name[-3:]} file of tracks, not compressed$"
    ):
        Imported(str(tmp_path / name)).start(context(times=TIMES))


@pytest.mark.parametrize("column", ["track", "frame"])
@pytest.mark.parametrize("number", ["9223372036854775808", "-1e30"])
def test_a_number_that_is_too_large_is_refused_with_the_limit(number, column, tmp_path):
    rows = table().with_columns(pl.lit(number).alias(column))
    with pytest.raises(DataError, match=rf"{column} '{number}', expected a whole number of at most {2**63 - 1}$"):
        start(tmp_path, rows)


def test_times_beyond_all_clocks_are_left_out_and_counted(tmp_path):
    rows = pl.concat([timed(), timed()[:2].with_columns(time_s=pl.Series([1.7e308, -1.7e308]))])
    (note,) = start(tmp_path, rows, context(times=TIMES)).notes
    assert note.startswith("3.2% of imported rows are too far in time")


@pytest.mark.parametrize("unit", ["timestamp", "time_s"])
def test_times_of_the_clock_of_the_recording_are_those_of_its_frames(tmp_path, unit):
    """Also where no track begins in the first frames."""
    start_ns = 1_403_636_579_763_555_584
    late = table().filter(pl.col("frame") >= 4)
    by_clock = pl.col("frame") * 50_000_000 + start_ns
    given = late.select("track", "u_px", "v_px", (by_clock if unit == "timestamp" else by_clock * 1e-9).alias(unit))
    where = replace(context(times=0.05 * np.arange(N_FRAMES)), clock_start_ns=start_ns)
    tracker = start(tmp_path, given, where)
    assert len(positions(tracker, 0)) == 0
    for _ in range(1, 4):
        positions(tracker, _)
    np.testing.assert_array_equal(positions(tracker, 4), late.filter(frame=4).select("u_px", "v_px").to_numpy())


def test_a_column_time_is_in_seconds_or_nanoseconds(tmp_path):
    expected = table().filter(frame=0).select("u_px", "v_px").to_numpy()
    times = 1.6e9 + TIMES
    seconds = table().with_columns(time=1.6e9 + 100.0 + 0.1 * pl.col("frame")).drop("frame")
    for rows in (seconds, seconds.with_columns((pl.col("time") * 1e9).cast(pl.Int64))):
        np.testing.assert_array_equal(positions(start(tmp_path, rows, context(times=times)), 0), expected)


def test_a_table_without_a_header_is_not_taken_for_a_dump_of_xivo(tmp_path):
    table().write_csv(tmp_path / "tracks.csv", include_header=False)
    with pytest.raises(DataError, match="expected track, frame, u_px, v_px"):
        Imported(str(tmp_path / "tracks.csv")).start(context(times=TIMES))


def test_points_of_a_tap_archive_begin_with_their_query(tmp_path):
    tracks = np.full((2, N_FRAMES, 2), 30.0)
    queries = np.array([[3, 30, 30], [0, 30, 30]])
    np.savez(tmp_path / "points.npz", tracks=tracks, visible=np.ones((2, N_FRAMES)), query_points=queries)
    tracker = Imported(str(tmp_path / "points.npz")).start(context())
    assert [len(positions(tracker, k)) for k in range(5)] == [1, 1, 1, 2, 2]


def observed() -> Observed:
    rows = table(4)
    return Observed(*(rows[name].to_numpy() for name in rows.columns), TIMES)


def test_colmap_databases_of_other_images_or_with_impossible_matches_are_refused(tmp_path):
    colmap(tmp_path / "colmap.db", observed())
    settings = Imported(str(tmp_path / "colmap.db"))
    assert len(positions(settings.start(context()), 0)) == 4
    with closing(sqlite3.connect(tmp_path / "colmap.db")) as database, database:
        database.execute("UPDATE two_view_geometries SET data = ?", (np.full((4, 2), 9, np.uint32).tobytes(),))
    with pytest.raises(DataError, match=r"matches of images \d+ and \d+, expected two numbers of keypoints that exist"):
        settings.start(context())
    with closing(sqlite3.connect(tmp_path / "colmap.db")) as database, database:
        database.execute("UPDATE keypoints SET rows = 1000000000")
    with pytest.raises(DataError, match=r"keypoints of 1000000000 x 6 numbers in 96 bytes"):
        settings.start(context())
    with closing(sqlite3.connect(tmp_path / "colmap.db")) as database, database:
        database.execute("DELETE FROM images WHERE name = 'frame00003.png'")
        database.execute("DELETE FROM keypoints")
        database.execute("DELETE FROM two_view_geometries")
    with pytest.raises(DataError, match=r"9 images, expected one for each of the 10 frames"):
        settings.start(context())


def test_images_of_a_colmap_database_are_in_the_order_of_the_numbers_in_their_names(tmp_path):
    """In the order of the alphabet, 10.png to 14.png would be before 5.png, and frames would be mixed up."""
    colmap(tmp_path / "colmap.db", observed())
    settings = Imported(str(tmp_path / "colmap.db"))
    expected = [positions(settings.start(context()), k) for k in range(N_FRAMES)]
    with closing(sqlite3.connect(tmp_path / "colmap.db")) as database, database:
        for k in range(N_FRAMES):
            database.execute("UPDATE images SET name = ? WHERE name = ?", (f"{k + 5}.png", f"frame{k:05}.png"))
    for k in range(N_FRAMES):
        np.testing.assert_array_equal(positions(settings.start(context()), k), expected[k])


def test_a_colmap_database_that_is_being_written_is_refused(tmp_path):
    colmap(tmp_path / "colmap.db", observed())
    settings = Imported(str(tmp_path / "colmap.db"))
    with closing(sqlite3.connect(tmp_path / "colmap.db")) as database:
        database.execute("PRAGMA journal_mode = WAL")
        database.execute("DELETE FROM two_view_geometries")
        database.commit()
        with pytest.raises(
            DataError, match=r"changes that are in colmap.db-wal alone, expected .* no program has open"
        ):
            settings.start(context())
    assert len(positions(settings.start(context()), 0)) == 4


def test_a_format_can_be_stated_for_a_file_with_another_ending(tmp_path):
    events(tmp_path / "tracks.log", observed())
    tap(tmp_path / "points.npz", observed())
    with pytest.raises(ValueError, match=r"path is .*, expected a file that ends in .csv, .* or .zstd, or a format$"):
        Imported(str(tmp_path / "tracks.log"))
    stated = Imported(str(tmp_path / "tracks.log"), format=TrackFormat.events).start(context(times=TIMES))
    native = Imported(str(tmp_path / "points.npz")).start(context())
    np.testing.assert_array_equal(positions(stated, 0), positions(native, 0))


def test_covariances_are_kept_as_quality(tmp_path):
    rows = table().with_columns(cov_uu=pl.lit(0.25), cov_uv=pl.lit(0.0), cov_vv=pl.lit(0.5), quality_age=pl.lit(3.0))
    step = start(tmp_path, rows).step(Frame(0, np.zeros(SIZE[::-1], np.uint8)))
    assert {name: values[0] for name, values in step.quality.items()} == {
        "age": 3.0,
        "cov_uu": 0.25,
        "cov_uv": 0.0,
        "cov_vv": 0.5,
    }


def test_a_column_that_counts_rows_is_not_taken_for_the_track_if_another_names_it(tmp_path):
    rows = table().with_row_index("id").rename({"track": "feature_id", "u_px": "x", "v_px": "y"})
    tracker = start(tmp_path, rows)
    assert [tracker.step(Frame(index, np.zeros(SIZE[::-1], np.uint8))).new for index in (0, 1)] == [6, 0]
    assert tracker.notes == ()
    (note,) = start(tmp_path, rows.drop("feature_id")).notes
    assert note.startswith("each imported track has one row alone")


def test_covariances_of_resized_images_are_scaled_with_the_positions(tmp_path):
    stated = {"cov_uu": 1.0, "cov_uv": 0.5, "cov_vv": 2.0, "quality_own_uu": 1.0, "quality_score": 3.0}
    rows = table().with_columns(
        (pl.col("u_px") + 0.5) / 2 - 0.5,
        (pl.col("v_px") + 0.5) / 4 - 0.5,
        **{name: pl.lit(value) for name, value in stated.items()},
    )
    step = start(tmp_path, rows, raster=(160.0, 60.0)).step(Frame(0, np.zeros(SIZE[::-1], np.uint8)))
    assert {name: values[0] for name, values in step.quality.items()} == {
        "cov_uu": 4.0,
        "cov_uv": 4.0,
        "cov_vv": 32.0,
        "own_uu": 1.0,  # one number alone is no covariance
        "score": 3.0,
    }


def test_covariances_and_positions_that_overflow_in_px_are_refused(tmp_path):
    rows = table().with_columns(cov_uu=pl.lit(3e38), cov_uv=pl.lit(0.0), cov_vv=pl.lit(3e38))
    with pytest.raises(DataError, match=r"csv:2: cov_uu 3.0.*e\+38, expected .* range of float32, in px\^2 too$"):
        start(tmp_path, rows, raster=(160.0, 120.0))
    with pytest.raises(DataError, match=r"csv:2: position \[1.7e\+308, 5.0\], expected numbers of at most 1e\+30$"):
        start(tmp_path, table().with_columns(u_px=pl.lit(1.7e308), v_px=pl.lit(5.0)), raster=(1.0, 1.0))
    with pytest.raises(DataError, match="no position inside images"):
        start(tmp_path, table(), raster=(1e-320, 1.0))


@pytest.mark.parametrize(
    "options",
    [
        {"first_frame": -(10**10)},
        {"raster": (0.0, 1.0)},
        {"time_offset_s": 1e10},
        {"max_gap_s": 0.0},
    ],
)
def test_impossible_options_are_refused_by_name(options):
    (name,) = options
    with pytest.raises(ValueError, match=rf"{name} is"):
        Imported("tracks.csv", **options)
