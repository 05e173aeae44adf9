"""Read an experiment from a file or a preset, and check all that can be checked before any data are read."""

from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from tracknoise.exceptions import DataError, SettingsError, TracknoiseError, UnknownNameError
from tracknoise.experiments.option_paths import with_paths_from
from tracknoise.experiments.resolve import resolve
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.foreign.files import MIB, absolute, is_regular_file, read_text
from tracknoise.sequences.frame_range import require_range

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
        Options of the reader, instead of what the file says.

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
        raise UnknownNameError("experiment file or preset", str(name), preset_names())
    experiment = parse_experiment(text, place=place)
    try:
        if is_file:
            experiment = with_paths_from(path.parent, experiment)
        experiment = _with_frames(experiment, frames).with_limits(scenes=scenes, frames=None)
        experiment = experiment if speeds is None else experiment.with_speeds(speeds)
        experiment = experiment if trackers is None else experiment.with_trackers(trackers)
        for option, value in (options or {}).items():
            experiment = experiment.with_option(option, value)
        return resolve(experiment if root is None else experiment.with_root(absolute(Path(), root)))
    except TracknoiseError as error:
        raise SettingsError(f"{place}: {error}") from error


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
