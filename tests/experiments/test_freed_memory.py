"""Freed memory is used again: the system gives no new pages for arrays of a size that was freed before."""

import platform
import subprocess
import sys

import pytest

PROGRAM = """
import resource, sys
import numpy as np
from tracknoise.experiments.machine import keep_freed_memory

if sys.argv[1] == "kept":
    keep_freed_memory()

def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

def work():
    for _ in range(50):
        large = [np.ones(2**17) for _ in range(4)]

work()
before = faults()
work()
print(faults() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other allocators decide for themselves")
def test_freed_memory_is_used_again() -> None:
    def new_pages(memory: str) -> int:
        command = [sys.executable, "-c", PROGRAM, memory]
        return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    assert new_pages("kept") < 500 < new_pages("returned") / 10
