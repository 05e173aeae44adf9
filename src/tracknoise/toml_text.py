"""TOML that a user wrote, within bounds: some short texts take minutes to read."""

import re
import tomllib
from typing import Any

from tracknoise.checks import MOST_LEVELS, require_storable
from tracknoise.exceptions import first_line

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
        found = tomllib.loads(text)
        require_storable(found)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{error}, expected TOML") from error
    except RecursionError as error:
        raise ValueError(f"lists and tables more than {MOST_LEVELS} deep, expected fewer levels") from error
    except ValueError as error:  # also of numbers with thousands of digits
        raise ValueError(first_line(error)) from error
    return found


def _require_short_keys(text: str) -> None:
    """Refuse keys such as ``a.b.c`` of very many parts: the time to read one grows with the cube of their number."""
    for number, line in enumerate(_TEXT_OR_COMMENT.sub(_placeholder, text).split("\n"), start=1):
        for part in _NO_KEY.split(line):
            if part.count(".") > _MOST_DOTS:
                raise ValueError(f"line {number}: a key of {part.count('.') + 1} parts, expected at most {MOST_LEVELS}")


def _placeholder(found: re.Match[str]) -> str:
    """A short word in place of a text, which may be part of a key, on as many lines."""
    return ("" if found[0].startswith("#") else "_") + "\n" * found[0].count("\n")
