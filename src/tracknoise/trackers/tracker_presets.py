"""Settings of trackers named after systems: what these ship, with the source of every value."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

from tracknoise.exceptions import UnknownNameError

_FOLDER = resources.files("tracknoise.trackers") / "presets"


@dataclass(frozen=True, slots=True)
class TrackerPreset:
    """Settings of a tracker that are those of a system, as far as a tracker has them.

    Attributes
    ----------
    name
        Of the preset.
    system, repository, commit
        Whose settings they are, and where they were read.
    tracker
        Kind of tracker.
    description
        What it does, in a few words.
    differs
        What the system does otherwise, one sentence each.
    options
        Options of the tracker, as a TOML file holds them.
    """

    name: str
    system: str
    repository: str
    commit: str
    tracker: str
    description: str
    differs: tuple[str, ...]
    options: Mapping[str, object]

    def merged(self, options: Mapping[str, object]) -> dict[str, object]:
        """Its options with others that take precedence; nested ones are merged too."""
        return _merged(self.options, options)


@cache
def preset_names() -> list[str]:
    """Names of all presets, sorted."""
    return sorted(item.name.removesuffix(".toml") for item in _FOLDER.iterdir() if item.name.endswith(".toml"))


def preset_text(name: str) -> str:
    """The file of a preset: TOML with a comment on every value.

    Raises
    ------
    UnknownNameError
        If there is no such preset.
    """
    if name not in preset_names():
        raise UnknownNameError("preset of a tracker", name, preset_names())
    return (_FOLDER / f"{name}.toml").read_text(encoding="utf-8")


def load_preset(name: str) -> TrackerPreset:
    """Read a preset by its name.

    Raises
    ------
    UnknownNameError
        If there is no such preset.
    """
    read = tomllib.loads(preset_text(name))
    return TrackerPreset(name=name, **{**read, "differs": tuple(read["differs"])})


def _merged(options: Mapping[str, object], others: Mapping[str, object]) -> dict[str, object]:
    merged = dict(options)
    for name, value in others.items():
        known = merged.get(name)
        merged[name] = _merged(known, value) if isinstance(known, Mapping) and isinstance(value, Mapping) else value
    return merged
