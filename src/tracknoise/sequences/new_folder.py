"""Folders that appear at once, when all that belongs in them is written."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tracknoise.exceptions import DataError


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Give a folder to write into, which takes its name when the block is left without an error, and vanishes with one.

    Parameters
    ----------
    path
        Where the folder is to be: new, or an empty one.

    Yields
    ------
    Path
        The folder under its passing name, beside that place.

    Raises
    ------
    DataError
        If there is something already, or it cannot be written.
    """
    path = Path(path).absolute()
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise DataError(path, "something is there already", "a new or empty folder")
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.unfinished")
    try:
        unfinished.mkdir(parents=True)
        yield unfinished
        unfinished.replace(path)
    except OSError as error:
        raise DataError(path, f"cannot be written ({error.strerror})", "a folder that can be written") from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
