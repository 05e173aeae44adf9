"""What cannot be written in the ASL layout is refused before anything is written."""

import pytest

from tracknoise.exceptions import DataError
from tracknoise.sequences.euroc_writer import write_euroc
from tracknoise.sequences.reader_registry import make_reader

_TIMED = {"imaging": {"rate_hz": 20.0}}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "no times, expected at least 2 frames with times"),
        ({**_TIMED, "frames": 1}, "1 frame, expected at least 2 frames with times"),
        (
            {**_TIMED, "lens": "radtan", "distortion": [0.1, 0.0, 0.0, 0.0, 0.0]},
            "a camera with distortion, expected one without",
        ),
        ({**_TIMED, "lens": "equidistant", "distortion": [0.0] * 4}, "expected a pinhole camera"),
    ],
)
def test_what_the_layout_cannot_hold_is_refused(tmp_path, options, message):
    reader = make_reader("simulated", None, {"motions": ["arvr"], "frames": 2, "width": 64, "height": 48, **options})
    with pytest.raises(DataError, match=message):
        write_euroc(reader.open(reader.sequences()[0]), tmp_path / "out")
    assert not (tmp_path / "out").exists()
