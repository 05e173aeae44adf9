"""Random vectors of the oracle: a stream for each kind of error, so that one kind does not change another."""

import zlib
from collections.abc import Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.tracker import SequenceContext


class Stream(IntEnum):
    """What random numbers are for."""

    white = 0
    birth = 1
    walk = 2
    common = 3


class RandomErrors:
    """Streams of random vectors.

    Parameters
    ----------
    key
        Whole numbers. Equal keys give equal streams, in every process.
    nu
        Degrees of freedom of Student's t, above 2; None for Gaussian errors.
    """

    __slots__ = ("_nu", "_streams")

    def __init__(self, key: Sequence[int], nu: float | None) -> None:
        self._nu = nu
        self._streams = [np.random.default_rng(np.random.SeedSequence(list(key), spawn_key=(kind,))) for kind in Stream]

    def gaussian(self, stream: Stream, count: int) -> NDArray[np.float64]:
        """(count, 2) float64: independent numbers of standard deviation 1."""
        return self._streams[stream].standard_normal((count, 2))

    def heavy_tailed(self, stream: Stream, gaussian: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vectors (n, 2) of Student's t in two dimensions from Gaussian ones. They keep their covariance."""
        if self._nu is None:
            return gaussian
        return gaussian * np.sqrt((self._nu - 2) / self._streams[stream].chisquare(self._nu, (len(gaussian), 1)))

    def steps(self, stream: Stream, count: int) -> NDArray[np.float64]:
        """(count, 2) float64: vectors of Student's t whose coordinates have standard deviation 1."""
        return self.heavy_tailed(stream, self.gaussian(stream, count))


def random_key(seed: int, context: SequenceContext) -> list[int]:
    """Key of random numbers: different for every sequence and speed, and the same in every process, unlike `hash`.

    Parameters
    ----------
    seed
        Of the tracker. The experiment's seed and the number of the repetition are those of the context.
    context
        The sequence and condition.
    """
    sequence = context.sequence
    cameras = [sequence.camera] if sequence.camera else []
    names = (zlib.crc32(name.encode()) for name in (sequence.scene, sequence.lighting, sequence.direction, *cameras))
    again = [context.repeat] if context.repeat else []
    return [seed, context.seed, *names, sequence.rotation % 360, context.speed, *again]
