"""What an estimator that assumes one noise makes of another, by exact linear algebra.

Each track is whitened by the covariance that the estimator assumes, and its 3-D point is eliminated. With G for what is
left of the derivatives by poses, C for the true covariance after whitening, and sums over tracks,

    claimed = (sum G' G)^-1,  actual = claimed (sum G' C G) claimed    (benchmark.covariances)
    NEES / dof = trace(claimed^-1 actual) / dof                        (benchmark.nees)

The normalised estimation error squared is 1 if the estimator is as certain as it should be, and larger if it is
overconfident. Innovations are the residuals of a track after its point was fitted with the true poses.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import gammaincinv

from tracknoise.noise_models.linear_window import LinearTracks
from tracknoise.noise_models.model import Landmark, Purpose
from tracknoise.noise_models.track_noise import Reference, TrackNoise

EXACT = 1e-4
"""Standard deviation of an observation that is taken as true, as a share of that of the others."""
_NEWEST = 5
"""Coordinates of the newest pose: three of its rotation, two of its position."""
_FACTORS = (-4.0, 4.0)
"""Range of the standard deviation that is searched, as logarithm of its ratio to the one for a free landmark."""
_DRAWS = 200
_ROUNDING = 1e-3
"""Error of a NEES that rounding may cause. It is larger where the poses of a window are not determined."""
Covariances = Sequence[NDArray[np.float64]]
"""(tracks, 2 n, 2 n) float64 for each group of tracks, px^2."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What an estimator claims about the poses of a window, and what is so.

    Parameters
    ----------
    claimed, actual
        (p, p) float64: covariances of the unknown coordinates of poses; radians and metres, those of the newest last.
    innovations
        Mean square of the whitened innovations; 1 if they look right.
    """

    claimed: NDArray[np.float64]
    actual: NDArray[np.float64]
    innovations: float

    @property
    def nees_all(self) -> float:
        """(benchmark.nees) of all poses."""
        return _nees(self.claimed, self.actual)

    @property
    def nees_newest(self) -> float:
        """(benchmark.nees) of the newest pose, with its own block of the covariance."""
        return _nees(self.claimed[-_NEWEST:, -_NEWEST:], self.actual[-_NEWEST:, -_NEWEST:])

    @property
    def position_m(self) -> float:
        """Root mean square error of the newest position."""
        return float(np.sqrt(np.trace(self.actual[-2:, -2:])))

    @property
    def rotation_rad(self) -> float:
        """Root mean square error of the newest rotation."""
        return float(np.sqrt(np.trace(self.actual[-_NEWEST:-2, -_NEWEST:-2])))


def _nees(claimed: NDArray[np.float64], actual: NDArray[np.float64]) -> float:
    return float(np.trace(np.linalg.solve(claimed, actual)) / len(claimed))


def true_covariances(window: Sequence[LinearTracks], noise: TrackNoise) -> Covariances:
    """Covariances of the errors of all tracks, counted from the true positions.

    A track that began before the window has its first observation there with the noise W of any other one. What it
    carries from before, its point absorbs.
    """
    found = []
    for tracks in window:
        covariance = noise.covariance(tracks.magnification, reference=Reference.FREE)
        covariance[~tracks.born, :2, :2] = noise.white
        found.append(covariance)
    return found


def scalar_covariances(
    window: Sequence[LinearTracks], sigma: float, *, first: float | None = None, born_only: bool = False
) -> Covariances:
    """One standard deviation for all observations, px, and another for first ones if it is given.

    With `born_only`, this is that of tracks that begin in the window, as where the first direction of a track is a
    state. An estimator that takes the first observation as exact does so with each track of its window.
    """
    variances = []
    for tracks in window:
        variance = np.full(tracks.by_point.shape[:2], sigma**2)
        if first is not None:
            variance[tracks.born | (not born_only), :2] = first**2
        variances.append(np.asarray(variance[:, :, None] * np.eye(len(variance[0]))))
    return variances


def outcome(window: Sequence[LinearTracks], actual: Covariances, assumed: Covariances) -> Outcome:
    """Claimed and actual covariance of the poses of a window, (benchmark.covariances)."""
    return outcomes(window, [actual], assumed)[0]


def outcomes(window: Sequence[LinearTracks], actual: Sequence[Covariances], assumed: Covariances) -> list[Outcome]:
    """The same for several true covariances, of an estimator that assumes one."""
    size = window[0].by_pose.shape[2]
    information, middle = np.zeros((size, size)), np.zeros((len(actual), size, size))
    squares, freedom = np.zeros(len(actual)), 0
    for place, (tracks, believed) in enumerate(zip(window, assumed, strict=True)):
        whitening = np.linalg.inv(np.linalg.cholesky(believed))
        span = np.linalg.qr(whitening @ tracks.by_point)[0]
        by_pose = _without(whitening @ tracks.by_pose, span)
        rows = by_pose.reshape(-1, size)
        information += rows.T @ rows
        freedom += by_pose.shape[0] * (by_pose.shape[1] - 3)
        for number, each in enumerate(actual):
            noise = _innovations(whitening, span, each[place])
            middle[number] += rows.T @ (noise @ by_pose).reshape(-1, size)
            squares[number] += np.trace(noise, axis1=1, axis2=2).sum()
    claimed = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return [
        Outcome(claimed, claimed @ one @ claimed, float(sum_ / freedom))
        for one, sum_ in zip(middle, squares, strict=True)
    ]


def determines_poses(window: Sequence[LinearTracks]) -> bool:
    """Whether tracks determine all poses of a window, so that an estimator with the true noise has a NEES of 1."""
    if not window:
        return False
    white = scalar_covariances(window, 1.0)
    try:
        found = outcome(window, white, white)
        errors = np.array([found.nees_all, found.nees_newest]) - 1.0
    except np.linalg.LinAlgError:
        return False
    return bool((np.abs(errors) < _ROUNDING).all())


def _innovations(
    whitening: NDArray[np.float64], span: NDArray[np.float64], true: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Covariances of whitened innovations, without what the points absorb."""
    half = _without(whitening @ true, span)
    return _without(whitening @ np.swapaxes(half, 1, 2), span)


