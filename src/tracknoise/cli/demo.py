"""``tracknoise demo``: the whole measurement on the built-in simulation."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.run import WorkersOption, run_experiment
from tracknoise.cli.terminal import DebugOption, QuietOption


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("demo")(demo)


def demo(
    context: typer.Context,
    out: Annotated[Path, typer.Option("--out", "-o", help="Run folder, replaced.")] = Path("runs/demo"),
    workers: WorkersOption = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Measure two trackers at three speeds in eight simulated scenes, from nothing, and write the report.

    Example: `tracknoise demo`
    """
    from tracknoise.experiments.load import load_experiment

    return run_experiment(context.obj, load_experiment("demo"), out, workers, fresh=True, report=True)
