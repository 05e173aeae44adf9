"""Losses of whitened residuals, and how much less an outlying one counts."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray


class LossKind(StrEnum):
    """How the cost grows with the squared norm of a whitened residual."""

    SQUARED = "squared"
    HUBER = "huber"
    CAUCHY = "cauchy"
    STUDENT = "student"
    """Student's distribution of the residuals of a whole track; the knee is its degrees of freedom."""


@dataclass(frozen=True, slots=True)
class Loss:
    """A loss, as Ceres, GTSAM and g2o define it.

    Parameters
    ----------
    kind
        Which one.
    knee
        Where it begins to differ from the square: in standard deviations, or degrees of freedom.
    """

    kind: LossKind = LossKind.SQUARED
    knee: float = np.inf

    def squared_norms(self, whitened: NDArray[np.float64]) -> NDArray[np.float64]:
        """Squared norms of residuals (tracks, 2 n): (tracks, n) of observations, or (tracks, 1) of tracks."""
        blocks = 1 if self.kind is LossKind.STUDENT else whitened.shape[1] // 2
        return np.asarray(np.square(whitened).reshape(len(whitened), blocks, -1).sum(axis=2))

    def weights(self, whitened: NDArray[np.float64]) -> NDArray[np.float64]:
        """(tracks, 2 n) float64: how much each residual counts, 1 under the squared loss."""
        squares = self.squared_norms(whitened)
        each = whitened.shape[1] // squares.shape[1]
        return np.repeat(self._weights(squares, each), each, axis=1)

    def _weights(self, squares: NDArray[np.float64], size: int) -> NDArray[np.float64]:
        match self.kind:
            case LossKind.HUBER:
                return np.asarray(self.knee / np.maximum(np.sqrt(squares), self.knee))
            case LossKind.CAUCHY:
                return np.asarray(1.0 / (1.0 + squares / self.knee**2))
            case LossKind.STUDENT:
                return np.asarray((self.knee + size) / (self.knee + squares))
            case _:
                return np.ones_like(squares)

    def cost(self, whitened: NDArray[np.float64]) -> float:
        """Twice the cost of residuals (tracks, 2 n)."""
        squares = self.squared_norms(whitened)
        size = whitened.shape[1] // squares.shape[1]
        match self.kind:
            case LossKind.HUBER:
                beyond = np.maximum(np.sqrt(squares) - self.knee, 0.0)
                return float((squares - beyond**2).sum())
            case LossKind.CAUCHY:
                return float((self.knee**2 * np.log1p(squares / self.knee**2)).sum())
            case LossKind.STUDENT:
                return float(((self.knee + size) * np.log1p(squares / self.knee)).sum())
            case _:
                return float(squares.sum())


PLAIN = Loss()
"""The squared loss."""
