"""The program, as it is called from a shell."""

import shutil

import pytest
from tests.lean import measured_by_command
from tests.report.runs import make_run
from tests.writers.wall import write_wall

from tracknoise.cli.app import main

__all__ = ["make_run"]


@pytest.fixture
def tracknoise(capsys):
    def go(*arguments):
        with pytest.raises(SystemExit) as exit_:
            main(list(arguments))
        captured = capsys.readouterr()
        return exit_.value.code, captured.out, captured.err

    return go


EXPERIMENT = """
name = "x"
speeds = [1]
[dataset]
reader = "sevenscenes"
root = "data"
[[trackers]]
kind = "lucas-kanade"
options = { max_features = 12, min_features = 8 }
[statistics]
min_features = 2
"""
"""It has too few features for a noise model, whose fit would take most of the time of a run."""


@pytest.fixture
def scene(tmp_path):
    """The folder of a sequence that can be measured, beside the experiment ``x.toml``."""
    return _written(tmp_path)


@pytest.fixture(scope="session")
def _measured(made_once):
    def write(folder):
        _written(folder)
        with pytest.raises(SystemExit) as exit_:
            main(["run", str(folder / "x.toml"), "--out", str(folder / "run"), "-q", "--no-report", "-w", "1"])
        assert exit_.value.code == 0
        (folder / "data").rename(folder / "moved")  # a run takes data elsewhere only where the old ones are gone

    return made_once("cli-wall", write)


@pytest.fixture
def measured_scene(_measured, tmp_path):
    """As `scene`, with the finished run of the experiment in ``run``."""
    shutil.copytree(_measured, tmp_path, dirs_exist_ok=True)
    (tmp_path / "moved").rename(tmp_path / "data")
    return tmp_path / "data" / "seq-01"


@pytest.fixture(scope="session")
def whole(make_run):
    """The folder of a small run of made-up measurements, which no test changes."""
    return make_run(told=True).path


@pytest.fixture
def lean():
    """Runs are measured, and nothing is computed of them. Not for the run of a `measured_scene`, which is whole."""
    with measured_by_command():
        yield


def _written(folder):
    write_wall(folder / "data" / "seq-01")
    (folder / "x.toml").write_text(EXPERIMENT)
    return folder / "data" / "seq-01"
