"""Covariances of single errors, of changes and of whole tracks, from the components of a model."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tracknoise.noise_models.track_noise import Reference, TrackNoise

Array = NDArray[np.float64]


def error_covariances(noise: TrackNoise, age: Array, magnification: Array, factor: Array) -> Array:
    """Covariances of errors about the first position, (n, 2, 2) px^2, at magnifications and factors (n,); 0 at age 0.

    The depth is taken to have changed evenly since birth, and the factor to have been the same.
    """
    later = np.where(age > 0.0, 1.0, 0.0)
    carried = age * (1.0 + magnification + magnification**2) / 3.0
    return _summed(noise, (later * magnification**2, later * factor, factor * carried, age**2))


def change_covariances(noise: TrackNoise, frames: Array, factor: Array) -> Array:
    """Covariances of changes over a number of frames (n,) after the first one, (n, 2, 2) px^2."""
    return _summed(noise, (np.zeros_like(frames), 2.0 * factor, factor * frames, frames**2))


def track_covariance(
    noise: TrackNoise, ages: Array, reference: Reference, magnification: Array, factor: Array
) -> Array:
    """Covariance of the errors of a track, (2 m, 2 m) px^2, at ages (m,) that need not begin with 0."""
    seen = np.stack([ages, magnification, factor])
    missing = int(ages[0] > 0)
    birth = np.array([[0.0], [1.0], [1.0]])
    aged, carried, scale = np.hstack([birth, seen])[:, None, 1 - missing :]
    return noise.covariance(carried, ages=aged, factor=scale, reference=reference)[0, 2 * missing :, 2 * missing :]


def _summed(noise: TrackNoise, scales: Iterable[Array]) -> Array:
    parts = zip(scales, (noise.first, noise.white, noise.walk, noise.drift), strict=True)
    return np.asarray(sum(scale[:, None, None] * covariance for scale, covariance in parts))
