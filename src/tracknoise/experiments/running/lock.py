"""One start at a time in a run folder: who holds it, and whether a worker still works for whoever does."""

import errno
import fcntl
import json
import os
import secrets
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from tracknoise.exceptions import StoreError
from tracknoise.tables.store import RunFolder

_UNSUPPORTED = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP}
_PATIENCE_S = 10.0
"""How long a network file system may go on showing what a file was before."""


@dataclass(frozen=True, slots=True)
class _Holder:
    """What the lock's file says."""

    pid: int
    host: str
    token: str


@dataclass(frozen=True, slots=True)
class Claim:
    """One start's hold on a run folder, as sent to its workers.

    Attributes
    ----------
    path
        Of the lock's file.
    token
        What it says while that start goes on.
    patience_s
        How long to look before it is taken to be another's, seconds.
    """

    path: Path
    token: str
    patience_s: float = _PATIENCE_S

    def check(self) -> None:
        """Refuse to go on where the folder is not seen, or is no longer held by the start that this is work for.

        A worker can outlive whoever sent it its work. What it writes then would come between the files of the next
        start.

        Raises
        ------
        StoreError
            If the lock is another one or none.
        """
        deadline = time.monotonic() + self.patience_s
        while not self._stands():
            if time.monotonic() > deadline:
                raise StoreError(
                    f"{self.path.parent}: not held by this run as seen from {socket.gethostname()}, "
                    "expected the same folder on every machine, and its run to go on"
                )
            time.sleep(min(0.5, self.patience_s))

    def _stands(self) -> bool:
        try:
            holder = _parse(self.path.read_bytes())
        except OSError:
            return False
        return holder is not None and holder.token == self.token


@contextmanager
def hold(run: RunFolder) -> Iterator[Claim]:
    """Lock a run folder, which is made if need be.

    The system releases the lock of a process that dies, so that one that was killed stands in nobody's way; its name
    is written into the file for people, and for hosts that see the file but not the lock.

    Raises
    ------
    StoreError
        If another process holds it, named by its id and host, or it cannot be written.
    """
    path = run.lock_path.absolute()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = _open(path)
    except OSError as error:
        raise StoreError(f"{path.parent}: cannot be written ({error.strerror}), expected a writable folder") from error
    try:
        yield _sign(path, descriptor)
    finally:
        with suppress(OSError):
            path.unlink()
        os.close(descriptor)


def _open(path: Path) -> int:
    """Descriptor of the lock's file, locked; tried anew when the file was removed by its holder in between."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            _require_free(path, descriptor)
            if path.exists() and os.path.samestat(path.stat(), os.fstat(descriptor)):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _require_free(path: Path, descriptor: int) -> None:
    """Lock the file, or refuse, naming who holds it."""
    locked = _lock(descriptor)
    holder = _parse(os.pread(descriptor, 1000, 0))
    if locked is False:
        who = f"process {holder.pid} on {holder.host}" if holder else "another process"
        raise StoreError(f"{path.parent}: in use by {who}, expected a folder that no other run is writing into")
    if holder is None:
        return
    if holder.host != socket.gethostname() or (locked is None and _is_running(holder.pid)):
        raise StoreError(
            f"{path.parent}: in use by process {holder.pid} on {holder.host}, expected a folder that no other run is "
            f"writing into; if that process is gone, delete {path}"
        )


def _lock(descriptor: int) -> bool | None:
    """Whether the file was locked; None where the file system knows no locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise
        return None
    return True


def _sign(path: Path, descriptor: int) -> Claim:
    """Write into the lock's file whose it is now."""
    holder = _Holder(os.getpid(), socket.gethostname(), secrets.token_hex(16))
    try:
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, json.dumps(asdict(holder)).encode(), 0)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written ({error.strerror}), expected a writable folder") from error
    return Claim(path, holder.token)


def _parse(content: bytes) -> _Holder | None:
    """Whom the lock's file names; None if its writer died before it did."""
    try:
        return _Holder(**json.loads(content))
    except (ValueError, TypeError):
        return None


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
