"""Streams that are closed or full, and readers that have gone: messages are dropped, results are not."""

import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest
from tests.experiments.conftest import write_experiment
from tests.writers.program import PROGRAM

from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.store import RunFolder

REPORTING = "from functools import partial\nfrom tracknoise.report import page\n" + PROGRAM.replace(
    "main()\n",
    "page.write_report = partial(page.write_report, figure_formats=())\n"
    "    page.FAMILIES = [family for family in page.FAMILIES if family.id == 'feature-counts']\n"
    "    main()\n",
)
"""The program, but that reports have one family of figures and no files of them, so that they take a moment."""


@pytest.fixture
def shell(tmp_path):
    """Runs the program in a shell, with what is behind its arguments. Gives its status and what it wrote."""
    (tmp_path / "go.py").write_text(PROGRAM)
    (tmp_path / "reporting.py").write_text(REPORTING)
    write_experiment(tmp_path, 2).rename(tmp_path / "small.toml")
    folder = tmp_path / "current"
    folder.mkdir()

    def go(arguments: str, redirected: str = "") -> tuple[int, str, str]:
        program = "reporting" if arguments == REPORTED else "go"
        command = f'"{sys.executable}" ../{program}.py {arguments} {redirected}; exit ${{PIPESTATUS[0]}}'
        ended = subprocess.run(["bash", "-c", command], cwd=folder, capture_output=True, text=True)
        return ended.returncode, ended.stdout, ended.stderr

    return go


REPORTED = "run ../small.toml --out ../run --workers 1"


def run(workers: int) -> str:
    return f"run ../small.toml --out ../run --workers {workers} --no-report"


def is_complete(folder: Path) -> bool:
    found = RunFolder(folder)
    return len(found.manifest().sequences) == 2 and found.statistics(FINDINGS).height > 0


def test_messages_that_cannot_be_written_do_not_stop_a_run(shell, tmp_path):
    status, out, err = shell(run(2), "2>&-")
    assert (status, err) == (0, "")
    assert "oracle" in out
    assert is_complete(tmp_path / "run")
    assert list((tmp_path / "current").iterdir()) == []


@pytest.mark.parametrize("redirected", ["2>/dev/full", "2>&1 >/dev/null | true"])
def test_an_error_that_cannot_be_written_is_the_status_alone(redirected, shell):
    assert shell("report ../none --text", redirected) == (1, "", "")


@pytest.mark.usefixtures("shell")
def test_bars_in_a_terminal_that_closes_do_not_stop_a_run(tmp_path):
    ours, theirs = pty.openpty()
    command = [sys.executable, "../go.py", *run(1).split()]
    environment = {**os.environ, "TERM": "xterm"}
    with subprocess.Popen(
        command, cwd=tmp_path / "current", stderr=theirs, stdout=subprocess.PIPE, env=environment
    ) as program:
        os.close(theirs)
        assert os.read(ours, 100)
        os.close(ours)
        assert b"oracle" in program.communicate()[0]
    assert program.returncode == 0
    assert is_complete(tmp_path / "run")


def test_results_of_a_run_that_cannot_be_written_are_one_line_and_the_report_is_written(shell, tmp_path):
    status, _, err = shell(REPORTED, ">/dev/full")
    assert status == 1
    errors = [text for text in err.splitlines() if "error" in text and not text.startswith("note: ")]
    assert errors == ["tracknoise: error: standard output cannot be written (No space left on device)"]
    assert is_complete(tmp_path / "run")
    assert (tmp_path / "run" / "report" / "index.html").exists()


def test_results_that_have_no_stream_are_one_line(shell, tmp_path):
    line = "tracknoise: error: standard output cannot be written (Bad file descriptor)\n"
    for arguments in ("--help", "trackers"):
        assert shell(arguments, ">&-") == (1, "", line), arguments
    assert shell("trackers", ">&- 2>&-") == (1, "", "")
    assert list((tmp_path / "current").iterdir()) == []


def test_a_reader_that_has_gone_has_read_enough(shell):
    assert shell("trackers", "| true") == (0, "", "")
    assert shell("--help", "| true") == (0, "", "")
    assert shell("report ../none --text", "| true")[0] == 1


def test_files_do_not_get_the_numbers_of_closed_streams(tmp_path):
    """Otherwise, what a library prints would be written into them."""
    program = tmp_path / "go.py"
    program.write_text(
        "import os, sys\nfrom tracknoise import processes\nprocesses.prepare()\n"
        f"file = open({str(tmp_path / 'file')!r}, 'w')\n"
        f"open({str(tmp_path / 'number')!r}, 'w').write(str(file.fileno()))\n"
        "sys.stderr.write('x'); os.write(2, b'x'); sys.stdout.write('x')\n"
    )
    status = subprocess.run(["bash", "-c", f'"{sys.executable}" "{program}" <&- >&- 2>&-'], check=False).returncode
    assert status == 0
    assert int((tmp_path / "number").read_text()) > 2
    assert (tmp_path / "file").read_text() == ""
