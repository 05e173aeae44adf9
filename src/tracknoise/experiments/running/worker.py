"""A process that calls functions for this one. The two share a pair of sockets that no other process can reach."""

import atexit
import os
import pickle
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from ctypes import Array, c_char
from dataclasses import dataclass
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakSet

from tracknoise import children, signals
from tracknoise.exceptions import with_type
from tracknoise.foreign.opened import opened_for_reading

_SPAWN = get_context("spawn")
_PATH_BYTES = 4096
_NOT_DATA = (".py", ".pyc", ".so")
_LIBRARIES = (sys.prefix, sys.base_prefix, "/proc/", "/sys/")
_PATIENCE_S = 5.0

_Result = TypeVar("_Result")

_started: "WeakSet[SpawnProcess]" = WeakSet()
_program: Connection | None = None
"""In a worker: the connection to the process that started it."""


class WorkerDiedError(Exception):
    """A worker died before it returned a result.

    Parameters
    ----------
    exit_status
        As in `multiprocessing.Process.exitcode`: negative for the signal that ended it.
    pid
        Of the worker.
    opened
        File that the call was the last to open for reading; None if it opened none.
    """

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
    """One worker process. It ends when this process does, and ignores the signals of a terminal.

    Parameters
    ----------
    environment
        Environment variables of the worker, besides those of this process.

    Raises
    ------
    OSError
        If the process cannot be started.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._opened: Array[c_char] = _SPAWN.RawArray("c", _PATH_BYTES)
        self.connection, theirs = _SPAWN.Pipe()
        self._process = _SPAWN.Process(target=_serve, args=(theirs, self._opened), daemon=True)
        _started.add(self._process)
        try:
            with theirs, children.safely_started(environment):
                resource_tracker.ensure_running()  # otherwise started below, and it unblocks signals
                with signals.delayed():
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
        """Wait for the next `Note`, or the result of the call.

        Raises
        ------
        WorkerDiedError
            If the worker died.
        BaseException
            What the function raised.
        """
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


@contextmanager
def beside(function: Callable[..., _Result], *arguments: object) -> Iterator[Callable[[], _Result]]:
    """Call a function in another process while the block runs. Yields what waits for its result."""
    worker = Worker({})
    try:
        worker.call(function, *arguments)
        yield worker.result
    finally:
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
    signals.ignore()
    children.begin()
    threading.Thread(target=_end_with_program, daemon=True).start()
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


def _end_with_program() -> None:
    """End this process when the program dies, also in the middle of a call."""
    program = parent_process()
    if program is not None:
        wait([program.sentinel])
        os._exit(1)


def _record_opened(opened: "Array[c_char]") -> None:
    """Record the file that is opened for reading, where the program can see it: a damaged one may end the process."""

    def record(event: str, arguments: tuple[Any, ...]) -> None:
        path = opened_for_reading(event, arguments)
        if isinstance(path, str) and not path.endswith(_NOT_DATA) and not path.startswith(_LIBRARIES):
            opened.value = os.fsencode(path)[: _PATH_BYTES - 1]

    sys.addaudithook(record)
