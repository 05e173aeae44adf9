"""``tracknoise noise export``: the noise of a model in the syntax of an estimator."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.options import DebugOption
from tracknoise.noise_models.exports.export import FocalChange, RateChange, Target
from tracknoise.noise_models.model import Purpose

if TYPE_CHECKING:
    from collections.abc import Mapping


def register(app: typer.Typer) -> None:
    """Add the command to those of ``tracknoise noise``."""
    app.command("export", no_args_is_help=True)(export_command)


def export_command(
    context: typer.Context,
    file: Annotated[Path | None, typer.Argument(help="Noise model, as `tracknoise noise fit` writes it.")] = None,
    to: Annotated[str | None, typer.Option("--to", help="Estimator: see --list.")] = None,
    focal: Annotated[float | None, typer.Option("--focal", help="Focal length of its images, px.")] = None,
    rate: Annotated[float | None, typer.Option("--rate", help="Frames that it uses per second.")] = None,
    window: Annotated[int | None, typer.Option("--window", min=2, help="Length of its window, frames.")] = None,
    purpose: Annotated[Purpose | None, typer.Option("--purpose", help="What its sigma must make right.")] = None,
    allow_focal: Annotated[
        FocalChange | None, typer.Option("--allow-focal", help="Why its focal length is not that of the model.")
    ] = None,
    allow_rate: Annotated[
        RateChange | None, typer.Option("--allow-rate", help="Why its rate is not that of the model.")
    ] = None,
    tracks: Annotated[
        Path | None, typer.Option("--tracks", help="Tracks for `--to csv`: a run folder, or a file of tracks.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for the files. By default, print them.")] = None,
    show_list: Annotated[bool, typer.Option("--list", help="List the estimators.")] = False,
    debug: DebugOption = False,
) -> int:
    """Write the noise of a model in the syntax of an estimator, and say what it makes right.

    A focal length or a rate that the model was not measured at is refused. See docs/estimators/exports.md.

    Example: `tracknoise noise export lk.noise.json --to openvins --focal 458.6 --rate 20 -o config`
    """
    from tracknoise.exceptions import SettingsError
    from tracknoise.noise_models.exports.render import export
    from tracknoise.noise_models.noise_model import NoiseModel

    if show_list:
        context.obj.result(_estimators())
        return 0
    if file is None or to is None:
        raise SettingsError(f"no {'FILE' if file is None else '--to'}, expected a noise model and an estimator")
    target = Target(
        focal_px=focal,
        rate_hz=rate,
        focal_change=allow_focal,
        rate_change=allow_rate,
        window=window,
        purpose=purpose,
    )
    model = NoiseModel.read(file)
    found = export(model, to, target=target, source=file.name)
    files = {**found.files, **({} if found.patch is None else {f"{to}.patch": found.patch}), f"{to}.txt": found.text}
    if out is None:
        context.obj.result("\n".join(f"==> {name} <==\n{content}" for name, content in files.items()).rstrip())
    else:
        _write(out, files)
        context.obj.result("\n".join(f"written: {(out / name).resolve()}" for name in files))
    return 0


def _estimators() -> str:
    """Names of estimators and what is written for them, then those that are refused, with the reason."""
    from tracknoise.cli.listing import listing
    from tracknoise.noise_models.exports.estimators import estimators, refused

    known = listing({name: f"{about.title}: {about.unit}" for name, about in estimators().items()})
    without = listing({name: f"{about.title}: {about.why}" for name, about in refused().items()})
    return f"{known}\n\nWithout an export:\n{without}"


def _write(folder: Path, files: "Mapping[str, str]") -> None:
    from tracknoise.tables.files import write_atomically

    for name, content in files.items():
        write_atomically(folder / name, content.encode())
