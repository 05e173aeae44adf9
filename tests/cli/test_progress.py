"""What is said of a run's pace."""

import threading

import pytest

from tracknoise.cli.progress import Heartbeat, Pace, RunProgress
from tracknoise.cli.terminal import Terminal
from tracknoise.tables.identity import SequenceId


@pytest.mark.parametrize(
    ("done", "to_do", "elapsed_s", "said"),
    [
        (0, 10, 5.0, ""),
        (4, 10, 2.0, "2.0/s, 3 s left"),
        (1, 10, 20.0, "3.0/min, 3 min left"),
        (2, 60, 1200.0, "6.0/h, 9 h 40 min left"),
        (1, 3, 7200.0, "0.5/h, 4 h 00 min left"),
        (10, 10, 20.0, "30.0/min"),
    ],
)
def test_rate_and_time_left(done, to_do, elapsed_s, said):
    times = iter([100.0, 100.0 + elapsed_s])
    pace = Pace(to_do, clock=lambda: next(times))
    for _ in range(done):
        pace.advance()
    assert str(pace) == said


class Clock:
    def __init__(self):
        self.now_s = 0.0

    def __call__(self):
        return self.now_s


def test_lines_come_ten_seconds_apart_and_farther_the_longer_it_takes():
    clock, said = Clock(), []
    heartbeat = Heartbeat(said.append, "{:g} s".format, clock=clock)
    for now_s in (0, 9, 10, 11, 19, 20, 35, 44, 45, 10_000, 10_400, 10_600):
        clock.now_s = now_s
        heartbeat.beat()
    assert said == ["10 s", "20 s", "35 s", "45 s", "10000 s", "10600 s"]


def test_a_thread_says_it_while_nothing_else_happens():
    came, times = threading.Event(), iter(range(0, 10**6, 20))
    heartbeat = Heartbeat(lambda text: came.set(), lambda elapsed_s: "still here", clock=times.__next__, pause_s=1e-3)
    heartbeat.start()
    try:
        assert came.wait(60)
    finally:
        heartbeat.stop()


def test_nothing_is_said_where_there_is_nothing_to_say():
    clock, said = Clock(), []
    heartbeat = Heartbeat(said.append, lambda elapsed_s: "", clock=clock)
    clock.now_s = 60
    heartbeat.beat()
    assert said == []


def test_without_a_terminal_it_is_said_where_a_run_stands(capsys):
    clock = Clock()
    progress = RunProgress(Terminal(), clock)
    clock.now_s = 20
    progress.heartbeat.beat()
    assert capsys.readouterr().err == "", "before it is known what there is to do"
    progress.planned(["a", "b", "c", "d"], 1)
    progress.frame("a", 3, 9, 0)
    clock.now_s = 40
    progress.heartbeat.beat()
    assert capsys.readouterr().err.splitlines()[-1] == "1 of 5 sequences done after 40 s; a at frame 3 of 9"
    progress.failed(["a", "b"], "torn")
    progress.failed(["c"], "dark")
    clock.now_s = 320
    progress.heartbeat.beat()
    assert capsys.readouterr().err.splitlines() == [
        "tracknoise: error: a and b: torn",
        "tracknoise: error: c: dark",
        "4 of 5 sequences done after 5 min; 36.0/h, 2 min left",
    ]
    progress.failed(["d"], "dark")
    clock.now_s = 900
    progress.heartbeat.beat()
    assert capsys.readouterr().err.splitlines()[-1] == "5 of 5 sequences done after 15 min; results are being computed"


def test_no_time_is_said_to_be_left_while_results_of_all_frames_are_computed(capsys):
    clock = Clock()
    progress = RunProgress(Terminal(), clock)
    progress.planned(["a"], 0)
    for done in range(1, 31):
        clock.now_s += 1.0
        progress.frame("a", done, 30, 0)
    clock.now_s = 300.0
    progress.heartbeat.beat()
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "0 of 1 sequence done after 5 min; a at frame 30 of 30; results are being computed"


def test_reference_tracks_are_said_to_be_followed_until_a_frame_is_measured(capsys):
    clock = Clock()
    progress = RunProgress(Terminal(), clock)
    progress.planned(["a"], 0)
    for _ in range(30):
        clock.now_s += 1.0
        progress.frame("a", 0, 30, 0)
    progress.heartbeat.beat()
    for done in range(1, 13):
        progress.frame("a", done, 30, 0)
        clock.now_s += 1.0
    progress.heartbeat.beat()
    assert capsys.readouterr().err.splitlines() == [
        "0 of 1 sequence done after 30 s; a at frame 0 of 30; reference tracks are being followed",
        "0 of 1 sequence done after 42 s; a at frame 12 of 30; 1.0 frames/s, 18 s left",
    ]


def test_names_of_scenes_are_shown_as_they_are_written(capsys):
    """File names have percent signs for special characters; messages have the characters."""
    clock = Clock()
    progress = RunProgress(Terminal(), clock)
    keys = [SequenceId("d", scene, "dunkel/hell").key for scene in ("büro/1 [b]", "50%", "50%25\n")]
    assert "%" in keys[0]
    progress.planned(keys, 0)
    progress.frame(keys[0], 3, 9, 0)
    clock.now_s = 40
    progress.heartbeat.beat()
    progress.failed(keys, "torn")
    assert capsys.readouterr().err.splitlines() == [
        "0 of 3 sequences done after 40 s; büro/1 [b]@dunkel/hell at frame 3 of 9",
        "tracknoise: error: büro/1 [b]@dunkel/hell, 50%@dunkel/hell and 50%25 @dunkel/hell: torn",
    ]


def test_frames_of_parts_that_are_measured_side_by_side_add_up(capsys):
    clock = Clock()
    progress = RunProgress(Terminal(), clock)
    progress.planned(["long"], 0)
    progress.frame("long", 200, 1000, 0)  # an earlier start measured this part
    for done in range(1, 31):
        clock.now_s += 1.0
        progress.frame("long", done, 1000, 200)
        progress.frame("long", done, 1000, 400)
    progress.heartbeat.beat()
    assert capsys.readouterr().err.splitlines()[-1] == (
        "0 of 1 sequence done after 30 s; long at frame 260 of 1000; 2.0 frames/s, 6 min left"
    )
