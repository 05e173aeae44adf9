"""The camera that a noise model states is that of all recordings it was fitted to, or of none."""

from dataclasses import replace

import polars as pl
import pytest
from tests.estimators.exports.models import lucas_kanade

from tracknoise.estimators.export_render import export
from tracknoise.estimators.exports import FocalChange, Target
from tracknoise.estimators.training import recorded_camera
from tracknoise.exceptions import SettingsError
from tracknoise.report.noise_cells import model_sentences


def recording(
    *, focal: float | None = 460.0, taller: float = 1.0, rate: float | None = 20.0, width: int = 640
) -> pl.DataFrame:
    times = [None] * 3 if rate is None else [frame / rate for frame in range(3)]
    kinds = {"time_s": pl.Float64, "width": pl.Int32, "height": pl.Int32, "fx_px": pl.Float64, "fy_px": pl.Float64}
    in_v = None if focal is None else taller * focal
    row = {"width": width, "height": 480, "fx_px": focal, "fy_px": in_v}
    return pl.DataFrame([{"time_s": time, **row} for time in times], kinds)


def test_recordings_of_one_camera_give_its_numbers() -> None:
    found = recorded_camera({"a": recording(), "b": recording(focal=461.0, rate=20.1)})
    assert (found.width, found.height, found.focal_px) == (640, 480, 460.0)
    assert found.rate_hz == pytest.approx(20.0)
    assert found.notes == ()
    untimed = recorded_camera({"a": recording(rate=None), "b": recording(rate=None)})
    assert (untimed.rate_hz, untimed.notes) == (None, ())


def test_one_focal_length_stands_for_those_in_u_and_v() -> None:
    assert recorded_camera({"a": recording(taller=1.21)}).focal_px == pytest.approx(506.0)


def test_what_recordings_do_not_have_in_common_is_not_stated_but_noted() -> None:
    found = recorded_camera({"a": recording(), "b": recording(focal=700.0, rate=10.0, width=752)})
    assert (found.focal_px, found.rate_hz) == (None, None)
    assert found.notes == (
        "It was fitted to recordings with different focal lengths, 460 to 700 px: it has none of its own.",
        "It was fitted to recordings with different rates, 10 to 20 Hz: it has none of its own.",
        "It was fitted to images of different sizes: 640 x 480, 752 x 480 px.",
    )
    some = recorded_camera({"a": recording(focal=None), "b": recording(rate=None)})
    assert (some.focal_px, some.rate_hz) == (None, None)
    assert "460 px, and unknown ones" in some.notes[0]


def test_no_model_is_fitted_where_no_lens_is_known() -> None:
    with pytest.raises(SettingsError, match="found no focal length of a"):
        recorded_camera({"a": recording(focal=None)})


def test_exports_ask_for_a_focal_length_that_the_recordings_do_not_have_in_common_and_repeat_the_note() -> None:
    mixed = replace(lucas_kanade(), camera=recorded_camera({"a": recording(), "b": recording(focal=700.0)}))
    (note,) = mixed.camera.notes
    assert note in model_sentences(mixed, "filter")
    with pytest.raises(SettingsError, match="does not know that of its recordings"):
        export(mixed, "openvins", target=Target(focal_px=460.0))
    used = export(mixed, "openvins", target=Target(focal_px=460.0, focal_change=FocalChange.LENS))
    assert note in used.caveats
    assert note in used.text
