"""``tracknoise tournament``: your tracker among those of known systems, on the same scenes."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.shared_options import (
    DataOption,
    DebugOption,
    FreshOption,
    QuietOption,
    RunFolderOption,
    TrackersOption,
    WorkersOption,
    parse_names,
    processes,
)


def tournament(
    context: typer.Context,
    experiment: Annotated[
        str,
        typer.Argument(metavar="EXPERIMENT", help="An experiment file (TOML) with your trackers, or a preset."),
    ] = "tournament",
    data: DataOption = None,
    out: RunFolderOption = None,
    trackers: TrackersOption = None,
    workers: WorkersOption = None,
    fresh: FreshOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Rank trackers: those of an experiment, the built-in ones, and the settings of known systems.

    Prints for each what to set, its ranks, and the CPU time of a step. A tracker of rank 2 to 5 is shown to be worse
    than one other. An interrupted tournament resumes when the same command is run again.

    Examples: `tracknoise tournament`, `tracknoise tournament mine.toml --data /data/mine --trackers mine,openvins,svo`
    """
    from tracknoise.cli.progress import RunProgress
    from tracknoise.cli.run_summary import print_outcome
    from tracknoise.exceptions import TracknoiseError
    from tracknoise.experiments.entrants import entrants, step_costs
    from tracknoise.experiments.execute import execute
    from tracknoise.experiments.load import load_experiment
    from tracknoise.tables.costs import write_costs
    from tracknoise.tables.store import RunFolder

    context.obj.resumes(fresh=fresh)
    own = load_experiment(experiment, root=data)
    named = entrants(own) if trackers is None else parse_names(trackers)
    loaded = load_experiment(experiment, root=data, speeds=[min(own.speeds)], trackers=named)
    out = out or Path("runs") / (loaded.name if loaded.name == "tournament" else f"{loaded.name}-tournament")
    run = RunFolder(out)
    with RunProgress(context.obj) as shown:
        outcome = execute(loaded, run, listener=shown, workers=processes(workers), fresh=fresh, debug=debug)
    if outcome.measured:
        context.obj.say("measuring the time of a step")
        try:
            write_costs(run, step_costs(loaded, run.manifest().sequences))
        except TracknoiseError as error:
            context.obj.say(f"note: no times of steps: {error}")
    return print_outcome(context.obj, out, outcome, report=True, ranked=True)
