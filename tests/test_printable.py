import json
import math
import sys
import unicodedata

import pytest

from tracknoise.text import (
    absolute_paths,
    browser_json,
    counted,
    counted_of,
    is_printable,
    printable,
    significant,
    without_folders,
)


def test_every_control_character_is_escaped_and_other_text_stays():
    for code in range(sys.maxunicode + 1):
        char = chr(code)
        if unicodedata.category(char) in {"Cc", "Cs", "Zl", "Zp"}:
            assert not is_printable(char), hex(code)
    assert printable("a\x1b[31m\n\x00\udcff\u202e\u2028") == "a\\x1b[31m\\n\\x00\\udcff\\u202e\\u2028"
    assert printable("a\tb\r\n", keep="\n\t") == "a\tb\\r\n"
    for text in ("plain", "\u00e4\u8ddf\u8e2a", "\U0001f468\u200d\U0001f469", "\u0627\u0644", "\\x1b"):
        assert is_printable(text)
        assert printable(text) == text


def test_one_thing_is_singular():
    assert [counted(n, "image") for n in (0, 1, 2)] == ["0 images", "1 image", "2 images"]
    assert counted(1, "vertex", "vertices") == "1 vertex"
    assert counted(4, "vertex", "vertices") == "4 vertices"
    assert counted_of(1, 30, "frame", "has", "have") == "1 of 30 frames has"
    assert counted_of(0, 1, "frame", "has", "have") == "0 of 1 frame have"


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (100.0, 2, "100"),
        (99.6, 2, "100"),
        (12345.6, 3, "12346"),
        (-999.9, 3, "-1000"),
        (0.01234, 2, "0.012"),
        (1.5e-9, 2, "1.5e-09"),
        (99.4, 2, "99"),
    ],
)
def test_no_number_above_one_is_written_with_a_power_of_ten(value, digits, text):
    assert significant(value, digits) == text


def test_numbers_that_are_not_finite_are_null_in_the_json_of_a_page():
    written = browser_json({"a": [math.nan, 1.5, (math.inf,)], "b": {"c": -math.inf}, "d": "NaN"})
    assert json.loads(written) == {"a": [None, 1.5, [None]], "b": {"c": None}, "d": "NaN"}
    assert written.count("NaN") == 1


def test_folders_of_a_machine_are_left_out_of_settings_and_of_what_is_said_of_its_files():
    settings = {
        "dataset": {"root": "/home/ann/data/rec", "options": {"image_topic": "/cam/image_raw", "rate": 20}},
        "trackers": [{"options": {"command": ["python", "/home/ann/data/rec/track.py"]}}, {"path": "mine.csv"}],
    }
    shown = without_folders(settings)
    assert shown["dataset"] == {"root": ".../rec", "options": {"image_topic": "/cam/image_raw", "rate": 20}}
    assert shown["trackers"] == [{"options": {"command": ["python", ".../track.py"]}}, {"path": "mine.csv"}]
    note = "/home/ann/data/rec/rgb/3.png:1: no image; topic /cam/image_raw"
    assert without_folders(note, absolute_paths(settings)) == ".../rec/rgb/3.png:1: no image; topic /cam/image_raw"
