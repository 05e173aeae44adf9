"""Folders of sequences that appear at once, when all their files are written."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tracknoise import atomic
from tracknoise.exceptions import DataError


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """As `tracknoise.atomic.created_folder`.

    Parameters
    ----------
    path
        Where the folder is to be: new, or an empty one.

    Yields
    ------
    Path
        The folder under its temporary name, beside that place.

    Raises
    ------
    DataError
        If there is something already, or it cannot be written.
    """
    path = Path(path).absolute()
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise DataError(path, "already exists", "a new or empty folder")
    try:
        with atomic.created_folder(path) as unfinished:
            yield unfinished
    except OSError as error:
        raise DataError(path, f"cannot be written ({error.strerror})", "a folder that can be written") from error
