"""``tracknoise noise``: noise models, their checks, exports, and tables of noise.

- ``tracknoise noise check``: whether a noise model, or what a front end reports itself, is right on other scenes.
- ``tracknoise noise export``: the noise of a model in the syntax of an estimator.
- ``tracknoise noise table``: noise by tracker, speed and motion.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.shared_options import (
    AcceptTruthOption,
    DebugOption,
    JsonCommand,
    JsonFileOption,
    JsonOption,
    QuietOption,
    require_truth,
    write_json,
)
from tracknoise.cli.terminal import wrapped

if TYPE_CHECKING:
    from tracknoise.estimators.calibration import Calibration
    from tracknoise.estimators.exports import Export, Target
    from tracknoise.estimators.lookup_table import NoiseTable
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.estimators.run_models import RunModels


ForOption = Annotated[
    str, typer.Option("--for", help="Estimator to say what to set in, or a kind: see `noise export --list`.")
]


ForceOption = Annotated[bool, typer.Option("--force", help="Replace the files of another model.")]


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
    speed: Annotated[
        int | None, typer.Option("--speed", min=1, help="Speed of the run, with --own (default: 1).")
    ] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", help="Write the reliability plot to this file: .svg or .png.")
    ] = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Check whether predicted covariances describe the errors of a run: coverage, NEES, likelihood, ENCE.

    Example: `tracknoise noise check lucas-kanade@1.noise.json --on runs/other`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.cli.text_table import show
    from tracknoise.report.noise_cells import calibration_cells, calibration_sentences, reliability_cells

    kind = None if figure is None else _kind(figure)
    require_outputs([("--figure", figure)], inputs=[file, on])
    found = _found(file, on, scene, own, tracker, speed)
    _tell(context, calibration_sentences(found))
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
    from tracknoise.report.figure_files import FORMATS

    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise SettingsError(f"--figure {path}: found a name that ends in {path.suffix!r}, expected .svg or .png")
    return kind


def _draw(found: "Calibration", what: str, path: Path, kind: str) -> None:
    from tracknoise.report.figure_files import render, specification
    from tracknoise.report.figures.noise_models import reliability
    from tracknoise.tables.files import write_atomically

    figure = reliability(found, title=f"Reliability of {what}")
    write_atomically(path, render(specification(figure), (kind,))[kind])


def _found(
    file: Path | None,
    on: Path | None,
    scenes: list[str] | None,
    own: str | None,
    tracker: str | None,
    speed: int | None,
) -> "Calibration":
    from tracknoise.estimators.calibration import check_model, check_own
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.exceptions import SettingsError
    from tracknoise.tables.store import RunFolder

    if on is None:
        raise SettingsError("no --on RUN, expected the run whose errors are compared")
    if own is not None:
        if tracker is None or file is not None:
            raise SettingsError("--own NAME: found no --tracker or a model as well, expected --tracker alone")
        return check_own(RunFolder(on), tracker=tracker, speed=speed or 1, name=own, scenes=scenes)
    if file is None:
        raise SettingsError("no FILE, expected a noise model, or --own NAME")
    if tracker is not None or speed is not None:
        option = "--speed" if tracker is None else "--tracker"
        raise SettingsError(f"{option}: found a noise model, which has its own, expected the option with --own alone")
    return check_model(NoiseModel.read(file), RunFolder(on), scenes=scenes)


def export_command(
    context: typer.Context,
    file: Annotated[Path | None, typer.Argument(help="Noise model, as `tracknoise noise fit` writes it.")] = None,
    to: Annotated[str | None, typer.Option("--to", help="Estimator: see --list.")] = None,
    focal: Annotated[float | None, typer.Option("--focal", help="Focal length of its images, px.")] = None,
    rate: Annotated[float | None, typer.Option("--rate", help="Frames that it uses per second.")] = None,
    window: Annotated[int | None, typer.Option("--window", min=2, help="Length of its window, frames.")] = None,
    purpose: Annotated[
        str | None, typer.Option("--purpose", help="What to make right: innovations, all_poses or newest_pose.")
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
    force: ForceOption = False,
    accept_truth: AcceptTruthOption = False,
    show_list: Annotated[bool, typer.Option("--list", help="List the estimators.")] = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Write the noise of a model in the syntax of an estimator, and say what it makes right.

    A focal length or a rate that the model was not measured at is refused, and so is a model from a truth that is not
    trusted. The verdict on the truth is in a comment of each file. See docs/estimators/exports.md.

    Example: `tracknoise noise export lk.noise.json --to openvins --focal 458.6 --rate 20 -o config`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.estimators.exports import estimator_name, estimators
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.exceptions import SettingsError
    from tracknoise.tables.files import write_atomically

    if show_list:
        context.obj.result(_estimators())
        return 0
    if file is None or to is None:
        raise SettingsError(f"no {'FILE' if file is None else '--to'}, expected a noise model and an estimator")
    target = _target(focal, rate, window, {"purpose": purpose, "allow-focal": allow_focal, "allow-rate": allow_rate})
    name = estimator_name(to)
    if tracks is not None and "observations" not in estimators()[name].needs:
        raise SettingsError(f"--tracks {tracks}: found --to {to}, expected the option with --to csv alone")
    model = NoiseModel.read(file)
    require_truth(model.truth, str(file), accepted=accept_truth)
    exported = _export(model, file, name, target, tracks)
    files = _files(name, exported)
    if out is None:
        context.obj.result("\n".join(f"==> {name} <==\n{content}" for name, content in files.items()).rstrip())
        return 0
    require_outputs([("--out", out / name) for name in files], inputs=[file, tracks])
    _require_same_model(out / f"{name}.txt", model, force=force)
    for name, content in files.items():
        write_atomically(out / name, content.encode())
    whose = "that of the model" if rate is None else "as stated"
    used = "rate: unknown" if exported.rate_hz is None else f"rate: {exported.rate_hz:.6g} Hz, {whose}"
    context.obj.result("\n".join([*(f"written: {(out / name).resolve()}" for name in files), used]))
    return 0


def _require_same_model(path: Path, model: "NoiseModel", *, force: bool) -> None:
    """Refuse to replace the export of another model. `path`: of its text, which every export has."""
    from tracknoise.estimators.exports import is_of
    from tracknoise.exceptions import SettingsError
    from tracknoise.foreign_files import is_regular_file

    if force or not is_regular_file(path) or is_of(path.read_text(encoding="utf-8", errors="replace"), model.sha256):
        return
    raise SettingsError(f"--out {path.parent}: found {path.name} of another model, expected another folder, or --force")


def _target(focal: float | None, rate: float | None, window: int | None, named: Mapping[str, str | None]) -> "Target":
    from tracknoise.estimators.exports import FocalChange, RateChange, Target
    from tracknoise.estimators.model import Purpose
    from tracknoise.exceptions import UnknownNameError

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


def _export(model: "NoiseModel", file: Path, to: str, target: "Target", tracks: Path | None) -> "Export":
    from tracknoise.estimators.export_render import export
    from tracknoise.estimators.observation_noise import observation_noise, read_tracks

    observations = None if tracks is None else observation_noise(model, read_tracks(tracks, model)).write_csv()
    return export(model, to, target=target, source=file.name, observations=observations)


def _files(to: str, found: "Export") -> dict[str, str]:
    """Everything by the name of its file: the files of the estimator, a patch if there is one, and the text."""
    patch = {} if found.patch is None else {f"{to}.patch": found.patch}
    return {**found.files, **patch, f"{to}.txt": found.text}


def _estimators() -> str:
    """Names of estimators and what is written for them, then those that are refused, with the reason."""
    from tracknoise.cli.terminal import listing
    from tracknoise.estimators.exports import estimators, refused

    known = listing({name: f"{about.title}: {about.unit}" for name, about in estimators().items()})
    without = listing({name: f"{about.title}: {about.why}" for name, about in refused().items()})
    return f"{known}\n\nWithout an export:\n{without}"


def table(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Folder of a finished run.")],
    tracker: Annotated[list[str] | None, typer.Option("--tracker", help="Only this tracker; may be repeated.")] = None,
    speed: Annotated[list[int] | None, typer.Option("--speed", help="Only this speed; may be repeated.")] = None,
    window: Annotated[int, typer.Option("--window", min=3, help="Length of windows, frames.")] = 11,
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
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.estimators.lookup_table import noise_table, noise_table_csv, noise_table_json
    from tracknoise.tables.files import write_atomically
    from tracknoise.tables.store import RunFolder

    files = {out / "noise-table.csv": noise_table_csv, out / "noise-table.json": noise_table_json} if out else {}
    require_outputs([("--json-file", json_file), *(("--out", path) for path in files)], inputs=[run])
    found = noise_table(RunFolder(run), trackers=tracker, speeds=speed, window=window)
    write_json(context.obj, noise_table_json(found), as_json=as_json, file=json_file)
    if not as_json:
        _print(context, found)
    for path, content in files.items():
        write_atomically(path, content(found).encode())
        (context.obj.say if as_json else context.obj.result)(f"written: {path}")
    return 0


def _print(context: typer.Context, found: "NoiseTable") -> None:
    from tracknoise.cli.text_table import show
    from tracknoise.report.noise_cells import gain_cells, noise_table_cells, noise_table_sentences

    _tell(context, noise_table_sentences(found))
    for cells in (noise_table_cells(found), gain_cells(found)):
        context.obj.result("")
        show(context.obj.result, cells)


def fit(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Folder of a finished run.")],
    tracker: Annotated[list[str] | None, typer.Option("--tracker", help="Only this tracker; may be repeated.")] = None,
    speed: Annotated[list[int] | None, typer.Option("--speed", help="Only this speed; may be repeated.")] = None,
    scene: Annotated[
        list[str] | None, typer.Option("--scene", help="Fit to this scene (default: all); may be repeated.")
    ] = None,
    window: Annotated[int, typer.Option("--window", min=2, help="Length of the windows that are shown, frames.")] = 11,
    name: ForOption = "filter",
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the models.")] = Path(),
    force: ForceOption = False,
    accept_truth: AcceptTruthOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Write a noise model of each tracker and speed of a run, and print what to assume.

    Models of the lowest speed are those that the run fitted; others are fitted now.

    Refuses a run whose truth is not trusted, or of which this is unknown: errors of the truth would be in the noise.

    A model is written as TRACKER@SPEED.noise.json. `tracknoise noise export` writes it in the syntax of an estimator.
    Trackers and speeds with too few errors are named, and have no model.

    Example: `tracknoise noise fit runs/demo -o models`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.estimators.exports import estimator_name
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.estimators.run_models import run_models
    from tracknoise.estimators.training import chosen_conditions
    from tracknoise.exceptions import SettingsError
    from tracknoise.report.noise_cells import model_sentences
    from tracknoise.tables.store import RunFolder
    from tracknoise.tables.trust import TruthVerdict

    require_truth(TruthVerdict.of_run(RunFolder(run)), str(run), accepted=accept_truth)
    about = estimator_name(name)
    wanted = chosen_conditions(RunFolder(run), trackers=tracker, speeds=speed)
    stems = _stems(wanted)
    files = {(label, played): out / f"{stems[label]}@{played}.noise.json" for label, played in wanted}
    require_outputs([("--out", path) for path in files.values()], inputs=[run])
    kept = run_models(RunFolder(run))
    failed = list[SettingsError]()
    for (label, played), path in files.items():
        own = kept.models.get(label) if played == kept.speed and scene is None else None
        if own is None:
            context.obj.say(f"{label} at speed {played}: fitted now, because {_why_anew(kept, played, scene)}")
        try:
            model = NoiseModel.fit(run, tracker=label, speed=played, scenes=scene) if own is None else own
        except SettingsError as error:
            failed.append(error)
            context.obj.warn(f"{label} at speed {played} has no model: {error}")
            continue
        _require_same_data(path, model, force=force)
        model.write(path)
        _tell(context, model_sentences(model, about))
        _show(context, model, window)
        context.obj.result(f"written: {path}\n")
    if len(failed) == len(wanted):
        raise failed[-1]
    return 0


def _require_same_data(path: Path, model: "NoiseModel", *, force: bool) -> None:
    """Refuse to replace a model that was fitted to other scenes."""
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.exceptions import SettingsError
    from tracknoise.foreign_files import is_regular_file
    from tracknoise.text import counted

    if force or not is_regular_file(path):
        return
    earlier = NoiseModel.read(path).training
    if (earlier.dataset, earlier.scenes) != (model.training.dataset, model.training.scenes):
        of = f"a model that was fitted to other data ({counted(len(earlier.scenes), 'scene')} of {earlier.dataset})"
        raise SettingsError(f"--out {path}: found {of}, expected another folder, or --force")


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
    window: Annotated[int, typer.Option("--window", min=2, help="Length of the windows that are shown, frames.")] = 11,
    name: ForOption = "filter",
    header: Annotated[bool, typer.Option("--header", help="Print the model as a C++ header.")] = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Show a noise model: its components, and the standard deviations to assume.

    Example: `tracknoise noise show lucas-kanade@1.noise.json`
    """
    from tracknoise.estimators.cpp_header import cpp_header
    from tracknoise.estimators.exports import estimator_name
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.report.noise_cells import model_sentences

    about, model = estimator_name(name), NoiseModel.read(file)
    if header:
        context.obj.result(cpp_header(model))
        return 0
    _tell(context, model_sentences(model, about))
    _show(context, model, window)
    return 0


