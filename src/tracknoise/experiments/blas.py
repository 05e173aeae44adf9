"""Number of threads that BLAS uses.

With several threads BLAS adds up in another order, so that results would depend on the number of cores.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import scipy.linalg  # noqa: F401 (loads a BLAS beside NumPy's: only a loaded one can be limited)
from threadpoolctl import threadpool_limits


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread in this process, within a block or a decorated function."""
    with threadpool_limits(1, user_api="blas"):
        yield
