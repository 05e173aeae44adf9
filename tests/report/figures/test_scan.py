"""Figures of a run whose truth is a scan: curves run along frames, and errors are zero in the key frame."""

import io
from collections.abc import Callable

import polars as pl
import pytest

from tracknoise.report.figures import distributions, error_curves, levels, track_ends
from tracknoise.report.figures import frames as example_frames
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.words import px

KEY_FRAME = 8


@pytest.fixture(scope="module")
def data(make_run: Callable[..., RunFolder]) -> ReportData:
    world = {"scenes": ("only",), "born": 40, "speeds": (1, 4, 8), "n_frames": 24, "truth": "scan"}
    return ReportData.of(make_run(**world, key_frame=KEY_FRAME))


@pytest.fixture(scope="module")
def trimmed(data: ReportData) -> Figure:
    figure = error_curves.curve_figures(data)[0]
    assert isinstance(figure, Figure)
    return figure


@pytest.fixture(scope="module")
def by_speed(data: ReportData) -> Figure:
    figure = levels.speed_figures(data)[0]
    assert isinstance(figure, Figure)
    return figure


def _tables(figure: Figure, column: str) -> list[pl.DataFrame]:
    texts = [data for data in figure.spec["datasets"].values() if isinstance(data, str)]
    return [table for table in (pl.read_csv(io.StringIO(text)) for text in texts) if column in table.columns]


def test_curves_quote_the_summary_at_ten_frames_after_the_key_frame(data: ReportData, trimmed: Figure) -> None:
    assert trimmed.title == "Error by frame at speed 1, trimmed"
    rows = data["summary"].filter(speed=1).to_dicts()
    assert [row["at"] for row in rows] == [KEY_FRAME + 10] * 2
    assert trimmed.look_for.startswith("At 10 frames after the key frame, ")
    for row in rows:
        assert f"{px(row['trimmed_rms_u_px'])} in u and {px(row['trimmed_rms_v_px'])} in v" in trimmed.look_for


def test_the_key_frame_is_marked_in_every_panel_and_axes_are_named_in_words(trimmed: Figure) -> None:
    assert len(trimmed.spec["concat"]) == 8
    for panel in trimmed.spec["concat"]:
        texts = [layer for layer in panel["layer"] if layer["mark"].get("text") == "key frame"]
        assert [trimmed.spec["datasets"][layer["data"]["name"]] for layer in texts] == [[{"at": KEY_FRAME}]]
        assert panel["layer"][0]["encoding"]["x"]["title"] == "frame"
    titles = [panel["layer"][0]["encoding"]["y"].get("title") for panel in trimmed.spec["concat"][::2]]
    assert titles == ["mean error (px)", "mean absolute error (px)", "RMS error (px)", "core error (px)"]


def test_curves_run_to_both_sides_of_the_key_frame(trimmed: Figure) -> None:
    frames = _tables(trimmed, "of")[0]["at"]
    assert frames.min() < KEY_FRAME < frames.max()


def test_boxes_leave_the_key_frame_out(data: ReportData, by_speed: Figure) -> None:
    boxes = [table.filter(speed=1) for table in _tables(by_speed, "lower_whisker")]
    seconds = data.points.filter(tracker="lucas-kanade", speed=1, population="visible", trimming="trimmed")
    values = seconds.filter(pl.col("at") != KEY_FRAME, role="second")["u"]
    assert any(box["mean"][0] == pytest.approx(values.mean(), rel=1e-3) for box in boxes)


def test_speeds_are_read_at_the_last_frame_up_to_ten_after_the_key_frame_that_all_have(by_speed: Figure) -> None:
    assert by_speed.look_for.startswith("At 8 frames after the key frame, the RMS for ")


def test_features_are_counted_by_frame(data: ReportData) -> None:
    (figure,) = track_ends.feature_count_figures(data)
    assert isinstance(figure, Figure)
    assert figure.title == "Features by frame"
    frames = pl.concat(data.run.sequence_tables("frames")).filter(tracker="lucas-kanade", speed=1)
    drawn = _tables(figure, "drawn")[0].filter(tracker="lucas-kanade", of="all tracks").sort("at")
    assert drawn["n"].to_list() == frames["alive"].to_list()
    kept = pl.concat(data.run.sequence_tables("observations")).filter(
        pl.col("truth") == "valid", tracker="lucas-kanade", speed=1, frame=KEY_FRAME, kept=True
    )
    alive = frames.filter(frame=KEY_FRAME)["alive"][0]
    told = f"lucas-kanade has {alive} features in the key frame 8. The curves contain {kept.height} of them."
    assert told in figure.look_for


def test_errors_before_trimming_say_how_many_tracks_have_one(data: ReportData) -> None:
    (figure,) = distributions.trimming_figures(data)
    assert isinstance(figure, Figure)
    tracks = pl.concat(data.run.sequence_tables("tracks")).filter(tracker="lucas-kanade", speed=1)
    measured = tracks["max_error_px"].count()
    assert f"lucas-kanade has {tracks.height} tracks. " in figure.look_for
    assert f" {measured} of them are alive in the key frame and have a known error." in figure.look_for


def test_the_key_frame_itself_is_no_example_frame(make_run: Callable[..., RunFolder]) -> None:
    small = {"scenes": ("only",), "trackers": ("one",), "speeds": (1,), "n_frames": 16, "truth": "scan"}
    (item,) = example_frames.example_frame_figures(ReportData.of(make_run(**small, key_frame=8)))
    assert isinstance(item, Absence)
    assert item.why == "The image is of frame 8, the key frame, where errors are zero by construction."
