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
