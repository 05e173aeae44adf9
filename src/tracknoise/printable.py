"""Text that can be shown: names from files and folders may contain control characters."""

import re

_UNPRINTABLE = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
"""Control characters, signs that change the direction of writing, and what cannot be written as UTF-8 or XML."""


def is_printable(text: str) -> bool:
    """Whether a text has no control characters and can be written as UTF-8."""
    return _UNPRINTABLE.search(text) is None


def printable(text: str, *, keep: str = "") -> str:
    r"""Replace control characters by their Python escapes, such as ``\x1b``, except those in `keep`."""
    return _UNPRINTABLE.sub(lambda found: found[0] if found[0] in keep else ascii(found[0])[1:-1], text)
