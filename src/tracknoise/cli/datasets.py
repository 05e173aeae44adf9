"""``tracknoise datasets``: the dataset formats, the options of a reader, and the sequences of a dataset."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.listing import listing
from tracknoise.cli.options import DebugOption

if TYPE_CHECKING:
    from tracknoise.cli.terminal import Terminal


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("datasets")(datasets)


def datasets(
    context: typer.Context,
    reader: Annotated[
        str | None, typer.Argument(help="Reader whose options to show, or sequences if --data is given.")
    ] = None,
    data: Annotated[Path | None, typer.Option("--data", "-d", help="Folder of the data.")] = None,
    debug: DebugOption = False,
) -> int:
    """List the dataset formats, the options of a reader with their defaults, or the sequences of a dataset.

    Examples: `tracknoise datasets kitti`, `tracknoise datasets sevenscenes --data /data/7scenes`
    """
    from tracknoise.sequences.registry import READERS, reader_defaults

    if reader is None:
        context.obj.result(listing({name: READERS.load(name).description for name in READERS.names()}))
        return 0
    if data is None:
        context.obj.result(reader_defaults(reader) or f"# the reader {reader} has no options")
        if READERS.load(reader).needs_root:
            return 0
        context.obj.result("")
    _print_sequences(context.obj, reader, data)
    return 0


def _print_sequences(terminal: "Terminal", reader: str, data: Path | None) -> None:
    """One line per sequence: scene, lighting and, if it is turned, rotation."""
    from tracknoise.sequences.registry import make_reader

    for item in make_reader(reader, data).sequences():
        rotation = f"  rotated {item.rotation}" if item.rotation else ""
        terminal.result(f"{item.scene}  {item.lighting}{rotation}")
