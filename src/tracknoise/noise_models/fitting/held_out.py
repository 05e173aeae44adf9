"""How well components describe scenes, groups of scenes, or blocks of tracks that they were not fitted to.

The measure is the log likelihood of an error given the one before, of Gaussian errors with the mean variance of the two
coordinates:

    log p(e_k | e_(k-1)) = -log v - m / v + constant,  v = V(e_k | e_(k-1)),  m its measured mean square    (held_out)

From r e_(k-1), with moments S_00 = `before`, S_11 = `error` and S_01 = (S_11 + S_00 - `change`) / 2, the best
prediction is b r e_(k-1) with b = S_01 / S_00, all as the components have it, and v = S_11 - b S_01.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.noise_models.fitting.equations import Equations
from tracknoise.tables.enumerations import Product

Array = NDArray[np.float64]
Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """Equations of errors, and of the same products at the same ages that predict them.

    Attributes
    ----------
    error, before, change : (steps,) intp
        Places among all equations, by increasing age; 0 where there is none.
    predicted : (steps,) bool
        Whether `before` and `change` are known.
    """

    error: Rows
    before: Rows
    change: Rows
    predicted: NDArray[np.bool_]

    @classmethod
    def of(cls, points: pl.DataFrame) -> "Steps":
        """From the columns product and age: one row per equation, sorted by age within each product."""
        numbered = points.with_columns(pl.col("product").cast(pl.String)).with_row_index("row")
        rows = numbered.filter(product=Product.error).select("age", error="row")
        for kind in (Product.before, Product.change):
            same = numbered.filter(product=kind).select("age", pl.col("row").alias(kind))
            rows = rows.join(same, on="age", how="left", maintain_order="left")
        known = rows.select(pl.all_horizontal(pl.all().is_not_null())).to_series().to_numpy()
        error, before, change = (
            rows[kind].fill_null(0).to_numpy().astype(np.intp)
            for kind in (Product.error, Product.before, Product.change)
        )
        return cls(error, before, change, known)

    def log_likelihoods(self, counts: Array, measured: Array, modelled: Array) -> Array:
        """Log likelihood of the errors of each scene, per error, by (held_out), nat, without its constant.

        Parameters
        ----------
        counts
            (equations, scenes) float64.
        measured, modelled
            (equations, scenes) float64: half traces, px^2.

        Returns
        -------
        (scenes,) float64
            NaN for scenes without errors.
        """
        n = np.nan_to_num(counts[self.error])
        variance, square = self._conditional(measured, modelled)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = -np.log(variance) - square / variance
        total, errors = np.where(n > 0, n * found, 0.0).sum(axis=0), n.sum(axis=0)
        return np.asarray(total / np.where(errors > 0, errors, np.nan))

    def _conditional(self, measured: Array, modelled: Array) -> tuple[Array, Array]:
        """Modelled variance and measured mean square of what the error before does not predict, (steps, scenes)."""
        s11, s00, s01 = self._moments(modelled)
        slope = np.where(self.predicted[:, None], s01 / np.where(s00 > 0.0, s00, np.inf), 0.0)
        o11, o00, o01 = self._moments(measured)
        return s11 - slope * s01, o11 - 2.0 * slope * o01 + slope**2 * o00

    def _moments(self, values: Array) -> tuple[Array, Array, Array]:
        s11, s00 = values[self.error], np.nan_to_num(values[self.before])
        return s11, s00, 0.5 * (s11 + s00 - np.nan_to_num(values[self.change]))


@dataclass(frozen=True, slots=True, eq=False)
class LeftOut:
    """What is left out in turn, and all others.

    Attributes
    ----------
    own, others
        Equations of what is left out, and of all others, (equations, ..., units).
    counts
        (equations, units) float64, of what is left out.
    steps
        How errors are predicted.
    """

    own: Equations
    others: Equations
    counts: Array
    steps: Steps

    @classmethod
    def of(cls, points: pl.DataFrame, sums: Array) -> "LeftOut | None":
        """From sums (units, equations, columns) of independent units; None if fewer than two have any errors.

        Parameters
        ----------
        points
            Columns product and age: one row per equation.
        sums
            Columns `tracknoise.noise_models.fitting.equations.COLUMNS`.
        """
        some, steps = sums[sums[..., 0].any(axis=1)], Steps.of(points)
        if len(some) < 2:
            return None
        own, others = (Equations.of(np.transpose(each, (2, 1, 0))) for each in (some, some.sum(axis=0) - some))
        return cls(own, others, some[..., 0].T, steps)

    def score(self, weights: Array, active: Sequence[int]) -> float:
        """Mean log likelihood of what was left out, under the active components fitted to all others, nat per error."""
        half = np.maximum(self.others.half_traces(weights, active), 0.0)
        modelled = np.einsum("eau,au->eu", np.nan_to_num(self.own.factors[:, list(active)]), half)
        found = self.steps.log_likelihoods(self.counts, self.own.half_trace, modelled)
        return float(np.average(found, weights=self.counts.sum(axis=0)))
