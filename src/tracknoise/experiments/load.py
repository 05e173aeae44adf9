"""Read an experiment from a file or a preset, check it before any data are read, and write out its defaults."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from importlib import resources
from pathlib import Path
from typing import Any

from tracknoise.exceptions import DataError, SettingsError, TracknoiseError, UnknownNameError
from tracknoise.experiments.settings import Experiment, SecondTruthSettings, TrackerChoice, parse_experiment
from tracknoise.foreign_files import MIB, absolute, is_regular_file, read_text
from tracknoise.options import PathTemplate, as_toml_values
from tracknoise.plugins import Plugins
from tracknoise.sequences.frame_range import require_range
from tracknoise.sequences.reader_registry import READERS, make_reader
from tracknoise.trackers.tracker_registry import TRACKERS, make_tracker, tracker_names
from tracknoise.truth.truth_registry import TRUTHS


def with_paths_from(folder: Path, experiment: Experiment) -> Experiment:
    """Return the same experiment with every relative path made absolute, starting from a folder.

    Paths that start from the folder of the data stay as they are, as do options of an unknown tracker or reader.
    """
    dataset = experiment.dataset
    moved = dataset.model_copy(
        update={
            "root": None if dataset.root is None else absolute(folder, dataset.root),
            "trajectory": _absolute_template(folder, dataset.trajectory),
            "options": _absolute(folder, READERS, dataset.reader, dataset.options),
        }
    )
    trackers = [
        choice.model_copy(update={"options": _absolute(folder, TRACKERS, choice.kind, choice.options)})
        for choice in experiment.trackers
    ]
    truth = experiment.truth.model_copy(update={"second": _second(folder, experiment)})
    check = None if experiment.check is None else absolute(folder, experiment.check)
    return experiment.model_copy(update={"dataset": moved, "trackers": trackers, "truth": truth, "check": check})


def _second(folder: Path, experiment: Experiment) -> SecondTruthSettings | None:
    second = experiment.truth.second
    if second is None:
        return None
    trajectory = _absolute_template(folder, second.trajectory)
    options = _absolute(folder, READERS, experiment.dataset.reader, second.options)
    return second.model_copy(update={"trajectory": trajectory, "options": options})


def _absolute_template(folder: Path, trajectory: str | None) -> str | None:
    return None if trajectory is None else str(absolute(folder, Path(trajectory)))


def option_paths(experiment: Experiment) -> Iterator[Path | PathTemplate]:
    """The paths among the options of the reader, the second truth and the trackers, and of trajectories."""
    dataset = experiment.dataset
    yield from READERS.paths(dataset.reader, dataset.options, dataset.root)
    yield from [] if dataset.trajectory is None else [PathTemplate(dataset.trajectory)]
    second = experiment.truth.second
    if second is not None:
        yield from READERS.paths(dataset.reader, second.options, dataset.root)
        yield from [] if second.trajectory is None else [PathTemplate(second.trajectory)]
    yield from tracker_paths(experiment)


def tracker_paths(experiment: Experiment) -> Iterator[Path | PathTemplate]:
    """The paths among the options of the trackers."""
    for choice in experiment.trackers:
        yield from TRACKERS.paths(choice.kind, choice.options)


def _absolute(folder: Path, plugins: Plugins[Any], name: str, options: dict[str, Any]) -> dict[str, Any]:
    return plugins.with_paths_from(folder, name, options) if name in plugins.names() else options


def resolve(experiment: Experiment) -> Experiment:
    """Return the same experiment with all options of its trackers and its reader written out.

    Raises
    ------
    SettingsError
        If a tracker, the reader, the kind of truth or an option is unknown, or a value is wrong or has control
        characters; the message names the section.
    """
    dataset = experiment.dataset
    with _errors_of("dataset"):
        reader = as_toml_values(asdict(make_reader(dataset.reader, dataset.root, dataset.options)))  # type: ignore[call-overload]
    reader.pop("root", None)
    if experiment.truth.second is not None:
        with _errors_of("truth.second.options"):
            make_reader(dataset.reader, dataset.root, {**dataset.options, **experiment.truth.second.options})
    if experiment.truth.kind is not None:
        with _errors_of("truth.kind"):
            TRUTHS.load(experiment.truth.kind)
    resolved = experiment.model_copy(
        update={
            "dataset": dataset.model_copy(update={"options": reader}),
            "trackers": [_resolved(choice, f"trackers[{i}]") for i, choice in enumerate(experiment.trackers)],
        }
    )
    try:
        resolved.require_printable()  # folders may have been given on the command line
    except ValueError as error:
        raise SettingsError(str(error)) from error
    return resolved


def with_tracker_defaults(experiment: Experiment) -> Experiment:
    """Return the experiment of a run with the options that its trackers did not have yet when it was measured.

    The default of an option that is added later is what trackers did before. Options that cannot be read are left as
    they are.
    """
    try:
        trackers = [_resolved(choice, f"trackers[{i}]") for i, choice in enumerate(experiment.trackers)]
    except SettingsError:
        return experiment
    return experiment.model_copy(update={"trackers": trackers})


def _resolved(choice: TrackerChoice, section: str) -> TrackerChoice:
    with _errors_of(section):
        options = as_toml_values(asdict(make_tracker(choice.kind, choice.options)))  # type: ignore[call-overload]
    return choice.model_copy(update={"options": options})


@contextmanager
def _errors_of(section: str) -> Iterator[None]:
    try:
        yield
    except TracknoiseError as error:
        raise SettingsError(f"{section}: {error}") from error


_MOST_BYTES = MIB
_PRESETS = resources.files("tracknoise.experiments") / "presets"


def preset_names() -> list[str]:
    """Names of the experiments that come with the package, sorted."""
    return sorted(item.name.removesuffix(".toml") for item in _PRESETS.iterdir() if item.name.endswith(".toml"))


def load_experiment(
    name: str | Path,
    *,
    root: Path | None = None,
    scenes: int | None = None,
    frames: int | list[int] | None = None,
    speeds: list[int] | None = None,
    trackers: list[str] | None = None,
    options: Mapping[str, object] | None = None,
) -> Experiment:
    """Load an experiment with all its options written out.

    Parameters
    ----------
    name
        A TOML file, or the name of a preset. Relative paths in a file start from its folder.
    root
        Folder of the data, instead of the one that the file names.
    scenes
        Maximum number of scenes, instead of that in the file.
    frames
        Maximum number of frames per scene, or first, last and step of the frames, instead of those in the file.
    speeds
        Instead of those in the file, for all views.
    trackers
        Names of trackers in the file, or kinds of others, which get their default options.
    options
        Options of the reader, instead of what the file says. Paths among them start from the current folder.

    Raises
    ------
    SettingsError
        Naming file, key, what was found and what was expected.
    UnknownNameError
        If there is neither such a file nor such a preset.
    """
    path = Path(name)
    if is_file := is_regular_file(path):
        place, text = str(path), _read(path)
    elif str(name) in preset_names():
        place, text = f"preset {name}", (_PRESETS / f"{name}.toml").read_text(encoding="utf-8")
    else:
        raise UnknownNameError("experiment file or preset", str(name), preset_names(), {})
    experiment = parse_experiment(text, place=place)
    try:
        if is_file:
            experiment = with_paths_from(path.parent, experiment)
        experiment = _with_frames(experiment, frames).with_limits(scenes=scenes, frames=None)
        experiment = experiment if speeds is None else experiment.with_speeds(speeds)
        experiment = experiment if trackers is None else experiment.with_trackers(_kinds(experiment, trackers))
        for option, value in _absolute(Path(), READERS, experiment.dataset.reader, dict(options or {})).items():
            experiment = experiment.with_option(option, value)
        return resolve(experiment if root is None else experiment.with_root(absolute(Path(), root)))
    except TracknoiseError as error:
        raise SettingsError(f"{place}: {error}") from error


def _kinds(experiment: Experiment, names: list[str]) -> list[str]:
    """Names of trackers; underscores of a name that is not known become hyphens, as in `lucas_kanade`."""
    existing = {*tracker_names(), *(tracker.label for tracker in experiment.trackers)}
    return [name if name in existing else name.replace("_", "-") for name in names]


def _with_frames(experiment: Experiment, frames: int | list[int] | None) -> Experiment:
    """The experiment with a maximum number of frames, or with a range of them."""
    if frames is None or isinstance(frames, int):
        return experiment.with_limits(scenes=None, frames=frames)
    require_range(frames)
    return experiment.with_frames(frames)


def _read(path: Path) -> str:
    try:
        return read_text(path, "an experiment file", most=_MOST_BYTES)
    except DataError as error:
        raise SettingsError(f"{path}: cannot be read ({error.found}), expected an experiment file") from error
