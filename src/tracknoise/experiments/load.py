"""Read an experiment from a file or a preset, with everything checked that can be before any data is read."""

from importlib import resources
from pathlib import Path

from tracknoise.exceptions import SettingsError, TracknoiseError, UnknownNameError
from tracknoise.experiments.resolve import resolve
from tracknoise.experiments.settings import Experiment, parse_experiment

_PRESETS = resources.files("tracknoise.experiments") / "presets"


def preset_names() -> list[str]:
    """Names of the experiments that come with the package, sorted."""
    return sorted(item.name.removesuffix(".toml") for item in _PRESETS.iterdir() if item.name.endswith(".toml"))


def load_experiment(name: str | Path, *, root: Path | None = None) -> Experiment:
    """Read and check an experiment, and write out every option that it leaves to its default.

    Parameters
    ----------
    name
        A TOML file, or the name of a preset. Paths in a file are taken from its folder.
    root
        Folder of the data, instead of the one that the file names.

    Raises
    ------
    SettingsError
        Naming file, key, what was found and what was expected.
    UnknownNameError
        If there is neither such a file nor such a preset.
    """
    path = Path(name)
    if path.is_file():
        place, experiment = str(path), parse_experiment(_read(path), place=str(path)).with_paths_from(path.parent)
    elif str(name) in preset_names():
        place = f"preset {name}"
        experiment = parse_experiment((_PRESETS / f"{name}.toml").read_text(encoding="utf-8"), place=place)
    else:
        raise UnknownNameError("experiment file or preset", str(name), preset_names())
    try:
        return resolve(experiment if root is None else experiment.with_root(root.resolve()))
    except TracknoiseError as error:
        raise SettingsError(f"{place}: {error}") from error


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path}: cannot be read ({error}), expected an experiment file") from error
