"""``tracknoise export``: the noise of a tracker in the syntax of an estimator, from a run or from a noise model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tracknoise.cli.shared_options import (
    UNTRUSTED,
    DebugOption,
    QuietOption,
    flag,
    number,
    require_truth,
    text,
    whole,
)
from tracknoise.cli.terminal import Terminal

if TYPE_CHECKING:
    from tracknoise.estimators.exports import Export, Target
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.estimators.run_models import RunModels


@dataclass(frozen=True, slots=True)
class _Source:
    """A noise model, the name of its file, and what it was read from: the folder of a run, or this file."""

    model: "NoiseModel"
    name: str
    path: Path


def export(
    context: typer.Context,
    source: Annotated[
        Path | None, typer.Argument(metavar="RUN|MODEL", help="Folder of a finished run, or file of a noise model.")
    ] = None,
    to: Annotated[
        str | None,
        text("--to", metavar="NAME", help="Estimator, or text, cpp, csv, json. Without any argument: the list."),
    ] = None,
    model: Annotated[
        Path | None, text("--model", metavar="FILE", help="Keep the model of a run in this file: NAME.noise.json.")
    ] = None,
    tracker: Annotated[str | None, text("--tracker", metavar="NAME", help="Tracker of the run.")] = None,
    speed: Annotated[int | None, whole("--speed", help="Speed of the run (default: the lowest).")] = None,
    focal: Annotated[float | None, number("--focal", help="Focal length of the estimator's images, px.")] = None,
    rate: Annotated[float | None, number("--rate", help="Frames that the estimator uses per second.")] = None,
    window: Annotated[
        int | None, whole("--window", least=2, help="Length of the estimator's window, frames (default: as shipped).")
    ] = None,
    allow: Annotated[
        list[str] | None,
        text(
            "--allow",
            metavar="REASON",
            help=f"Allow another focal length (resampled, lens), rate (thinned, unchecked), or an {UNTRUSTED} truth.",
        ),
    ] = None,
    tracks: Annotated[
        Path | None, text("--tracks", metavar="PATH", help="Tracks for csv: run folder or file (default: the run).")
    ] = None,
    out: Annotated[
        Path | None, text("--out", "-o", metavar="FOLDER", help="Folder for the files (default: print them).")
    ] = None,
    force: Annotated[bool, flag("--force", help="Replace the files of another model.")] = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Write the noise of a tracker in the syntax of an estimator, and say what it makes right.

    Without arguments, lists the estimators. `text` says what to set, and shows the components; `cpp` is a header. The
    model is the one that the run fitted, or is fitted now. A focal length or a rate that it was not measured at is
    refused, and so is a truth that is not trusted. The verdict on the truth is in a comment of each file
    unless it is trusted. See docs/estimators/exports.md.

    Examples: `tracknoise export runs/mine --to openvins --focal 458.6 --rate 20 -o config`,
    `tracknoise export runs/mine --to text --tracker lucas-kanade --model lk.noise.json`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.exceptions import SettingsError
    from tracknoise.tables.store import RunFolder

    if source is None and to is None:
        context.obj.result(_estimators())
        return 0
    if source is None or to is None:
        missing, expected = ("RUN|MODEL", "a run or a noise model") if source is None else ("--to", "an estimator")
        raise SettingsError(f"no {missing}, expected {expected}")
    reasons = _reasons(allow)
    form = _form(to, tracks)
    require_outputs([("--model", model)], inputs=[source, tracks])
    settings = RunFolder(source).settings() if source.is_dir() else {}
    about = str(settings.get("estimator", {}).get("name", _KIND)) if form == _TEXT else form
    target = _target(settings, about, focal, rate, window, reasons)
    sources = _sources(context.obj, source, form, model, tracker, speed, accepted=UNTRUSTED in reasons, force=force)
    for item in sources:
        _write(context.obj, item, form, about, target, tracks, out, accepted=UNTRUSTED in reasons, force=force)
    return 0


_TEXT, _HEADER = "text", "cpp"
_OF_TRACKNOISE = {
    _TEXT: "Text: what to set, components, and sigmas for each purpose",
    _HEADER: "C++: all components as a header without dependencies",
}
"""What is no syntax of an estimator, by its name."""


def _form(to: str, tracks: Path | None) -> str:
    """The name under which an estimator, or another form, is known."""
    from tracknoise.estimators.exports import estimator_name, estimators
    from tracknoise.exceptions import SettingsError

    name = to if to in _OF_TRACKNOISE else estimator_name(to)
    if tracks is not None and (name in _OF_TRACKNOISE or "observations" not in estimators()[name].needs):
        raise SettingsError(f"--tracks {tracks}: found --to {to}, expected the option with --to csv alone")
    return name


def _reasons(allow: Sequence[str] | None) -> frozenset[str]:
    from tracknoise.estimators.exports import FocalChange, RateChange
    from tracknoise.exceptions import UnknownNameError

    accepted = [*map(str, FocalChange), *map(str, RateChange), UNTRUSTED]
    for reason in allow or ():
        if reason not in accepted:
            raise UnknownNameError("value of --allow", reason, accepted)
    return frozenset(allow or ())


def _target(
    settings: Mapping[str, Any],
    about: str,
    focal: float | None,
    rate: float | None,
    window: int | None,
    reasons: frozenset[str],
) -> "Target":
    """What is stated, and else the window and the features that the experiment of a run has for this estimator."""
    from tracknoise.estimators.exports import FocalChange, RateChange, asked
    from tracknoise.exceptions import SettingsError

    for kind in (FocalChange, RateChange):
        if reasons.issuperset(kind):
            raise SettingsError(f"--allow: found {' and '.join(kind)}, expected one of them")
    of_experiment = asked(settings, about)
    return replace(
        of_experiment,
        focal_px=focal,
        rate_hz=rate,
        focal_change=next((change for change in FocalChange if change in reasons), None),
        rate_change=next((change for change in RateChange if change in reasons), None),
        window=window or of_experiment.window,
    )


def _sources(
    terminal: Terminal,
    source: Path,
    form: str,
    kept_in: Path | None,
    tracker: str | None,
    speed: int | None,
    *,
    accepted: bool,
    force: bool,
) -> list[_Source]:
    """The model of a file, or models of a run: of one tracker, or for a text that is printed alone, of all."""
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.exceptions import SettingsError

    if not source.is_dir():
        for option, given in {"--model": kept_in, "--tracker": tracker, "--speed": speed}.items():
            if given is not None:
                raise SettingsError(f"{option}: found a noise model, expected the option with a run alone")
        return [_Source(NoiseModel.read(source), source.name, source)]
    wanted = _conditions(source, tracker, speed)
    if len(wanted) > 1 and (form != _TEXT or kept_in is not None):
        names = ", ".join(name for name, _ in wanted)
        raise SettingsError(f"{source}: found noise of {names}, expected --tracker with one of them")
    models = _models(terminal, source, wanted, accepted=accepted)
    if kept_in is not None:
        _keep(terminal, models[0].model, kept_in, force=force)
        return [_Source(models[0].model, kept_in.name, source)]
    return models


def _conditions(run: Path, tracker: str | None, speed: int | None) -> list[tuple[str, int]]:
    """Trackers of a run and their speed."""
    from tracknoise.estimators.training import chosen_conditions
    from tracknoise.tables.store import RunFolder

    conditions = chosen_conditions(
        RunFolder(run), trackers=None if tracker is None else [tracker], speeds=None if speed is None else [speed]
    )
    lowest = min(played for _, played in conditions)
    return [(name, played) for name, played in conditions if played == lowest]


def _models(terminal: Terminal, run: Path, wanted: Sequence[tuple[str, int]], *, accepted: bool) -> list[_Source]:
    """The models that the run fitted, or that are fitted now. Trackers with too few errors are named."""
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.estimators.run_models import run_models
    from tracknoise.exceptions import SettingsError
    from tracknoise.tables.store import RunFolder
    from tracknoise.tables.trust import TruthVerdict

    require_truth(TruthVerdict.of_run(RunFolder(run)), str(run), accepted=accepted)
    kept = run_models(RunFolder(run))
    models, failed = list[_Source](), list[SettingsError]()
    for label, played in wanted:
        own = kept.models.get(label) if played == kept.speed else None
        if own is None:
            terminal.say(f"{label} at speed {played}: fitted now, because {_why_anew(kept, played)}")
        try:
            model = NoiseModel.fit(run, tracker=label, speed=played) if own is None else own
        except SettingsError as error:
            failed.append(error)
            if len(wanted) > 1:
                terminal.warn(f"{label} at speed {played} has no model: {error}")
            continue
        models.append(_Source(model, f"{label}@{played}.noise.json", run))
    if not models:
        raise failed[-1]
    return models


def _why_anew(kept: "RunModels", speed: int) -> str:
    """Why the analysis of a run has no such model."""
    if kept.speed is not None and speed != kept.speed:
        return f"the models of the run are those of speed {kept.speed}"
    return "the run has no model of it"


def _keep(terminal: Terminal, model: "NoiseModel", path: Path, *, force: bool) -> None:
    """Write a model, but not over one that was fitted to other scenes."""
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.exceptions import SettingsError
    from tracknoise.foreign_files import is_regular_file
    from tracknoise.text import counted

    if not force and is_regular_file(path):
        earlier = NoiseModel.read(path).training
        if (earlier.dataset, earlier.scenes) != (model.training.dataset, model.training.scenes):
            of = f"a model that was fitted to other data ({counted(len(earlier.scenes), 'scene')} of {earlier.dataset})"
            raise SettingsError(f"--model {path}: found {of}, expected another file, or --force")
    model.write(path)
    terminal.say(f"written: {path.resolve()}")


def _write(
    terminal: Terminal,
    source: _Source,
    form: str,
    about: str,
    target: "Target",
    tracks: Path | None,
    out: Path | None,
    *,
    accepted: bool,
    force: bool,
) -> None:
    """Print what is exported, or write it to a folder."""
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.tables.files import write_atomically

    if form in _OF_TRACKNOISE:
        content = _header(source.model) if form == _HEADER else _as_text(source.model, about, target)
        marked = "noise.txt" if form == _TEXT else "noise.hpp"
        files, used, shown = {marked: content}, list[str](), content
    else:
        require_truth(source.model.truth, source.name, accepted=accepted)
        exported = _exported(source, form, target, tracks)
        files, marked = _files(form, exported), f"{form}.txt"
        shown = "\n".join(f"==> {name} <==\n{content}" for name, content in files.items())
        whose = "that of the model" if target.rate_hz is None else "as stated"
        used = ["rate: unknown" if exported.rate_hz is None else f"rate: {exported.rate_hz:.6g} Hz, {whose}"]
    if out is None:
        terminal.result(shown.rstrip())
        return
    require_outputs([("--out", out / name) for name in files], inputs=[source.path, tracks])
    _require_same_model(out / marked, source.model, force=force)
    for name, content in files.items():
        write_atomically(out / name, content.encode())
    terminal.result("\n".join([*(f"written: {(out / name).resolve()}" for name in files), *used]))


def _as_text(model: "NoiseModel", name: str, target: "Target") -> str:
    """What to set in an estimator, the components, and one sigma for each purpose."""
    from tracknoise.cli.terminal import wrapped
    from tracknoise.cli.text_table import plain
    from tracknoise.estimators.exports import hash_text
    from tracknoise.report.noise_cells import component_cells, equivalent_cells, model_sentences

    said = model_sentences(model, name, features=target.features)
    sentences = "\n".join(line for sentence in said for line in wrapped(sentence))
    tables = [component_cells(model), equivalent_cells(model, target.window or _WINDOW)]
    return "\n\n".join([sentences, *map(plain, tables), f"Model: {hash_text(model.sha256)}"]) + "\n"


_KIND, _WINDOW = "filter", 11
"""The estimator that a text is about where none is named, and the length of the windows that it shows, frames."""


def _header(model: "NoiseModel") -> str:
    from tracknoise.estimators.cpp_header import cpp_header

    return cpp_header(model)


def _exported(source: _Source, to: str, target: "Target", tracks: Path | None) -> "Export":
    from tracknoise.estimators.export_render import export as rendered
    from tracknoise.estimators.exports import estimators
    from tracknoise.estimators.observation_noise import observation_noise, read_tracks

    if tracks is None and source.path.is_dir() and "observations" in estimators()[to].needs:
        tracks = source.path
    observations = None
    if tracks is not None:
        observations = observation_noise(source.model, read_tracks(tracks, source.model)).write_csv()
    return rendered(source.model, to, target=target, source=source.name, observations=observations)


def _files(to: str, exported: "Export") -> dict[str, str]:
    """Everything by the name of its file: the files of the estimator, a patch if there is one, and the text."""
    patch = {} if exported.patch is None else {f"{to}.patch": exported.patch}
    return {**exported.files, **patch, f"{to}.txt": exported.text}


def _require_same_model(path: Path, model: "NoiseModel", *, force: bool) -> None:
    """Refuse to replace the export of another model. `path`: of a file that names its model."""
    from tracknoise.estimators.exports import is_of
    from tracknoise.exceptions import SettingsError
    from tracknoise.foreign_files import is_regular_file

    if force or not is_regular_file(path) or is_of(path.read_text(encoding="utf-8", errors="replace"), model.sha256):
        return
    raise SettingsError(f"--out {path.parent}: found {path.name} of another model, expected another folder, or --force")


def _estimators() -> str:
    """Names of estimators and what is written for them, then those that are refused, with the reason."""
    from tracknoise.cli.terminal import listing
    from tracknoise.estimators.exports import estimators, refused

    titles = {name: f"{about.title}: {about.unit}" for name, about in estimators().items()}
    without = listing({name: f"{about.title}: {about.why}" for name, about in refused().items()})
    return f"{listing({**titles, **_OF_TRACKNOISE})}\n\nWithout an export:\n{without}"
