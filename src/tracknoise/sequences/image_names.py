"""Names of image files that have no numbers of frames: those of a folder, and their folders."""

from collections.abc import Iterable
from pathlib import Path, PurePosixPath

from tracknoise.sequences.sequence import require_directory

_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp")


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
