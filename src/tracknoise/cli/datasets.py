"""``tracknoise datasets``: which formats can be read, and what lies in a folder."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.listing import listing
from tracknoise.cli.terminal import DebugOption


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("datasets")(datasets)


def datasets(
    context: typer.Context,
    reader: Annotated[str | None, typer.Argument(help="List the sequences that this reader finds.")] = None,
    data: Annotated[Path | None, typer.Option("--data", "-d", help="Folder of the data.")] = None,
    debug: DebugOption = False,
) -> int:
    """List the formats that can be read, or the sequences of a data set by scene and lighting.

    Example: `tracknoise datasets sevenscenes --data /data/7scenes`
    """
    from tracknoise.sequences.registry import READERS, make_reader

    if reader is None:
        context.obj.result(listing({name: READERS.load(name).description for name in READERS.names()}))
        return 0
    made = make_reader(reader, data)
    for item in made.sequences():
        rotation = f"  rotated {item.rotation}" if item.rotation else ""
        context.obj.result(f"{item.scene}  {item.lighting}{rotation}")
    return 0
