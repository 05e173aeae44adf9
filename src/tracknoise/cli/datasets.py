"""``tracknoise datasets``: the dataset formats, and the sequences of a dataset."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.listing import listing
from tracknoise.cli.options import DebugOption


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("datasets")(datasets)


def datasets(
    context: typer.Context,
    reader: Annotated[str | None, typer.Argument(help="Reader whose sequences to list.")] = None,
    data: Annotated[Path | None, typer.Option("--data", "-d", help="Folder of the data.")] = None,
    debug: DebugOption = False,
) -> int:
    """List the dataset formats that can be read, or the scene and lighting of each sequence of a dataset.

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
