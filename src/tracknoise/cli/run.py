"""``tracknoise run``: measure the experiment of a file or preset, and write the report."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.shared_options import (
    DebugOption,
    FramesOption,
    FreshOption,
    ModelsOption,
    QuietOption,
    ScenesOption,
    SchedulerOption,
    SpeedsOption,
    TableOption,
    TrackersOption,
    WorkersOption,
    parse_frames,
    parse_names,
    processes,
)
from tracknoise.cli.terminal import write_result
from tracknoise.sequences.frame_range import parse_numbers

_PRESETS = "demo, dtu, gazebo-arvr, gazebo-linear, kitti, tournament"


def _print_schema(asked: bool) -> None:
    if asked:
        from tracknoise.experiments.settings import experiment_schema

        write_result(experiment_schema())
        raise typer.Exit


def run(
    context: typer.Context,
    experiment: Annotated[str, typer.Argument(help=f"An experiment file (TOML) or a preset: {_PRESETS}.")],
    data: Annotated[Path | None, typer.Option("--data", "-d", help="Folder of the data.")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Run folder (default: runs/NAME).")] = None,
    scenes: ScenesOption = None,
    frames: FramesOption = None,
    speeds: SpeedsOption = None,
    trackers: TrackersOption = None,
    models: ModelsOption = None,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    fresh: FreshOption = False,
    verify: Annotated[
        bool, typer.Option("--verify", help="Compare images and depth maps by content with those that were measured.")
    ] = False,
    check: Annotated[
        Path | None,
        typer.Option(
            "--check", help="What `tracknoise check --json-file` wrote: the run says what it changed in that verdict."
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A first answer in about a minute, from five clips of 60 frames; no report.")
    ] = False,
    report: Annotated[bool, typer.Option(help="Write the report.")] = True,
    table: TableOption = False,
    schema: Annotated[
        bool,
        typer.Option(
            "--schema", help="Print the JSON Schema of experiment files.", callback=_print_schema, is_eager=True
        ),
    ] = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Measure the experiment of a file or preset, and write the report.

    An interrupted run resumes when the same command is run again.

    Examples: `tracknoise run examples/sevenscenes.toml --data /data/7scenes --out runs/7scenes`,
    `tracknoise run recording.toml --quick`
    """
    from tracknoise.cli.progress import RunProgress
    from tracknoise.cli.run_summary import print_outcome
    from tracknoise.experiments.execute import execute
    from tracknoise.experiments.load import load_experiment
    from tracknoise.experiments.plan import plan
    from tracknoise.tables.store import RunFolder
    from tracknoise.truth_faults.check_change import CHECK_JSON, read_check

    context.obj.resumes(fresh=fresh)
    checked = None if check is None else read_check(check)
    options = {} if models is None else {"models": str(models.resolve())}
    loaded = load_experiment(
        experiment,
        root=data,
        scenes=scenes,
        frames=parse_frames(frames),
        speeds=None if speeds is None else parse_numbers("--speeds", speeds, ",", "whole numbers such as 1,2,4"),
        trackers=None if trackers is None else parse_names(trackers),
        options=options,
    )
    if quick:
        loaded = loaded.quick(len({task.sequence.scene for task in plan(loaded)}))
    out = out or Path("runs") / loaded.name
    folder = RunFolder(out)
    with RunProgress(context.obj) as shown:
        outcome = execute(
            loaded,
            folder,
            listener=shown,
            workers=processes(workers),
            scheduler=scheduler,
            fresh=fresh,
            verify=verify,
            debug=debug,
        )
    if checked is not None and outcome.measured:
        folder.write_statistics({}, documents={CHECK_JSON: checked})
    return print_outcome(context.obj, out, outcome, report=report and not quick, table=table, quick=quick)
