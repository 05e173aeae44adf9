"""Calls of parsers that can end or block the whole process, in a child process with limits of time and memory.

Compiled parsers abort on some damaged files, and others take forever. The child is started when it is first needed. It
serves all calls of this process, one after another, and is started again after it was lost. It says what it has read.
"""

import atexit
import math
import os
import pickle
import resource
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any, TypeVar

from tracknoise.exceptions import TracknoiseError, first_line
from tracknoise.opened_files import note, note_elsewhere, noting
from tracknoise.processes import end_with, module_path

T = TypeVar("T")

_READY = b"ready"
_LENGTH_BYTES = 8
_PROGRAM = "import sys; sys.path = sys.argv[1:]; from tracknoise.parsing_child import serve; serve()"
_START_S = 600.0
_CPU_S, _BYTES_PER_SECOND = 5, 1 << 20
_WALL_PER_CPU = 60.0
"""Limits of CPU time, so that no result depends on what else a machine does, and of time for a child that waits."""
_LOOK_S = 1.0
_MEMORY_BYTES = 1 << 30
_MEMORY_PER_BYTE = 32


class LostError(Exception):
    """The child ended, or took too long. The message says which."""


def limits_of(size: int) -> tuple[int, int]:
    """How many seconds of the processor, and how many bytes of memory, a call may take that parses so many bytes."""
    return _CPU_S + size // _BYTES_PER_SECOND, _MEMORY_BYTES + _MEMORY_PER_BYTE * size


def call_in_child(function: Callable[..., T], *arguments: object, size: int, who: str = "its parser") -> T:
    """Call a function in the child process.

    Parameters
    ----------
    function
        Of a module, so that the child can import it.
    *arguments
        They and the result must be picklable.
    size
        Size of the file that is parsed, bytes. It determines how much memory and time the call may take: `limits_of`.
    who
        What ends or takes too long, for the error.

    Raises
    ------
    LostError
        If the child ends before it answers, or does not answer in time.
    TracknoiseError
        As the function. Its other exceptions become a `LostError` too, with the first line of their message.
    """
    global _used_s
    for argument in arguments:
        if isinstance(argument, Path) and argument.is_file():
            note(argument)  # which compiled code of the child may open
    with _lock:
        cpu_s, memory = limits_of(size)
        answer = _child().ask(pickle.dumps((function, arguments, memory, cpu_s)), _WALL_PER_CPU * cpu_s, who)
    succeeded, value, files, folders, used_s = pickle.loads(answer)
    note_elsewhere(files, folders)
    _used_s += used_s
    if not succeeded:
        raise value
    result: T = value
    return result


def cpu_time_of_calls() -> float:
    """Time of the processor that calls of this process took in its children so far, seconds."""
    return _used_s


@dataclass(frozen=True, slots=True)
class _Child:
    """The running child, of the process `owner`."""

    process: subprocess.Popen[bytes]
    owner: int

    @classmethod
    def started(cls) -> "_Child":
        """A new child, once it can be asked."""
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", _PROGRAM, *module_path()],  # -P: not from the current folder, which -c adds
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for this process
        )
        child = cls(process, os.getpid())
        child._receive(len(_READY), time.monotonic() + _START_S, "the child")
        return child

    @property
    def is_usable(self) -> bool:
        """Whether it runs, and was not inherited from a process that forked this one."""
        return self.owner == os.getpid() and self.process.poll() is None

    def ask(self, request: bytes, seconds: float, who: str) -> bytes:
        """Send a request and wait for the answer."""
        deadline = time.monotonic() + seconds
        try:
            _send(self._pipe(self.process.stdin), request)
            length = int.from_bytes(self._receive(_LENGTH_BYTES, deadline, who))
            return self._receive(length, deadline, who)
        except BaseException as error:  # an interrupt too: a late answer must not become that of the next request
            self.close()
            if self.process.returncode == -signal.SIGXCPU:
                raise LostError(f"{who} takes too long") from error
            if isinstance(error, OSError):
                raise LostError(f"{who} ended") from error
            raise

    def close(self) -> None:
        """End it."""
        if self.owner == os.getpid():
            self.process.kill()
            self.process.communicate()

    def _receive(self, count: int, deadline: float, who: str) -> bytes:
        descriptor, received = self._pipe(self.process.stdout).fileno(), bytearray()
        poller = select.poll()
        poller.register(descriptor, select.POLLIN)
        while len(received) < count:
            if not poller.poll(max(0.0, 1e3 * (deadline - time.monotonic()))):
                raise LostError(f"{who} takes too long")
            part = os.read(descriptor, count - len(received))
            if not part:
                raise LostError(f"{who} ended")
            received += part
        return bytes(received)

    @staticmethod
    def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
        assert pipe is not None, "both are pipes"
        return pipe


_lock = threading.Lock()
_current: _Child | None = None
_used_s = 0.0


def _child() -> _Child:
    global _current
    if _current is None or not _current.is_usable:
        _current = _Child.started()
        atexit.register(_current.close)
    return _current


def _send(pipe: IO[bytes], message: bytes) -> None:
    pipe.write(len(message).to_bytes(_LENGTH_BYTES) + message)
    pipe.flush()


def serve() -> None:
    """Answer requests until there are no more. This is what the child does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with(partial(_wait_for_end_of, os.getppid()))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a parser prints is no answer
    answers.write(_READY)
    answers.flush()
    while length := requests.read(_LENGTH_BYTES):
        _send(answers, _answer(requests.read(int.from_bytes(length))))


def _wait_for_end_of(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_S)


def _answer(request: bytes) -> bytes:
    function, arguments, memory, cpu_s = pickle.loads(request)
    _limit_memory(memory)
    _limit_time(cpu_s)
    answer: tuple[bool, Any]
    begun = time.process_time()
    with noting(lambda _: True, most=0) as opened:
        try:
            answer = True, function(*arguments)
        except TracknoiseError as error:
            answer = False, error
        except BaseException as error:
            answer = False, LostError(first_line(error))
    return pickle.dumps((*answer, opened.files, opened.folders, time.process_time() - begun))


def _limit_time(more_s: int) -> None:
    """Limit this process to the CPU time that it has used, and so many seconds more."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    _set_soft_limit(resource.RLIMIT_CPU, math.ceil(used.ru_utime + used.ru_stime) + more_s)


def _limit_memory(more: int) -> None:
    """Limit this process to what it uses now, and so many bytes more."""
    used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    _set_soft_limit(resource.RLIMIT_AS, used + more)


def _set_soft_limit(kind: int, soft: int) -> None:
    hard = resource.getrlimit(kind)[1]
    resource.setrlimit(kind, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))
