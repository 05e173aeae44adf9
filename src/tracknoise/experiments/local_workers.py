"""Worker processes on this machine: calls of functions, and measuring with them."""

import atexit
import os
import pickle
import signal
import sys
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from ctypes import Array, c_char
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, TypeAlias
from weakref import WeakSet

from tracknoise import processes
from tracknoise.exceptions import with_type
from tracknoise.experiments.failures import Batch, Failure, FailureKind, Result, Results
from tracknoise.experiments.machine import memory_bytes, used_bytes
from tracknoise.opened_files import opened_for_reading

_SPAWN = get_context("spawn")
_PATH_BYTES = 4096
_NOT_DATA = (".py", ".pyc", ".so")
_LIBRARIES = (sys.prefix, sys.base_prefix, "/proc/", "/sys/")
_PATIENCE_S = 5.0

_started: "WeakSet[SpawnProcess]" = WeakSet()
_program: Connection | None = None
"""In a worker: the connection to the process that started it."""


class WorkerDiedError(Exception):
    """A worker died before it returned a result. `opened`: None if it opened none."""

    def __init__(self, exit_status: int | None, pid: int | None, opened: Path | None) -> None:
        super().__init__(exit_status, pid, opened)
        self.exit_status, self.pid, self.opened = exit_status, pid, opened


@dataclass(frozen=True, slots=True)
class Note:
    """What a function said in a worker with `notify`, before it returned."""

    values: tuple[object, ...]


@dataclass(frozen=True, slots=True)
class _Returned:
    value: Any


@dataclass(frozen=True, slots=True)
class _Raised:
    error: BaseException


class Worker:
    """One worker process. It ends when this process does, and ignores the signals of a terminal."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._opened: Array[c_char] = _SPAWN.RawArray("c", _PATH_BYTES)
        self.connection, theirs = _SPAWN.Pipe()
        self._process = _SPAWN.Process(target=_serve, args=(theirs, self._opened), daemon=True)
        _started.add(self._process)
        try:
            with theirs, processes.safely_started(environment):
                resource_tracker.ensure_running()  # otherwise started below, and it unblocks signals
                with processes.delayed():
                    self._process.start()
        except BaseException:
            self.connection.close()  # the next attempt may need its number
            raise

    @property
    def pid(self) -> int:
        """Process number."""
        return self._process.pid or 0

    def call(self, function: Callable[..., object], *arguments: object) -> None:
        """Begin a call. Its notes and its result are received with `receive`."""
        with suppress(BrokenPipeError, ConnectionResetError):  # it died, as `receive` finds out
            self.connection.send((function, arguments))

    def receive(self) -> Any:
        """Wait for the next `Note`, or the result of the call."""
        try:
            answer = self.connection.recv()
        except (EOFError, ConnectionResetError) as error:
            self._process.join(_PATIENCE_S)
            opened = self._opened.value.decode(errors="surrogateescape")
            raise WorkerDiedError(self._process.exitcode, self.pid, Path(opened) if opened else None) from error
        if isinstance(answer, _Raised):
            raise answer.error
        return answer.value if isinstance(answer, _Returned) else answer

    def result(self) -> Any:
        """Wait for the result of the call, and ignore its notes. Raises what `receive` raises."""
        while isinstance(answer := self.receive(), Note):
            pass
        return answer

    def kill(self) -> None:
        """End the process, without waiting for its end."""
        self._process.kill()

    def close(self) -> None:
        """End the process and release what is left of it."""
        self.kill()
        self._process.join(_PATIENCE_S)
        self.connection.close()


Call: TypeAlias = Callable[..., Callable[[], Any]]
"""Begins a call of a function with arguments, and returns what waits for its result."""


@contextmanager
def beside(*, is_wanted: bool = True) -> Iterator[Call]:
    """Call functions in another process while the block runs, one after the other.

    Unless it is wanted, and where it dies, they are called in this process when their results are asked for.
    """
    worker: Worker | None = None
    with suppress(OSError):  # too many processes
        worker = Worker(ENVIRONMENT) if is_wanted else None

    def begin(function: Callable[..., Any], *arguments: object) -> Callable[[], Any]:
        if worker is None:
            return partial(function, *arguments)
        worker.call(function, *arguments)
        return partial(result, worker, function, *arguments)

    def result(worker: Worker, function: Callable[..., Any], *arguments: object) -> Any:
        try:
            return worker.result()
        except WorkerDiedError:
            return function(*arguments)

    try:
        yield begin
    finally:
        if worker is not None:
            worker.close()


def notify(*values: object) -> None:
    """Send a `Note` to the process that started this one, if this is a worker."""
    if _program is not None:
        _program.send(Note(values))


@atexit.register
def _kill_started() -> None:
    """End workers that an interruption left. Python would wait for them at its exit."""
    for process in _started:
        if process.pid is not None:
            process.kill()


def _serve(program: Connection, opened: "Array[c_char]") -> None:
    """What a worker runs: calls, until the program closes the connection or dies."""
    global _program
    _program = program
    processes.ignore()
    processes.begin()
    _record_opened(opened)
    while True:
        opened.value = b""
        try:
            program.send(_outcome(program))
        except (EOFError, OSError):
            return


def _outcome(program: Connection) -> _Returned | _Raised:
    try:
        function, arguments = program.recv()
        return _Returned(function(*arguments))
    except (EOFError, KeyboardInterrupt):
        raise
    except BaseException as error:
        return _Raised(_portable(error))


def _portable(error: BaseException) -> BaseException:
    """An exception as the program can receive it, with the traceback as a note."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        error = RuntimeError(with_type(error))
    error.add_note(f"In a worker:\n{traceback.format_exc()}")
    return error


