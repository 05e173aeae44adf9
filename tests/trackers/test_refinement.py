"""Positions of other front ends, refined by Lucas-Kanade: what comes nearer to the truth, and what stays."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from tracknoise.exceptions import SettingsError
from tracknoise.trackers.external import External
from tracknoise.trackers.function import Function
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.refinement import Refinement
from tracknoise.trackers.tracker_registry import make_tracker

BIRTHS = np.array([[60.0 + 30 * column, 60.0 + 30 * row] for row in range(4) for column in range(6)])
STEP = np.array([3.0, -2.0])
"""Motion of the images `sideways`, px a frame."""
ONE_PIXEL_OFF = """
from pathlib import Path
frames = Path("frames_color.txt").read_text().splitlines()
for query in Path().glob("query_*.txt"):
    x, y = map(float, query.read_text().splitlines()[1].split(","))
    lines = [f"{x + 3 * k + 1},{y - 2 * k}" for k in range(len(frames))]
    Path(query.name.replace("query", "output")).write_text("\\n".join(lines) + "\\n")
"""


def followed(tracker, frames) -> list[tuple[np.ndarray, dict]]:
    """Errors (n, 2) px and quality in each frame after the first, of tracks that begin in the first."""
    first = tracker.step(frames[0])
    start = dict(zip(first.ids.tolist(), first.uv, strict=True))
    found = []
    for frame in frames[1:]:
        step = tracker.step(frame)
        expected = np.array([start[name] for name in step.ids.tolist()]) + frame.index * STEP
        found.append((step.uv - expected, step.quality))
    return found


def imported(error: np.ndarray, frames, **options) -> Imported:
    """Tracks that are off by (tracks, 2) px in every frame but the first."""
    frame = np.repeat(np.arange(len(frames)), len(BIRTHS))
    track = np.tile(np.arange(len(BIRTHS)), len(frames))
    uv = BIRTHS[track] + frame[:, None] * STEP + np.where(frame[:, None] > 0, error[track], 0.0)
    return Imported.from_arrays(track, frame, uv[:, 0], uv[:, 1], **options)


@pytest.mark.parametrize("template", ["previous", "first"])
def test_refined_positions_are_those_of_the_patch(sideways, setting, template) -> None:
    error = np.random.default_rng(0).normal(size=BIRTHS.shape) * 0.5
    tracker = imported(error, sideways, refine=Refinement(template)).start(setting())
    for left, quality in followed(tracker, sideways):
        assert np.abs(left).max() < 0.1
        assert quality["refine_shift_px"] == pytest.approx(np.hypot(*error.T), abs=0.1)


def test_positions_stay_where_the_correction_would_be_too_large(sideways, setting) -> None:
    error = np.zeros_like(BIRTHS)
    error[3] = (2.0, 0.0)
    error[5] = (350.0, 0.0)  # not in the image
    tracker = imported(error, sideways, refine=Refinement("first", max_shift_px=1.5)).start(setting())
    for left, quality in followed(tracker, sideways):
        assert left[3] == pytest.approx([2.0, 0.0])
        assert left[5] == pytest.approx([350.0, 0.0])
        assert np.isnan(quality["refine_shift_px"]).nonzero()[0].tolist() == [3, 5]


def test_by_default_positions_are_as_reported(sideways, setting) -> None:
    error = np.full(BIRTHS.shape, 0.25)
    for left, quality in followed(imported(error, sideways).start(setting()), sideways):
        assert left == pytest.approx(error)
        assert quality == {}


def test_a_function_goes_on_from_refined_positions(sideways, setting) -> None:
    def off(previous, image, points):
        return points + STEP + [0.4, -0.3], np.ones(len(points), dtype=bool)

    few = {"min_features": 30, "max_features": 40}
    plain = followed(Function(off, **few).start(setting()), sideways[:4])
    assert plain[-1][0][0] == pytest.approx([1.2, -0.9])  # errors of steps add up
    refined = followed(Function(off, **few, refine=Refinement("first")).start(setting()), sideways[:4])
    assert np.quantile(np.abs(refined[-1][0]), 0.9) < 0.1


def test_positions_of_a_program_are_refined(sideways, setting, tmp_path) -> None:
    script = tmp_path / "program.py"
    script.write_text(ONE_PIXEL_OFF)
    settings = External((sys.executable, "-S"), script, max_features=20, every=None, refine=Refinement("first"))
    context = replace(setting(), images=lambda: (frame.image for frame in sideways))
    for left, _ in followed(settings.start(context), sideways):
        assert np.quantile(np.abs(left), 0.8) < 0.1


def test_it_is_an_option_in_experiments() -> None:
    made = make_tracker("imported", {"path": "tracks.csv", "refine": {"template": "first", "window_px": 21}})
    assert made.refine == Refinement("first", window_px=21)
    with pytest.raises(SettingsError, match="template"):
        make_tracker("imported", {"path": "tracks.csv", "refine": {"template": "last"}})
