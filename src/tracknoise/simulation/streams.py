"""Independent streams of random numbers of a simulation."""

import zlib
from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """What random numbers are for."""

    world = 0
    path = 1
    noise = 2
    second_noise = 3
    pattern = 4
    second_pattern = 5


def generator(seed: int, stream: Stream, name: str, index: int = 0) -> np.random.Generator:
    """A generator that depends only on its arguments, so that frames can be rendered in any order."""
    return np.random.default_rng([seed, stream, zlib.crc32(name.encode()), index])
