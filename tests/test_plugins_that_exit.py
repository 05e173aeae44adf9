"""Trackers, readers and truths of other packages that call `sys.exit`, as scripts do when they are imported."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.lean import measured_by_command

from tracknoise.cli.app import main
from tracknoise.exceptions import SettingsError
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.tracker_registry import TRACKERS

LEAVING = """
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from tracknoise.sequences.simulated import Simulated
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.truth.birth import BirthDepth


@dataclass(frozen=True, slots=True)
class Tracker:
    kind: ClassVar[str] = "leaving"
    description: ClassVar[str] = "leaves"

    when: str = "never"

    def __post_init__(self):
        if self.when == "settings":
            sys.exit(0)

    def start(self, context):
        self._leave("start", context)
        made = LucasKanade().start(context)
        step = made.step

        class Steps:
            def step(_, frame):
                self._leave("step", context)
                return step(frame)

        return Steps()

    def _leave(self, when, context):
        if self.when == when and context.sequence.scene == "forward-01":
            sys.exit(0)


@dataclass(frozen=True, slots=True)
class Reader:
    name: ClassVar[str] = "leaving"
    description: ClassVar[str] = "leaves"
    needs_root: ClassVar[bool] = False

    root: Path = Path()
    when: str = "never"

    def sequences(self):
        if self.when == "list":
            sys.exit(0)
        return self._data().sequences()

    def open(self, sequence):
        if self.when == "open" and sequence.scene == "forward-01":
            sys.exit("no licence")
        return self._data().open(sequence)

    def _data(self):
        return Simulated(motions=("forward",), frames=4, width=96, height=72, worlds=2, supersampling=1)


@dataclass(frozen=True, slots=True)
class Truth:
    kind: ClassVar[str] = "leaving"

    def open(self, sequence):
        if sequence.id.scene == "forward-01":
            sys.exit()
        return BirthDepth().open(sequence)
"""
POINTS = """
[tracknoise.trackers]
leaving = leaving:Tracker
script = leaving_script:Tracker
[tracknoise.sequences]
leaving = leaving:Reader
[tracknoise.truths]
leaving = leaving:Truth
"""


@pytest.fixture
def installed(tmp_path, monkeypatch) -> Iterator[None]:
    """A package of such plug-ins, and one of a script, which ends when it is imported."""
    info = tmp_path / "site" / "leaving-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: leaving\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(POINTS)
    (tmp_path / "site" / "leaving.py").write_text(LEAVING)
    (tmp_path / "site" / "leaving_script.py").write_text("import sys\nsys.exit(0)\n")
    monkeypatch.syspath_prepend(tmp_path / "site")
    yield
    sys.modules.pop("leaving", None)


@pytest.fixture
def run(installed, tmp_path):
    """Runs an experiment, of which nothing is computed. Gives the exit status."""

    def go(*options: str, kind: str = "leaving", tracker: str = "never", reader: str = "never", truth: str = "") -> int:
        (tmp_path / "leaving.toml").write_text(
            f'name = "leaving"\nspeeds = [1]\n[dataset]\nreader = "leaving"\noptions = {{ when = "{reader}" }}\n'
            f'[[trackers]]\nkind = "{kind}"\noptions = {{ when = "{tracker}" }}\n'
            f'[truth]\nkind = "{truth or "birth"}"\n[statistics]\nmin_features = 2\n'
        )
        with measured_by_command(), pytest.raises(SystemExit) as ended:
            main(["run", str(tmp_path / "leaving.toml"), "--out", str(tmp_path / "run"), "--no-report", *options])
        return ended.value.code

    return go


def failures(folder: Path) -> dict[str, str]:
    lines = (folder / "failures.jsonl").read_text().splitlines()
    return {entry["sequence"]: entry["cause"] for entry in map(json.loads, lines)}


@pytest.mark.parametrize(
    ("when", "workers", "cause"),
    [
        ({"tracker": "step"}, "1", "SystemExit: 0"),
        ({"tracker": "step"}, "2", "SystemExit: 0"),
        ({"tracker": "start"}, "1", "SystemExit: 0"),
        ({"reader": "open"}, "1", "SystemExit: no licence"),
        ({"truth": "leaving"}, "1", "SystemExit"),
    ],
)
def test_a_scene_in_which_a_plug_in_exits_has_failed(when, workers, cause, run, tmp_path):
    assert run("--workers", workers, **when) == 2
    assert failures(tmp_path / "run") == {"forward-01@default": cause}
    assert list(RunFolder(tmp_path / "run").manifest().sequences) == ["forward-00@default"]


@pytest.mark.parametrize(
    ("when", "line"),
    [
        (
            {"kind": "script"},
            "tracker 'script': leaving_script:Tracker cannot be loaded (SystemExit: 0), expected a class",
        ),
        ({"tracker": "settings"}, "tracker 'leaving': cannot be made (SystemExit: 0), expected settings"),
        ({"reader": "list"}, "a plug-in ended the program (SystemExit: 0); use --debug for a traceback"),
    ],
)
def test_a_plug_in_that_exits_before_the_run_is_one_line(when, line, run, capsys):
    assert run("--workers", "1", **when) == 1
    captured = capsys.readouterr()
    assert captured.err.startswith("tracknoise: error: ")
    assert captured.err.endswith(f"{line}\n")
    assert captured.err.count("\n") == 1
    assert captured.out == ""


@pytest.mark.parametrize("workers", ["1", "2"])
def test_with_debug_the_exit_status_is_not_that_of_the_plug_in(workers, run):
    with pytest.raises(RuntimeError, match=r"^a plug-in ended the program \(SystemExit: 0\)") as raised:
        run("--debug", "--workers", workers, tracker="step")
    assert isinstance(raised.value.__cause__, SystemExit)


@pytest.mark.usefixtures("installed")
def test_a_program_that_uses_the_package_goes_on():
    with pytest.raises(SettingsError, match=r"tracker 'script': .* cannot be loaded \(SystemExit: 0\)"):
        TRACKERS.load("script")
