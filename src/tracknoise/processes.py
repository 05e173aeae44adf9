"""Processes: how children of this program start and end, which signals end a program, and its standard streams."""

import errno
import io
import os
import resource
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from ctypes import CDLL
from multiprocessing import get_context, parent_process
from types import MappingProxyType
from typing import TYPE_CHECKING, TextIO

from tracknoise.exceptions import SettingsError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


_STDOUT, _STDERR = 1, 2


def prepare() -> None:
    """Let what cannot be written to stdout and stderr be dropped, so that it stops nothing. See `error_of_stdout`."""
    _reserve_numbers()
    sys.stdout, sys.stderr = _dropping(_STDOUT, sys.stdout), _dropping(_STDERR, sys.stderr)


_GIB = 1024**3
_LEAST_MEMORY_GIB = 4


def require_memory() -> None:
    """Refuse a limit of virtual memory under which numerical libraries wait for ever, or are not loaded.

    Raises
    ------
    SettingsError
        If this process may have less than it needs.
    """
    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    if most != resource.RLIM_INFINITY and most < _LEAST_MEMORY_GIB * _GIB:
        raise SettingsError(
            f"virtual memory is limited to {most / _GIB:.1f} GiB, expected at least {_LEAST_MEMORY_GIB} GiB "
            "(`ulimit -v unlimited`)"
        )


def error_of_stdout() -> OSError | None:
    """Why something could not be written to stdout since `prepare`. None if its reader has gone: that has read enough.

    What is still in memory is written first.
    """
    try:
        sys.stdout.flush()
    except OSError as flushing:  # of a stream that drops nothing
        return flushing
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    error = raw.error if isinstance(raw, _Dropping) else None
    return None if isinstance(error, BrokenPipeError) else error


class _Dropping(io.FileIO):
    """A file that is open. What cannot be written to it is dropped, and not written later either.

    Attributes
    ----------
    error
        The first that occurred.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number, "w", closefd=False)
        self.error: OSError | None = None

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write some bytes, and return how many were written or dropped."""
        try:
            written: int | None = super().write(data)
            if written is None:
                raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        except OSError as error:
            self.error = self.error or error
            return memoryview(data).nbytes
        return written


def _dropping(number: int, like: TextIO | None) -> TextIO:
    """A stream of text in place of another, which is None if it is closed."""
    raw = _Dropping(number)
    by_lines = number == _STDERR or raw.isatty() or getattr(like, "write_through", False)
    encoding = "utf-8" if like is None else like.encoding
    return io.TextIOWrapper(io.BufferedWriter(raw), encoding, errors="replace", line_buffering=by_lines)


