"""``tracknoise noise export``: the noise of a model in the syntax of an estimator."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.options import DebugOption, QuietOption

if TYPE_CHECKING:
    from tracknoise.noise_models.exports.export import Export, Target


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
    purpose: Annotated[
        str | None, typer.Option("--purpose", help="What to make right: innovations, all_poses, newest_pose or depth.")
    ] = None,
    allow_focal: Annotated[
        str | None, typer.Option("--allow-focal", help="Why the focal length is another one: resampled or lens.")
    ] = None,
    allow_rate: Annotated[
        str | None, typer.Option("--allow-rate", help="Why the rate is another one: thinned or unchecked.")
    ] = None,
    tracks: Annotated[
        Path | None, typer.Option("--tracks", help="Tracks for `--to csv`: a run folder, or a file of tracks.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for the files (default: print them).")] = None,
    show_list: Annotated[bool, typer.Option("--list", help="List the estimators.")] = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Write the noise of a model in the syntax of an estimator, and say what it makes right.

    A focal length or a rate that the model was not measured at is refused. See docs/estimators/exports.md.

    Example: `tracknoise noise export lk.noise.json --to openvins --focal 458.6 --rate 20 -o config`
    """
    from tracknoise.exceptions import SettingsError
    from tracknoise.noise_models.exports.estimators import estimator_name

    if show_list:
        context.obj.result(_estimators())
        return 0
    if file is None or to is None:
        raise SettingsError(f"no {'FILE' if file is None else '--to'}, expected a noise model and an estimator")
    target = _target(focal, rate, window, {"purpose": purpose, "allow-focal": allow_focal, "allow-rate": allow_rate})
    name = estimator_name(to)
    files = _files(name, _export(file, name, target, tracks))
    if out is None:
        context.obj.result("\n".join(f"==> {name} <==\n{content}" for name, content in files.items()).rstrip())
        return 0
    _write(out, files)
    context.obj.result("\n".join(f"written: {(out / name).resolve()}" for name in files))
    return 0


def _target(focal: float | None, rate: float | None, window: int | None, named: Mapping[str, str | None]) -> "Target":
    from tracknoise.exceptions import UnknownNameError
    from tracknoise.noise_models.exports.export import FocalChange, RateChange, Target
    from tracknoise.noise_models.model import Purpose

    kinds = {"purpose": Purpose, "allow-focal": FocalChange, "allow-rate": RateChange}
    for option, value in named.items():
        if value is not None and value not in list(kinds[option]):
            raise UnknownNameError(f"value of --{option}", value, kinds[option])
    purpose, allow_focal, allow_rate = named.values()
    return Target(
        focal_px=focal,
        rate_hz=rate,
        focal_change=None if allow_focal is None else FocalChange(allow_focal),
        rate_change=None if allow_rate is None else RateChange(allow_rate),
        window=window,
        purpose=None if purpose is None else Purpose(purpose),
    )


def _export(file: Path, to: str, target: "Target", tracks: Path | None) -> "Export":
    from tracknoise.noise_models.exports.observations import observation_noise
    from tracknoise.noise_models.exports.render import export
    from tracknoise.noise_models.exports.track_files import read_tracks
    from tracknoise.noise_models.noise_model import NoiseModel

    model = NoiseModel.read(file)
    observations = None if tracks is None else observation_noise(model, read_tracks(tracks, model)).write_csv()
    return export(model, to, target=target, source=file.name, observations=observations)


def _files(to: str, found: "Export") -> dict[str, str]:
    """Everything by the name of its file: the files of the estimator, a patch if there is one, and the text."""
    patch = {} if found.patch is None else {f"{to}.patch": found.patch}
    return {**found.files, **patch, f"{to}.txt": found.text}


def _estimators() -> str:
    """Names of estimators and what is written for them, then those that are refused, with the reason."""
    from tracknoise.cli.listing import listing
    from tracknoise.noise_models.exports.estimators import estimators, refused

    known = listing({name: f"{about.title}: {about.unit}" for name, about in estimators().items()})
    without = listing({name: f"{about.title}: {about.why}" for name, about in refused().items()})
    return f"{known}\n\nWithout an export:\n{without}"


def _write(folder: Path, files: Mapping[str, str]) -> None:
    from tracknoise.tables.files import write_atomically

    for name, content in files.items():
        write_atomically(folder / name, content.encode())
