"""Names of image files that have no numbers of frames: their order and their folders."""

import re
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

from tracknoise.sequences.sequence import require_directory

_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp")
_DIGITS = re.compile(r"(\d+)")
_LONGEST_NUMBER = 19


def natural_order(names: Iterable[str]) -> list[str]:
    """Names in the order in which people number them: ``image2`` before ``image10``."""
    return sorted(names, key=lambda name: ([_part(part) for part in _DIGITS.split(name)], name))


def folders_of(names: Iterable[str]) -> list[str]:
    """Folders of files, sorted; "." for files without."""
    return sorted({str(PurePosixPath(name).parent) for name in names})


def image_names(root: Path, folder: str) -> list[str]:
    """Names of the image files in a folder below another, without those in deeper folders and hidden ones.

    Raises
    ------
    DataError
        If there is no such folder.
    """
    files = (path for path in require_directory(root / folder).iterdir() if path.suffix.lower() in _SUFFIXES)
    return [path.relative_to(root).as_posix() for path in files if not path.name.startswith(".")]


def _part(text: str) -> tuple[int, int, str]:
    """A number or a text, in a form in which both can be compared."""
    return (0, int(text), "") if text.isascii() and text.isdigit() and len(text) < _LONGEST_NUMBER else (1, 0, text)
