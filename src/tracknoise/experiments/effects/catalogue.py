"""The effects that are measured, and their sizes."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.tables.effects_schema import Size

Options = Mapping[str, Any]
"""Options of the reader ``simulated``."""


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect.

    Attributes
    ----------
    name
        Its name.
    kind
        Whether it changes `images` or the stated `truth`.
    source
        Where its sizes come from.
    options, shown
        What is changed at each size, and the size as text.
    """

    name: str
    kind: str
    source: str
    options: Mapping[Size, Options]
    shown: Mapping[Size, str]


@cache
def catalogue() -> tuple[Effect, ...]:
    """All effects, in an order in which those that share rendered images follow one another."""
    return tuple(_effect(entry) for entry in _read()["effect"])


def base_options() -> Options:
    """Options of the clean sequences."""
    options: Options = _read()["base"]
    return options


def chosen_effects(names: list[str] | None) -> tuple[Effect, ...]:
    """Effects by name; None for all.

    Raises
    ------
    SettingsError
        If there is no name.
    UnknownNameError
        If there is no effect of a name.
    """
    known = {effect.name: effect for effect in catalogue()}
    if names == []:
        raise SettingsError(f"no name of an effect, expected some of {', '.join(known)}")
    for name in names or []:
        if name not in known:
            raise UnknownNameError("effect", name, known)
    return tuple(effect for effect in catalogue() if names is None or effect.name in names)


def merged(options: Options, changes: Options) -> dict[str, Any]:
    """Options with changes, also in nested settings."""
    both = {**options, **changes}
    nested = {name for name in options.keys() & changes.keys() if isinstance(options[name], Mapping)}
    return {**both, **{name: merged(options[name], changes[name]) for name in nested}}


def _effect(entry: Mapping[str, Any]) -> Effect:
    changes = {size: {name: value for name, value in entry[size].items() if name != "shown"} for size in Size}
    shown = {size: entry[size]["shown"] for size in Size}
    return Effect(entry["name"], entry["kind"], entry["source"], changes, shown)


def _read() -> dict[str, Any]:
    return tomllib.loads((resources.files("tracknoise.experiments.effects") / "effects.toml").read_text("utf-8"))
