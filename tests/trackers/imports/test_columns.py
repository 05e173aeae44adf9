"""Columns beside positions are used, refused or named: what was seen, by which camera, and when."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.writers.bags import BagWriter, Format

from tracknoise.exceptions import DataError
from tracknoise.tables.identity import SequenceId
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.tracker import Frame, SequenceContext

SIZE, N_FRAMES, N_TRACKS = (320, 240), 12, 8
TIMES = 1_700_000_000.0 + 0.05 * np.arange(N_FRAMES)
NAMES = tuple(f"{1000 + index}.png" for index in range(N_FRAMES))


def context(**more) -> SequenceContext:
    known = {"timestamps_s": TIMES, "image_names": NAMES} | more
    return SequenceContext(SequenceId("d", "s"), SIZE, N_FRAMES, 1, 0, None, **known)


def table() -> pl.DataFrame:
    """Tracks that are lost in some frames, where their last position is repeated."""
    rng = np.random.default_rng(1)
    track, frame = (a.ravel() for a in np.meshgrid(np.arange(N_TRACKS), np.arange(N_FRAMES), indexing="ij"))
    u, v = rng.uniform(20, 60, len(track)) + 25 * track, rng.uniform(20, 200, len(track))
    seen = (track + frame) % 5 != 4
    return pl.DataFrame({"track": track, "frame": frame, "u": u, "v": v, "seen": seen})


def written(path, rows: pl.DataFrame, **options) -> Imported:
    if path.suffix == ".parquet":
        rows.write_parquet(path)
    else:
        separator = {".tsv": "\t", ".txt": " "}.get(path.suffix, ",")
        header = "# " if path.suffix == ".txt" else ""
        path.write_text(header + rows.write_csv(separator=separator))
    return Imported(str(path), **options)


def found(settings: Imported, where: SequenceContext | None = None) -> list[list]:
    """Positions in each frame, sorted."""
    tracker = settings.start(where or context())
    steps = [tracker.step(Frame(index, np.zeros(SIZE[::-1], np.uint8))) for index in range(N_FRAMES)]
    return [sorted(step.uv.tolist()) for step in steps]


def expected(rows: pl.DataFrame) -> list[list]:
    return [sorted(map(list, rows.filter(frame=index).select("u", "v").rows())) for index in range(N_FRAMES)]


SEEN = table().filter("seen").drop("seen")


def stated(name: str, kind: str) -> pl.DataFrame:
    """The table with a column of what was seen, of this name."""
    said = {
        "0 and 1": pl.col("seen").cast(pl.Int64),
        "1.0": pl.col("seen").cast(pl.Float64),
        "bool": pl.col("seen"),
        "not": (~pl.col("seen")).cast(pl.Int64),
        "words": pl.when("seen").then(pl.lit("Tracked")).otherwise(pl.lit("LOST")),
    }[kind]
    return table().with_columns(said.alias(name)).drop("seen" if name != "seen" else [])


@pytest.mark.parametrize("suffix", [".csv", ".tsv", ".parquet", ".txt"])
@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("visible", "0 and 1"),
        ("vis", "1.0"),
        ("is_visible", "bool"),
        ("isVisible", "0 and 1"),
        ("valid", "bool"),
        ("occluded", "not"),
        ("lost", "not"),
        ("is_outlier", "not"),
        ("status", "0 and 1"),
        ("Status", "words"),
        ("visibility", "words"),
    ],
)
def test_rows_of_features_that_were_not_seen_are_no_observations(name, kind, suffix, tmp_path):
    settings = written(tmp_path / f"tracks{suffix}", stated(name, kind))
    assert found(settings) == expected(SEEN)
    hidden = table().height - SEEN.height
    notes = settings.start(context()).notes
    assert notes == (
        f"{hidden} of {table().height} imported rows say that the feature was not seen (column {name}), and are no "
        "observations",
    )


@pytest.mark.parametrize("name", ["visible", "is_visible", "occluded", "lost", "status"])
def test_archives_of_points_have_them_under_the_same_names(name, tmp_path):
    seen = np.reshape(table()["seen"].to_numpy(), (N_TRACKS, N_FRAMES))
    tracks = np.reshape(table().select("u", "v").to_numpy(), (N_TRACKS, N_FRAMES, 2))
    np.savez(tmp_path / "points.npz", tracks=tracks, **{name: ~seen if name in ("occluded", "lost") else seen})
    assert found(Imported(str(tmp_path / "points.npz"))) == expected(SEEN)


SCORE = pl.when("seen").then(0.6 + 0.01 * pl.col("track")).otherwise(0.3 - 0.01 * pl.col("track"))


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".txt", ".npz"])
@pytest.mark.parametrize("name", ["confidence", "score", "prob", "visible"])
def test_a_score_needs_a_limit_which_is_an_option(name, suffix, tmp_path):
    rows, path = table().with_columns(SCORE.alias(name)).drop("seen"), tmp_path / f"tracks{suffix}"
    if suffix == ".npz":
        shape = (N_TRACKS, N_FRAMES)
        tracks = np.reshape(rows.select("u", "v").to_numpy(), (*shape, 2))
        np.savez(path, tracks=tracks, **{name: np.reshape(rows[name].to_numpy(), shape)})
    else:
        written(path, rows)
    with pytest.raises(
        DataError, match=rf"column {name}, by which scores are from 0.23 to 0.67, .* the option visible_above = "
    ):
        found(Imported(str(path)))
    assert found(Imported(str(path), visible_above=0.5)) == expected(SEEN)
    assert found(Imported(str(path), visible_above=-1)) == expected(table())


def test_a_probability_of_occlusion_is_one_minus_that_of_being_seen(tmp_path):
    rows = table().with_columns(occluded=1.0 - SCORE).drop("seen")
    assert found(written(tmp_path / "tracks.csv", rows, visible_above=0.5)) == expected(SEEN)


@pytest.mark.parametrize(
    ("columns", "options", "message"),
    [
        ({"visible": pl.lit("maybe")}, {}, r"tracks.csv:2: visible 'maybe', expected 0 or 1, true or false"),
        ({"status": pl.lit(0)}, {}, "status is 0 in 100% of the rows, expected 1 where a feature was found; name the"),
        ({"score": pl.lit("high")}, {"visible_above": 0.5}, r"tracks.csv:2: score 'high', expected a number"),
        ({}, {"visible_above": 0.5}, "visible_above = 0.5 and no score, expected one column of a score"),
        ({"visible": pl.lit(0)}, {}, "no row with a feature that was seen"),
        (
            {"state": pl.col("track") % 3},
            {},
            "column state, by which scores are from 0 to 2, expected the option visible_above",
        ),
        ({"occluded": pl.col("u") - 50}, {}, "column occluded from -.*, expected 0 or 1, or probabilities"),
        ({}, {"camera": 0}, "camera = 0 and no column of the camera"),
    ],
)
def test_what_is_not_understood_is_refused(columns, options, message, tmp_path):
    rows = table().with_columns(**columns).drop("seen")
    with pytest.raises(DataError, match=message):
        found(written(tmp_path / "tracks.csv", rows, **options))


def of_two_cameras(name: str, values: tuple) -> pl.DataFrame:
    """The second camera sees the same tracks elsewhere."""
    other = SEEN.with_columns(pl.col("u", "v") + 3.0)
    cameras = [rows.with_columns(pl.lit(value).alias(name)) for rows, value in zip((SEEN, other), values, strict=True)]
    return pl.concat(cameras)


@pytest.mark.parametrize("suffix", [".csv", ".tsv", ".parquet", ".txt"])
@pytest.mark.parametrize(
    ("name", "values"),
    [("camera", (0, 1)), ("cam", (0.0, 1.0)), ("cam_id", (2, 3)), ("camera_id", ("cam0", "cam1"))],
)
def test_observations_of_several_cameras_are_refused_until_one_is_chosen(name, values, suffix, tmp_path):
    path = tmp_path / f"tracks{suffix}"
    settings = written(path, of_two_cameras(name, values))
    first = int(values[0]) if not isinstance(values[0], str) else values[0]
    with pytest.raises(DataError, match=rf"several cameras: {name} is {first}, .*option camera = \"?{first}"):
        found(settings)
    assert found(replace(settings, camera=first)) == expected(SEEN)
    with pytest.raises(DataError, match=rf"no row of camera 7: {name} is {first}"):
        found(replace(settings, camera=7))
    one = written(path, SEEN.with_columns(pl.lit(values[1]).alias(name)))
    assert found(one) == expected(SEEN)
    assert one.start(context()).notes == ()


def test_columns_that_are_not_used_are_named_once(tmp_path):
    rows = SEEN.with_columns(age=0, depth_m=1.5, **{"": 7})
    notes = written(tmp_path / "tracks.csv", rows).start(context()).notes
    assert notes == ("columns age, depth_m of tracks.csv are not used",)
    many = SEEN.with_columns(**{f"d{index}": 0 for index in range(128)})
    (note,) = written(tmp_path / "many.parquet", many).start(context()).notes
    assert note == "columns d0, d1, d2, d3, d4, d5 and 122 more of many.parquet are not used"


FACTORS = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".txt"])
@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("timestamp_ns", "ns"),
        ("time_ns", "ns"),
        ("#timestamp [ns]", "ns"),
        ("t_us", "us"),
        ("timestamp_ms", "ms"),
        ("t", "s"),
        ("t", "ns"),
        ("time_s", "s"),
        ("stamp", "s"),
    ],
)
def test_times_are_understood_under_many_names(name, unit, suffix, tmp_path):
    if suffix == ".txt":
        name = name.replace(" ", "_")
    ticks = (1_700_000_000_000 + 50 * pl.col("frame")) * (FACTORS[unit] // 1_000 or 1)
    rows = SEEN.with_columns((ticks / 1_000 if unit == "s" else ticks).alias(name)).drop("frame")
    settings = written(tmp_path / f"tracks{suffix}", rows)
    assert found(settings) == expected(SEEN)
    assert settings.start(context()).notes == ()


def test_the_unit_of_times_without_a_name_is_an_option(tmp_path):
    lines = [f"{t} {1e6 * TIMES[k]:.0f} {u!r} {v!r}" for t, k, u, v in SEEN.rows()]
    (tmp_path / "tracks.txt").write_text("\n".join(lines))
    with pytest.raises(DataError, match='these look like microseconds: set time_unit = "us"'):
        found(Imported(str(tmp_path / "tracks.txt")))
    assert found(Imported(str(tmp_path / "tracks.txt"), time_unit="us")) == expected(SEEN)


@pytest.mark.parametrize(
    "name",
    [
        lambda k: NAMES[k],
        lambda k: f"cam0/data/{NAMES[k]}",
        lambda k: NAMES[k].removesuffix(".png") + ".jpg",
        lambda k: f"frame_{1000 + k}.png",
    ],
)
@pytest.mark.parametrize("column", ["frame", "image", "filename", "image_name"])
def test_image_names_show_the_frame(name, column, tmp_path):
    named = pl.Series(column, [name(k) for k in SEEN["frame"]])
    rows = SEEN.drop("frame").with_columns(named)
    assert found(written(tmp_path / "tracks.csv", rows)) == expected(SEEN)


@pytest.mark.parametrize("name", [lambda k: NAMES[k].removesuffix(".png"), lambda k: f"frame_{1000 + k}"])
def test_image_names_without_an_ending_show_the_frame_where_nothing_else_does(name, tmp_path):
    rows = SEEN.drop("frame").with_columns(pl.Series("image", [name(k) for k in SEEN["frame"]]))
    assert found(written(tmp_path / "tracks.csv", rows)) == expected(SEEN)
    some = rows.with_columns(image=pl.when(pl.int_range(pl.len()) > 0).then("image"))
    with pytest.raises(DataError, match="rows without a frame, time or image, expected one of them in each row"):
        found(written(tmp_path / "some.csv", some))


def test_names_of_images_that_are_numbers_or_times_do_where_no_files_are_known(tmp_path):
    for of in (lambda k: f"{k:06d}.png", lambda k: f"{1e9 * TIMES[k]:.0f}.png", lambda k: f"{TIMES[k]:.6f}.png"):
        rows = SEEN.drop("frame").with_columns(pl.Series("image", [of(k) for k in SEEN["frame"]]))
        assert found(written(tmp_path / "tracks.csv", rows), context(image_names=None)) == expected(SEEN)
    rows = SEEN.drop("frame").with_columns(image=pl.lit("left.png"))
    with pytest.raises(
        DataError, match=r"csv:2: image 'left.png', expected an image of the sequence, such as 1000.png"
    ):
        found(written(tmp_path / "tracks.csv", rows))


@pytest.mark.parametrize("unit", FACTORS)
def test_a_frame_and_a_time_that_contradict_are_refused_until_one_is_chosen(unit, tmp_path):
    """The tracker counted from its own first frame, which was the fourth of the recording, and dropped one more."""
    late = SEEN.filter(pl.col("frame") >= 3, pl.col("frame") != 8)
    own = pl.col("frame") - 3 - (pl.col("frame") > 7).cast(pl.Int64)
    ticks = (1_700_000_000_000 + 50 * pl.col("frame")) * max(FACTORS[unit] // 1_000, 1)
    rows = late.with_columns(frame=own, timestamp=ticks / 1_000 if unit == "s" else ticks)
    settings = written(tmp_path / "tracks.csv", rows)
    found_there = r"csv:2: frame 0 and timestamp .*, which is that of frame 3: they differ by 3 to 4 frames in 100%"
    with pytest.raises(DataError, match=rf'{found_there} .* frames_by = "frame" or "time" chooses one'):
        found(settings)
    if unit == "s":
        assert found(replace(settings, frames_by="time")) == expected(late)
    by_frame = expected(late.with_columns(frame=own))
    assert found(replace(settings, frames_by="frame")) == by_frame


def test_a_frame_and_an_image_that_contradict_are_refused(tmp_path):
    image = pl.Series("image", [NAMES[k] for k in SEEN["frame"]])
    rows = SEEN.with_columns(image).with_columns(pl.col("frame") // 2)
    with pytest.raises(
        DataError, match=r'frame 0 and image 1001.png, which is that of frame 1.* frames_by = "frame" or'
    ):
        found(written(tmp_path / "tracks.csv", rows))
    assert found(written(tmp_path / "tracks.csv", rows, frames_by="image")) == expected(SEEN)


def test_a_frame_and_a_time_that_agree_are_fine_and_another_clock_is_noted(tmp_path):
    rows = SEEN.with_columns(timestamp=TIMES[0] + 0.05 * pl.col("frame") + 0.004)
    settings = written(tmp_path / "tracks.csv", rows)
    assert found(settings) == expected(SEEN)
    assert settings.start(context()).notes == ()
    other = written(tmp_path / "other.csv", SEEN.with_columns(timestamp=5.0 + 0.1 * pl.col("frame")))
    assert found(other) == expected(SEEN)
    assert other.start(context()).notes == ("column timestamp of other.csv fits to no frame, and is not used",)


@pytest.mark.parametrize("name", ["tracks.csv", "tracks.txt"])
@pytest.mark.parametrize("count", [4, 5, 6])
def test_a_table_without_a_header_is_named_as_such(name, count, tmp_path):
    more = {"score": 0.9, "age": 3}
    rows = SEEN.select("frame", "track", "u", "v").with_columns(**dict([*more.items()][: count - 4]))
    rows.write_csv(tmp_path / name, include_header=False)
    with pytest.raises(DataError, match=r"no header line|4 columns|1 column"):
        found(Imported(str(tmp_path / name)))


def test_tracks_of_opensfm_are_named_with_what_makes_them_pixels(tmp_path):
    """In versions 1 and 2; the first had no line for it."""
    width, height = SIZE
    x, y = ((pl.col(name) + 0.5 - half) / width for name, half in (("u", width / 2), ("v", height / 2)))
    names = pl.Series("image", [NAMES[k] for k in SEEN["frame"]])
    rows = SEEN.select(names, "track", feature=1, x=x, y=y, scale=0.01, r=0, g=0, b=0)
    body = rows.write_csv(include_header=False, separator="\t")
    path = tmp_path / "tracks.csv"
    path.write_text(f"OPENSFM_TRACKS_VERSION_v2\n{body}")
    advice = "expected a table with the columns image, track, u_px = x max"
    with pytest.raises(DataError, match=f"tracks.csv: tracks of OpenSfM, .*{advice}"):
        found(Imported(str(path)))
    path.write_text(body)
    with pytest.raises(DataError, match=r"tracks.csv:1: no header line"):
        found(Imported(str(path)))
    u, v = (pl.col(name) * width + half - 0.5 for name, half in (("x", width / 2), ("y", height / 2)))
    corrected = rows.select("image", "track", u_px=u, v_px=v)
    np.testing.assert_allclose(found(written(path, corrected))[1], expected(SEEN)[1])


def test_numbers_of_frames_in_a_dump_of_xivo_are_no_nanoseconds(tmp_path):
    rows = SEEN.select("frame", "track", "u", "v").with_columns(**{f"d{index}": index for index in range(32)})
    rows.write_csv(tmp_path / "tracks.csv", include_header=False)
    with pytest.raises(DataError, match=r"no header line, and times 0, 1, 2, ... ns, expected track, frame, u_px"):
        found(Imported(str(tmp_path / "tracks.csv")))


@pytest.mark.parametrize(("name", "separator"), [("tracks.csv", ","), ("tracks.txt", " ")])
def test_columns_without_a_name_are_noted_and_refused_where_they_are_0_and_1(name, separator, tmp_path):
    """A dump of XIVO and a text of events."""
    seen = table().with_columns(
        pl.col("seen").cast(pl.Int64), ns=1_700_000_000_000_000_000 + 50_000_000 * pl.col("frame")
    )
    seen = seen.with_columns(s=pl.col("ns") / 1e9)
    columns = ("ns", "track", "u", "v") if separator == "," else ("track", "s", "u", "v")
    path = tmp_path / name
    seen.select(*columns, "seen").write_csv(path, include_header=False, separator=separator)
    with pytest.raises(DataError, match=r"column 5 without a name, of 0 and 1, expected a first line that names all"):
        found(Imported(str(path)))
    header = {"ns": "timestamp_ns", "s": "t"}
    names = [header.get(column, column) for column in (*columns, "visible")]
    path.write_text("# " + separator.join(names) + "\n" + path.read_text())
    if separator == ",":
        assert found(Imported(str(path))) == expected(SEEN)
    seen.filter(seen=1).select(*columns, d=pl.lit(0.5)).write_csv(path, include_header=False, separator=separator)
    assert Imported(str(path)).start(context()).notes == (f"column number 5 of {name} is not used",)


def test_events_are_not_interpolated_over_an_update_in_which_the_feature_was_lost(tmp_path):
    lines = ["# id t x y visible", "1 0.00 10 20 1", "1 0.04 11 20 1", "1 0.045 50 20 0", "1 0.06 13 20 1"]
    (tmp_path / "tracks.txt").write_text("\n".join(lines))
    assert found(Imported(str(tmp_path / "tracks.txt")), context(timestamps_s=TIMES - TIMES[0]))[:2] == [[[10, 20]], []]


NS = 1_700_000_000_000_000_000


def bag(path, message) -> Imported:
    with BagWriter(path / "run", Format.ros1) as to:
        for frame in range(N_FRAMES):
            to.write("/tracks", message(to, frame), NS + 50_000_000 * frame)
    return Imported(str(to.path))


def cloud(to: BagWriter, frame: int, channels: dict[str, np.ndarray]):
    made = [
        to.make("sensor_msgs/msg/ChannelFloat32", name=name, values=np.float32(one)) for name, one in channels.items()
    ]
    points = [to.make("geometry_msgs/msg/Point32", x=0.1, y=0.2, z=1.0) for _ in next(iter(channels.values()))]
    header = to.header(NS + 50_000_000 * frame, "world")
    return to.make("sensor_msgs/msg/PointCloud", header=header, points=points, channels=made)


def rounded(positions: list[list]) -> list[list]:
    return [np.round(one, 3).tolist() for one in positions]


def test_channels_with_names_say_what_was_seen_and_by_which_camera(tmp_path):
    def message(to: BagWriter, frame: int):
        rows = table().filter(frame=frame)
        columns = {"v": rows["v"], "u": rows["u"], "id": rows["track"], "lost": ~rows["seen"], "age": rows["frame"]}
        both = {name: np.concatenate([column, column]) for name, column in columns.items()}
        both["u"][len(rows) :] += 2.0
        return cloud(to, frame, both | {"camera": np.repeat([0, 1], len(rows))})

    settings = bag(tmp_path, message)
    with pytest.raises(DataError, match=r"several cameras: camera is 0, 1, .* camera = 0"):
        found(settings)
    assert rounded(found(replace(settings, camera=0))) == rounded(expected(SEEN))
    notes = " ".join(replace(settings, camera=0).start(context()).notes)
    assert "say that the feature was not seen (column lost)" in notes
    assert "column age of run.bag is not used" in notes


def test_of_a_cloud_with_cameras_the_first_is_read_with_a_note_or_the_one_that_is_chosen(tmp_path):
    other = SEEN.with_columns(pl.col("u", "v") + 2.0)

    def message(to: BagWriter, frame: int):
        parts = [rows.filter(frame=frame) for rows in (SEEN, other)]
        rows, camera = pl.concat(parts), np.repeat([0, 1], [part.height for part in parts])
        zero = np.zeros(rows.height)
        with_names = dict(zip("abcdef", (rows["track"], camera, rows["u"], rows["v"], zero, zero), strict=True))
        return cloud(to, frame, with_names)

    settings = bag(tmp_path, message)
    assert rounded(found(settings)) == rounded(expected(SEEN))
    assert settings.start(context()).notes == ("features of camera 0 are read: camera = ... chooses another",)
    assert rounded(found(replace(settings, camera=1))) == rounded(expected(other))
    assert replace(settings, camera=1).start(context()).notes == ()
    with pytest.raises(DataError, match="no feature of camera 5"):
        found(replace(settings, camera=5))
