"""``tracknoise trackers``: the trackers and their settings."""

from typing import Annotated

import typer

from tracknoise.cli.shared_options import DebugOption, QuietOption
from tracknoise.cli.terminal import listing


def trackers(
    context: typer.Context,
    kind: Annotated[str | None, typer.Argument(metavar="TRACKER", help="Tracker whose settings to show.")] = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """List the trackers, or the settings of one tracker with their defaults, in the syntax of an experiment file.

    Presets have the settings of a system, each with its source, and state what that system does otherwise.

    Example: `tracknoise trackers lucas-kanade`
    """
    from tracknoise.trackers.tracker_registry import descriptions, tracker_defaults

    if kind is None:
        context.obj.result("\n\n".join(map(listing, descriptions())))
    else:
        context.obj.result(tracker_defaults(kind))
    return 0
