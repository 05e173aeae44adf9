"""What densities of pairs that depend on a squared distance alone have in common: many samples at once, arrays only.

A sample is given by the terms of its power sums to order 2: 1, u, v, u^2, uv, v^2 of each point. Squared distances and
weighted moments are then one matrix product each. Shorter samples are padded with zeros, which have no
effect.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TERMS = 6
_LOG_2PI = float(np.log(2 * np.pi))


def terms(samples: Sequence[Array]) -> Array:
    """Terms of samples of pairs, each (points, 2): (samples, 6, most points)."""
    padded = np.zeros((len(samples), _TERMS, max((len(points) for points in samples), default=0)))
    for place, points in enumerate(samples):
        u, v = np.ascontiguousarray(points.T)
        for row, values in enumerate((1.0, u, v, u * u, u * v, v * v)):
            padded[place, row, : len(points)] = values
    return padded


def gathered(every: Array, samples: Sequence[NDArray[np.intp]]) -> Array:
    """Terms of samples, each some of the columns of the terms of all points: (samples, 6, most points).

    Parameters
    ----------
    every : (6, points)
        Terms of one sample that holds all points.
    samples
        Which points each is of.
    """
    padded = np.zeros((len(samples), len(every), max(map(len, samples), default=0)))
    for place, points in enumerate(samples):
        padded[place, :, : len(points)] = np.take(every, points, axis=1)
    return padded


def moments(sums: Array) -> tuple[Array, Array]:
    """Mean, (samples, 2), and covariance as uu, uv, vv, (samples, 3), from weighted sums of terms, (samples, 6)."""
    mean, covariance = sums[:, 1:3] / sums[:, :1], sums[:, 3:] / sums[:, :1]
    u, v = mean.T
    covariance[:, 0] -= u * u
    covariance[:, 1] -= u * v
    covariance[:, 2] -= v * v
    return mean, covariance


def squared_distances(points: Array, mean: Array, scatter: Array) -> Array:
    """(x - mean)^T scatter^-1 (x - mean) of each point, (samples, points).

    Parameters
    ----------
    points : (samples, 6, points)
        What `terms` made.
    mean, scatter : (samples, 2), (samples, 3)
        As from `moments`.
    """
    squared = combined(distance_weights(mean, scatter), points)
    return np.maximum(squared, 0.0, out=squared)  # rounding may leave less than 0


def distance_weights(mean: Array, scatter: Array) -> Array:
    """The weights of the terms of which `squared_distances` are sums, (samples, 6)."""
    u, v = mean.T
    uu, uv, vv = _inverse(scatter).T
    of_u, of_v = uu * u + uv * v, uv * u + vv * v
    weights = np.empty((len(mean), _TERMS))
    weights[:, 0] = u * of_u + v * of_v
    weights[:, 1], weights[:, 2] = -2 * of_u, -2 * of_v
    weights[:, 3], weights[:, 4], weights[:, 5] = uu, 2 * uv, vv
    return weights


def combined(weights: Array, points: Array) -> Array:
    """Sums of the terms of each point with the weights of its sample, (samples, points); 0 for padding."""
    sums: Array = (weights[:, None, :] @ points)[:, 0]
    return sums


def trace_ratio(second: Array, scatter: Array) -> Array:
    """Trace of scatter^-1 times second, both as uu, uv, vv, (samples, 3): (samples,)."""
    inverse = _inverse(scatter)
    ratio: Array = (inverse * second) @ np.array([1.0, 2.0, 1.0])
    return ratio


def log_normaliser(scatter: Array) -> Array:
    """Log density of a Gaussian at its mean, (samples, 1)."""
    logs: Array = -_LOG_2PI - 0.5 * np.log(determinant(scatter))
    return logs[:, None]


def determinant(scatter: Array) -> Array:
    """Determinant of each scatter, (samples,)."""
    uu, uv, vv = scatter.T
    product: Array = uu * vv - uv * uv
    return product


def _inverse(scatter: Array) -> Array:
    inverse = np.empty_like(scatter)
    inverse[:, 0], inverse[:, 1], inverse[:, 2] = scatter[:, 2], -scatter[:, 1], scatter[:, 0]
    inverse /= determinant(scatter)[:, None]
    return inverse
