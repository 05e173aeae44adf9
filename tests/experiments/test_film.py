"""The film of a sequence holds its first frames, small, in one piece and in parts."""

import cv2
import numpy as np
import pytest

from tracknoise.experiments import pictures as module
from tracknoise.experiments.measure import measure
from tracknoise.experiments.pictures import film
from tracknoise.sequences.reader_registry import make_reader
from tracknoise.statistics.joining import Part, join
from tracknoise.tables.schema import FILM, check

SIMULATED = {"motions": ["arvr"], "frames": 4, "width": 160, "height": 120, "supersampling": 1}
NOISE = 6.0
"""Mean difference of grey values between an image and its JPEG image."""


@pytest.fixture(scope="module")
def measured():
    reader = make_reader("simulated", None, SIMULATED)
    return measure(reader.open(reader.sequences()[0]), {"lk": "lucas-kanade"}, speeds=(1,))


def image_of(encoded):
    return cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_GRAYSCALE)


def test_it_holds_the_frames_in_order(measured):
    table = film(measured)
    check(table, FILM, "film")
    assert table["frame"].to_list() == [0, 1, 2, 3]
    for frame, encoded in table.iter_rows():
        difference = image_of(encoded).astype(float) - measured.sequence.image(frame)
        assert np.abs(difference).mean() < NOISE


def test_wide_images_are_made_small(measured, monkeypatch):
    monkeypatch.setattr(module, "_WIDEST_PX", 80)
    assert {image_of(encoded).shape for encoded in film(measured)["image"]} == {(60, 80)}


def test_it_has_a_limited_size(measured, monkeypatch):
    whole = film(measured)
    sizes = [len(encoded) for encoded in whole["image"]]
    monkeypatch.setattr(module, "_MOST_BYTES", sum(sizes[:2]))
    assert film(measured).equals(whole.head(2))
    monkeypatch.setattr(module, "_MOST_FRAMES", 1)
    assert film(measured).equals(whole.head(1))


def test_of_a_sequence_in_parts_it_is_that_of_the_first(measured):
    table = film(measured)
    assert join("film", [(Part(0, 2, 0, {}), table)], FILM).equals(table)