def _record_opened(opened: "Array[c_char]") -> None:
    """Record the file that is opened for reading, where the program can see it: a damaged one may end the process."""

    def record(event: str, arguments: tuple[Any, ...]) -> None:
        path = opened_for_reading(event, arguments)
        if isinstance(path, str) and not path.endswith(_NOT_DATA) and not path.startswith(_LIBRARIES):
            opened.value = os.fsencode(path)[: _PATH_BYTES - 1]

    sys.addaudithook(record)


ENVIRONMENT = {
    **processes.ONE_THREAD,
    # Images and descriptors are allocated and freed in every frame. If their memory were returned to the system each
    # time, a worker would spend a sixth of its time in page faults.
    "MALLOC_TRIM_THRESHOLD_": str(512 * 2**20),
    "MALLOC_MMAP_THRESHOLD_": str(32 * 2**20),
}
"""Variables of the environment of every worker."""
_SHARE = 0.95
"""Part of its share of the memory that a worker may use."""
_PAUSE_S = 0.2
"""Time between two checks of the memory, seconds."""
_KILLED = "the worker died while measuring it (killed, or out of memory)"


def measure_locally(
    job: Callable[[Batch], Result],
    together: list[Batch],
    *,
    workers: int,
    frame: Callable[..., None] | None = None,
) -> Results:
    """Measure in worker processes on this machine.

    Each process gets an equal share of the memory. A process that exceeds it is ended, and its batch fails. Each call
    starts new processes, so that retries do not depend on the state of old ones.
    """
    count = min(workers, len(together))
    pool = _Pool(job, deque(together), count, frame)
    try:
        yield from pool.results()
    finally:
        pool.close()


class _Pool:
    """At most `count` workers, each with one batch at a time. A worker that dies is replaced."""

    def __init__(
        self,
        job: Callable[[Batch], Result],
        waiting: deque[Batch],
        count: int,
        frame: Callable[..., None] | None,
    ) -> None:
        self._job, self._waiting, self._count, self._frame = job, waiting, count, frame
        self._idle: list[Worker] = []
        self._busy: dict[Worker, Batch] = {}
        self._limit = int(_SHARE * memory_bytes() / count) if count else 0
        self._exceeded: set[Worker] = set()

    def results(self) -> Results:
        error = self._assign()
        while self._busy:
            self._end_the_largest()
            for worker in self._ready():
                result = self._receive(worker)
                if isinstance(result, Note):
                    self._pass_on(result)
                else:
                    batch = self._busy.pop(worker)
                    error = self._assign()
                    yield batch, result
        failure = Failure(f"worker processes could not be started ({error})", None, FailureKind.transient)
        yield from ((batch, failure) for batch in self._waiting)

    def close(self) -> None:
        left = [*self._busy, *self._idle]
        for worker in left:
            worker.kill()
        for worker in left:
            worker.close()

    def _assign(self) -> str | None:
        """Give batches to workers; why one could not be started. An error would keep what was opened for it."""
        while self._waiting and len(self._busy) < self._count:
            try:
                worker = self._idle.pop() if self._idle else Worker(ENVIRONMENT)
            except OSError as error:
                return str(error)
            self._busy[worker] = self._waiting.popleft()
            worker.call(self._job, self._busy[worker])
        return None

    def _ready(self) -> Iterator[Worker]:
        """Workers that have sent something, or died."""
        connections = {worker.connection: worker for worker in self._busy}
        return (connections[item] for item in wait(list(connections), _PAUSE_S))  # type: ignore[index]

    def _receive(self, worker: Worker) -> Result | Note:
        """The result of a worker's batch, or a note that it sent before."""
        try:
            answer: Result | Note = worker.receive()
        except WorkerDiedError as death:
            worker.close()
            return Failure(
                self._cause(worker, death),
                str(death.opened or f"worker process {death.pid}"),
                FailureKind.transient,
            )
        if isinstance(answer, Note):
            return answer
        if self._waiting:
            self._idle.append(worker)
        else:
            worker.close()  # it would keep its memory
        return answer

    def _pass_on(self, note: Note) -> None:
        if self._frame:
            self._frame(*note.values)

    def _cause(self, worker: Worker, death: WorkerDiedError) -> str:
        status = death.exit_status
        if worker in self._exceeded:
            return f"the worker exceeded its share of the memory ({self._limit / 2**30:.1f} GiB); use fewer workers"
        if status in (None, -signal.SIGKILL):
            return _KILLED
        how = f"crashed ({processes.signal_name(-status)})" if status < 0 else f"ended with exit status {status}"
        where = f"; the last file it opened is {death.opened}" if death.opened else ""
        return f"the worker {how} while measuring it{where}"

    def _end_the_largest(self) -> None:
        """End the workers that use more than their share of the memory."""
        for worker in self._busy:
            if used_bytes(worker.pid) > self._limit:
                self._exceeded.add(worker)
                worker.kill()
