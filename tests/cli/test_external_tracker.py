"""Programs of one's own as trackers of a run."""

import shutil
import sys
from pathlib import Path

import pytest

from tracknoise.tables.store import RunFolder

FOLLOW_POINTS = Path(__file__).parents[1] / "foreign" / "follow_points.py"


@pytest.fixture
def experiment(tmp_path):
    """An experiment beside its program."""
    shutil.copy(FOLLOW_POINTS, tmp_path / "mine.py")
    (tmp_path / "x.toml").write_text(
        'name = "x"\nspeeds = [1]\n[dataset]\nreader = "simulated"\n'
        'options = { motions = ["forward"], worlds = 1, frames = 4, width = 160, height = 120, supersampling = 1 }\n'
        '[[trackers]]\nkind = "external"\n[trackers.options]\nscript = "mine.py"\nevery = 2\n'
        f"command = [{sys.executable!r}]\n"
    )
    return tmp_path / "x.toml"


@pytest.mark.usefixtures("lean")
def test_a_program_is_measured_again_when_its_script_changes(tracknoise, experiment):
    run = ["run", str(experiment), "--out", str(experiment.parent / "run"), "-w", "1", "--no-report", "--quiet"]
    assert tracknoise(*run) == (0, "", "")
    (observed,) = RunFolder(experiment.parent / "run").sequence_tables("observations")
    assert observed["tracker"].unique().to_list() == ["external"]
    with (experiment.parent / "mine.py").open("a") as script:
        script.write("# another version\n")
    code, out, err = tracknoise(*run[:-1])
    assert code == 0
    assert "mine.py changed" in " ".join((out + err).split())


def test_a_script_that_is_missing_is_named_in_one_line(tracknoise, experiment):
    (experiment.parent / "mine.py").unlink()
    code, _, err = tracknoise("run", str(experiment), "--out", str(experiment.parent / "run"), "-w", "1", "--quiet")
    (line,) = err.splitlines()
    assert code == 1
    assert "mine.py: no such file, expected the script of a tracker" in line


def test_a_program_that_fails_is_named_in_one_line(tracknoise, experiment):
    (experiment.parent / "mine.py").write_text("print('no weights')\nraise SystemExit(3)\n")
    code, out, err = tracknoise("run", str(experiment), "--out", str(experiment.parent / "run"), "-w", "1", "--quiet")
    assert code == 1
    assert out == ""
    (line,) = err.splitlines()
    assert line.endswith("mine.py: ended with code 3, expected code 0; it printed last: no weights")
