"""``tracknoise run``: measure what an experiment file or preset describes, and write the report."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.terminal import DebugOption, QuietOption, Terminal

if TYPE_CHECKING:
    from tracknoise.experiments.running.execute import Outcome
    from tracknoise.experiments.settings import Experiment

_NAMED = 10
"""So many causes of failures are told of in the end, by the sequences that failed of each."""
_PRESETS = "demo, dtu, gazebo-arvr, gazebo-linear, kitti"
WorkersOption = Annotated[int | None, typer.Option("--workers", "-w", min=1, help="Processes; by default one a core.")]
ScenesOption = Annotated[int | None, typer.Option("--scenes", min=1, help="Only so many scenes, the first by name.")]
FramesOption = Annotated[int | None, typer.Option("--frames", min=2, help="Only so many frames of each scene.")]
ModelsOption = Annotated[
    Path | None, typer.Option("--models", help="Folder of Gazebo models, for simulated worlds made of them.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option("--scheduler", help="Address of a Dask scheduler, whose workers are used instead: tcp://HOST:8786."),
]
FreshOption = Annotated[bool, typer.Option("--fresh", help="Replace the run that the folder holds.")]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("run", no_args_is_help=True)(run)


def _print_schema(asked: bool) -> None:
    if asked:
        from tracknoise.experiments.settings import experiment_schema

        sys.stdout.write(experiment_schema())
        raise typer.Exit


def run(
    context: typer.Context,
    experiment: Annotated[str, typer.Argument(help=f"A TOML file, or the name of a preset: {_PRESETS}.")],
    data: Annotated[Path | None, typer.Option("--data", "-d", help="Folder of the data.")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Run folder; by default runs/NAME.")] = None,
    scenes: ScenesOption = None,
    frames: FramesOption = None,
    models: ModelsOption = None,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    fresh: FreshOption = False,
    report: Annotated[bool, typer.Option(help="Write the report.")] = True,
    schema: Annotated[
        bool,
        typer.Option(
            "--schema", help="Print the JSON Schema of experiment files.", callback=_print_schema, is_eager=True
        ),
    ] = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Measure what an experiment file or a preset describes, and write the report.

    A run that was interrupted goes on where it stopped.

    Example: `tracknoise run examples/sevenscenes.toml --data /data/7scenes --out runs/7scenes`
    """
    from tracknoise.experiments.load import load_experiment

    options = {} if models is None else {"models": str(models.resolve())}
    loaded = load_experiment(experiment, root=data, scenes=scenes, frames=frames, options=options)
    out = out or Path("runs") / loaded.name
    return run_experiment(context.obj, loaded, out, workers, scheduler=scheduler, fresh=fresh, report=report)


def processes(workers: int | None) -> int:
    """How many processes measure: as many as were asked for, else one a core."""
    return workers or os.cpu_count() or 1


def run_experiment(
    terminal: Terminal,
    experiment: "Experiment",
    out: Path,
    workers: int | None,
    *,
    scheduler: str | None = None,
    fresh: bool,
    report: bool,
) -> int:
    """Run an experiment, print its summary and where the report is, and return the exit status."""
    from tracknoise.cli.progress import RunProgress
    from tracknoise.cli.report import write
    from tracknoise.cli.summary import summary_text
    from tracknoise.experiments.running.execute import execute
    from tracknoise.tables.store import RunFolder

    folder = RunFolder(out)
    with RunProgress(terminal) as progress:
        outcome = execute(
            experiment,
            folder,
            listener=progress,
            workers=processes(workers),
            scheduler=scheduler,
            fresh=fresh,
            debug=terminal.debug,
        )
    if outcome.measured:
        terminal.result(summary_text(folder))
        if report:
            terminal.result(f"report: {write(terminal, folder)}")
    if not outcome.failures:
        return 0
    if outcome.measured:
        _name_failures(terminal, outcome)
    return 2 if outcome.measured else 1


def _name_failures(terminal: Terminal, outcome: "Outcome") -> None:
    """Say which sequences failed, those of one cause together: their errors may have scrolled away."""
    from tracknoise.report.names import by_statement, together

    failures = outcome.failures
    named = list(by_statement(sorted(failures.items())).values())[:_NAMED]
    rest = len(failures) - sum(map(len, named))
    names = "; ".join([*map(together, named), *([f"{rest} more"] if rest else [])])
    of_all = f"{len(failures)} of {len(failures) + len(outcome.measured)} sequences failed"
    terminal.say(f"{of_all}: {names}; see failures.jsonl. The same command tries them again.")
