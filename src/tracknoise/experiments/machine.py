"""The machine that measures: threads of BLAS, machine code of libraries, and memory.

With several threads BLAS adds up in another order, so that results would depend on the number of cores.

Libraries bring several versions of their inner loops, and choose one by the instructions that the processor has. They
round differently, so that numbers of two kinds of machine differ in their last digits.

Findings make many arrays of about a megabyte that live for one operation. glibc returns such memory at once, and the
system has to clear each page again for the next array. This takes a sixth of the CPU time of findings. Once a larger
block was freed, glibc keeps freed memory up to twice its size (`man mallopt`, M_MMAP_THRESHOLD).
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import psutil
from threadpoolctl import threadpool_info, threadpool_limits

from tracknoise.processes import release_memory


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread in this process, within a block or a decorated function."""
    with threadpool_limits(1, user_api="blas"):
        yield


def use_one_opencv_thread() -> None:
    """Make OpenCV use one thread in this process; no result depends on it."""
    cv2.setNumThreads(1)


@cache
def kernels() -> str:
    """Name the kernels of every BLAS that is loaded, of NumPy and of OpenCV: ``OpenBLAS 0.3.30 Haswell, ...``.

    It is asked for once per process, after something was measured: all libraries that take part are loaded then.
    """
    blas = {_blas_text(library) for library in threadpool_info() if library["user_api"] == "blas"}
    return ", ".join([*sorted(blas), f"NumPy {_numpy_kernel()}", f"OpenCV {_opencv_kernel()}"])


def _blas_text(library: dict[str, object]) -> str:
    """Name, version and, where the library tells it, kernel of a BLAS."""
    name = "OpenBLAS" if library["internal_api"] == "openblas" else str(library["internal_api"])
    return " ".join(filter(None, [name, str(library["version"] or ""), str(library.get("architecture") or "")]))


def _numpy_kernel() -> str:
    """The highest instructions that NumPy uses here."""
    levels = np.show_config(mode="dicts")["SIMD Extensions"]
    return str([*levels.get("baseline", ["none"]), *levels.get("found", [])][-1])


_NOT_USED, _OPTIONAL = "?", "*"
"""OpenCV writes these after instructions that the processor lacks, and before those that not every processor has."""


def _opencv_kernel() -> str:
    """The highest instructions that OpenCV uses here."""
    used = [word for word in cv2.getCPUFeaturesLine().split() if not word.endswith(_NOT_USED)]
    return used[-1].removeprefix(_OPTIONAL) if used else "none"


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


_BLOCK = 31 * 2**20
"""Bytes; blocks from 32 MiB on have no such effect."""


@contextmanager
def keeping_freed_memory() -> Iterator[None]:
    """Let the allocator keep up to 62 MiB of freed memory, within a block or a decorated function, and none after it.

    Other allocators than glibc's ignore it.
    """
    np.empty(_BLOCK, dtype=np.uint8)
    try:
        yield
    finally:
        release_memory()
