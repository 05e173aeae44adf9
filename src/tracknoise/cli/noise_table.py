"""``tracknoise noise table``: noise by tracker, speed and motion."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.options import DebugOption, JsonCommand, JsonFileOption, JsonOption, QuietOption, write_json

if TYPE_CHECKING:
    from tracknoise.noise_models.lookup.noise_table import NoiseTable


def register(app: typer.Typer) -> None:
    """Add the command to those of ``tracknoise noise``."""
    app.command("table", cls=JsonCommand, no_args_is_help=True)(table)


def table(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Folder of a finished run.")],
    tracker: Annotated[list[str] | None, typer.Option("--tracker", help="Only this tracker; may be repeated.")] = None,
    speed: Annotated[list[int] | None, typer.Option("--speed", help="Only this speed; may be repeated.")] = None,
    window: Annotated[int, typer.Option("--window", min=3, help="Length of windows, frames.")] = 10,
    as_json: JsonOption = False,
    json_file: JsonFileOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for noise-table.csv and noise-table.json.")
    ] = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Print covariance and bias by tracker, speed and motion, and what the table gains on scenes that were left out.

    The motion of a scene is its group: see `groups` in the section `dataset` of an experiment.

    Example: `tracknoise noise table runs/demo -o tables`
    """
    from tracknoise.noise_models.lookup.files import noise_table_csv, noise_table_json
    from tracknoise.noise_models.lookup.noise_table import noise_table
    from tracknoise.tables.files import write_atomically
    from tracknoise.tables.store import RunFolder

    found = noise_table(RunFolder(run), trackers=tracker, speeds=speed, window=window)
    write_json(context.obj, noise_table_json(found), as_json=as_json, file=json_file)
    if not as_json:
        _print(context, found)
    files = {"noise-table.csv": noise_table_csv, "noise-table.json": noise_table_json} if out else {}
    for name, content in files.items():
        path = Path(out or ".") / name
        write_atomically(path, content(found).encode())
        (context.obj.say if as_json else context.obj.result)(f"written: {path}")
    return 0


def _print(context: typer.Context, found: "NoiseTable") -> None:
    from tracknoise.cli.text_table import show
    from tracknoise.report.noise_table_cells import gain_cells, noise_table_cells, noise_table_sentences

    context.obj.result("\n".join(noise_table_sentences(found)))
    for cells in (noise_table_cells(found), gain_cells(found)):
        context.obj.result("")
        show(context.obj.result, cells)
