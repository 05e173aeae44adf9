"""``tracknoise replicate``: the paper's experiments for which there are data, and pages that compare them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.shared_options import (
    DebugOption,
    FramesOption,
    FreshOption,
    QuietOption,
    ScenesOption,
    WorkersOption,
    parse_frames,
    processes,
    text,
)
from tracknoise.cli.terminal import Terminal
from tracknoise.exceptions import TracknoiseError

if TYPE_CHECKING:
    from tracknoise.experiments.settings import Experiment
    from tracknoise.paper.replication import Replicated
    from tracknoise.paper.variants import Candidate, Limits
    from tracknoise.tables.enumerations import Reading
    from tracknoise.tables.store import RunFolder


_CAPTION = "verdicts with untrimmed errors (none) and with two readings of the paper's trimming"


def replicate(
    context: typer.Context,
    data: Annotated[
        list[Path] | None,
        text(
            "--data",
            "-d",
            metavar="FOLDER",
            help="Folder that is, or contains, DTU Point Features, KITTI or Gazebo models; repeatable.",
        ),
    ] = None,
    out: Annotated[Path, text("--out", "-o", metavar="FOLDER", help="Folder for the runs.")] = Path("runs/replication"),
    scenes: ScenesOption = None,
    frames: FramesOption = None,
    workers: WorkersOption = None,
    fresh: FreshOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Repeat the paper's experiments and compare the results with the paper's tables.

    The two Gazebo experiments are simulated, of Gazebo models if `--data` has some. DTU Point Features and KITTI are
    measured if it has them. For each experiment, the first scene is also run with other outlier rejections. Every claim
    of the paper is judged with untrimmed errors, and with two readings of its trimming. An interrupted replication
    resumes.

    Example: `tracknoise replicate --data /data --scenes 2 --frames 60`
    """
    from tracknoise.paper.replication import write_replication
    from tracknoise.paper.variants import Limits, candidates
    from tracknoise.tables.files import require_no_links

    require_no_links(out)
    context.obj.resumes(fresh=fresh)
    offered = candidates(data or [])
    for candidate in offered:
        context.obj.say(f"{candidate.preset}: {candidate.found}")
    runs = _Runs(context.obj, out, processes(workers), fresh=fresh)
    replicated = [_repeat(candidate, runs, Limits(scenes, parse_frames(frames))) for candidate in offered]
    if not any(item.run for item in replicated):
        context.obj.error("none of the paper's experiments could be measured")
        return 1
    page = write_replication(out, replicated)
    _print_claims(context.obj, replicated)
    context.obj.result(f"replication: {page.resolve()}")
    return 2 if runs.failed else 0


class _Runs:
    """Runs experiments into folders of one parent folder. A failure does not stop the others."""

    def __init__(self, terminal: Terminal, out: Path, workers: int, *, fresh: bool) -> None:
        self._terminal, self._out, self._workers, self._fresh = terminal, out, workers, fresh
        self.failed = False

    def run(self, name: str, load: Callable[[], "Experiment"]) -> "RunFolder | None":
        """Run an experiment. Returns its folder, or None if nothing was measured."""
        from tracknoise.cli.progress import RunProgress
        from tracknoise.cli.run_summary import print_outcome
        from tracknoise.experiments.execute import execute
        from tracknoise.tables.store import RunFolder

        folder = self._out / name
        self._terminal.say(f"{name}:")

        def measure() -> int:
            with RunProgress(self._terminal) as shown:
                outcome = execute(
                    load(),
                    RunFolder(folder),
                    listener=shown,
                    workers=self._workers,
                    fresh=self._fresh,
                    debug=self._terminal.debug,
                )
            return print_outcome(self._terminal, folder, outcome, report=False, table=True)

        return None if self._survive(name, measure) == 1 else RunFolder(folder)

    def remake(self, name: str, run: "RunFolder", reading: "Reading") -> "RunFolder | None":
        """Make a run again under a reading of the paper's trimming. Returns its folder, or None if that failed."""
        from tracknoise.experiments.execute import remake
        from tracknoise.paper.variants import as_read
        from tracknoise.tables.store import RunFolder

        folder = RunFolder(self._out / "readings" / f"{name}-{reading}")
        self._terminal.say(f"{name}: statistics with trimming {reading}")

        def make() -> int:
            remake(run, as_read(run, reading), folder)
            return 0

        return None if self._survive(name, make) else folder

    @contextmanager
    def report_beside(self, name: str, run: "RunFolder | None") -> Iterator[None]:
        """Write the report of a run while the body of the `with` runs; with one worker, after it."""
        from tracknoise.experiments.local_workers import beside
        from tracknoise.report.page import write_report

        if run is None:
            yield
            return
        with beside(is_wanted=self._workers > 1) as begin:
            written = begin(write_report, run)
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
    from tracknoise.paper.replication import Replicated
    from tracknoise.paper.variants import load_candidate, variants

    if not candidate.possible:
        return Replicated(candidate.preset, candidate.found)
    run = runs.run(candidate.preset, lambda: load_candidate(candidate, limits))
    with runs.report_beside(candidate.preset, run):
        others = runs.run(f"{candidate.preset}-differences", lambda: variants(load_candidate(candidate, limits)))
    read = _other_readings(candidate.preset, run, runs) if run else {}
    return Replicated(candidate.preset, candidate.found, run, others, read)


def _other_readings(name: str, run: "RunFolder", runs: _Runs) -> "dict[Reading, RunFolder]":
    """The run under the readings of the paper's trimming that are not its own, as far as they can be made."""
    from tracknoise.tables.enumerations import Reading

    made = ((reading, runs.remake(name, run, reading)) for reading in (Reading.none, Reading.followed))
    return {reading: folder for reading, folder in made if folder}


def _print_claims(terminal: Terminal, replicated: "list[Replicated]") -> None:
    """Print the verdict on every claim under each reading of the paper's trimming."""
    from tracknoise.cli.text_table import show
    from tracknoise.paper.claim_verdicts import best_reading, verdicts
    from tracknoise.paper.replication import judged_cells, judged_claims
    from tracknoise.report import paper

    stated, of_tables = judged_claims(replicated), judged_cells(replicated)
    for item in replicated:
        judged = [verdict for verdict in (*stated, *of_tables) if verdict.claim.experiment == item.experiment]
        if item.run:
            show(terminal.result, verdicts(judged, f"{paper.title(item.experiment)}: {_CAPTION}"))
    terminal.result(best_reading(stated))
