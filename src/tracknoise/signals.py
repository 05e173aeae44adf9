"""The signals that end a program, what they raise and end, and how to make them wait while a process is started."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

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
