"""The estimators that noise can be exported to. Each is a file in the folder `estimators`."""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import chain

from pydantic import ConfigDict, TypeAdapter

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.noise_models.model import Landmark, Purpose

_ROOM = "tracknoise.noise_models.exports"
FAMILIES: Mapping[str, str] = {
    "filters": "Filters",
    "smoothers": "Smoothers and visual SLAM",
    "maps": "Mapping and structure from motion",
    "libraries": "Libraries",
    "data": "Data",
}
"""Kinds of estimators and their titles, in order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimator:
    """An estimator, and how its noise is written.

    Parameters
    ----------
    title, family
        Its name in text, and a key of `FAMILIES`.
    unit, place
        Of what is written: phrases.
    landmark
        How it uses the first observation of a track.
    purpose, window
        What its sigma makes right by default, and the length of its window as shipped, frames. The purpose is None
        where the components of the model are written themselves.
    needs
        What must be known: ``focal length``, ``rate``, ``observations``.
    cannot
        What it cannot express: phrases.
    without_effect
        Keys that look right and do nothing, or something else: sentences.
    notes
        Sentences.
    checked_against
        Repositories and commits whose source code was read, or packages that were run.
    files, patch
        Templates of the files by name, and of a change of its source code. See `values.template_values`.
    aliases
        Other names: of programs that are written for alike, and names that are in use.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    title: str
    family: str
    unit: str
    place: str
    landmark: Landmark
    cannot: tuple[str, ...]
    files: Mapping[str, str]
    purpose: Purpose | None = None
    window: int = 11
    needs: tuple[str, ...] = ()
    without_effect: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    checked_against: tuple[str, ...] = ()
    patch: str | None = None
    aliases: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Refused:
    """An estimator that noise of tracks cannot be exported to, and why not."""

    title: str
    why: str
    aliases: tuple[str, ...] = ()


@cache
def estimators() -> Mapping[str, Estimator]:
    """All estimators by name, in the order of their families."""
    folder = resources.files(_ROOM) / "estimators"
    texts = {file.name.removesuffix(".toml"): file.read_text(encoding="utf-8") for file in folder.iterdir()}
    read = TypeAdapter(Estimator)
    found = {name: read.validate_python(tomllib.loads(text)) for name, text in texts.items()}
    order = list(FAMILIES)
    return dict(sorted(found.items(), key=lambda item: (order.index(item[1].family), item[0])))


@cache
def refused() -> Mapping[str, Refused]:
    """Estimators without an export, by name."""
    text = (resources.files(_ROOM) / "refused.toml").read_text(encoding="utf-8")
    return {name: TypeAdapter(Refused).validate_python(fields) for name, fields in tomllib.loads(text).items()}


def estimator(name: str) -> Estimator:
    """Return an estimator by its name: see `estimator_name`.

    Raises
    ------
    SettingsError, UnknownNameError
        As `estimator_name`.
    """
    return estimators()[estimator_name(name)]


def estimator_name(name: str) -> str:
    """Return the name under which an estimator is known. Case and the signs between words do not matter.

    Parameters
    ----------
    name
        Its name or one of its aliases: ``orbslam3``, ``ORB-SLAM3`` and ``orb-slam2`` are one.

    Raises
    ------
    SettingsError
        If its noise cannot be exported, with the reason.
    UnknownNameError
        If it is not known.
    """
    if (known := _names().get(_plain(name))) is None:
        listed = {one: about.aliases for one, about in estimators().items()}
        raise UnknownNameError("estimator", name, [*listed, *chain.from_iterable(listed.values())])
    if known in refused():
        raise SettingsError(f"{refused()[known].title}: {refused()[known].why}")
    return known


@cache
def _names() -> Mapping[str, str]:
    """The name of every estimator by its names and aliases, each without signs and capitals."""
    every: Mapping[str, Estimator | Refused] = {**refused(), **estimators()}
    return {_plain(alias): name for name, about in every.items() for alias in (name, *about.aliases)}


def _plain(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).casefold()
