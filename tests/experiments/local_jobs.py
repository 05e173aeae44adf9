"""What workers do in `test_local`. They import this module, and little else, so that they start quickly."""

import os
import signal
import time
from pathlib import Path

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.experiments.local_workers import notify


def crash(path: str) -> None:
    """A job that reads a file and then crashes, as a parser in C does."""
    Path(path).read_bytes()
    os.kill(os.getpid(), signal.SIGSEGV)


def allocate(size: int) -> int:
    """A job that uses memory until it is ended."""
    content = bytearray(os.urandom(1 << 20)) * size
    time.sleep(60)
    return len(content)


def refuse(name: str) -> None:
    """A job that raises."""
    if name == "lambda":
        raise type("Local", (Exception,), {})("cannot be sent")
    raise DataError(name, "nothing", "something") if name == "data" else SettingsError(name)


def announce(count: int) -> int:
    """A job that tells how far it is."""
    for number in range(count):
        notify("key", number, count)
    return count


def status_of(number: int) -> object:
    """A job that tells how its process handles a signal."""
    return signal.getsignal(number), number in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def survive_in(process: int) -> int:
    """A job that ends every process but one, and returns which this is."""
    if os.getpid() != process:
        os.kill(os.getpid(), signal.SIGKILL)
    return process
