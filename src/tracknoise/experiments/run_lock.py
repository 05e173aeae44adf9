"""The lock of a run folder, into which one start at a time may write, and its manifest while it is measured.

The package `filelock` (4.2) gives less: it does not say who holds a lock; its file stays, while here a file tells other
hosts that a run goes on; it refuses network file systems whose `flock` is ENOLCK or EOPNOTSUPP; and it does not notice
that the file of a lock was replaced, so that two could hold it.
"""

import errno
import fcntl
import json
import os
import secrets
import socket
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from tracknoise import processes
from tracknoise.atomic import is_running
from tracknoise.exceptions import SchemaError, StoreError
from tracknoise.experiments.failures import Failure
from tracknoise.tables.files import require_no_links
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.store import RunFolder

_UNSUPPORTED = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP}
_PATIENCE_S = 10.0
"""Longest time for which a network file system may show old file contents, seconds."""


@dataclass(frozen=True, slots=True)
class _Holder:
    """Contents of the lock file."""

    pid: int
    host: str
    token: str


@dataclass(frozen=True, slots=True)
class Claim:
    """Proof that a start holds the lock of a run folder, as sent to its workers."""

    path: Path  # path of the lock file
    token: str  # token in the lock file while that start runs
    patience_s: float = _PATIENCE_S  # how long to wait for the token before the lock counts as lost, seconds

    def check(self) -> None:
        """Check that the start which sent this claim still holds the lock.

        A worker can outlive the program that sent it its work. It must not write into the run of the next start.
        """
        deadline = time.monotonic() + self.patience_s
        while not self._stands():
            if time.monotonic() > deadline:
                raise StoreError(
                    f"{self.path.parent}: not held by this run as seen from {socket.gethostname()}, "
                    "expected the same folder on every machine, and a run that still holds its lock"
                )
            time.sleep(min(0.5, self.patience_s))

    def require(self) -> None:
        """Check, in the process that holds the lock, that the folder is still there."""
        if not self._stands():
            raise StoreError(
                f"{self.path.parent}: removed or replaced during the run, expected it to stay; "
                "run the same command again to start over"
            )

    @contextmanager
    def explained(self) -> Iterator[None]:
        """Give the removal of the folder as the cause of an error in the block, if it was removed."""
        try:
            yield
        except (StoreError, SchemaError) as error:
            try:
                self.require()
            except StoreError as cause:
                raise cause from error
            raise

    def _stands(self) -> bool:
        try:
            holder = _parse(self.path.read_bytes())
        except OSError:
            return False
        return holder is not None and holder.token == self.token


@contextmanager
def hold(run: RunFolder) -> Iterator[Claim]:
    """Lock a run folder. The folder is created if it does not exist.

    The operating system releases the lock of a process that dies, so a killed run leaves no lock on its host. Process
    and host are also written into the file, for users and for hosts that see the file but not the lock.
    """
    path = run.lock_path.absolute()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = _open(path)
    except OSError as error:
        if error.errno == errno.ELOOP:
            require_no_links(path.parent)
        raise StoreError(f"{path.parent}: cannot be written ({error.strerror}), expected a writable folder") from error
    try:
        if run.exists:
            require_no_links(run.path)
        yield _sign(path, descriptor)
    finally:
        with processes.delayed():  # a lock that is left would have to be deleted by hand on another host
            _release(path, descriptor)


def _release(path: Path, descriptor: int) -> None:
    with suppress(OSError):
        if os.path.samestat(path.stat(), os.fstat(descriptor)):  # another start may have made the folder again
            path.unlink()
    os.close(descriptor)


def _open(path: Path) -> int:
    """Descriptor of the locked lock file. Retries if the holder removed the file in the meantime."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        try:
            _require_own(path, os.fstat(descriptor))
            _require_free(path, descriptor)
            if path.exists() and os.path.samestat(path.stat(), os.fstat(descriptor)):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _require_own(path: Path, status: os.stat_result) -> None:
    """Refuse a file that is elsewhere too, or no file: what it holds is replaced."""
    if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
        what = "a file with other names" if stat.S_ISREG(status.st_mode) else "not a regular file"
        raise StoreError(f"{path}: {what}, expected the lock of a run; remove it")


def _require_free(path: Path, descriptor: int) -> None:
    """Lock the file. If another process holds it, raise an error that names the process."""
    locked = _lock(descriptor)
    holder = _parse(os.pread(descriptor, 1000, 0))
    if locked is False:
        who = f"process {holder.pid} on {holder.host}" if holder else "another process"
        raise StoreError(f"{path.parent}: in use by {who}, expected a folder that is not in use")
    if holder is None:
        return
    if holder.host != socket.gethostname() or (locked is None and is_running(holder.pid)):
        raise StoreError(
            f"{path.parent}: in use by process {holder.pid} on {holder.host}, expected a folder that is not in use; "
            f"if that process no longer runs, delete {path}"
        )


def _lock(descriptor: int) -> bool | None:
    """Whether the file was locked; None if the file system does not support locks."""
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
    """Write this process into the lock file."""
    holder = _Holder(os.getpid(), socket.gethostname(), secrets.token_hex(16))
    try:
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, json.dumps(asdict(holder)).encode(), 0)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written ({error.strerror}), expected a writable folder") from error
    return Claim(path, holder.token)


def _parse(content: bytes) -> _Holder | None:
    """The holder named in a lock file; None if the file is incomplete."""
    try:
        return _Holder(**json.loads(content))
    except (ValueError, TypeError, RecursionError):
        return None


_SHARE = 0.05
"""Maximum share of the time that is spent writing the manifest."""


class ManifestWriter:
    """Records measured and failed sequences, and writes them to the run folder during the run and at its end.

    Writing takes longer with more sequences. It is delayed so that it takes at most a twentieth of the time. Sequences
    measured since the last write are measured again if the run is killed. `manifest`: changed in place.
    """

    def __init__(self, run: RunFolder, manifest: Manifest, claim: Claim | None = None) -> None:
        self._run, self.manifest, self._claim = run, manifest, claim
        self._failures: dict[str, Failure] = {}
        self._next = 0.0

    def __enter__(self) -> Self:
        self.write()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.write()
        except StoreError:
            if error is None:  # otherwise report the error that ended the run
                raise

    def measured(self, entry: SequenceEntry) -> None:
        """Record that a sequence was measured and its tables are complete. Earlier statistics are outdated."""
        self.manifest.sequences[entry.key] = entry
        self.manifest.statistics.clear()

    def failed(self, key: str, failure: Failure) -> None:
        """Record that a sequence failed."""
        self.manifest.failures[key] = failure.cause
        self._failures[key] = failure

    def write_if_due(self) -> None:
        """Write, unless the last write was too recent."""
        if time.monotonic() >= self._next:
            self.write()

    def write(self) -> None:
        """Write manifest and failures."""
        if self._claim:
            self._claim.require()  # a folder that was removed must not be created again
        started = time.monotonic()
        self._run.write_failures({key: failure.entry for key, failure in self._failures.items()})
        self._run.write_manifest(self.manifest)
        finished = time.monotonic()
        self._next = finished + (finished - started) / _SHARE
