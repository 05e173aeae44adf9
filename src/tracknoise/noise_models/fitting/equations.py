"""Equations between second moments of errors and the components of noise, and their solutions.

Each product at each age gives one equation, (error_products.expected) divided by its count:

    y = x A_0 + x_1 A_1 + ...,  y and A_j symmetric 2x2    (equations)

Its standard error is taken to be t sqrt(2 / n + OWN^2), where t is half the trace of the product, or of the change if
the product is lagged. That is what n Gaussian errors have, and a share for what the components do not describe. Where n
is large, all equations count by their relative error. t counts as at least `_SMALLEST` times the largest one: where all
but the first position is nearly exact, the weights would otherwise differ by more than the precision of the numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.tables.enumerations import Product

Array = NDArray[np.float64]

NAMES = ("first", "white", "walk", "drift")
"""Components, in the order of the factors."""
COLUMNS = ("n", "uu", "uv", "vv", *NAMES)
"""Columns of sums, by product and age."""
OWN = 0.05
"""How far off the components may be, relative to a second moment."""
LEAST = 50
"""Fewest products of an equation."""
_SMALLEST = 1e-6
"""Half trace of a product, relative to the largest one."""
_ROUNDS, _ENOUGH = 2000, 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """Second moments and what multiplies the components in them.

    Attributes
    ----------
    second : (equations, 3, ...) float64
        uu, uv and vv, px^2.
    factors : (equations, 4, ...) float64
        Of A, W, Q and D.
    """

    second: Array
    factors: Array

    @classmethod
    def of(cls, sums: Array) -> "Equations":
        """From sums (COLUMNS, equations, ...); NaN where a count is 0."""
        counts = np.where(sums[0] > 0, sums[0], np.nan)
        means = np.moveaxis(sums[1:] / counts, 0, 1)
        return cls(means[:, :3], means[:, 3:])

    @property
    def half_trace(self) -> Array:
        """(equations, ...) float64, px^2."""
        return np.asarray(0.5 * (self.second[:, 0] + self.second[:, 2]))

    def solved(self, weights: Array, active: Sequence[int]) -> Array:
        """Components (len(active), 3, ...) by least squares: entries uu, uv, vv, which may be negative."""
        x, y = np.nan_to_num(self.factors[:, list(active)]), np.nan_to_num(self.second)
        left = np.moveaxis(np.einsum("e,ei...,ej...->ij...", weights, x, x), (0, 1), (-2, -1))
        right = np.moveaxis(np.einsum("e,ei...,ek...->ik...", weights, x, y), (0, 1), (-2, -1))
        return np.moveaxis(np.linalg.pinv(left, hermitian=True) @ right, (-2, -1), (0, 1))

    def half_traces(self, weights: Array, active: Sequence[int]) -> Array:
        """Half the trace of each active component by least squares, (len(active), ...) float64, px^2."""
        solved = self.solved(weights, active)
        return np.asarray(0.5 * (solved[:, 0] + solved[:, 2]))

    def bounded(self, weights: Array, active: Sequence[int]) -> Array:
        """The same for one set of sums, without negative eigenvalues: (len(active), 3); 0 where all weights are 0."""
        x = np.nan_to_num(self.factors[:, list(active)])
        left, right = (x * weights[:, None]).T @ x, (x * weights[:, None]).T @ np.nan_to_num(self.second)
        found = np.array([without_negative(row) for row in self.solved(weights, active)])
        for _ in range(_ROUNDS):
            before = found.copy()
            for place in np.flatnonzero(np.diag(left)):
                rest = right[place] - left[place] @ found + left[place, place] * found[place]
                found[place] = without_negative(rest / left[place, place])
            if np.abs(found - before).max() <= _ENOUGH * np.abs(found).max():
                break
        return found


def weights_of(counts: Array, points: pl.DataFrame, equations: Equations) -> Array:
    """Weights (equations,) of squared residuals; 0 where there are fewer than `LEAST` products.

    Half traces are first the measured ones, then those of a fit: where few products happen to be small, they would
    count for too much.
    """
    every = range(len(NAMES))
    first = _weights(counts, points, equations.half_trace)
    modelled = np.einsum("ea,a->e", equations.factors, _half(equations.bounded(first, every)))
    return _weights(counts, points, modelled)


def _half(entries: Array) -> Array:
    return np.asarray(0.5 * (entries[:, 0] + entries[:, 2]))


def _weights(counts: Array, points: pl.DataFrame, half_trace: Array) -> Array:
    scale = _scales(points, half_trace)
    enough = (counts >= LEAST) & (scale > 0.0) & (points["product"] != Product.before).to_numpy()
    floored = np.maximum(scale, _SMALLEST * scale.max(initial=0.0))
    usual = np.where(enough, floored, 1.0) ** 2 * (2.0 / np.maximum(counts, 1.0) + OWN**2)
    return np.where(enough, 1.0 / usual, 0.0)


def _scales(points: pl.DataFrame, half_trace: Array) -> Array:
    """Half the trace of each product; for lagged ones that of the change at the same age."""
    own = points.with_columns(pl.col("product").cast(pl.String), scale=half_trace)
    changes = own.filter(pl.col("product") == Product.change).select("age", change="scale")
    lagged = pl.col("product") == Product.lagged
    joined = own.join(changes, on="age", how="left", maintain_order="left")
    return joined.select(pl.when(lagged).then("change").otherwise("scale").fill_null(0.0)).to_series().to_numpy()


def without_negative(entries: Array) -> Array:
    """The nearest matrix without negative eigenvalues, as entries uu, uv, vv, (3,)."""
    values, vectors = np.linalg.eigh(matrix(entries))
    nearest = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.array([nearest[0, 0], nearest[0, 1], nearest[1, 1]])


def matrix(entries: Array) -> Array:
    """Entries uu, uv, vv as a symmetric (2, 2) matrix."""
    return np.array([[entries[0], entries[1]], [entries[1], entries[2]]])
