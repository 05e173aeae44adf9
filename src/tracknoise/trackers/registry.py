"""Trackers by name: the built-in ones, and those of other packages' entry points ``tracknoise.trackers``."""

import json
from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields, is_dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, get_type_hints

from tracknoise.exceptions import SettingsError
from tracknoise.plugins import Plugins
from tracknoise.trackers.tracker import TrackerSettings

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

TRACKERS: Plugins[TrackerSettings] = Plugins(
    what="tracker",
    group="tracknoise.trackers",
    built_in={
        "correspondence": "tracknoise.trackers.correspondence:Correspondence",
        "imported": "tracknoise.trackers.imported:Imported",
        "lucas-kanade": "tracknoise.trackers.lucas_kanade:LucasKanade",
        "oracle": "tracknoise.trackers.oracle:Oracle",
    },
)


def make_tracker(kind: str, options: Mapping[str, object] | None = None) -> TrackerSettings:
    """Make a tracker's settings from its name and options, types checked.

    Options are what a TOML or JSON file can hold: nested settings (``detection``, ``rejection``) are mappings, the
    members of enumerations their names, tuples lists. Types must fit as they are: "12" is no number.

    Raises
    ------
    UnknownNameError
        If there is no tracker of that name.
    SettingsError
        If an option is unknown or missing, or has a wrong type or value; the message names it.
    """
    from pydantic import TypeAdapter, ValidationError

    settings_type = TRACKERS.load(kind)
    _refuse_unknown(settings_type)
    try:
        written = json.dumps(dict(options or {}))
        settings: TrackerSettings = TypeAdapter(settings_type).validate_json(written, strict=True)
    except TypeError as error:
        raise SettingsError(f"tracker {kind!r}: {error}, expected what a TOML file can hold") from error
    except ValidationError as error:
        raise SettingsError(f"tracker {kind!r}: {_explain(settings_type, error.errors()[0])}") from error
    return settings


def tracker_defaults(kind: str) -> str:
    """The settings of a tracker with their defaults as TOML, those without a default as comments.

    Raises
    ------
    UnknownNameError
        If there is no tracker of that name.
    """
    import tomlkit

    settings_type: type = TRACKERS.load(kind)
    required, defaults = [], {}
    for field in fields(settings_type):
        if field.default is not MISSING:
            defaults[field.name] = field.default
        elif field.default_factory is not MISSING:
            defaults[field.name] = field.default_factory()
        else:
            required.append(f"# {field.name} = ... (required)\n")
    plain = json.loads(json.dumps(defaults, default=asdict))
    return ("".join(required) + tomlkit.dumps(plain)).rstrip()


def _refuse_unknown(settings_type: type) -> None:
    """Make pydantic refuse unknown keys in a dataclass and in all dataclasses that are its fields."""
    from pydantic import ConfigDict, with_config

    with_config(ConfigDict(extra="forbid"))(settings_type)
    for nested in _nested(settings_type).values():
        _refuse_unknown(nested)


def _nested(settings_type: type) -> dict[str, type]:
    hints = get_type_hints(settings_type).items()
    return {name: hint for name, hint in hints if isinstance(hint, type) and is_dataclass(hint)}


def _explain(settings_type: type, error: "ErrorDetails") -> str:
    place = ".".join(str(part) for part in error["loc"])
    if error["type"] == "unexpected_keyword_argument":
        return f"{place}: unknown setting{_known(settings_type, error['loc'])}"
    if error["type"] == "value_error":
        return f"{place}{'.' if place else ''}{error['ctx']['error']}"
    if error["type"] == "missing":
        return f"{place}: missing, expected a value"
    return f"{place or 'settings'}: {error['msg']}, found {error['input']!r}"


def _known(settings_type: type, location: tuple[Any, ...]) -> str:
    """The known names beside an unknown one, and the likeliest."""
    for part in location[:-1]:
        settings_type = _nested(settings_type)[part]
    known = sorted(field.name for field in fields(settings_type))
    close = get_close_matches(str(location[-1]), known, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    return f"{hint}; known: {', '.join(known)}"
