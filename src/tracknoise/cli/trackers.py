"""``tracknoise trackers``: which trackers there are, and their settings."""

from typing import Annotated

import typer

from tracknoise.cli.listing import listing
from tracknoise.cli.terminal import DebugOption


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("trackers")(trackers)


def trackers(
    context: typer.Context,
    kind: Annotated[str | None, typer.Argument(help="Show the settings of this one.")] = None,
    debug: DebugOption = False,
) -> int:
    """List the trackers, or the settings of one with their defaults, as an experiment file has them.

    Example: `tracknoise trackers lucas-kanade`
    """
    from tracknoise.trackers.registry import TRACKERS, tracker_defaults

    if kind is None:
        context.obj.result(listing({name: TRACKERS.load(name).description for name in TRACKERS.names()}))
    else:
        context.obj.result(tracker_defaults(kind))
    return 0
