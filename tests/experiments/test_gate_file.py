"""Gates are read, and refused with one clear line."""

import os

import pytest

from tracknoise.analysis.gate import read_gate
from tracknoise.exceptions import TracknoiseError
from tracknoise.topics.catalogue import ESTIMANDS


def write(tmp_path, text):
    path = tmp_path / "gate.toml"
    path.write_text(text)
    return path


def test_a_gate(tmp_path):
    text = 'level = 0.9\nages = "mean"\ntrackers = ["lk"]\nspeeds = [1, 2]\n[tolerances]\ncore = 0.1\nbias = 1\n'
    gate = read_gate(write(tmp_path, text), ESTIMANDS)
    assert gate.tolerances == {"core": 0.1, "bias": 1.0}
    assert (gate.level, gate.ages, gate.trackers, gate.speeds) == (0.9, "mean", ("lk",), (1, 2))


def test_defaults(tmp_path):
    gate = read_gate(write(tmp_path, "[tolerances]\ncore = 0.1\n"), ESTIMANDS)
    assert (gate.level, gate.ages, gate.trackers, gate.speeds) == (0.95, "every", None, None)
    assert gate.poses is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "tolerances: found {}, expected a table"),
        ("tolerances = 3", "tolerances: found 3"),
        ("core = 0.1", "core: found outside of a table, expected it below a line .tolerances."),
        ("[tolerances]\ncore = -0.1", "tolerances.core: found -0.1, expected more than 0"),
        ("[tolerances]\ncore = true", "tolerances.core: found True"),
        ("[tolerances]\ncore = nan", "tolerances.core: found nan"),
        ("[tolerances]\ncore = inf", "tolerances.core: found inf"),
        ("[tolerances]\ncoer = 0.1", "unknown statistic in .*gate.toml 'coer' .did you mean 'core'"),
        (
            "[tolerances]\nwindow_sigma = 0.1",
            "tolerances: found the former name 'window_sigma', expected residual_sigma.* ",
        ),
        ("level = 2\n[tolerances]\ncore = 0.1", "level: found 2"),
        ('ages = "all"\n[tolerances]\ncore = 0.1', "ages: found 'all', expected one of every, mean"),
        ('poses = "best"\n[tolerances]\ncore = 0.1', "poses: found 'best', expected one of refined, stated"),
        ("poses = []\n[tolerances]\ncore = 0.1", r"poses: found \[\], expected one of"),
        ("ages = [1]\n[tolerances]\ncore = 0.1", r"ages: found \[1\]"),
        ('speeds = ["1"]\n[tolerances]\ncore = 0.1', "speeds: found .* expected a list of whole numbers"),
        ("trackers = []\n[tolerances]\ncore = 0.1", "trackers: found .* expected a list of names"),
        ("tolerance = 1\n[tolerances]\ncore = 0.1", "unknown key in .* 'tolerance'"),
        ("[tolerances", "expected TOML"),
        ("a = " + "[" * 5000, "expected TOML"),
        ("a." * 40_000 + "b = 1", "line 1: a key of 40001 parts, expected TOML with at most 16$"),
        (f"a = {'[' * 20}{']' * 20}", "lists and tables more than 16 deep, expected TOML with fewer levels$"),
        (f"level = {2**64}", "a whole number of 65 bits, expected TOML with at most 64 bits$"),
        ("#" * 1_100_000, "cannot be read .a file of 1100000 bytes., expected TOML with tolerances$"),
    ],
)
def test_mistakes(tmp_path, text, message):
    with pytest.raises(TracknoiseError, match=message):
        read_gate(write(tmp_path, text), ESTIMANDS)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(TracknoiseError, match="cannot be read"):
        read_gate(tmp_path / "none.toml", ESTIMANDS)
    with pytest.raises(TracknoiseError, match="cannot be read"):
        read_gate(tmp_path, ESTIMANDS)
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(TracknoiseError, match="expected TOML"):
        read_gate(tmp_path / "bytes.toml", ESTIMANDS)
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(TracknoiseError, match="not a regular file"):
        read_gate(tmp_path / "pipe.toml", ESTIMANDS)
