"""``tracknoise replicate``: the paper's experiments for which there are data, and pages that compare them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.options import (
    DebugOption,
    FramesOption,
    FreshOption,
    ModelsOption,
    QuietOption,
    ScenesOption,
    WorkersOption,
    parse_frames,
)
from tracknoise.cli.running import measure, processes
from tracknoise.exceptions import TracknoiseError

if TYPE_CHECKING:
    from tracknoise.cli.terminal import Terminal
    from tracknoise.experiments.replicate import Candidate, Limits
    from tracknoise.experiments.settings import Experiment
    from tracknoise.report.replication import Replicated
    from tracknoise.tables.store import RunFolder


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("replicate")(replicate)


def replicate(
    context: typer.Context,
    data: Annotated[
        list[Path] | None,
        typer.Option("--data", "-d", help="Folder that is, or contains, DTU Point Features or KITTI; repeatable."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the runs.")] = Path("runs/replication"),
    scenes: ScenesOption = None,
    frames: FramesOption = None,
    models: ModelsOption = None,
    workers: WorkersOption = None,
    fresh: FreshOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Repeat the paper's experiments and compare the results with the paper's tables.

    The two Gazebo experiments are simulated. DTU Point Features and KITTI are measured if `--data` has them. For each
    experiment, the first scene is also run with other outlier rejections. An interrupted replication resumes.

    Example: `tracknoise replicate --data /data --scenes 2 --frames 60`
    """
    from tracknoise.experiments.replicate import Limits, candidates
    from tracknoise.report.replication import write_replication

    found = candidates(data or [])
    for candidate in found:
        context.obj.say(f"{candidate.preset}: {candidate.found}")
    runs = _Runs(context.obj, out, processes(workers), fresh=fresh)
    replicated = [_repeat(candidate, runs, Limits(scenes, parse_frames(frames), models)) for candidate in found]
    if not any(item.run for item in replicated):
        context.obj.error("none of the paper's experiments could be measured")
        return 1
    context.obj.result(f"replication: {write_replication(out, replicated).resolve()}")
    return 2 if runs.failed else 0


class _Runs:
    """Runs experiments into folders of one parent folder. A failure does not stop the others."""

    def __init__(self, terminal: "Terminal", out: Path, workers: int, *, fresh: bool) -> None:
        self._terminal, self._out, self._workers, self._fresh = terminal, out, workers, fresh
        self.failed = False

    def run(self, name: str, load: Callable[[], "Experiment"]) -> "RunFolder | None":
        """Run an experiment. Returns its folder, or None if nothing was measured."""
        from tracknoise.cli.summary import print_outcome
        from tracknoise.tables.store import RunFolder

        folder = self._out / name
        self._terminal.say(f"{name}:")

        def execute() -> int:
            outcome = measure(self._terminal, load(), folder, self._workers, fresh=self._fresh)
            return print_outcome(self._terminal, folder, outcome, report=False)

        return None if self._survive(name, execute) == 1 else RunFolder(folder)

    @contextmanager
    def report_beside(self, name: str, run: "RunFolder | None") -> Iterator[None]:
        """Write the report of a run while the body of the `with` runs; with one worker, after it."""
        from tracknoise.experiments.running.worker import beside
        from tracknoise.report.page import write_report

        if run is None:
            yield
            return
        with beside(write_report, run) if self._workers > 1 else nullcontext(partial(write_report, run)) as written:
            yield

            def finish() -> int:
                self._terminal.result(f"report: {written().resolve()}")
                return 0

            self._survive(name, finish)

    def _survive(self, name: str, act: Callable[[], int]) -> int:
        """Call a function and return its exit status, or 1 if it raises."""
        try:
            status = act()
        except Exception as error:
            if self._terminal.debug:
                raise
            self._terminal.error(f"{name}: {error if isinstance(error, TracknoiseError) else repr(error)}")
            status = 1
        self.failed |= status != 0
        return status


def _repeat(candidate: "Candidate", runs: _Runs, limits: "Limits") -> "Replicated":
    """Run an experiment of the paper, and variants of its trackers on the first scene."""
    from tracknoise.experiments.replicate import load_candidate, variants
    from tracknoise.report.replication import Replicated

    if not candidate.possible:
        return Replicated(candidate.preset, candidate.found)
    run = runs.run(candidate.preset, lambda: load_candidate(candidate, limits))
    with runs.report_beside(candidate.preset, run):
        others = runs.run(f"{candidate.preset}-differences", lambda: variants(load_candidate(candidate, limits)))
    return Replicated(candidate.preset, candidate.found, run, others)
