"""Trackers by name: the built-in ones, and those of other packages' entry points ``tracknoise.trackers``."""

from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import entry_points

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.trackers.tracker import TrackerSettings

ENTRY_POINT_GROUP = "tracknoise.trackers"

_BUILT_IN = {
    "correspondence": "tracknoise.trackers.correspondence:Correspondence",
    "imported": "tracknoise.trackers.imported:Imported",
    "lucas-kanade": "tracknoise.trackers.lucas_kanade:LucasKanade",
    "oracle": "tracknoise.trackers.oracle:Oracle",
}


def tracker_kinds() -> list[str]:
    """Names of all trackers, sorted."""
    return sorted({*_BUILT_IN, *(point.name for point in entry_points(group=ENTRY_POINT_GROUP))})


def tracker_type(kind: str) -> type[TrackerSettings]:
    """The settings class of the tracker of that name.

    Raises
    ------
    UnknownNameError
        Listing the known names.
    """
    if kind in _BUILT_IN:
        module, attribute = _BUILT_IN[kind].split(":")
        built_in: type[TrackerSettings] = getattr(import_module(module), attribute)
        return built_in
    for point in entry_points(group=ENTRY_POINT_GROUP):
        if point.name == kind:
            plugin: type[TrackerSettings] = point.load()
            return plugin
    raise UnknownNameError("tracker", kind, tracker_kinds())


def make_tracker(kind: str, options: Mapping[str, object] | None = None) -> TrackerSettings:
    """Make a tracker's settings from its name and options, types checked.

    Nested settings (``detection``, ``rejection``) are given as mappings.

    Raises
    ------
    UnknownNameError
        If there is no tracker of that name.
    SettingsError
        If an option is unknown, or has a wrong type or value.
    """
    from pydantic import ConfigDict, TypeAdapter, ValidationError, with_config

    settings_type = with_config(ConfigDict(extra="forbid"))(tracker_type(kind))
    try:
        settings: TrackerSettings = TypeAdapter(settings_type).validate_python(dict(options or {}))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "settings"
        raise SettingsError(f"tracker {kind!r}: {place}: {first['msg']}, found {first['input']!r}") from error
    return settings
