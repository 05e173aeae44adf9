"""Files of a run folder. Each is written completely or not at all, and can be checked against its hash."""

import hashlib
import io
import os
import re
import shutil
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO

import polars as pl

from tracknoise import atomic
from tracknoise.exceptions import SchemaError, StoreError
from tracknoise.foreign_files import is_regular_file
from tracknoise.processes import raise_if_interruption
from tracknoise.tables import schema
from tracknoise.text import printable

REMEDY = "`tracknoise run` makes it again"
_DAMAGE = (pl.exceptions.PolarsError, pl.exceptions.PanicException)


def write_atomically(path: Path, content: bytes, *, durably: bool = False) -> str:
    """Write a file as `tracknoise.atomic.write_file` does.

    Returns
    -------
    str
        Hexadecimal SHA-256 of the content.

    Raises
    ------
    StoreError
        If it cannot be written. The file is then as it was.
    """
    try:
        atomic.write_file(path, content, durably=durably)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written ({error.strerror}), expected a writable folder") from error
    return digest(content)


_ROWS_TOGETHER = 2**17
"""Rows of a table that are written, and later read, together, where it is not in memory."""


def write_parquet(path: Path, table: pl.DataFrame | pl.LazyFrame) -> str:
    """Write a table as Parquet, compressed with zstd, as `write_atomically` does; a lazy one a few rows at a time."""
    if isinstance(table, pl.LazyFrame):
        try:
            with atomic.replaced_file(path) as temporary:
                table.sink_parquet(temporary, compression="zstd", row_group_size=_ROWS_TOGETHER)
                with temporary.open("rb") as file:
                    return hashlib.file_digest(file, "sha256").hexdigest()
        except (OSError, pl.exceptions.PolarsError) as error:
            cause = _system_error(error)
            raise StoreError(f"{path}: cannot be written ({cause.strerror}), expected a writable folder") from cause
    buffer = io.BytesIO()
    table.write_parquet(buffer, compression="zstd")
    return write_atomically(path, buffer.getvalue())


def _system_error(error: Exception) -> OSError:
    """The error of the system behind one of Polars, whose text ends with its number. Raises any other error again."""
    if isinstance(error, OSError):
        return error
    number = re.search(r"\(os error (\d+)\)", str(error))
    if number is None:
        raise error
    return OSError(int(number[1]), os.strerror(int(number[1])))


def read_checked(path: Path, sha256: Collection[str], *, expected: str, remedy: str = REMEDY) -> bytes:
    """Read a file that has one of these hashes, or any content if no hash is known.

    Raises
    ------
    StoreError
        If the file is missing, cannot be read or has another hash.
    """
    try:
        content = read_regular(path)
    except FileNotFoundError as error:
        raise StoreError(f"{path}: missing, expected {expected}; {remedy}") from error
    except (OSError, ValueError) as error:
        raise StoreError(f"{path}: cannot be read ({error}), expected {expected}; {remedy}") from error
    if sha256 and digest(content) not in sha256:
        raise StoreError(f"{path}: damaged (checksum mismatch), expected {expected}; {remedy}")
    return content


def read_regular(path: Path) -> bytes:
    """Content of a file of a run.

    Raises
    ------
    StoreError
        If it is a pipe or a device: opening it would wait for a writer.
    OSError, ValueError
        If it cannot be read.
    """
    if path.exists() and not (is_regular_file(path) or path.is_dir()):
        raise StoreError(f"{path}: not a regular file, expected a file of the run")
    return path.read_bytes()


def read_text_checked(path: Path, sha256: Collection[str], *, expected: str, remedy: str = REMEDY) -> str:
    """As `read_checked`, for a file of text."""
    try:
        return read_checked(path, sha256, expected=expected, remedy=remedy).decode()
    except UnicodeDecodeError as error:
        raise StoreError(f"{path}: damaged ({error}), expected {expected}; {remedy}") from error


def digest(content: bytes) -> str:
    """Hexadecimal SHA-256 of some content."""
    return hashlib.sha256(content).hexdigest()


def read_parquet(path: Path, columns: schema.Schema, sha256: str | None) -> pl.DataFrame:
    """Read a table of known columns, and check its hash if that is known."""
    return _parsed(path, _content(path, sha256), columns)


def read_stacked(
    files: Mapping[Path, str | None], columns: schema.Schema, *, only: Collection[str] | None = None
) -> pl.DataFrame:
    """Read several tables of the same columns as one, in their order. This takes half the time of one by one.

    If all files are equal, one is parsed. Such files are mostly empty tables, of which a run has many. `files`: their
    hashes, None where that is not known.
    """
    wanted = columns if only is None else {name: kind for name, kind in columns.items() if name in only}
    contents = {path: _content(path, sha256) for path, sha256 in files.items()}
    encoded = list(contents.values())
    are_equal = all(content == encoded[0] for content in encoded)
    try:
        sources: list[IO[bytes]] = [io.BytesIO(content) for content in (encoded[:1] if are_equal else encoded)]
        scanned = pl.scan_parquet(sources) if only is None else pl.scan_parquet(sources).select(list(wanted))
        table = schema.of_this_version(scanned.collect(), wanted)
        stacked = pl.concat([table] * len(encoded)) if are_equal else table
        return schema.check_stored(stacked, wanted, "tables")
    except (OSError, SchemaError, *_DAMAGE) as error:
        raise_if_interruption(error)  # otherwise one by one, so that the error names the file
        return pl.concat([_parsed(path, content, columns).select(list(wanted)) for path, content in contents.items()])


def _content(path: Path, sha256: str | None) -> bytes:
    return read_checked(path, [sha256] if sha256 else [], expected="a table of the run")


def _parsed(path: Path, content: bytes, columns: schema.Schema) -> pl.DataFrame:
    try:
        table = pl.read_parquet(io.BytesIO(content))
    except (OSError, *_DAMAGE) as error:
        raise_if_interruption(error)
        raise StoreError(f"{path}: damaged ({error}), expected a Parquet table; {REMEDY}") from error
    return schema.check_stored(schema.of_this_version(table, columns), columns, str(path))


def is_intact(path: Path, sha256: str) -> bool:
    """Whether a regular file exists and has this hash. It is read in pieces."""
    if not is_regular_file(path):
        return False
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == sha256
    except OSError:
        return False


def require_no_links(folder: Path) -> None:
    """Refuse a folder with a link below it: what is written or removed there would be elsewhere.

    Links that lead to the folder itself are no fault. What cannot be listed is left to those who use it.

    Raises
    ------
    StoreError
        If there is one, naming it.
    """
    folders = [folder]
    while folders:
        with suppress(OSError), os.scandir(folders.pop()) as entries:
            for entry in entries:
                if entry.is_symlink():
                    leads = printable(str(Path(entry.path).readlink()))
                    raise StoreError(f"{entry.path}: a link to {leads}, expected no links in this folder; remove it")
                if entry.is_dir(follow_symlinks=False):
                    folders.append(Path(entry.path))


def remove(path: Path) -> None:
    """Remove a file, or a folder with its contents, if it exists."""
    try:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    except OSError as error:
        raise StoreError(f"{path}: cannot be removed ({error.strerror}), expected a writable folder") from error
