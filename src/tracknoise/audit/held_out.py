"""What corrections explain of clusters that took no part in their fit.

A correction fitted without a cluster is applied to this cluster; the fit moves as (audit.jackknife) says. The share
that it explains is 1 - sum min(d^2, 9) / sum min(d0^2, 9) (audit.gain): d and d0 are the lengths of residuals with and
without it, in units of the robust scale of the tracker and age, so that outliers count as three scales.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.audit.fitted import Fit
from tracknoise.audit.jackknife import Jackknife
from tracknoise.audit.robust import squared
from tracknoise.audit.samples import AuditSamples

_MOST = 9.0


@dataclass(frozen=True, slots=True)
class Gain:
    """A share that is explained, with its interval.

    Attributes
    ----------
    value, low, high
        At most 1; negative where the correction makes it worse.
    """

    value: float
    low: float
    high: float


def held_out_residuals(samples: AuditSamples, fitted: Fit, moves: Jackknife) -> NDArray[np.float64]:
    """Residuals (n, 2) of each observation about the fit without its cluster, px."""
    return np.asarray(fitted.residual - np.einsum("nij,nj->ni", fitted.design, moves.moves[samples.cluster]))


def held_out_errors(samples: AuditSamples, fitted: Fit, moves: Jackknife) -> NDArray[np.float64]:
    """Errors (n, 2) about the truth corrected by the fit without the cluster of each observation, px."""
    k = len(fitted.free)
    moved = np.einsum("nij,nj->ni", fitted.design[:, :, :k], moves.moves[samples.cluster, :k])
    return np.asarray(fitted.error - moved)


def losses(samples: AuditSamples, residual: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of min(d^2, 9) over each cluster, (clusters,); unknown residuals count as outliers."""
    cut = np.minimum(np.nan_to_num(squared(residual, scale), nan=_MOST), _MOST)
    return np.asarray(np.bincount(samples.cluster, cut, minlength=samples.n_clusters))


def gain(corrected: NDArray[np.float64], base: NDArray[np.float64], *, level: float) -> Gain:
    """Share explained, from losses of clusters with and without the correction, by (audit.gain).

    Its interval is from the jackknife over clusters, by Student's distribution.

    Parameters
    ----------
    corrected, base : (clusters,)
        See `losses`.
    level
        Probability that the interval contains the share.
    """
    if len(base) < 2 or not base.sum() > 0.0:
        return Gain(0.0, 0.0, 0.0)
    value = 1.0 - float(corrected.sum() / base.sum())
    others = np.maximum(base.sum() - base, 1e-300)
    without = 1.0 - (corrected.sum() - corrected) / others
    n = len(base)
    error = float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))
    half = float(special.stdtrit(n - 1, 0.5 + 0.5 * level)) * error
    return Gain(value, value - half, min(value + half, 1.0))