def _reserve_numbers() -> None:
    """Open something in place of closed streams. Other files would get their numbers, and what is printed with them.

    Stdout is opened for reading, so that writing to it still fails.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if number == _STDOUT else os.O_RDWR)  # the lowest number that is free
            os.set_inheritable(number, True)


_SAFE_PATH, _OURS = "PYTHONSAFEPATH", "set by tracknoise"
_NOTHING: Mapping[str, str] = MappingProxyType({})


@contextmanager
def safely_started(environment: Mapping[str, str] = _NOTHING) -> Iterator[None]:
    """Let processes that `multiprocessing` starts in the block not import modules of the current folder by mistake.

    They begin with ``python -c``, which looks in the current folder first. A ``pickle.py`` among the data would be run
    in place of the standard one. If this process itself looks there, as an interactive one does, they do so last.
    `begin` must be the first call in each of them.

    Parameters
    ----------
    environment
        Environment variables of these processes, besides those of this one.
    """
    safe = {} if os.environ.get(_SAFE_PATH) else {_SAFE_PATH: _OURS}
    with _added_to_environment({**environment, **safe}), _current_folder_last():
        yield


def begin() -> None:
    """Prepare a process that was started by `safely_started`. Its results are not what it prints."""
    if os.environ.get(_SAFE_PATH) == _OURS:
        del os.environ[_SAFE_PATH]  # programs of plug-ins find what lies beside them
    prepare()
    from multiprocessing.connection import wait  # not needed by a program without workers

    parent = parent_process()
    if parent is not None:
        end_with(lambda: wait([parent.sentinel]))


def end_with(wait_for_end: Callable[[], object]) -> None:
    """End this process when a call returns, such as one that waits for the end of its parent; also amid other work."""

    def end() -> None:
        wait_for_end()
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


ONE_THREAD: Mapping[str, str] = MappingProxyType(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS"), "1")
)
"""Variables of the environment of a process that is one of several."""


@contextmanager
def process_pool(workers: int, environment: Mapping[str, str] = _NOTHING) -> Iterator[ProcessPoolExecutor]:
    """Processes that share work; the parameters are their number and those of `safely_started`."""
    spawn = get_context("spawn")
    with safely_started(environment), ProcessPoolExecutor(workers, mp_context=spawn, initializer=begin) as pool:
        yield pool


def module_path() -> list[str]:
    """Where this process looks for modules, the current folder by its name and last."""
    return [*filter(None, sys.path), *([os.getcwd()] if "" in sys.path else [])]  # noqa: PTH109 (a str is wanted)


@contextmanager
def _added_to_environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Some variables are read when a process begins, so that it cannot set them itself."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _current_folder_last() -> Iterator[None]:
    """`multiprocessing` passes the module path on."""
    if "" not in sys.path:
        yield
        return
    place = sys.path.index("")
    sys.path.append(sys.path.pop(place))
    try:
        yield
    finally:
        if "" in sys.path:
            sys.path.remove("")
            sys.path.insert(place, "")


ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, ``kill`` and a closed terminal."""


def raise_if_interruption(error: BaseException) -> None:
    """Raise KeyboardInterrupt if an exception is one, or a panic of compiled code that was calling Python meanwhile.

    Such a panic is neither an Exception nor a KeyboardInterrupt; its text has the name of what was raised.
    """
    panicked = type(error).__name__ == "PanicException"
    if isinstance(error, KeyboardInterrupt) or (panicked and KeyboardInterrupt.__name__ in str(error)):
        raise KeyboardInterrupt from error


@contextmanager
def delayed() -> Iterator[None]:
    """Delay the signals of `ENDING` until the block ends. Processes that are started within it have them blocked.

    A signal that arrives in the block is recorded, and takes its usual effect right after it.
    """
    handled_here = threading.current_thread() is threading.main_thread()
    with _recorded() if handled_here else nullcontext(), _blocked():
        yield


@contextmanager
def _blocked() -> Iterator[None]:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _recorded() -> Iterator[None]:
    """Record signals and raise them again afterwards. Other threads can receive those that this thread blocks."""
    received: list[int] = []
    handlers = {number: signal.getsignal(number) for number in ENDING}
    kept = {number: handler for number, handler in handlers.items() if handler not in (None, signal.SIG_IGN)}
    try:
        for number in kept:
            signal.signal(number, lambda number, _: received.append(number))
        yield
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)
        for late in dict.fromkeys(received):
            signal.raise_signal(late)


def signal_name(number: int) -> str:
    """Name of a signal; ``signal 40`` of one without a name."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def end_system_calls() -> None:
    """Let the signals of `ENDING` end system calls that wait, such as those that read from a pipe.

    Handlers of Python do so. When Polars is loaded, it puts a handler for Ctrl-C in front of an existing one, and such
    calls then go on. To be called after that.
    """
    for number in ENDING:
        signal.siginterrupt(number, True)


def ignore() -> None:
    """Ignore the signals of `ENDING` in this process, which another process ends."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)


def release_memory() -> None:
    """Return freed memory to the system, where the C library can: workers keep it while they track features."""
    with suppress(OSError, AttributeError):  # not glibc
        CDLL(None).malloc_trim(0)
