"""``tracknoise noise``: noise models, for estimators."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli import noise_check, noise_export, noise_table
from tracknoise.cli.options import DebugOption, QuietOption

if TYPE_CHECKING:
    from tracknoise.noise_models.noise_model import NoiseModel
    from tracknoise.noise_models.run_models import RunModels


def register(app: typer.Typer) -> None:
    """Add the commands."""
    noise = typer.Typer(no_args_is_help=True)
    noise.command("fit", no_args_is_help=True)(fit)
    noise.command("show", no_args_is_help=True)(show_model)
    noise_table.register(noise)
    noise_check.register(noise)
    noise_export.register(noise)
    app.add_typer(noise, name="noise", help="Fit noise models to a run, check them, and export them to estimators.")


def fit(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Folder of a finished run.")],
    tracker: Annotated[list[str] | None, typer.Option("--tracker", help="Only this tracker; may be repeated.")] = None,
    speed: Annotated[list[int] | None, typer.Option("--speed", help="Only this speed; may be repeated.")] = None,
    scene: Annotated[
        list[str] | None, typer.Option("--scene", help="Fit to this scene (default: all); may be repeated.")
    ] = None,
    window: Annotated[int, typer.Option("--window", min=2, help="Length of the windows that are shown, frames.")] = 10,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the models.")] = Path(),
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Write a noise model of each tracker and speed of a run, and print what to assume.

    Models of the lowest speed are those that the run fitted; others are fitted now.

    A model is written as TRACKER@SPEED.noise.json. `tracknoise noise export` writes it in the syntax of an estimator.
    Trackers and speeds with too few errors are named, and have no model.

    Example: `tracknoise noise fit runs/demo -o models`
    """
    from tracknoise.exceptions import SettingsError
    from tracknoise.noise_models.fitting.training_tables import chosen_conditions
    from tracknoise.noise_models.noise_model import NoiseModel
    from tracknoise.noise_models.run_models import run_models
    from tracknoise.report.noise_model_cells import model_sentences
    from tracknoise.tables.store import RunFolder

    wanted = chosen_conditions(RunFolder(run), trackers=tracker, speeds=speed)
    kept = run_models(RunFolder(run))
    failed = list[SettingsError]()
    stems = _stems(wanted)
    for name, played in wanted:
        own = kept.models.get(name) if played == kept.speed and scene is None else None
        if own is None:
            context.obj.say(f"{name} at speed {played}: fitted now, because {_why_anew(kept, played, scene)}")
        try:
            model = NoiseModel.fit(run, tracker=name, speed=played, scenes=scene) if own is None else own
        except SettingsError as error:
            failed.append(error)
            context.obj.warn(f"{name} at speed {played} has no model: {error}")
            continue
        path = out / f"{stems[name]}@{played}.noise.json"
        model.write(path)
        context.obj.result("\n".join(model_sentences(model)))
        _show(context, model, window)
        context.obj.result(f"written: {path}\n")
    if len(failed) == len(wanted):
        raise failed[-1]
    return 0


def _why_anew(kept: "RunModels", speed: int, scenes: list[str] | None) -> str:
    """Why the analysis of a run has no such model."""
    if scenes is not None:
        return "the models of the run are fitted to all scenes"
    if kept.speed is not None and speed != kept.speed:
        return f"the models of the run are those of speed {kept.speed}"
    return "the run has no model of it"


def show_model(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="Noise model, as `tracknoise noise fit` writes it.")],
    window: Annotated[int, typer.Option("--window", min=2, help="Length of the windows that are shown, frames.")] = 10,
    header: Annotated[bool, typer.Option("--header", help="Print the model as a C++ header.")] = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Show a noise model: its components, and the standard deviations to assume.

    Example: `tracknoise noise show lucas-kanade@1.noise.json`
    """
    from tracknoise.noise_models.cpp_header import cpp_header
    from tracknoise.noise_models.noise_model import NoiseModel
    from tracknoise.report.noise_model_cells import model_sentences

    model = NoiseModel.read(file)
    if header:
        context.obj.result(cpp_header(model))
        return 0
    context.obj.result("\n".join(model_sentences(model)))
    _show(context, model, window)
    return 0


def _stems(wanted: list[tuple[str, int]]) -> dict[str, str]:
    """Names of trackers as parts of file names: as they are, unless they have signs that files should not have."""
    from tracknoise.tables.identity import identifiers

    plain = identifiers(sorted({name for name, _ in wanted}))
    return {name: name if re.fullmatch(r"\w[\w .+()-]*", name) else plain[name] for name in plain}


def _show(context: typer.Context, model: "NoiseModel", window: int) -> None:
    from tracknoise.cli.text_table import show
    from tracknoise.report.noise_model_cells import component_cells, equivalent_cells

    for cells in (component_cells(model), equivalent_cells(model, window)):
        context.obj.result("")
        show(context.obj.result, cells)