def _stems(wanted: list[tuple[str, int]]) -> dict[str, str]:
    """Names of trackers as parts of file names: as they are, unless they have signs that files should not have."""
    from tracknoise.tables.identity import identifiers

    plain = identifiers(sorted({name for name, _ in wanted}))
    return {name: name if re.fullmatch(r"\w[\w .+()-]*", name) else plain[name] for name in plain}


def _tell(context: typer.Context, sentences: list[str]) -> None:
    """Print sentences, each from the beginning of a line."""
    context.obj.result("\n".join(line for sentence in sentences for line in wrapped(sentence)))


def _show(context: typer.Context, model: "NoiseModel", window: int) -> None:
    from tracknoise.cli.text_table import show
    from tracknoise.report.noise_cells import component_cells, equivalent_cells

    for cells in (component_cells(model), equivalent_cells(model, window)):
        context.obj.result("")
        show(context.obj.result, cells)


noise = typer.Typer(no_args_is_help=True, help="Fit noise models to a run, check them, and export them to estimators.")
noise.command("fit", no_args_is_help=True)(fit)
noise.command("show", no_args_is_help=True)(show_model)
noise.command("table", no_args_is_help=True, cls=JsonCommand)(table)
noise.command("check", no_args_is_help=True)(check)
noise.command("export", no_args_is_help=True)(export_command)
