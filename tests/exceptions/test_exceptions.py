import pickle
from pathlib import Path

import pytest

from tracknoise.exceptions import DataError, TracknoiseError, UnknownNameError, did_you_mean

ERRORS = {
    "data.txt:17: 7 fields, expected 8": DataError("data.txt:17", "7 fields", "8"),
    "folder/a.png: no such file, expected an image": DataError(Path("folder/a.png"), "no such file", "an image"),
    "unknown tracker 'lucas'; known: oracle": UnknownNameError("tracker", "lucas", ["oracle"]),
    "unknown tracker 'lucas' (did you mean 'lucas-kanade'?); known: lucas-kanade": UnknownNameError(
        "tracker", "lucas", ["lucas-kanade"], {}
    ),
    "unknown tracker 'KLT' (did you mean 'lucas-kanade'?); known: lucas-kanade": UnknownNameError(
        "tracker", "KLT", ["lucas-kanade"], {"klt": "lucas-kanade"}
    ),
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


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("lk", "lucas-kanade"),  # initials
        ("LK", "lucas-kanade"),
        ("kanade", "lucas-kanade"),  # a word
        ("orbslam", "orb-slam3"),  # without the sign
        ("kittiodo", "kitti-odometry"),  # the beginning, although `kitti` is spelt more alike
        ("tum-rgbd", "tum"),  # more than the name
        ("lucas-kande", "lucas-kanade"),
        ("x", None),
        ("-", None),
        ("", None),
        ("superpoint", None),
    ],
)
def test_what_people_write_for_a_name_is_understood(name, meant):
    known = ["kitti", "kitti-odometry", "lucas-kanade", "orb-slam3", "tum", "vins-mono"]
    assert did_you_mean(name, known, {}) == (f" (did you mean {meant!r}?)" if meant else "")
