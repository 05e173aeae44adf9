"""How much of the errors the truth could explain at most, whatever is wrong with it and whether or not it is found.

- Constant faults: all parameters of the audit together, with no bias of the trackers beside them. A fault that cannot
  be separated from another one, or from a bias, is in the bound. One that moves no true position adds nothing to it.
- Depths that are wrong by chance, each by itself. Such an error moves a true position along the epipolar line only.

Errors are in units of the robust scale of their tracker and age. Those beyond three scales do not count, as outliers.

The first is the share 1 - sum min(d^2, 9) / sum min(d0^2, 9) for residuals d of a robust linear regression of the
errors d0 on the derivatives of true positions. It is of the errors that it was fitted to, and so an upper bound.
(truth.faults)

For the second, with the derivative g of a true position by the logarithm of its depth, and the error along and across
g,

    along^2 - across^2 = a + s^2 g^2    (truth.depths)

is fitted to the errors of each tracker and age. A tracker whose noise is larger along the motion of the image has it in
a. The share is sum s^2 g^2 / sum d0^2.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.inference.robust_fits import scales, squared, summed
from tracknoise.truth_faults.audit_fit import LEVEL, Gain, gain, losses
from tracknoise.truth_faults.audit_samples import AuditSamples
from tracknoise.truth_faults.corrected_positions import predict
from tracknoise.truth_faults.fault_parameters import COUNT, Parameter, furthest

EVERY_FAULT, DEPTHS = "every_fault", "depths"
"""Names of the two bounds in the family `at_most` of an audit."""
_ROUNDS = 8
_MOST = 9.0
"""Squared distance, in scales, beyond which an error is an outlier."""
_LONGEST = 0.98
"""Quantile at which derivatives by depth are cut: few points are so near that they would decide alone."""


@dataclass(frozen=True, slots=True)
class Explained:
    """Shares of the errors that the truth could explain.

    Attributes
    ----------
    faults
        By all constant faults together.
    depths
        By random errors of single depths.
    """

    faults: Gain
    depths: Gain


def explained(samples: AuditSamples, parameters: Sequence[Parameter]) -> Explained:
    """How much the truth could explain of the errors of some observations.

    Parameters
    ----------
    samples
        The observations.
    parameters
        Those that can be fitted.
    """
    error = samples.observed - samples.stated
    scale = scales(samples.group, error)
    stated = predict(samples, np.zeros(COUNT))
    return Explained(
        _by_faults(samples, error, scale, stated.by(parameters), 1.0 / furthest(parameters) ** 2),
        _by_depths(samples, error, scale, stated.by([Parameter.depth_scale])[:, :, 0]),
    )


def _by_faults(
    samples: AuditSamples,
    error: NDArray[np.float64],
    scale: NDArray[np.float64],
    design: NDArray[np.float64],
    ridge: NDArray[np.float64],
) -> Gain:
    """(truth.faults)."""
    residual, theta = error, np.zeros(len(ridge))
    for _ in range(_ROUNDS):
        information, score = summed(design, residual, scale, ridge)
        theta = theta + np.linalg.solve(information, score - ridge * theta)
        residual = error - design @ theta
    found = gain(losses(samples, residual, scale), losses(samples, error, scale), level=LEVEL)
    return Gain(max(found.value, 0.0), found.low, max(found.high, 0.0))


def _by_depths(
    samples: AuditSamples, error: NDArray[np.float64], scale: NDArray[np.float64], by_depth: NDArray[np.float64]
) -> Gain:
    """(truth.depths)."""
    length = np.hypot(by_depth[:, 0], by_depth[:, 1])
    used = np.isfinite(length) & (length > 0.0) & (squared(error, scale) <= _MOST)
    if not used.any():
        return Gain(0.0, 0.0, 0.0)
    unit, size = by_depth[used] / length[used, None], error[used] / scale[used, None]
    along, across = (np.sum(size * axis, axis=1) for axis in (unit, np.stack([-unit[:, 1], unit[:, 0]], axis=1)))
    group = np.unique(samples.group[used], return_inverse=True)[1]
    moved = np.square(length[used] / scale[used])
    moved = np.minimum(moved, np.quantile(moved, _LONGEST))
    beyond = along**2 - across**2
    x, y = (_within(group, values) for values in (moved, beyond))
    cluster, n = samples.cluster[used], samples.n_clusters
    products: NDArray[np.float64] = np.stack(
        [np.bincount(cluster, values, n) for values in (x * y, x * x, moved, along**2 + across**2)]
    )
    return _share(products)


def _within(group: NDArray[np.intp], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values without the mean of their group."""
    return np.asarray(values - (np.bincount(group, values) / np.bincount(group))[group])


def _share(products: NDArray[np.float64]) -> Gain:
    """Share that depths explain, by the jackknife over clusters, from sums of each, (4, clusters)."""
    n = products.shape[1]
    value, without = _ratio(products.sum(axis=1)), _ratio(products.sum(axis=1)[:, None] - products)
    error = float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))
    half = float(special.stdtrit(max(n - 1, 1), 0.5 + 0.5 * LEVEL)) * error
    low, high = float(value) - half, float(value) + half
    return Gain(min(max(float(value), 0.0), 1.0), low, min(max(high, 0.0), 1.0))


def _ratio(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    slope = sums[0] / np.maximum(sums[1], 1e-300)
    return np.asarray(slope * sums[2] / np.maximum(sums[3], 1e-300))
