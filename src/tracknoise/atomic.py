"""Files and folders that appear whole or not at all."""

import fcntl
import glob
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

UNFINISHED = ".tracknoise-unfinished"
"""How the name of a file or folder ends as long as it is not finished."""


def write_file(path: Path, content: bytes, *, durably: bool = False) -> None:
    """Write a file under a temporary name and rename it, so that no reader sees half of it.

    Parameters
    ----------
    path
        Where. Its folder is made.
    content
        All of it.
    durably
        Wait until the disk has it. Even a power cut then leaves either the old content or the new.

    Raises
    ------
    OSError
        If it cannot be written. The file is then as it was.
    """
    with replaced_file(path) as temporary, temporary.open("wb") as file:
        file.write(content)
        if durably:
            file.flush()
            os.fsync(file.fileno())


@contextmanager
def replaced_file(path: Path) -> Iterator[Path]:
    """Give the path of a file to write. It gets its name when the block ends without an error.

    Parameters
    ----------
    path
        Where the file is to be. Its folder is made. A file that is there already is replaced.

    Yields
    ------
    Path
        The file under its temporary name, beside that place.

    Raises
    ------
    OSError
        If it cannot be written. The file is then as it was.
    """
    temporary = _temporary(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    finally:  # also of an interrupt
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def created_folder(path: Path) -> Iterator[Path]:
    """Give a folder to write into. It gets its name when the block ends without an error, and is removed otherwise.

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
    OSError
        If there is something already, or the folder cannot be written.
    """
    with _building(path) as building:
        yield building
        building.replace(path)


@contextmanager
def replaced_folder(path: Path) -> Iterator[Path]:
    """As `created_folder`, but a folder that is there already is replaced, as is a link to one.

    Raises
    ------
    OSError
        If there is a file of that name, or the folder cannot be written.
    """
    old = _temporary(path)
    with _building(path) as building:
        try:
            yield building
            if path.is_dir():
                path.rename(old)
            building.rename(path)
        finally:
            if old.is_symlink():
                old.unlink()
            shutil.rmtree(old, ignore_errors=True)


def unfinished(folder: Path, *, of: str = "") -> Iterator[Path]:
    """Files and folders within a folder that were begun and not finished.

    Parameters
    ----------
    folder
        Where to look.
    of
        Name that the finished one would have had. By default, any.
    """
    return folder.glob(f".{glob.escape(of)}.*{UNFINISHED}" if of else f".*{UNFINISHED}")


@contextmanager
def _building(path: Path) -> Iterator[Path]:
    building, descriptor = _claimed(path)
    try:
        discard_abandoned(path.parent, of=path.name)
        yield building
    finally:
        shutil.rmtree(building, ignore_errors=True)
        os.close(descriptor)


def _claimed(path: Path) -> tuple[Path, int]:
    """A new folder and its locked descriptor. The operating system releases the lock of a process that is killed."""
    while True:
        building = _temporary(path)
        building.mkdir(parents=True)
        with suppress(FileNotFoundError):  # another process removed it before it was locked
            descriptor = os.open(building, os.O_RDONLY)
            if _lock(descriptor) is not False and building.exists():
                return building, descriptor
            os.close(descriptor)


def _lock(descriptor: int) -> bool | None:
    """Whether a folder was locked; None if the file system does not support locks of folders."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(8)}{UNFINISHED}")


def discard_abandoned(folder: Path, *, of: str = "") -> None:
    """Remove the unfinished folders of processes that were killed. Those of running processes stay.

    Parameters
    ----------
    folder, of
        As in `unfinished`.
    """
    for leftover in unfinished(folder, of=of):
        with suppress(OSError):  # it is a file or a link, or another process removed it
            _discard_if_abandoned(leftover, os.open(leftover, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW))


def _discard_if_abandoned(leftover: Path, descriptor: int) -> None:
    """Remove a folder that no process has locked. Where there are no locks, the process in its name must have ended."""
    pid = leftover.name.removesuffix(UNFINISHED).split(".")[-2]
    try:
        locked = _lock(descriptor)
        if locked or (locked is None and pid.isdecimal() and not is_running(int(pid))):
            shutil.rmtree(leftover, ignore_errors=True)
    finally:
        os.close(descriptor)


def is_running(pid: int) -> bool:
    """Whether a process of this machine runs, as far as can be seen."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # it is another user's, or no process can have this number
        return True
    return True
