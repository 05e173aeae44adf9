"""Text from outside and for outside: printable names, TOML read within bounds, and what objects show of themselves."""

import html
import json
import math
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import PurePath
from typing import Any

from tracknoise.checks import MOST_LEVELS, require_storable
from tracknoise.exceptions import first_line

_UNPRINTABLE = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
"""Control characters, signs that change the direction of writing, and what cannot be written as UTF-8 or XML."""


def is_printable(text: str) -> bool:
    """Whether a text has no control characters and can be written as UTF-8."""
    return _UNPRINTABLE.search(text) is None


def printable(text: str, *, keep: str = "") -> str:
    r"""Replace control characters by their Python escapes, such as ``\x1b``, except those in `keep`."""
    return _UNPRINTABLE.sub(lambda match: match[0] if match[0] in keep else ascii(match[0])[1:-1], text)


def counted(n: int, noun: str, nouns: str | None = None) -> str:
    """A count with its noun: ``1 image``, ``12 images``.

    Parameters
    ----------
    n
        How many.
    noun, nouns
        In the singular, and in the plural unless that has one more ``s``.
    """
    return f"{n} {plural(n, noun, nouns)}"


def plural(n: int, noun: str, nouns: str | None = None) -> str:
    """A noun as it follows a count: see `counted`."""
    return noun if n == 1 else nouns or f"{noun}s"


def counted_of(n: int, total: int, noun: str, one: str, several: str) -> str:
    """A part of a count, and what is said of it: ``1 of 30 frames has``, ``2 of 30 frames have``.

    Parameters
    ----------
    n, total
        How many, and of how many.
    noun
        In the singular.
    one, several
        What follows if `n` is 1, and otherwise: verbs in most cases.
    """
    return f"{n} of {counted(total, noun)} {one if n == 1 else several}"


def significant(value: float, digits: int) -> str:
    """A number to some significant digits, as ``:.3g`` writes it, but 1234 and not 1.23e+03."""
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text else text


MOST_SHOWN = 10
"""Of more rows than this, a notebook shows the first, and how many there are."""


def one_line(kind: str, name: str, facts: Mapping[str, object]) -> str:
    """What an object shows of itself in one line: ``<Sequence tum/desk: frames: 20; ...>``."""
    return printable(f"<{kind} {name}: {'; '.join(f'{key}: {value}' for key, value in facts.items())}>")


def constructed(settings: Any) -> str:
    """What makes a dataclass: its name, and its fields that are not as by default."""
    values = {field.name: getattr(settings, field.name) for field in fields(settings)}
    usual = {field.name: field.default for field in fields(settings)}
    changed = (f"{name}={value!r}" for name, value in values.items() if value != usual[name])
    return f"{type(settings).__name__}({', '.join(changed)})"


def html_card(title: str, facts: Mapping[str, object]) -> str:
    """A part of an HTML page: a title, and facts by name."""
    return f"<p><b>{_safe(title)}</b></p>{html_table((), facts.items())}"


def html_table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table of an HTML page: its first `MOST_SHOWN` rows, and how many there are."""
    all_rows = list(rows)
    lines = [_row("th", headings)] if headings else []
    lines += [_row("td", row) for row in all_rows[:MOST_SHOWN]]
    more = f"<p>{MOST_SHOWN} of {len(all_rows)} rows</p>" if len(all_rows) > MOST_SHOWN else ""
    return f"<table>{''.join(lines)}</table>{more}"


def _row(kind: str, cells: Iterable[object]) -> str:
    return f"<tr>{''.join(f'<{kind}>{_safe(cell)}</{kind}>' for cell in cells)}</tr>"


def _safe(value: object) -> str:
    return html.escape(printable(str(value)))


_TEXT_OR_COMMENT = re.compile(
    r'"""(?:\\.|[^\\])*?(?:"""|\Z)'
    r"|'''.*?(?:'''|\Z)"
    r'|"(?:\\[^\n]|[^"\\\n])*"?'
    r"|'[^'\n]*'?"
    r"|#[^\n]*",
    re.DOTALL,
)
_NO_KEY = re.compile(r"[^\w.\s-]+")
_MOST_DOTS = 64


def parse_toml(text: str) -> dict[str, Any]:
    """What a TOML file holds.

    Raises
    ------
    ValueError
        If it is no TOML, or has longer keys, deeper lists and tables or larger numbers than any program needs. The
        message is one line.
    """
    try:
        _require_short_keys(text)
        table = tomllib.loads(text)
        require_storable(table)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{error}, expected TOML") from error
    except RecursionError as error:
        raise ValueError(f"lists and tables more than {MOST_LEVELS} deep, expected fewer levels") from error
    except ValueError as error:  # also of numbers with thousands of digits
        raise ValueError(first_line(error)) from error
    return table


def _require_short_keys(text: str) -> None:
    """Refuse keys such as ``a.b.c`` of very many parts: the time to read one grows with the cube of their number."""
    for number, line in enumerate(_TEXT_OR_COMMENT.sub(_placeholder, text).split("\n"), start=1):
        for part in _NO_KEY.split(line):
            if part.count(".") > _MOST_DOTS:
                raise ValueError(f"line {number}: a key of {part.count('.') + 1} parts, expected at most {MOST_LEVELS}")


def _placeholder(match: re.Match[str]) -> str:
    """A short word in place of a text, which may be part of a key, on as many lines."""
    return ("" if match[0].startswith("#") else "_") + "\n" * match[0].count("\n")


def dotted(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Every setting with its dotted name. A table in a list has its position: ``views[1].rotation``."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from dotted(inner, f"{key}.{name}".lstrip("."))
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for position, inner in enumerate(value):
            yield from dotted(inner, f"{key}[{position}]")
    else:
        yield key, value


def browser_json(value: object) -> str:
    """JSON that every browser reads: numbers that are not finite are null."""
    return json.dumps(_with_null(value), separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def _with_null(value: object) -> object:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _with_null(entry) for key, entry in value.items()}
    return [_with_null(entry) for entry in value] if isinstance(value, list | tuple) else value


def without_folders(settings: Any, paths: Sequence[str] | None = None) -> Any:
    """Settings, or a text, with the last name of each absolute path: what is shown is sent to others.

    Parameters
    ----------
    settings
        Tables, lists and texts.
    paths
        Absolute paths, the longest first; by default those among the settings (`absolute_paths`).
    """
    absolute = list(absolute_paths(settings)) if paths is None else paths
    if isinstance(settings, Mapping):
        return {key: without_folders(value, absolute) for key, value in settings.items()}
    if isinstance(settings, list):
        return [without_folders(value, absolute) for value in settings]
    if isinstance(settings, str):
        for path in absolute:
            settings = settings.replace(path, f".../{PurePath(path).name}")
    return settings


def absolute_paths(settings: object) -> list[str]:
    """Absolute paths among the values of settings, the longest first. Topics of bags look like them and are none."""
    return sorted(set(_paths(settings)), key=len, reverse=True)


def _paths(value: object) -> Iterator[str]:
    if isinstance(value, Mapping):
        for key, entry in value.items():
            if "topic" not in str(key):
                yield from _paths(entry)
    elif isinstance(value, list):
        for entry in value:
            yield from _paths(entry)
    elif isinstance(value, str) and PurePath(value).is_absolute() and PurePath(value).name:
        yield value
