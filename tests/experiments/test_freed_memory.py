"""Freed memory is used again: the system gives no new pages for arrays of a size that was freed before."""

import platform
import subprocess
import sys

import pytest

PROGRAM = """
import resource, sys
from contextlib import nullcontext
import numpy as np
from tracknoise.experiments.machine import keeping_freed_memory, used_bytes
import os

def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

def work():
    for _ in range(50):
        large = [np.ones(2**17) for _ in range(4)]

with keeping_freed_memory() if sys.argv[1] == "kept" else nullcontext():
    work()
    before = faults()
    work()
    new_pages = faults() - before
    many = [bytes(1000) for _ in range(100_000)]
    last = bytes(1000)  # above them on the heap
    many.clear()
    within = used_bytes(os.getpid())
print(new_pages, within - used_bytes(os.getpid()))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other allocators decide for themselves")
def test_freed_memory_is_used_again_and_given_back_at_the_end() -> None:
    def measured(memory: str) -> tuple[int, int]:
        command = [sys.executable, "-c", PROGRAM, memory]
        new_pages, given_back = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
        return int(new_pages), int(given_back)

    (kept, given_back), (returned, _) = measured("kept"), measured("returned")
    assert kept < 500 < returned / 10
    assert given_back > 2**25
