"""Timing and the rows that every benchmark returns."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Row:
    """One measured figure."""

    name: str
    value: float
    unit: str
    note: str = ""


def median_ms(run: Callable[[], object], repeats: int = 15) -> float:
    """Median wall time of one call, ms, after one warm-up call."""
    run()
    return statistics.median(_elapsed_ms(run) for _ in range(repeats))


def _elapsed_ms(run: Callable[[], object]) -> float:
    start = time.perf_counter()
    run()
    return (time.perf_counter() - start) * 1e3
