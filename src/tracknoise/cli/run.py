"""``tracknoise run``: measure the experiment of a file or preset, and write the report."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.recording_arguments import options_of
from tracknoise.cli.shared_options import (
    DataOption,
    DebugOption,
    FramesOption,
    FreshOption,
    QuietOption,
    RunFolderOption,
    ScenesOption,
    TrackersOption,
    flag,
    parse_frames,
    parse_names,
    parse_whole,
    processes,
    text,
)
from tracknoise.sequences.frame_range import parse_numbers

_PRESETS = "demo, dtu, effects, gazebo-arvr, gazebo-linear, kitti, tournament"


def run(
    context: typer.Context,
    experiment: Annotated[
        str, typer.Argument(metavar="EXPERIMENT", help=f"An experiment file (TOML) or a preset: {_PRESETS}.")
    ],
    data: DataOption = None,
    out: RunFolderOption = None,
    scenes: ScenesOption = None,
    frames: FramesOption = None,
    speeds: Annotated[
        str | None, text("--speeds", metavar="NUMBERS", help="Speeds, separated by commas: 1,2,4.")
    ] = None,
    trackers: TrackersOption = None,
    option: Annotated[
        list[str] | None, text("--option", metavar="NAME=VALUE", help="Option of the reader; repeatable.")
    ] = None,
    workers: Annotated[
        str | None,
        text(
            "--workers",
            "-w",
            metavar="N|ADDRESS",
            help="Worker processes (default: one per core), or a Dask scheduler, tls://HOST:8786 (extra: cluster).",
        ),
    ] = None,
    fresh: FreshOption = False,
    quick: Annotated[
        bool, flag("--quick", help="A first answer in about a minute, from five clips of 60 frames; no report.")
    ] = False,
    report: Annotated[bool, flag("--report/--no-report", help="Write the report.")] = True,
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

    context.obj.resumes(fresh=fresh)
    scheduler = workers if workers is not None and ":" in workers else None
    count = None if workers is None or scheduler else parse_whole("--workers", workers)
    loaded = load_experiment(
        experiment,
        root=data,
        scenes=scenes,
        frames=parse_frames(frames),
        speeds=None if speeds is None else parse_numbers("--speeds", speeds, ",", "whole numbers such as 1,2,4"),
        trackers=None if trackers is None else parse_names(trackers),
        options=options_of(option),
    )
    if quick:
        loaded = loaded.quick(len({task.sequence.scene for task in plan(loaded)}))
    out = out or Path("runs") / loaded.name
    with RunProgress(context.obj) as shown:
        outcome = execute(
            loaded,
            RunFolder(out),
            listener=shown,
            workers=processes(count),
            scheduler=scheduler,
            fresh=fresh,
            debug=debug,
        )
    return print_outcome(context.obj, out, outcome, report=report and not quick, quick=quick)
