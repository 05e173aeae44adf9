"""Memory of freed arrays, which is used again rather than returned to the system.

Findings make many arrays of about a megabyte that live for one operation. glibc returns such memory at once, and the
system has to clear each page again for the next array. This takes a sixth of the CPU time of findings. Once a larger
block was freed, glibc keeps freed memory up to twice its size (`man mallopt`, M_MMAP_THRESHOLD).
"""

import numpy as np

_BLOCK = 31 * 2**20
"""Bytes; blocks from 32 MiB on have no such effect."""


def keep_freed_memory() -> None:
    """Let the allocator of this process keep up to 62 MiB of freed memory. Other allocators than glibc's ignore it."""
    np.empty(_BLOCK, dtype=np.uint8)
