"""Robust linear fits: scales and weights of residuals, normal equations by cluster, and intervals without each cluster.

Each step of a fit needs the sums of all observations only. Jackknives and comparisons of trackers are made of the
normal equations by tracker and cluster.

Intervals of fits leave out one cluster at a time. With the second derivatives H of the loss and the negative first g,
one step of Newton's method leads to the fit without a cluster c: (H - H_c)^-1 (g - g_c) (audit.jackknife). This costs
no fit. At the fit of all clusters g is 0.

Clusters do not know equally much of a number: with their shares s_c in its variance, as they would be for independent
observations, there are 1 / sum s_c^2 effective clusters (audit.effective), and one degree of freedom less. Several
numbers together have the mean of their shares.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.inference.units import sorting

FREEDOM = 4.0
"""Degrees of freedom of Student's distribution, for residuals in two coordinates."""
_RAYLEIGH_MEDIAN = 1.1774100225154747
LEAST_PX = 1e-3
"""Smaller errors are none."""


def scales(group: NDArray[np.intp], residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Robust standard deviation per coordinate of residuals (n, 2) of the same group, (n,), px.

    It is that of a round Gaussian with the same median length, and at least a thousandth of a pixel.

    Parameters
    ----------
    group : (n,)
        Number of the tracker and age, see `tracknoise.truth_faults.audit_samples.AuditSamples.group`.
    residual : (n, 2)
        px; NaN is left out.
    """
    return scales_of_groups(group, residual)[group]


def scales_of_groups(group: NDArray[np.signedinteger[Any]], residual: NDArray[np.floating]) -> NDArray[np.float64]:
    """The same of each group, (groups,); the least one of a group that has none."""
    length = np.hypot(residual[:, 0], residual[:, 1])
    count = np.bincount(group)
    last = np.cumsum(count)
    of_groups = length[sorting(group)]
    for of_group in np.split(of_groups, last[:-1]):
        of_group.sort()  # NaN last
    n_known = np.bincount(group, np.isfinite(length)).astype(np.intp)
    low, high = last - count + np.maximum(n_known - 1, 0) // 2, last - count + n_known // 2
    median = 0.5 * (of_groups[low] + of_groups[np.minimum(high, len(length) - 1)])
    scale: NDArray[np.float64] = np.maximum(np.nan_to_num(median / _RAYLEIGH_MEDIAN), LEAST_PX)
    return scale


def squared(residual: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared lengths of residuals (n, 2) in units of their scales (n,)."""
    u, v = residual.T
    distance: NDArray[np.float64] = (u * u + v * v) / (scale * scale)
    return distance


def weights(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights of Student's distribution for squared distances (n,); 0 where one is unknown."""
    weight: NDArray[np.float64] = np.nan_to_num((FREEDOM + 2.0) / (FREEDOM + distance))
    return weight


@dataclass(frozen=True, slots=True, eq=False)
class TrackerSums:
    """Sums over the observations of a tracker in each cluster, of the columns on which these depend."""

    columns: NDArray[np.intp]  # (q,)
    weighted: NDArray[np.float64]  # (clusters, q, q): information with the weights taken as fixed: D^T W D
    # (clusters, q, q): second derivatives of the loss, but for those of the predictions
    curvature: NDArray[np.float64]
    gradient: NDArray[np.float64]  # (clusters, q): first derivatives of the negative loss: D^T W r


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """Sums over the observations of each tracker and cluster."""

    of_trackers: Sequence[TrackerSums]
    # (p,): added to the diagonal where equations are solved, so that what nothing determines stays finite
    ridge: NDArray[np.float64]
    count: NDArray[np.intp]  # (trackers, clusters): how many observations there are

    def matrices(self, name: str, trackers: Sequence[int] | None = None) -> NDArray[np.float64]:
        """(clusters, p, p): `weighted` or `curvature` of each cluster, of all trackers or of some."""
        p = len(self.ridge)
        matrices = np.zeros((self.count.shape[1], p, p))
        for sums in self._chosen(trackers):
            matrices[:, sums.columns[:, None], sums.columns] += getattr(sums, name)
        return matrices

    def gradients(self, trackers: Sequence[int] | None = None) -> NDArray[np.float64]:
        """(clusters, p): `gradient` of each cluster, of all trackers or of some."""
        gradients = np.zeros((self.count.shape[1], len(self.ridge)))
        for sums in self._chosen(trackers):
            gradients[:, sums.columns] += sums.gradient
        return gradients

    def counts(self, trackers: Sequence[int] | None = None) -> NDArray[np.intp]:
        """(clusters,): observations of each cluster, of all trackers or of some."""
        return np.asarray(self.count.sum(axis=0) if trackers is None else self.count[list(trackers)].sum(axis=0))

    @property
    def information(self) -> NDArray[np.float64]:
        """Information of all observations and the ridge, (p, p)."""
        return np.asarray(self.matrices("weighted").sum(axis=0) + np.diag(self.ridge))

    def _chosen(self, trackers: Sequence[int] | None) -> Sequence[TrackerSums]:
        return self.of_trackers if trackers is None else [self.of_trackers[tracker] for tracker in trackers]


def summed(
    design: NDArray[np.float64], residual: NDArray[np.float64], scale: NDArray[np.float64], ridge: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Information, (p, p), and first derivatives, (p,), of all observations; parameters as in `normal_equations`."""
    _, weight, filled, finite = _weighted(design, residual, scale)
    rows, twice = finite.reshape(2 * len(weight), design.shape[2]), np.repeat(weight, 2)
    return (rows * twice[:, None]).T @ rows + np.diag(ridge), rows.T @ (twice * filled.ravel())


def _weighted(
    design: NDArray[np.float64], residual: NDArray[np.float64], scale: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Squared distances and weights, (n,), residuals and design with 0 for what is missing."""
    distance = squared(residual, scale)
    weight = weights(distance) / (scale * scale)
    filled = np.where(np.isfinite(distance)[:, None], residual, 0.0)
    return distance, weight, filled, np.where(np.isfinite(design), design, 0.0)


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
    shape = int(tracker.max()) + 1, int(cluster.max()) + 1
    distance, weight, filled, finite = _weighted(design, residual, scale)
    steep = 2.0 * weight / ((FREEDOM + np.nan_to_num(distance)) * scale * scale)
    group = tracker * shape[1] + cluster
    count = np.bincount(group, minlength=shape[0] * shape[1]).reshape(shape)
    of_trackers = np.split(sorting(group), np.cumsum(count.sum(axis=1))[:-1])
    of_each = []
    for rows, counts in zip(of_trackers, count, strict=True):
        columns = np.flatnonzero(finite[rows].any(axis=(0, 1)))
        tracker_design = finite[rows][:, :, columns]
        along = np.einsum("nij,ni->nj", tracker_design, filled[rows])
        of_each.append(_sums(columns, counts, tracker_design, along, weight[rows], steep[rows]))
    return NormalEquations(of_each, ridge, count)


def _sums(
    columns: NDArray[np.intp],
    counts: NDArray[np.intp],
    design: NDArray[np.float64],
    along: NDArray[np.float64],
    weight: NDArray[np.float64],
    steep: NDArray[np.float64],
) -> TrackerSums:
    """Of one tracker, whose observations are in the order of their clusters; `counts`: of each."""
    n, q = len(counts), len(columns)
    weighted, curvature, gradient = np.zeros((n, q, q)), np.zeros((n, q, q)), np.zeros((n, q))
    ends = np.cumsum(counts)
    for number, (start, stop) in enumerate(zip(ends - counts, ends, strict=True)):
        rows = slice(start, stop)
        block = design[rows].reshape(2 * (stop - start), q)
        weighted[number] = block.T @ (np.repeat(weight[rows], 2)[:, None] * block)
        curvature[number] = weighted[number] - along[rows].T @ (steep[rows, None] * along[rows])
        gradient[number] = weight[rows] @ along[rows]
    return TrackerSums(columns, weighted, curvature, gradient)


@dataclass(frozen=True, slots=True, eq=False)
class Jackknife:
    """How a fit moves when each cluster is left out."""

    moves: NDArray[np.float64]  # (clusters, p): fit without the cluster minus the fit
    # (p,): from where the equations were made to the fit: nothing, but for those of single trackers
    step: NDArray[np.float64]
    # (clusters, p): of each cluster in the variance of each number; their sum is 1, or 0 where none determines it
    share: NDArray[np.float64]

    @property
    def n(self) -> int:
        """How many clusters there are."""
        return len(self.moves)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(p, p): of the fit."""
        covariance: NDArray[np.float64] = (self.n - 1) / self.n * self.moves.T @ self.moves
        return covariance

    @property
    def standard_errors(self) -> NDArray[np.float64]:
        """(p,): of the fit."""
        return np.sqrt(np.diag(self.covariance))

    def effective(self, places: NDArray[np.intp]) -> float:
        """Number of clusters that determine some numbers together, by (audit.effective); 0 where none does."""
        return float(_effective(self.share[:, places].mean(axis=1)))

    @property
    def freedom(self) -> NDArray[np.float64]:
        """(p,): degrees of freedom of each number, at least one."""
        return np.maximum(_effective(self.share) - 1.0, 1.0)

    def half_widths(self, level: float) -> NDArray[np.float64]:
        """(p,): half of each interval, by Student's distribution."""
        return np.asarray(special.stdtrit(self.freedom, 0.5 + 0.5 * level) * self.standard_errors)

    def p_value(self, values: NDArray[np.float64], places: NDArray[np.intp]) -> float:
        """Of the test that some numbers are 0, by Hotelling's T^2; 1 where there are too few clusters.

        Parameters
        ----------
        values : (k,)
            The numbers.
        places : (k,)
            Their columns.
        """
        k, n = len(places), self.effective(places)
        if n <= k:
            return 1.0
        covariance = self.covariance[np.ix_(places, places)]
        squared = float(values @ np.linalg.pinv(covariance, hermitian=True) @ values)
        return float(special.fdtrc(k, n - k, max(squared, 0.0) * (n - k) / (k * (n - 1))))


def jackknife(equations: NormalEquations, trackers: Sequence[int] | None = None) -> Jackknife:
    """Leave out each cluster that has observations: (audit.jackknife).

    Parameters
    ----------
    equations
        At the fit.
    trackers
        Places of those whose observations are used; by default all.
    """
    present = equations.counts(trackers) > 0
    information = _definite(equations, trackers)[present]
    gradient = equations.gradients(trackers)[present]
    total = information.sum(axis=0) + np.diag(equations.ridge)
    step = np.linalg.solve(total, gradient.sum(axis=0))
    without = np.linalg.solve(total - information, (gradient.sum(axis=0) - gradient)[:, :, None])[:, :, 0]
    shares = _shares(equations.matrices("weighted", trackers)[present], equations.ridge)
    return Jackknife(without - step, step, shares)


def _shares(matrices: NDArray[np.float64], ridge: NDArray[np.float64]) -> NDArray[np.float64]:
    """(clusters, p): shares of clusters in variances, from the information (clusters, p, p) of each."""
    inverse = np.linalg.inv(matrices.sum(axis=0) + np.diag(ridge))
    variance = np.maximum(np.einsum("ij,cjk,ik->ci", inverse, matrices, inverse), 0.0)  # rounding may make it negative
    return np.asarray(variance / np.maximum(variance.sum(axis=0), 1e-300))


def _effective(share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Effective number of clusters, from shares (clusters, ...)."""
    return np.asarray(share.sum(axis=0) ** 2 / np.maximum(np.sum(share**2, axis=0), 1e-300))


def _definite(equations: NormalEquations, trackers: Sequence[int] | None) -> NDArray[np.float64]:
    """Second derivatives of each cluster; those with fixed weights where outliers leave the others indefinite."""
    information = equations.matrices("curvature", trackers)
    without = information.sum(axis=0) + np.diag(equations.ridge) - information
    safe = without.size == 0 or float(np.linalg.eigvalsh(_scaled(without)).min()) > 1e-12
    return information if safe else equations.matrices("weighted", trackers)


def _scaled(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetric matrices (..., p, p) with 1 on the diagonal."""
    root = np.sqrt(np.maximum(np.diagonal(matrices, axis1=-2, axis2=-1), 1e-300))
    return np.asarray(matrices / root[..., :, None] / root[..., None, :])


def condition_number(equations: NormalEquations) -> float:
    """Condition number of the information about all numbers, each in units of its own error alone."""
    if not len(equations.ridge):
        return 1.0
    return float(np.linalg.cond(_scaled(equations.information)))
