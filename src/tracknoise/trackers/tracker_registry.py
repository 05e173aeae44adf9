"""Trackers by name: the built-in ones, and those of other packages' entry points ``tracknoise.trackers``."""

from collections.abc import Mapping

from tracknoise.plugins import Plugins, plugin_defaults
from tracknoise.trackers.tracker import TrackerSettings

TRACKERS: Plugins[TrackerSettings] = Plugins(
    what="tracker",
    group="tracknoise.trackers",
    built_in={
        "correspondence": "tracknoise.trackers.correspondence:Correspondence",
        "dense-flow": "tracknoise.trackers.dense_flow:DenseFlow",
        "imported": "tracknoise.trackers.imported:Imported",
        "lucas-kanade": "tracknoise.trackers.lucas_kanade:LucasKanade",
        "oracle": "tracknoise.trackers.oracle:Oracle",
    },
)


def make_tracker(kind: str, options: Mapping[str, object] | None = None) -> TrackerSettings:
    """Make a tracker's settings from its name and options, types checked.

    Options are what a TOML or JSON file can hold: nested settings (``detection``, ``rejection``) are mappings, the
    members of enumerations their names, tuples lists. Types must fit as they are: "12" is not a number.

    Raises
    ------
    UnknownNameError
        If there is no tracker of that name.
    SettingsError
        If an option is unknown or missing, or has a wrong type or value; the message names it.
    """
    return TRACKERS.make(kind, options)


def tracker_defaults(kind: str) -> str:
    """The options of a tracker with their defaults as TOML, those without a default as comments.

    Raises
    ------
    UnknownNameError
        If there is no tracker of that name.
    """
    return plugin_defaults(TRACKERS, kind)
