"""``tracknoise tournament``: your tracker among those of known systems, on the same scenes."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    text,
    write_files,
)

if TYPE_CHECKING:
    from tracknoise.cli.terminal import Terminal
    from tracknoise.experiments.execute import Outcome
    from tracknoise.experiments.settings import Experiment
    from tracknoise.report.results_file import Results
    from tracknoise.tables.store import RunFolder


def tournament(
    context: typer.Context,
    experiment: Annotated[
        str,
        typer.Argument(metavar="EXPERIMENT", help="An experiment file (TOML) with your trackers, or a preset."),
    ] = "tournament",
    data: DataOption = None,
    out: RunFolderOption = None,
    trackers: TrackersOption = None,
    to: Annotated[
        Path | None, text("--to", metavar="FILE", help="Add the results to this file (JSON): one round of it.")
    ] = None,
    add: Annotated[
        Path | None,
        text("--add", metavar="FILE", help="Measure the trackers of this experiment file in every round of --to."),
    ] = None,
    workers: WorkersOption = None,
    fresh: FreshOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Rank trackers: those of an experiment, the built-in ones, and the settings of known systems.

    Prints which tracker to take and what to set, and for each its errors, lifetime, outliers, ranks, and the CPU time
    of a step. An interrupted tournament resumes when the same command is run again. With --add, trackers are measured
    on the data of each round of a file of results, and join it where data, truth, settings and libraries are the same;
    --data is then the folder that contains the recordings.

    Examples: `tracknoise tournament`, `tracknoise tournament mine.toml --data /data/mine --trackers mine,openvins,svo`,
    `tracknoise tournament --add mine.toml --to docs/benchmark.json`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.cli.run_summary import print_outcome
    from tracknoise.experiments.entrants import entrants
    from tracknoise.experiments.load import load_experiment
    from tracknoise.report.results_file import Results, read_results

    context.obj.resumes(fresh=fresh)
    require_outputs([("--to", to)], inputs=[add], are_reports=True)
    measure = partial(_measured, context.obj, workers=processes(workers), fresh=fresh, debug=debug)
    if add is not None:
        return _add(context.obj, add, to, data, out or Path("runs") / "rounds", measure)
    results = None if to is None else read_results(to) if to.exists() else Results()
    own = load_experiment(experiment, root=data)
    named = entrants(own) if trackers is None else parse_names(trackers)
    loaded = load_experiment(experiment, root=data, speeds=[min(own.speeds)], trackers=named)
    out = out or Path("runs") / (loaded.name if loaded.name == "tournament" else f"{loaded.name}-tournament")
    run, outcome = measure(loaded, out)
    status = print_outcome(context.obj, out, outcome, report=True, ranked=True)
    if results is not None and to is not None and not status:
        _join(context.obj, to, results, loaded.name, run)  # its leaderboard was printed
    return status


def _measured(
    terminal: "Terminal", experiment: "Experiment", out: Path, *, workers: int, fresh: bool, debug: bool
) -> tuple["RunFolder", "Outcome"]:
    """Measure trackers, and the time of a step of each."""
    from tracknoise.cli.progress import RunProgress
    from tracknoise.exceptions import TracknoiseError
    from tracknoise.experiments.entrants import step_costs
    from tracknoise.experiments.execute import execute
    from tracknoise.tables.costs import write_costs
    from tracknoise.tables.store import RunFolder

    run = RunFolder(out)
    with RunProgress(terminal) as shown:
        outcome = execute(experiment, run, listener=shown, workers=workers, fresh=fresh, debug=debug)
    if outcome.measured:
        terminal.say("measuring the time of a step")
        try:
            write_costs(run, step_costs(experiment, run.manifest().sequences))
        except TracknoiseError as error:
            terminal.say(f"note: no times of steps: {error}")
    return run, outcome


def _add(
    terminal: "Terminal",
    add: Path,
    to: Path | None,
    data: Path | None,
    out: Path,
    measure: Callable[["Experiment", Path], tuple["RunFolder", "Outcome"]],
) -> int:
    """Measure trackers in every round of a file of results. Returns the exit status: 2 if a round was left out."""
    from tracknoise.cli.text_table import show
    from tracknoise.exceptions import SettingsError
    from tracknoise.experiments.entrants import fitting, of_round
    from tracknoise.experiments.load import load_experiment
    from tracknoise.report.results_file import read_results, standings
    from tracknoise.tables.identity import identifiers

    if to is None:
        raise SettingsError("--add: found no --to, expected the file of results that trackers are added to")
    results, own = read_results(to), load_experiment(add).trackers
    folders = identifiers([*results.rounds])
    left_out = 0
    for name, one in results.rounds.items():
        chosen = fitting(own, [tracker.kind for tracker in one.trackers.values()])
        if not chosen:
            terminal.say(f"note: round {name} is of errors in the other camera: no tracker of {add} takes part")
            continue
        root = None if data is None or not one.folder else data / one.folder
        if one.folder and (root is None or not root.is_dir()):
            terminal.warn(f"round {name} is left out: its data are {one.folder}, expected in the folder of --data")
            left_out += 1
            continue
        run, outcome = measure(of_round(one.experiment, name, chosen, root), out / folders[name])
        if outcome.failures or not outcome.measured:
            terminal.warn(f"round {name} is left out: {next(iter(outcome.failures.values()), 'nothing was measured')}")
            left_out += 1
            continue
        results = _join(terminal, to, results, name, run)
        show(terminal.result, standings(results.rounds[name]).cells(f"{name}: truth {one.truth}. "))
    return 2 if left_out else 0


def _join(terminal: "Terminal", to: Path, results: "Results", name: str, run: "RunFolder") -> "Results":
    """Add the trackers of a run to a round, and write the file."""
    from tracknoise.report.report_data import ReportData
    from tracknoise.report.results_file import joined, results_json, round_of

    made, before = round_of(ReportData.of(run)), results.rounds.get(name)
    new, known = joined(results, name, made), {} if before is None else before.trackers
    for tracker, one in made.trackers.items():
        earlier = known.get(tracker, one)
        if (earlier.kind, earlier.options) != (one.kind, one.options):
            terminal.warn(f"round {name}: {tracker} replaces the results of a tracker of this name with other options")
    write_files({to: lambda: results_json(new)}, terminal.result)
    return new
