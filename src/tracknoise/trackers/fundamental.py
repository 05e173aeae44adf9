"""Fundamental matrices between two images: through eight matches or more."""

import numpy as np
from numpy.typing import NDArray

_RANK_DEFICIENT = 1e-10

Floats = NDArray[np.float64]


class Fundamental:
    """The relation x'^T F x = 0 of two views of a rigid scene; its error is Sampson's distance.

    Sampson's distance is to first order how far a match must move, in both images together, to fulfil the relation.
    """

    sample_size = 8

    def hypotheses(self, source: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """The fundamental matrices through eight matches each, by the eight-point algorithm.

        Parameters
        ----------
        source, target
            (b, 8, 2) float64, about the origin and of unit size.

        Returns
        -------
        models : (b, 3, 3) float64
            Of rank 2; arbitrary for degenerate samples.
        usable : (b,) bool
        """
        _, singular, transposed = np.linalg.svd(_equations(source, target))
        usable = singular[:, -1] > _RANK_DEFICIENT * singular[:, 0]
        return _rank_two(transposed[:, -1].reshape(-1, 3, 3)), usable

    def agrees(self, models: Floats, source: Floats, target: Floats, threshold: float) -> NDArray[np.bool_]:
        """Which matches each model explains to within `threshold`.

        Parameters
        ----------
        models
            (b, 3, 3) float64.
        source, target
            (n, 2) float64.
        threshold
            Largest distance, in the unit of the points.

        Returns
        -------
        (b, n) bool
        """
        a, b, c = _epipolar_lines(models, source)
        a_back, b_back, _ = _epipolar_lines(np.swapaxes(models, 1, 2), target)
        algebraic = a * target[:, 0] + b * target[:, 1] + c
        slope = a * a + b * b + a_back * a_back + b_back * b_back
        return algebraic * algebraic <= threshold * threshold * slope

    def refine(self, model: Floats, source: Floats, target: Floats) -> Floats:
        """The eight-point solution on all matches; `model` is only needed where these leave it open.

        Parameters
        ----------
        model
            (3, 3) float64.
        source, target
            (n, 2) float64, about the origin and of unit size.

        Returns
        -------
        (3, 3) float64
        """
        equations = _equations(source, target)
        values, vectors = np.linalg.eigh(np.einsum("ni,nj->ij", equations, equations))
        if values[1] <= _RANK_DEFICIENT * values[-1]:
            return model
        closest: Floats = _rank_two(vectors[:, 0].reshape(1, 3, 3))[0]
        return closest


def _equations(source: Floats, target: Floats) -> Floats:
    """Rows (..., n, 9) whose product with the entries of F is x'^T F x."""
    one = np.ones_like(source[..., :1])
    x = np.concatenate([source, one], axis=-1)
    rows: Floats = np.concatenate([target[..., :1] * x, target[..., 1:] * x, x], axis=-1)
    return rows


def _rank_two(models: Floats) -> Floats:
    left, singular, right = np.linalg.svd(models)
    singular[:, 2] = 0.0
    return np.asarray((left * singular[:, None, :]) @ right, dtype=np.float64)


def _epipolar_lines(models: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
    u, v = points[:, 0], points[:, 1]
    a, b, c = (row[:, 0:1] * u + row[:, 1:2] * v + row[:, 2:3] for row in np.moveaxis(models, 1, 0))
    return a, b, c
