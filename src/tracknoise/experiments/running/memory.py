"""Memory that this machine, or its container, has, and what a process uses of it."""

from contextlib import suppress
from pathlib import Path

import psutil

_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
"""Files with the limit of a container, versions 2 and 1."""


def memory_bytes() -> int:
    """Memory of the machine, or the limit of the container if that is smaller, bytes."""
    limits = [int(psutil.virtual_memory().total)]
    for path in map(Path, _LIMITS):
        with suppress(OSError, ValueError):  # there is no such file, or it says "max"
            limits.append(int(path.read_text()))
    return min(limits)


def used_bytes(pid: int) -> int:
    """Memory that a process uses, bytes; 0 if it has ended, or this is not known."""
    try:
        return int(psutil.Process(pid).memory_info().rss)
    except (psutil.Error, OSError):  # OSError: this process has too many open files to ask
        return 0
