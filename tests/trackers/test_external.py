"""Programs of one's own as trackers: what they are given, what they may write, and how they can fail."""

import sys
import textwrap
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import tracknoise as tn
from tracknoise.exceptions import SettingsError, TrackerError
from tracknoise.trackers.external import External
from tracknoise.trackers.tracker_registry import make_tracker

FOLLOW_POINTS = Path(__file__).parents[1] / "foreign" / "follow_points.py"
BEGIN = """
import os, shutil, sys, time
from pathlib import Path
paths = Path("frames_color.txt").read_text().splitlines()
queries = {path.stem[6:]: path.read_text().splitlines() for path in Path().glob("query_*.txt")}
def write(lines, names=queries):
    for name in names:
        Path(f"output_{name}.txt").write_text("".join(line + "\\n" for line in lines))
"""


@pytest.fixture
def program(tmp_path):
    """Settings of a program: what it does after it has read its queries."""

    def make(does: str, **options) -> External:
        script = tmp_path / "program.py"
        script.write_text(BEGIN + textwrap.dedent(does))
        return External((sys.executable, "-S"), script, **{"max_features": 20, **options})

    return make


@pytest.fixture
def started(sideways, setting):
    """Start settings on the frames, at a speed."""

    def start(settings: External, speed: int = 1):
        shown = sideways[::speed]
        context = replace(setting(speed=speed), images=lambda: (frame.image for frame in shown))
        return settings.start(context), shown

    return start


@pytest.mark.parametrize("speed", [1, 2])
def test_points_that_a_program_follows_are_tracks(started, speed):
    settings = External((sys.executable,), FOLLOW_POINTS, every=None, max_features=30)
    tracker, frames = started(settings, speed)
    steps = [tracker.step(frame) for frame in frames]
    assert steps[0].new == 30
    start = dict(zip(steps[0].ids.tolist(), steps[0].uv, strict=True))
    for step, frame in zip(steps[1:], frames[1:], strict=True):
        moved = [uv - start[i] for i, uv in zip(step.ids.tolist(), step.uv, strict=True)]
        assert len(moved) > 20
        assert np.quantile(np.abs(moved - frame.index * np.array([3, -2])), 0.9) < 0.1


def test_a_program_is_given_images_and_queries(program, started, sideways, tmp_path):
    settings = program(
        f"""
        assert all(Path(path).is_absolute() for path in paths)
        shutil.copytree(".", {str(tmp_path / "copy")!r})
        write(["0"] * len(paths))
        """,
        every=4,
    )
    tracker, frames = started(settings)
    given = tmp_path / "copy"
    paths = (given / "frames_color.txt").read_text().split()
    images = [cv2.imread(str(given / "images" / Path(path).name), cv2.IMREAD_UNCHANGED) for path in paths]
    assert all((image == frame.image).all() for image, frame in zip(images, sideways, strict=True))
    first = [(given / f"query_{number}.txt").read_text().split()[0] for number in range(1, 41)]
    assert first == ["0"] * 20 + ["4"] * 20
    steps = [tracker.step(frame) for frame in frames]
    assert [step.new for step in steps] == [20, 0, 0, 0, 20, 0]
    query = [float(x) for x in (given / "query_1.txt").read_text().split()[1].split(",")]
    assert steps[0].uv[0].tolist() == query


@pytest.mark.parametrize(
    "visible",
    [
        "1\n1\n1\n1\n0\nFalse\n",
        "1.0\nTRUE\n+1\n1e0\n0.000000000000000000e+00\n-0\n",
        "\ufeff1\r\n1\r\n1\r\n1\r\n0\r\n0\r\n",
    ],
)
def test_what_is_not_seen_ends_and_begins_anew(program, started, visible):
    settings = program(
        f"""
        write(["5,6", "7,8", "0", "9,10", "11,12", "13,14"])
        Path("output_1_visible.txt").write_text({visible!r})
        """,
        every=None,
        max_features=2,
    )
    tracker, frames = started(settings)
    steps = [tracker.step(frame) for frame in frames]
    assert [step.ids.tolist() for step in steps] == [[0, 1], [0, 1], [], [2, 3], [3], [3]]
    assert steps[1].uv.tolist() == [[7, 8], [7, 8]]
    assert steps[4].uv.tolist() == [[11, 12]]
    hidden = ~tracker.points.visible
    assert tracker.points.point[hidden].tolist() == [0, 0]
    assert tracker.points.frame[hidden].tolist() == [4, 5]
    assert tracker.points.uv[hidden].tolist() == [[11, 12], [13, 14]]


@pytest.mark.parametrize("word", ["2", "0.5", "yes", "nan", "1_0", ""])
def test_what_is_neither_seen_nor_hidden_is_refused(program, started, word):
    settings = program(f"""write(["5,6"] * 6); Path("output_1_visible.txt").write_text("1\\n{word}" + "\\n1" * 4)""")
    with pytest.raises(
        TrackerError, match=rf"^external: found '{word}' in output_1_visible.txt:2, expected 0, 1, true or"
    ):
        started(settings)


def test_a_byte_order_mark_is_no_part_of_the_first_line(program, started):
    settings = program("""write(["\\ufeff0"] + ["7,8"] * 5)""", every=None, max_features=2)
    tracker, frames = started(settings)
    assert [tracker.step(frame).uv.tolist() for frame in frames[:2]][1] == [[7, 8], [7, 8]]


