"""What a run prints when it has ended: a few lines that answer, and its tables where they are asked for."""

import pytest

from tracknoise.cli.run_answer import most_important
from tracknoise.cli.run_summary import MOST_LINES, print_results
from tracknoise.cli.terminal import Terminal
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.trust import TruthVerdict
from tracknoise.topics.sentences import sentences_of

TRACKERS = tuple(f"tracker-{place}-of-a-team-with-a-long-name" for place in range(7))


@pytest.fixture(scope="module")
def seven(make_run):
    """A made-up run of seven trackers."""
    return make_run(told=True, scenes=("one", "two"), n_frames=14, min_features=20, trackers=TRACKERS)


def test_the_answer_fits_into_twelve_lines_however_many_trackers_there_are(seven, capsys):
    print_results(Terminal(), seven, report=False, failed=["one failed"], limits=["Quick.", "Wide."])
    out, err = capsys.readouterr()
    lines = [*out.splitlines(), *err.splitlines()]
    assert len(lines) <= MOST_LINES
    assert max(len(line.replace(str(seven.path), "runs/seven")) for line in lines) <= 110
    assert TRACKERS[0] in lines[0]
    (more,) = (line for line in lines if " more: tracknoise report " in line)
    assert int(more.split()[0]) == len(TRACKERS) - sum(TRACKERS[place] in out.split(more)[0] for place in range(7))
    assert "Truth: limited." in out
    assert err.splitlines() == [
        f"The numbers of every tracker and speed: tracknoise report {seven.path} --all",
        "one failed",
    ]


@pytest.mark.parametrize("verdict", [verdict for verdict in Trust if verdict is not Trust.not_assessed])
def test_the_verdict_on_the_truth_comes_before_numbers_that_it_forbids(seven, monkeypatch, capsys, verdict):
    monkeypatch.setattr(TruthVerdict, "of", lambda trust: TruthVerdict(verdict, "A reason.", "Mend it."))
    print_results(Terminal(), seven, report=False)
    lines = capsys.readouterr().out.splitlines()
    first = verdict in (Trust.not_trusted, Trust.unknown)
    assert lines[0 if first else -1] == f"Truth: {verdict}. A reason. Next: Mend it."
    assert any(line.startswith(TRACKERS[0]) for line in lines)


def test_few_sentences_say_what_to_set_before_all_reasons(seven, monkeypatch):
    reason = " ".join(f"Reason {place}." for place in range(6))
    verdict = TruthVerdict(Trust.unknown, "A reason.", "Mend it.", stated=reason)
    monkeypatch.setattr(TruthVerdict, "of", lambda trust: verdict)
    texts = most_important(ReportData.of(seven), 8)
    assert texts[0].startswith("Truth: unknown.")
    assert any(text.startswith(TRACKERS[0]) for text in texts)


@pytest.mark.parametrize("table", [False, True])
def test_tracks_that_do_not_follow_the_images_have_no_numbers(seven, monkeypatch, capsys, table):
    monkeypatch.setattr(TruthVerdict, "of", lambda trust: TruthVerdict(Trust.not_assessed, "A reason.", "Mend it."))
    print_results(Terminal(), seven, report=False, table=table)
    assert capsys.readouterr().out.splitlines() == ["Tracks: wrong. A reason. Next: Mend it."]


def test_tables_name_every_tracker_and_hold_what_the_answer_leaves_out(seven, capsys):
    print_results(Terminal(), seven, report=False, table=True)
    out = capsys.readouterr().out
    assert out.startswith("Truth: limited.")
    assert "lifetime" in out
    assert all(name in out for name in TRACKERS)


def test_findings_are_ten_sentences_unless_all_are_asked_for(tracknoise, seven):
    code, out, _ = tracknoise("report", str(seven.path), "--text")
    assert code == 0
    *lines, more = out.splitlines()
    assert 4 <= len(sentences_of(" ".join(line[4:] for line in lines))) <= 10
    assert TRACKERS[0] in lines[0]
    assert "--all" in more
    _, every, _ = tracknoise("report", str(seven.path), "--all")
    assert len(every) > 2 * len(out)


@pytest.mark.parametrize(
    ("no_colour", "is_terminal", "coloured"), [("", True, True), ("1", True, False), ("", False, False)]
)
def test_results_have_colours_in_a_terminal_alone(capsys, monkeypatch, no_colour, is_terminal, coloured):
    monkeypatch.setenv("NO_COLOR", no_colour)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stdout.isatty", lambda: is_terminal)
    Terminal().result("Truth: trusted. \x1b[2J", coloured="trusted", colour="green")
    out = capsys.readouterr().out
    assert ("\x1b[32mtrusted\x1b[0m" in out) is coloured
    assert "\\x1b[2J" in out
