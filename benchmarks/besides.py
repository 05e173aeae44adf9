"""What a run costs besides the steps of its trackers: decoding, truth, recording, tables, statistics, findings.

Both built-in trackers at speed 1, one process, one thread, processor time: of the demo's simulation, and in the larger
version of the shared samples as well (``TRACKNOISE_SAMPLES``, by default ../shared/data). The report is not among it.
"""

import os
import tempfile
import time
from pathlib import Path

from benchmarks.harness import Row, Silent
from tracknoise.experiments.execute import execute
from tracknoise.experiments.load import resolve
from tracknoise.experiments.machine import use_one_opencv_thread
from tracknoise.experiments.settings import DatasetSettings, Experiment, TrackerChoice
from tracknoise.measurement import tracking
from tracknoise.tables.store import RunFolder

SAMPLES = Path(os.environ.get("TRACKNOISE_SAMPLES", "../shared/data"))
RECORDINGS = {
    "7-Scenes": DatasetSettings(reader="sevenscenes", root=SAMPLES / "sevenscenes"),
    "TUM": DatasetSettings(reader="tum", root=SAMPLES / "tum_rgbd"),
    "TartanAir": DatasetSettings(reader="tartanair", root=SAMPLES / "tartanair_v1"),
    "KITTI": DatasetSettings(reader="kitti", root=SAMPLES / "kitti"),
}
SIMULATED = DatasetSettings(reader="simulated", options={"motions": ["sideways"], "frames": 45})


def rows() -> list[Row]:
    """Of a simulated scene."""
    return [_row("simulation", SIMULATED)]


def full_rows() -> list[Row]:
    """Of the shared samples as well."""
    return [*rows(), *(_row(name, dataset) for name, dataset in RECORDINGS.items())]


def _row(name: str, dataset: DatasetSettings) -> Row:
    use_one_opencv_thread()
    trackers = [TrackerChoice(kind=kind) for kind in ("lucas-kanade", "correspondence")]
    experiment = resolve(Experiment(name="besides", dataset=dataset, trackers=trackers))
    steps: list[float] = []
    before = tracking.start_tracker
    tracking.start_tracker = lambda *arguments: _Timed(before(*arguments), steps)
    try:
        with tempfile.TemporaryDirectory() as folder:
            started = time.process_time()
            execute(experiment, RunFolder(Path(folder) / "run"), listener=Silent())
            total = time.process_time() - started
    finally:
        tracking.start_tracker = before
    note = f"{len(steps) // 2} frames; tracking {sum(steps):.1f} s of {total:.1f} s"
    return Row(f"besides tracking, {name}", total / sum(steps) - 1, "of tracking", note)


class _Timed:
    """A tracker whose steps are timed."""

    def __init__(self, tracker: tracking.Tracker, steps: list[float]) -> None:
        self._tracker, self._steps = tracker, steps

    def __getattr__(self, name: str) -> object:
        return getattr(self._tracker, name)

    def step(self, frame: tracking.Frame) -> object:
        started = time.process_time()
        found = self._tracker.step(frame)
        self._steps.append(time.process_time() - started)
        return found