@pytest.mark.parametrize(
    ("does", "message"),
    [
        ("sys.exit(3)", r"program.py: ended with code 3, expected code 0$"),
        ("print('no weights'); sys.exit(1)", r"ended with code 1, expected code 0; it printed last: no weights$"),
        ("raise ValueError('of mine')", r"ended with code 1, expected code 0; it printed last: ValueError: of mine$"),
        ("os.kill(os.getpid(), 11)", r"was ended by SIGSEGV, expected code 0$"),
        ("os.kill(os.getpid(), 40)", r"was ended by signal 40, expected code 0$"),
        ("os.remove('output.log'); sys.exit(1)", r"ended with code 1, expected code 0$"),
        (
            "print('full', flush=True); os.remove('output.log'); os.mkfifo('output.log'); sys.exit(1)",
            r"ended with code 1, expected code 0; it printed last: full$",
        ),
        ("", r"output_1.txt: no such file, expected 6 lines$"),
        ("here = os.getcwd(); shutil.rmtree(here); Path(here).touch()", r"output_1.txt: unreadable \(Not a directory"),
        ("write(['1,2'] * 5)", r"found 5 lines in output_1.txt, expected 6, one per image$"),
        ("write(['1,2'] * 5 + ['here'])", r"found 'here' in output_1.txt:6, expected x,y or 0$"),
        ("write(['1,2'] * 5 + ['nan,3'])", r"found 'nan,3' in output_1.txt:6, expected x,y or 0$"),
        ("write(['1,2'] * 5 + ['1,2,3'])", r"found '1,2,3' in output_1.txt:6, expected x,y or 0$"),
        ("write(['1,2'] * 5 + ['1e9,3'])", r"found \[1000000000.0, 3.0\] in output_1.txt:6, expected at most"),
        ("write(['1_0,2'] * 6)", r"found '1_0,2' in output_1.txt:1, expected x,y or 0$"),
        ("write(['\\u0663,2'] * 6)", r"found '\u0663,2' in output_1.txt:1, expected x,y or 0$"),
        (
            "Path('output_1.txt').write_bytes(b'\\xff\\xfe')",
            r"output_1.txt: not UTF-8 in line 1, expected text of 6 lines$",
        ),
        ("os.mkfifo('output_1.txt')", r"output_1.txt: unreadable \(not a regular file\), expected text of 6 lines$"),
        (
            "os.symlink('/dev/zero', 'output_1.txt')",
            r"output_1.txt: unreadable \(not a regular file\), expected text of",
        ),
        (
            "open('output_1.txt', 'wb').truncate(1 << 31)",
            r"output_1.txt: a file of 2147483648 bytes, expected 6 lines of",
        ),
    ],
)
def test_how_a_program_fails_is_said_in_one_line(program, started, does, message, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(TrackerError, match=message) as caught:
        started(program(does))
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("external: ")


def test_a_program_that_hangs_is_ended_with_all_that_it_started(program, started, tmp_path):
    settings = program(
        f"""
        child = os.fork()
        if child:
            Path({str(tmp_path / "pid")!r}).write_text(str(child))
        print("at work", flush=True)
        time.sleep(600)
        """,
        timeout_s=2.0,
    )
    with pytest.raises(TrackerError, match=r"still runs after 2 s, expected it to end; it printed last: at work$"):
        started(settings)
    child = Path("/proc") / (tmp_path / "pid").read_text()
    for _ in range(100):
        if not child.exists() or "Z (zombie)" in (child / "status").read_text():
            break
        time.sleep(0.1)
    assert not child.exists() or "Z (zombie)" in (child / "status").read_text()


def test_nothing_is_left_behind(program, started, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    started(program("write(['0'] * len(paths))"))
    with pytest.raises(TrackerError):
        started(program("sys.exit(1)"))
    assert list((tmp_path / "temporary").iterdir()) == []


def test_what_cannot_be_started_is_said_in_one_line(started, setting):
    with pytest.raises(SettingsError, match=r"external: no-such-program -x: cannot be started \(No such file or dir"):
        started(External(("no-such-program", "-x")))
    with pytest.raises(SettingsError, match=r"images come one by one, expected all of a sequence before the first"):
        External(("true",)).start(setting())
    for wrong in ((), ("",), (3,), ("a\0b",), ("true", "\ud800"), "true", 3):
        with pytest.raises(SettingsError, match=r"expected (a list of )?a program and its arguments"):
            External(wrong)


def test_options_of_a_file_make_the_same_settings():
    made = make_tracker("external", {"command": ["python", "-u"], "script": "mine.py", "timeout_s": 5})
    assert made == External(("python", "-u"), Path("mine.py"), timeout_s=5.0)


def test_it_is_measured_up_to_the_frames_that_are_read():
    sequence = tn.open_sequence("simulated", motions=["forward"], frames=6, width=200, height=150, supersampling=1)
    settings = External((sys.executable,), FOLLOW_POINTS, every=2)
    measured = tn.measure(sequence, settings, speeds=[1, 2], max_frames=4)
    last = {speed: rows["frame"].max() for (speed,), rows in measured.observations.group_by("speed")}
    assert last == {1: 3, 2: 2}
    moved = measured.observations.filter(measured.observations["age"] > 0)
    assert np.median(np.hypot(moved["du_px"].drop_nulls(), moved["dv_px"].drop_nulls())) < 1
