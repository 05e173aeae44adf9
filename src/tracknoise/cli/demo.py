"""``tracknoise demo``: a complete measurement on simulated scenes."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.shared_options import DebugOption, QuietOption, processes, text


def demo(
    context: typer.Context,
    out: Annotated[Path, text("--out", "-o", metavar="FOLDER", help="Run folder; an earlier run is replaced.")] = Path(
        "runs/demo"
    ),
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Measure two trackers at two speeds in eight simulated scenes, and write the report. No data are needed.

    Example: `tracknoise demo`
    """
    from tracknoise.cli.progress import RunProgress
    from tracknoise.cli.run_summary import print_outcome
    from tracknoise.experiments.execute import execute
    from tracknoise.experiments.load import load_experiment
    from tracknoise.tables.store import RunFolder

    experiment, run = load_experiment("demo"), RunFolder(out)
    with RunProgress(context.obj) as shown:
        outcome = execute(experiment, run, listener=shown, workers=processes(None), fresh=True, debug=debug)
    return print_outcome(context.obj, out, outcome, report=True)
