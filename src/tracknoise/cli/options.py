"""Options that several commands share, so that they have the same name and help everywhere."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.sequences.frame_range import frames_of


def _remember_debug(context: typer.Context, value: bool) -> bool:
    context.obj.debug = value
    return value


def parse_frames(text: str | None) -> int | list[int] | None:
    """Number of frames, or first, last and step; None where the option is not given.

    Raises
    ------
    SettingsError
        If it is neither.
    """
    return None if text is None else frames_of("--frames", text)


def parse_names(text: str) -> list[str]:
    """Names separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def _remember_quiet(context: typer.Context, value: bool) -> bool:
    context.obj.quiet = value
    return value


DebugOption = Annotated[
    bool, typer.Option("--debug", help="Show a traceback on errors.", callback=_remember_debug, is_eager=True)
]
QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print results and errors only.", callback=_remember_quiet, is_eager=True)
]
WorkersOption = Annotated[
    int | None, typer.Option("--workers", "-w", min=1, help="Worker processes (default: one per core).")
]
ScenesOption = Annotated[int | None, typer.Option("--scenes", min=1, help="Maximum number of scenes, sorted by name.")]
FramesOption = Annotated[
    str | None,
    typer.Option(
        "--frames",
        metavar="N|FIRST:LAST[:STEP]",
        help="Maximum number of frames per scene, or which frames, counted from 0, the last included.",
    ),
]
SpeedsOption = Annotated[str | None, typer.Option("--speeds", help="Speeds, separated by commas: 1,2,4.")]
TrackersOption = Annotated[
    str | None,
    typer.Option("--trackers", help="Trackers by name or kind, separated by commas: lucas-kanade,correspondence."),
]
ModelsOption = Annotated[
    Path | None, typer.Option("--models", help="Folder of Gazebo models, for simulated worlds that use them.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        help="Use the workers of the Dask scheduler at this address: tls://HOST:8786, or tcp:// in a trusted network.",
    ),
]
FreshOption = Annotated[bool, typer.Option("--fresh", help="Delete the run in this folder and start a new one.")]
