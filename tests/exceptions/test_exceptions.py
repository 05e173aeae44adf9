import pickle
from pathlib import Path

import pytest

from tracknoise.exceptions import DataError, TracknoiseError, UnknownNameError

ERRORS = {
    "data.txt:17: 7 fields, expected 8": DataError("data.txt:17", "7 fields", "8"),
    "folder/a.png: no such file, expected an image": DataError(Path("folder/a.png"), "no such file", "an image"),
    "unknown tracker 'lucas'; known: oracle": UnknownNameError("tracker", "lucas", ["oracle"]),
    "unknown tracker 'orcale' (did you mean 'oracle'?); known: imported, oracle": UnknownNameError(
        "tracker", "orcale", ["oracle", "imported"]
    ),
    "unknown table None; known: 5, curves": UnknownNameError("table", None, ["curves", 5]),
    "unknown scene 'a'; known: none": UnknownNameError("scene", "a", []),
}


@pytest.mark.parametrize(("message", "error"), ERRORS.items())
def test_one_line_that_survives_the_way_from_another_process(message, error):
    again = pickle.loads(pickle.dumps(error))
    assert str(error) == str(again) == message
    assert isinstance(again, TracknoiseError)
    assert vars(again) == vars(error)
