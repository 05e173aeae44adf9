"""Animations are read by other programs as they were written."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from tracknoise.exceptions import SettingsError
from tracknoise.sequences.animations import write_animation

GREYS = (40, 120, 200)
PICTURES = [Image.new("RGB", (64, 48), (grey, grey, 255 - grey)) for grey in GREYS]


def test_a_gif_has_all_pictures_and_repeats(tmp_path: Path) -> None:
    write_animation(tmp_path / "a.gif", iter(PICTURES), frame_ms=150)
    with Image.open(tmp_path / "a.gif") as file:
        assert (file.n_frames, file.size, file.info["duration"], file.info["loop"]) == (3, (64, 48), 150, 0)


def test_an_mp4_has_all_pictures_in_their_colours(tmp_path: Path) -> None:
    write_animation(tmp_path / "a.mp4", iter(PICTURES), frame_ms=150)
    capture = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(1e3 / 150, rel=1e-3)
    frames = [capture.read()[1] for _ in GREYS]
    assert not capture.read()[0]
    for grey, frame in zip(GREYS, frames, strict=True):
        assert np.abs(frame.mean(axis=(0, 1)) - [255 - grey, grey, grey]).max() < 8
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]


def test_without_an_encoder_the_other_kind_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2.VideoWriter, "isOpened", lambda _: False, raising=False)
    with pytest.raises(SettingsError, match=r"a\.mp4: this OpenCV has no encoder for MP4, expected a name .* in \.gif"):
        write_animation(tmp_path / "a.mp4", PICTURES, frame_ms=150)
    assert list(tmp_path.iterdir()) == []
