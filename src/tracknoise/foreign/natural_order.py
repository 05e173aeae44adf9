"""The order of names with numbers in them."""

import re
from collections.abc import Iterable

_DIGITS = re.compile(r"(\d+)")
_LONGEST_NUMBER = 19


def natural_order(names: Iterable[str]) -> list[str]:
    """Names in the order in which people number them: ``image2`` before ``image10``."""
    return sorted(names, key=lambda name: ([_part(part) for part in _DIGITS.split(name)], name))


def _part(text: str) -> tuple[int, int, str]:
    """A number or a text, in a form in which both can be compared."""
    return (0, int(text), "") if text.isascii() and text.isdigit() and len(text) < _LONGEST_NUMBER else (1, 0, text)
