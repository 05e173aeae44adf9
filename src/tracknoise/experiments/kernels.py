"""Kernels: the machine code that numerical libraries chose for the processor.

Libraries bring several versions of their inner loops, and choose one by the instructions that the processor has. They
round differently, so that numbers of two kinds of machine differ in their last digits.
"""

from functools import cache

import numpy as np
from threadpoolctl import threadpool_info

from tracknoise.trackers.opencv_kernel import opencv_kernel


@cache
def kernels() -> str:
    """Name the kernels of every BLAS that is loaded, of NumPy and of OpenCV: ``OpenBLAS 0.3.30 Haswell, ...``.

    It is asked for once per process, after something was measured: all libraries that take part are loaded then.
    """
    blas = {_blas_text(found) for found in threadpool_info() if found["user_api"] == "blas"}
    return ", ".join([*sorted(blas), f"NumPy {_numpy_kernel()}", f"OpenCV {opencv_kernel()}"])


def _blas_text(found: dict[str, object]) -> str:
    """Name, version and, where the library tells it, kernel of a BLAS."""
    name = "OpenBLAS" if found["internal_api"] == "openblas" else str(found["internal_api"])
    return " ".join(filter(None, [name, str(found["version"] or ""), str(found.get("architecture") or "")]))


def _numpy_kernel() -> str:
    """The highest instructions that NumPy uses here."""
    levels = np.show_config(mode="dicts")["SIMD Extensions"]
    return str([*levels.get("baseline", ["none"]), *levels.get("found", [])][-1])
