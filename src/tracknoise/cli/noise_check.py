"""``tracknoise noise check``: whether a noise model, or what a front end reports itself, is right on other scenes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.options import DebugOption, QuietOption

if TYPE_CHECKING:
    from tracknoise.noise_models.calibration import Calibration


def register(app: typer.Typer) -> None:
    """Add the command to those of ``tracknoise noise``."""
    app.command("check", no_args_is_help=True)(check)


def check(
    context: typer.Context,
    file: Annotated[Path | None, typer.Argument(help="Noise model, as `tracknoise noise fit` writes it.")] = None,
    on: Annotated[Path | None, typer.Option("--on", help="Folder of a finished run of other scenes.")] = None,
    scene: Annotated[
        list[str] | None, typer.Option("--scene", help="Only this scene of the run; may be repeated.")
    ] = None,
    own: Annotated[
        str | None,
        typer.Option("--own", help="Check the covariances of columns quality_NAME_uu, _uv, _vv, not a model."),
    ] = None,
    tracker: Annotated[str | None, typer.Option("--tracker", help="Tracker of the run, with --own.")] = None,
    speed: Annotated[int, typer.Option("--speed", min=1, help="Speed of the run, with --own.")] = 1,
    figure: Annotated[
        Path | None, typer.Option("--figure", help="Write the reliability plot to this file: .svg or .png.")
    ] = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Check whether predicted covariances describe the errors of a run: coverage, NEES, likelihood, ENCE.

    Example: `tracknoise noise check lucas-kanade@1.noise.json --on runs/other`
    """
    from tracknoise.cli.text_table import show
    from tracknoise.report.calibration_cells import calibration_cells, calibration_sentences, reliability_cells

    kind = None if figure is None else _kind(figure)
    found = _found(file, on, scene, own, tracker, speed)
    context.obj.result("\n".join(calibration_sentences(found)))
    for cells in (calibration_cells(found), reliability_cells(found)):
        context.obj.result("")
        show(context.obj.result, cells)
    if figure is not None and kind is not None:
        _draw(found, str(file or own), figure, kind)
        context.obj.result(f"\nwritten: {figure}")
    return 0


def _kind(path: Path) -> str:
    """Format of a figure, by the name of its file."""
    from tracknoise.exceptions import SettingsError
    from tracknoise.report.export import FORMATS

    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise SettingsError(f"--figure {path}: found a name that ends in {path.suffix!r}, expected .svg or .png")
    return kind


def _draw(found: "Calibration", what: str, path: Path, kind: str) -> None:
    from tracknoise.report.export import render, specification
    from tracknoise.report.figures.reliability import reliability
    from tracknoise.tables.files import write_atomically

    figure = reliability(found, title=f"Reliability of {what}")
    write_atomically(path, render(specification(figure), (kind,))[kind])


def _found(
    file: Path | None, on: Path | None, scenes: list[str] | None, own: str | None, tracker: str | None, speed: int
) -> "Calibration":
    from tracknoise.exceptions import SettingsError
    from tracknoise.noise_models.calibration import check_model, check_own
    from tracknoise.noise_models.noise_model import NoiseModel
    from tracknoise.tables.store import RunFolder

    if on is None:
        raise SettingsError("no --on RUN, expected the run whose errors are compared")
    if own is not None:
        if tracker is None or file is not None:
            raise SettingsError("--own NAME: found no --tracker or a model as well, expected --tracker alone")
        return check_own(RunFolder(on), tracker=tracker, speed=speed, name=own, scenes=scenes)
    if file is None:
        raise SettingsError("no FILE, expected a noise model, or --own NAME")
    return check_model(NoiseModel.read(file), RunFolder(on), scenes=scenes)
