"""What a sequence is called: the one name by which readers, tables and the manifest know it."""

import itertools
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from enum import StrEnum
from hashlib import sha256
from pathlib import Path
from string import Formatter
from urllib.parse import quote, unquote

from tracknoise.exceptions import DataError

DEFAULT_LIGHTING = "default"
_LONGEST = 160
"""Characters of a key. File systems allow names of 255, which includes what is added to them while they are written."""
_HASHED = 20
_LONGEST_NAME = 80
"""Characters of an identifier without its number. Names of files are longer and may have up to 255."""


class Direction(StrEnum):
    """Which way the frames of a scene are played."""

    forward = "forward"
    backward = "backward"


@dataclass(frozen=True, slots=True, order=True)
class SequenceId:
    """Name of a sequence: a scene under one lighting, one image rotation and one direction of play.

    Parameters
    ----------
    dataset, scene, lighting
        Names as the user or the data set writes them.
    rotation
        Degrees by which the images are turned counter-clockwise.
    direction
        Whether its frames come in the order of their recording, or the last first.
    camera
        Name of the camera on a rig; empty where there is only one.
    """

    dataset: str
    scene: str
    lighting: str = DEFAULT_LIGHTING
    rotation: int = 0
    direction: Direction = Direction.forward
    camera: str = ""

    @property
    def key(self) -> str:
        """File-safe name, unique in a data set.

        It is ``scene@lighting``, followed by ``@rDEGREES`` if the images are turned, ``@backward`` if the frames are
        played backward, and ``@camera-NAME`` if the camera has a name. A long one ends with ``=`` and a hash of it, so
        that it is a file name. No other key has this sign.
        """
        parts = [_quoted(self.scene), _quoted(self.lighting)]
        parts += [f"r{self.rotation}"] if self.rotation else []
        parts += [str(self.direction)] if self.direction != Direction.forward else []
        parts += [f"camera-{_quoted(self.camera)}"] if self.camera else []
        return _shortened("@".join(parts))

    def require_utf8(self) -> None:
        """Refuse names that tables cannot hold.

        Raises
        ------
        DataError
            If one is not UTF-8.
        """
        for name, value in self.placeholders().items():
            try:
                str(value).encode()
            except UnicodeEncodeError as error:
                raise DataError(f"{name} {value!a}", "not UTF-8", "a name that tables can hold") from error

    def placeholders(self) -> dict[str, str | int]:
        """Its fields by name, which replace ``{scene}``, ``{lighting}`` and so on in a path."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def expand(self, template: str, *, speed: int) -> Path:
        """Replace the placeholders of a path for one speed: see `PLACEHOLDERS`.

        Raises
        ------
        ValueError
            If there is an unmatched brace, or anything but the name of a placeholder between braces.
        """
        values = {**self.placeholders(), "speed": speed}
        for _, name, form, conversion in Formatter().parse(template):
            if name is not None and (name not in values or form or conversion):
                raise ValueError(f"{{{name}}} is not a placeholder, expected {', '.join(PLACEHOLDERS)}")
        return Path(template.format(**values))


def readable(key: str) -> str:
    """A key with the names in it as they are written, for messages: `SequenceId.key` is for names of files."""
    return unquote(key, errors="surrogateescape")


def _quoted(name: str) -> str:
    """A name as part of a file name. Bytes that are not UTF-8 are kept apart from all others."""
    return quote(name, safe=" ", errors="surrogateescape")


def _shortened(key: str) -> str:
    if len(key) <= _LONGEST:
        return key
    ending = "=" + sha256(key.encode()).hexdigest()[:_HASHED]
    return key[: _LONGEST - len(ending)] + ending


PLACEHOLDERS = (*(field.name for field in fields(SequenceId)), "speed")
"""Names that can be in braces in the path of a file that belongs to one sequence, or to one sequence and speed."""


def identifiers(names: Sequence[str], *, taken: Iterable[str] = ()) -> dict[str, str]:
    """Identifiers of names, for files and anchors: lower-case letters, digits and hyphens, unique by construction.

    Names that would share an identifier get numbers: their position, or the next number that is free.

    Parameters
    ----------
    names
        All different.
    taken
        Identifiers that must not be used.
    """
    wished = {name: re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:_LONGEST_NAME] or "tracker" for name in names}
    shared = {slug for slug, times in Counter([*wished.values(), *taken]).items() if times > 1}
    slugs = {name: slug for name, slug in wished.items() if slug not in shared}
    used = {*slugs.values(), *taken}
    for place, name in enumerate(names, start=1):
        if name not in slugs:
            numbered = (f"{wished[name]}-{number}" for number in itertools.count(place))
            slugs[name] = next(slug for slug in numbered if slug not in used)
            used.add(slugs[name])
    return slugs
