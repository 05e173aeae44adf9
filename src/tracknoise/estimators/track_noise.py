"""Covariances of the errors of a track, from the components of its noise.

The covariance of all errors of a track, from the components of its noise.

With the magnification M_k = Z_0 / Z_k of the image about the point since birth, the covariance of the errors about the
first position is, for ages j, k >= 1,

    Cov(e_j, e_k) = M_j M_k A + W [j = k] + Q sum_{1 <= i <= min(j, k)} M_j M_k / M_i^2 + j k D    (noise_model.track)

and 0 where j or k is 0. An estimator that solves for the 3-D point does not need to know from where errors are counted.
For it the first observation may have the covariance A, and the others lose M_j M_k A: both lead to the same estimate.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray


class Reference(StrEnum):
    """From where the errors of a track are counted."""

    BIRTH = "birth"
    """From the first position: its own error is 0, and A is in all others."""
    FREE = "free"
    """From the true position: the first observation has the covariance A."""


def _none() -> NDArray[np.float64]:
    return np.zeros((2, 2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackNoise:
    """Components of the noise of a track, each (2, 2) float64 and symmetric."""

    first: NDArray[np.float64] = field(default_factory=_none)  # A: covariance of the error of the first position, px^2
    # W: covariance of what is independent in each frame, px^2
    white: NDArray[np.float64] = field(default_factory=_none)
    walk: NDArray[np.float64] = field(default_factory=_none)  # Q: covariance of what each frame adds, px^2 per frame
    # D: covariance of the rate at which a track drifts, px^2 per frame^2
    drift: NDArray[np.float64] = field(default_factory=_none)

    @classmethod
    def isotropic(
        cls, *, first: float = 0.0, white: float = 0.0, walk: float = 0.0, drift: float = 0.0
    ) -> "TrackNoise":
        """The same in all directions, from standard deviations: px, px, px per sqrt(frame), px per frame."""
        covariances = [sigma**2 * np.eye(2) for sigma in (first, white, walk, drift)]
        return cls(first=covariances[0], white=covariances[1], walk=covariances[2], drift=covariances[3])

    def per_frames(self, frames: float) -> "TrackNoise":
        """The same noise of a track that is seen once in so many frames: walk and drift are of all of them."""
        return replace(self, walk=self.walk * frames, drift=self.drift * frames**2)

    def covariance(
        self,
        magnification: NDArray[np.float64],
        *,
        ages: NDArray[np.int64] | None = None,
        factor: NDArray[np.float64] | None = None,
        reference: Reference = Reference.FREE,
    ) -> NDArray[np.float64]:
        """Covariances of tracks of n observations, (noise_model.track).

        `magnification`: (tracks, n) float64: Z_0 / Z_k; 1 for motion across the optical axis; `ages`: (tracks, n)
        integers: frames since the first observation, increasing from 0. By default 0 to n - 1. What the walk adds in
        frames without an observation is magnified as in the next observed one; `factor`: (tracks, n) float64: on W, and
        on Q since the observation before. By default 1; `reference`: from where errors are counted. Returns (tracks, 2
        n, 2 n) float64: px^2, u and v of each observation in turn.
        """
        count = magnification.shape[1]
        aged = np.broadcast_to(np.arange(count), magnification.shape) if ages is None else ages
        scale = np.ones(magnification.shape) if factor is None else factor
        later = (np.arange(count) > 0).astype(np.float64)
        both = later[:, None] * later
        carried = magnification[:, :, None] * magnification[:, None, :]
        free = reference is Reference.FREE
        first = np.diag(1.0 - later) if free else carried * both
        shares = (
            (np.broadcast_to(first, carried.shape), self.first),
            ((later * scale)[:, :, None] * np.eye(count), self.white),
            (carried * _walked(magnification, aged, scale), self.walk),
            (aged[:, :, None] * aged[:, None, :] * 1.0, self.drift),
        )
        summed = np.zeros((len(carried), count, 2, count, 2))
        for share, component in shares:
            if component.any():  # most models have two of the four
                summed += np.einsum("tjk,uv->tjukv", share, component)
        return summed.reshape(len(carried), 2 * count, 2 * count)


def _walked(
    magnification: NDArray[np.float64], ages: NDArray[np.int64], factor: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(tracks, n, n) float64: sum of factor / M_i^2 over the frames up to the earlier of two observations."""
    steps = factor * np.diff(ages, axis=1, prepend=ages[:, :1]) / magnification**2
    sums = np.cumsum(steps, axis=1)
    return np.minimum(sums[:, :, None], sums[:, None, :])


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
