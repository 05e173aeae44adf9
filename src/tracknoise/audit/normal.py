"""Normal equations of robust fits: of all observations, and by tracker and cluster.

Those by tracker and cluster are what jackknives and comparisons of trackers are made of. Each step of a fit needs the
sums of all observations only.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.robust import FREEDOM, squared, weights


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """Sums over the observations of each tracker and cluster.

    Attributes
    ----------
    weighted : (trackers, clusters, p, p) float64
        Information with the weights taken as fixed: D^T W D.
    curvature : (trackers, clusters, p, p) float64
        Second derivatives of the loss, but for those of the predictions.
    gradient : (trackers, clusters, p) float64
        First derivatives of the negative loss: D^T W r.
    ridge : (p,) float64
        Added to the diagonal where equations are solved, so that what nothing determines stays finite.
    count : (trackers, clusters) intp
        How many observations there are.
    """

    weighted: NDArray[np.float64]
    curvature: NDArray[np.float64]
    gradient: NDArray[np.float64]
    ridge: NDArray[np.float64]
    count: NDArray[np.intp]

    @property
    def information(self) -> NDArray[np.float64]:
        """Information of all observations and the ridge, (p, p)."""
        return np.asarray(self.weighted.sum(axis=(0, 1)) + np.diag(self.ridge))


def summed(
    design: NDArray[np.float64], residual: NDArray[np.float64], scale: NDArray[np.float64], ridge: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Information, (p, p), and first derivatives, (p,), of all observations; parameters as in `normal_equations`."""
    _, weight, known, finite = _weighted(design, residual, scale)
    rows, twice = finite.reshape(2 * len(weight), design.shape[2]), np.repeat(weight, 2)
    return (rows * twice[:, None]).T @ rows + np.diag(ridge), rows.T @ (twice * known.ravel())


def _weighted(
    design: NDArray[np.float64], residual: NDArray[np.float64], scale: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Squared distances and weights, (n,), residuals and design with 0 for what is missing."""
    distance = squared(residual, scale)
    weight = weights(distance) / (scale * scale)
    known = np.where(np.isfinite(distance)[:, None], residual, 0.0)
    return distance, weight, known, np.where(np.isfinite(design), design, 0.0)


def normal_equations(
    tracker: NDArray[np.intp],
    cluster: NDArray[np.intp],
    design: NDArray[np.float64],
    residual: NDArray[np.float64],
    scale: NDArray[np.float64],
    ridge: NDArray[np.float64],
) -> NormalEquations:
    """Add up what Student's loss gives for residuals.

    Parameters
    ----------
    tracker, cluster : (n,)
        Numbers of the tracker and of the cluster of each observation, from 0.
    design : (n, 2, p)
        Derivatives of predictions.
    residual : (n, 2)
        px; NaN counts as missing.
    scale : (n,)
        Of the residuals, px.
    ridge : (p,)
        See `NormalEquations`.
    """
    shape, p = (int(tracker.max()) + 1, int(cluster.max()) + 1), design.shape[2]
    distance, weight, known, finite = _weighted(design, residual, scale)
    steep = 2.0 * weight / ((FREEDOM + np.nan_to_num(distance)) * scale * scale)
    along = np.einsum("nij,ni->nj", finite, known)
    group = tracker * shape[1] + cluster
    order = np.argsort(group, kind="stable")
    ends = np.searchsorted(group[order], np.arange(shape[0] * shape[1] + 1))
    weighted, curvature = np.zeros((2, ends.size - 1, p, p))
    gradient = np.zeros((ends.size - 1, p))
    for number, rows in enumerate(np.split(order, ends[1:-1])):
        some = finite[rows].reshape(2 * len(rows), p)
        weighted[number] = some.T @ (np.repeat(weight[rows], 2)[:, None] * some)
        curvature[number] = weighted[number] - along[rows].T @ (steep[rows, None] * along[rows])
        gradient[number] = weight[rows] @ along[rows]
    return NormalEquations(
        weighted.reshape(*shape, p, p),
        curvature.reshape(*shape, p, p),
        gradient.reshape(*shape, p),
        ridge,
        np.diff(ends).reshape(shape),
    )
