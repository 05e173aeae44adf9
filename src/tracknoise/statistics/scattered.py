"""Pseudo-random numbers from numbers, for choices that depend on nothing else."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def scattered(numbers: NDArray[np.integer[Any]]) -> NDArray[np.uint64]:
    """Distinct pseudo-random numbers: the finaliser of SplitMix64 (Steele et al. 2014)."""
    mixed = numbers.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return mixed ^ (mixed >> np.uint64(31))