def _without(values: NDArray[np.float64], span: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns without their parts in the span of orthonormal ones."""
    return np.asarray(values - span @ (np.swapaxes(span, 1, 2) @ values))


def consistent_sigma(
    window: Sequence[LinearTracks],
    noise: TrackNoise,
    *,
    purpose: Purpose,
    landmark: Landmark = Landmark.FREE,
) -> float:
    """The standard deviation of all observations that makes a purpose right, px.

    Parameters
    ----------
    window
        Tracks of the window, grouped by length.
    noise
        The true noise.
    purpose
        What is to be right.
    landmark
        How the first observation is used. For `Landmark.STATE` that of a track that begins in the window has the
        covariance A, and sigma is that of the others; where A is 0, it is exact. NaN if no standard deviation does it.
    """
    actual = true_covariances(window, noise)
    free = np.sqrt(_consistency(window, actual, scalar_covariances(window, 1.0), purpose))
    if landmark is Landmark.FREE:
        return float(free)
    is_state = landmark is Landmark.STATE
    first = np.sqrt(np.trace(noise.first) / 2.0) if is_state else 0.0

    def excess(log_sigma: float) -> float:
        sigma = float(np.exp(log_sigma))
        assumed = scalar_covariances(window, sigma, first=max(first, EXACT * sigma), born_only=is_state)
        return float(np.log(_consistency(window, actual, assumed, purpose)))

    return float(np.exp(_root(excess, float(np.log(free)))))


def _root(excess: Callable[[float], float], start: float) -> float:
    low, high = (start + factor for factor in _FACTORS)
    if excess(low) < 0.0 or excess(high) > 0.0:
        return float("nan")
    return float(brentq(excess, low, high, xtol=1e-6))


def consistencies(
    window: Sequence[LinearTracks], actual: Sequence[Covariances], assumed: Covariances
) -> list[dict[Purpose, float]]:
    """Actual over claimed mean square of what each purpose is about, for each of several true covariances."""
    return [
        {
            Purpose.INNOVATIONS: found.innovations,
            Purpose.ALL_POSES: found.nees_all,
            Purpose.NEWEST_POSE: found.nees_newest,
            Purpose.DEPTH: _depth_consistency(window, each, assumed),
        }
        for each, found in zip(actual, outcomes(window, actual, assumed), strict=True)
    ]


def _consistency(window: Sequence[LinearTracks], actual: Covariances, assumed: Covariances, purpose: Purpose) -> float:
    """Actual over claimed mean square of what a purpose is about."""
    if purpose is Purpose.DEPTH:
        return _depth_consistency(window, actual, assumed)
    found = outcome(window, actual, assumed)
    match purpose:
        case Purpose.INNOVATIONS:
            return found.innovations
        case Purpose.ALL_POSES:
            return found.nees_all
        case _:
            return found.nees_newest


def _depth_consistency(window: Sequence[LinearTracks], actual: Covariances, assumed: Covariances) -> float:
    """Mean square of the error of the depth of points over the claimed variance, with the true poses."""
    ratios = []
    for tracks, true, believed in zip(window, actual, assumed, strict=True):
        whitening = np.linalg.inv(np.linalg.cholesky(believed))
        span, root = np.linalg.qr(whitening @ tracks.by_point)
        along = np.linalg.solve(
            np.swapaxes(root, 1, 2), tracks.rays[:, :, None]
        )  # exact observations leave it accurate
        weights = np.swapaxes(whitening, 1, 2) @ (span @ along)
        claimed = np.square(along).sum(axis=(1, 2))
        ratios.append((np.swapaxes(weights, 1, 2) @ true @ weights)[:, 0, 0] / claimed)
    return float(np.concatenate(ratios).mean())


def gate_factor(
    window: Sequence[LinearTracks],
    noise: TrackNoise,
    *,
    sigma: float,
    level: float,
    first: float | None = None,
    born_only: bool = False,
    seed: int = 0,
) -> float:
    """What to multiply a chi-square gate of a track by, so that it lets through a share of `level` of good tracks.

    The gate is over the innovations of a track, whitened as by `scalar_covariances`, with 2 n - 3 degrees of freedom.
    Noise is Gaussian. The quantile is that of 200 draws of each track.
    """
    random = np.random.default_rng(seed)
    actual, assumed = (
        true_covariances(window, noise),
        scalar_covariances(window, sigma, first=first, born_only=born_only),
    )
    ratios = []
    for tracks, true, believed in zip(window, actual, assumed, strict=True):
        whitening = np.linalg.inv(np.linalg.cholesky(believed))
        span = np.linalg.qr(whitening @ tracks.by_point)[0]
        spread = np.linalg.eigvalsh(_innovations(whitening, span, true))
        draws = random.chisquare(1.0, (len(spread), _DRAWS, spread.shape[1]))
        squares = np.einsum("tdi,ti->td", draws, np.maximum(spread, 0.0))
        ratios.append(squares.ravel() / (2.0 * gammaincinv((spread.shape[1] - 3) / 2.0, level)))
    return float(np.quantile(np.concatenate(ratios), level))
