"""Trackers by name: the built-in ones, presets, and those of other packages' entry points ``tracknoise.trackers``.

Presets are settings of trackers named after systems: what these ship, with the source of every value.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

from tracknoise.exceptions import UnknownNameError
from tracknoise.plugins import Plugins, plugin_defaults
from tracknoise.trackers.tracker import TrackerSettings

TRACKERS: Plugins[TrackerSettings] = Plugins(
    what="tracker",
    group="tracknoise.trackers",
    built_in={
        "correspondence": "tracknoise.trackers.correspondence:Correspondence",
        "dense-flow": "tracknoise.trackers.dense_flow:DenseFlow",
        "external": "tracknoise.trackers.external:External",
        "imported": "tracknoise.trackers.imported:Imported",
        "lucas-kanade": "tracknoise.trackers.lucas_kanade:LucasKanade",
        "oracle": "tracknoise.trackers.oracle:Oracle",
        "patch": "tracknoise.trackers.aligned_patches:AlignedPatches",
        "second-view": "tracknoise.trackers.second_view:SecondView",
    },
    needs=("kind", "description", "start"),
)


_OF_OTHERS = frozenset({"external", "imported"})


def is_foreign(kind: str) -> bool:
    """Whether positions of a kind of tracker come from another program: imported, external, functions and plug-ins."""
    return kind in _OF_OTHERS or not (kind in TRACKERS.built_in or is_preset(kind))


def make_tracker(kind: str, options: Mapping[str, object] | None = None) -> TrackerSettings:
    """Make a tracker's settings from its name and options, types checked.

    Options are what a TOML or JSON file can hold: nested settings (``detection``, ``rejection``) are mappings, the
    members of enumerations their names, tuples lists. Types must fit as they are: "12" is not a number. Options of a
    preset take precedence over its own.

    Raises
    ------
    UnknownNameError
        If there is no tracker and no preset of that name.
    SettingsError
        If an option is unknown or missing, or has a wrong type or value; the message names it.
    """
    if is_preset(kind):
        preset = load_preset(kind)
        return TRACKERS.make(preset.tracker, preset.merged(options or {}))
    if kind not in TRACKERS:
        raise _unknown(kind)
    return TRACKERS.make(kind, options)


_ALIASES = {"klt": "lucas-kanade", "opticalflow": "dense-flow", "sift": "correspondence"}
"""Trackers by what people also call them, without signs and capitals."""


def _unknown(name: str) -> UnknownNameError:
    return UnknownNameError("tracker", name, tracker_names(), _ALIASES)


def tracker_names() -> list[str]:
    """Names of all trackers and presets, sorted."""
    return sorted({*TRACKERS.names(), *preset_names()})


def is_preset(name: str) -> bool:
    """Whether a name is that of a preset, and of no tracker."""
    return name in preset_names() and name not in TRACKERS


def descriptions() -> tuple[dict[str, str], dict[str, str]]:
    """What each tracker does, and each preset, by name: see `Plugins.descriptions`."""
    presets = {name: load_preset(name) for name in filter(is_preset, preset_names())}
    described = {name: f"preset of {preset.system}: {preset.description}" for name, preset in presets.items()}
    return TRACKERS.descriptions(), described


def tracker_defaults(kind: str) -> str:
    """The options of a tracker with their defaults as TOML, those without a default as comments; a preset's file.

    Raises
    ------
    UnknownNameError
        If there is no tracker and no preset of that name.
    """
    if is_preset(kind):
        return preset_text(kind).rstrip()
    if kind not in TRACKERS:
        raise _unknown(kind)
    return plugin_defaults(TRACKERS, kind)


_FOLDER = resources.files("tracknoise.trackers") / "presets"


@dataclass(frozen=True, slots=True)
class TrackerPreset:
    """Settings of a tracker that are those of a system, as far as a tracker has them."""

    name: str  # of the preset
    # system, repository, commit: whose settings they are, and where they were read
    system: str
    repository: str
    commit: str
    tracker: str  # kind of tracker
    description: str  # what it does, in a few words
    differs: tuple[str, ...]  # what the system does otherwise, one sentence each
    options: Mapping[str, object]  # options of the tracker, as a TOML file holds them

    def merged(self, options: Mapping[str, object]) -> dict[str, object]:
        """Its options with others that take precedence; nested ones are merged too."""
        return _merged(self.options, options)


@cache
def preset_names() -> list[str]:
    """Names of all presets, sorted."""
    return sorted(item.name.removesuffix(".toml") for item in _FOLDER.iterdir() if item.name.endswith(".toml"))


def preset_text(name: str) -> str:
    """The file of a preset: TOML with a comment on every value."""
    if name not in preset_names():
        raise UnknownNameError("preset of a tracker", name, preset_names(), {})
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
        present = merged.get(name)
        merged[name] = _merged(present, value) if isinstance(present, Mapping) and isinstance(value, Mapping) else value
    return merged
