"""The film of a run as pictures: what is drawn where, and of which trackers and frames."""

import base64
import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from PIL import Image, ImageColor
from tests.report.runs import filmed

from tracknoise.exceptions import StoreError
from tracknoise.report import animation as module
from tracknoise.report.animation import MOST_TRACKERS, animation
from tracknoise.report.filmed_scene import _first_visible
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder

WIDTH, HEIGHT = 160, 121


@pytest.fixture
def one_track(monkeypatch: pytest.MonkeyPatch, own_run: RunFolder) -> Callable[..., Any]:
    """Makes the animation of one track with errors along u, by frame; it moves one pixel per frame along v."""

    def make(errors_px: list[float | None]) -> Any:
        buffer = io.BytesIO()
        Image.new("L", (WIDTH, HEIGHT), 90).save(buffer, "png")
        image, n = base64.b64encode(buffer.getvalue()).decode(), len(errors_px)
        track = {"frame": 0, "u": [79.5] * n, "v": [60.0 + v for v in range(n)], "du": errors_px}
        track["dv"] = [None if error is None else 0.0 for error in errors_px]
        film = {
            "scene": "one",
            "width": WIDTH,
            "height": HEIGHT,
            "frames": [image] * n,
            "start": n // 2,
            "magnified": 2,
        }
        monkeypatch.setattr(module, "filmed_scene", lambda _: {**film, "trackers": {"one": [track]}})
        return animation(ReportData.of(own_run))

    return make


def test_a_cross_is_observed_and_a_circle_is_true(one_track: Callable[..., Any], own_run: RunFolder) -> None:
    *_, last = one_track([0.0, 0.1, 1.0, 1.0]).pictures()
    pixels = np.asarray(last).astype(int)
    scale = last.width / WIDTH
    x, y = round(80.0 * scale), round(63.5 * scale) + 30  # below the name
    assert pixels[y, x].min() > 200
    colour = np.array(ImageColor.getrgb(ReportData.of(own_run).colour["one"]))
    alike = np.argwhere(np.abs(pixels[30:-28] - colour).max(axis=2) < 40)
    ring = alike[alike[:, 1] < alike[:, 1].min() + 9]
    tip = x - 2 * scale
    assert alike[:, 1].max() < x
    assert ring.mean(axis=0) == pytest.approx([63.5 * scale, tip], abs=1.5)


@pytest.mark.parametrize(
    ("errors_px", "first"),
    [
        ([0.0, 0.1, 1.0, 1.0], 2),
        ([0.0, 0.0, 0.1, 1.0], 2),  # half of the frames remain
        ([0.0, None, None, None], 0),
        ([None], 0),
    ],
)
def test_pictures_begin_where_errors_are_visible(errors_px: list[float | None], first: int) -> None:
    frames = pl.DataFrame(
        {"frame": range(len(errors_px)), "size": errors_px}, schema={"frame": pl.Int64, "size": pl.Float64}
    )
    assert _first_visible(frames.drop_nulls(), len(errors_px)) == first


def test_all_pictures_have_one_even_size_and_a_panel_for_each_of_three_trackers(
    make_run: Callable[..., RunFolder], tmp_path: Path
) -> None:
    names = ("a", "b", "c", "d")
    run = make_run(scenes=("one",), trackers=names, speeds=(1,), n_frames=6, born=4)
    shown = animation(ReportData.of(filmed(run, tmp_path / "run")))
    assert (shown.trackers, shown.n_trackers) == (names[:MOST_TRACKERS], 4)
    pictures = list(shown.pictures())
    assert len(pictures) == 6 - shown.first_frame >= 3
    (size,) = {picture.size for picture in pictures}
    assert all(side % 2 == 0 for side in size)
    assert size[0] > MOST_TRACKERS * 480


def test_a_damaged_image_is_named(one_track: Callable[..., Any]) -> None:
    damaged = replace(one_track([0.0, 1.0]), _images=[b"no image"] * 2)
    with pytest.raises(StoreError, match="scene one, frame 1: its image is damaged, expected a new run"):
        list(damaged.pictures())


def test_a_run_without_frames_says_what_to_set(own_run: RunFolder) -> None:
    data = ReportData.of(own_run)
    with pytest.raises(StoreError, match="no frames are kept, expected a new run with one lighting and one rotation"):
        animation(data)
    with pytest.raises(StoreError, match='no frames are kept, expected keep = "observations" in the experiment file'):
        animation(replace(data, settings={**data.settings, "keep": "statistics"}))
