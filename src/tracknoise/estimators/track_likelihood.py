"""The likelihood of all errors of a track together, with a scale of its own for each track.

Errors e_k about the first observation of a track, over the magnification M_k, are a walk that is seen with noise:

    e_k / M_k = b_k + w_k / M_k,  b_k = b_(k-1) + q_k / M_k,  b_0 of variance A               (track_likelihood.walk)

so that a Kalman filter gives their innovations. A track that began before its first observation here has W in place of
A. A, W and Q are isotropic. The variances of w_k and q_k are multiplied by f_k = exp(sum_j c_j x_kj), with the
logarithms x of what a front end knows, about their medians. With the sum S of the squared whitened innovations, the
logarithm L of the determinant of their covariance, and d numbers, the log likelihood of a track is

    log G((nu + d) / 2) - log G(nu / 2) - d / 2 log(nu pi) - L / 2 - (nu + d) / 2 log(1 + S / nu)
                                                                                              (track_likelihood.student)

with the gamma function G. This is Gaussian noise whose covariance is divided by a number of each track, which has a
gamma distribution of mean 1 and shape nu / 2. With infinite nu all tracks have the same scale, and the log likelihood
is -d / 2 log(2 pi) - L / 2 - S / 2.

Derivatives go backwards through the filter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.optimize import minimize

from tracknoise.estimators.linear_window import of_full_rank
from tracknoise.inference.track_noise import Reference, TrackNoise

Array = NDArray[np.float64]

BULK = ("first", "white", "walk")
"""Components that a law of tracks has."""
LEAST_PX, MOST_PX = 1e-4, 100.0
LEAST_NU, MOST_NU = 2.05, 200.0
"""Degrees of freedom: the covariance is finite, and a larger number cannot be distinguished from a Gaussian."""
STEEPEST = 3.0
"""Largest power of a covariate."""
_START_PX, _START_NU = 0.1, 4.0
_STEP = 1e-4
"""Of the differences that give second derivatives."""


@dataclass(frozen=True, eq=False)
class TrackErrors:
    """Errors of tracks about their first observations. Tracks of fewer observations are filled up."""

    error: Array  # (tracks, n, 2): of all observations but the first, px; 0 where there is none
    magnification: Array  # (tracks, n): Z_0 / Z_k; 1 where there is none
    frames: Array  # (tracks, n): frames since the observation before; 0 where there is none
    known: NDArray[np.bool_]  # (tracks, n): whether there is an observation
    born: NDArray[np.bool_]  # (tracks,): whether the track begins with its first observation here
    # (tracks, 1 + n, covariates): logarithms about their medians, of all observations with the first; 0 where unknown
    covariates: Array

    @classmethod
    def of_rows(
        cls,
        track: NDArray[np.intp],
        error: Array,
        magnification: Array,
        age: Array,
        born: NDArray[np.bool_],
        covariates: Array,
    ) -> "TrackErrors":
        """From observations (rows, ...) in the order of tracks, numbered from 0, and age; `born`: (tracks,)."""
        begins = np.flatnonzero(np.diff(track, prepend=-1))
        since = np.arange(len(track)) - begins[track]
        longest = int(since.max(initial=0)) + 1
        frames = np.diff(age, prepend=0.0)

        def filled(values: NDArray[np.generic], rest: float) -> Array:
            table = np.full((len(begins), longest, *values.shape[1:]), rest)
            table[track, since] = values
            return table

        later = filled(np.ones(len(track)), 0.0)[:, 1:] > 0.0
        return cls(
            error=filled(error, 0.0)[:, 1:],
            magnification=filled(magnification, 1.0)[:, 1:],
            frames=filled(frames, 0.0)[:, 1:],
            known=later,
            born=born,
            covariates=filled(covariates, 0.0),
        )

    @cached_property
    def size(self) -> NDArray[np.int64]:
        """(tracks,): how many numbers the errors of each track are."""
        return np.asarray(2 * self.known.sum(axis=1))

    @cached_property
    def steps(self) -> "_Steps":
        """What a filter reads, whatever the law; it is made once for all laws that are tried on these tracks."""
        order = np.argsort(-self.size, kind="stable")
        tracks = self.chosen(order)
        return _Steps(
            order=order,
            alive=tracks.known.sum(axis=0).tolist(),
            born=tracks.born,
            covariates=tracks.covariates,
            square=_by_step(tracks.magnification**2),
            frames=_by_step(tracks.frames),
            seen_u=_by_step(tracks.error[:, :, 0] / tracks.magnification),
            seen_v=_by_step(tracks.error[:, :, 1] / tracks.magnification),
            log_magnification=np.log(tracks.magnification).sum(axis=1),
        )

    def chosen(self, tracks: NDArray[np.bool_] | NDArray[np.intp]) -> "TrackErrors":
        """Some of the tracks."""
        names = ("error", "magnification", "frames", "known", "born", "covariates")
        return replace(self, **{name: getattr(self, name)[tracks] for name in names})

    def with_covariates(self, places: Sequence[int]) -> "TrackErrors":
        """The same with some of the covariates."""
        return replace(self, covariates=self.covariates[:, :, list(places)])

    def gaussian(self, noise: TrackNoise, factor: Array) -> Array:
        """Log likelihoods (tracks,) of Gaussian noise of any components, with factors (tracks, 1 + n) on W and Q."""
        found = np.zeros(len(self.known))
        length = self.known.sum(axis=1)
        ages = np.cumsum(np.pad(self.frames, ((0, 0), (1, 0))), axis=1).astype(np.int64)
        carried = np.pad(self.magnification, ((0, 0), (1, 0)), constant_values=1.0)
        for n in np.unique(length[length > 0]):
            own = np.flatnonzero(length == n)
            some = own[:, None], np.arange(n + 1)
            covariance = noise.covariance(
                carried[some], ages=ages[some], factor=factor[some], reference=Reference.BIRTH
            )
            root = np.linalg.cholesky(of_full_rank(covariance[:, 2:, 2:]))
            whitened = np.linalg.solve(root, self.error[own, :n].reshape(len(own), -1, 1))[:, :, 0]
            logs = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
            found[own] = -n * np.log(2.0 * np.pi) - logs - 0.5 * np.square(whitened).sum(axis=1)
        return found


@dataclass(frozen=True, slots=True)
class TrackLaw:
    """A distribution of the errors of tracks, (track_likelihood.student)."""

    # first, white, walk: standard deviations of the bulk: px, px, and px per sqrt(frame)
    first: float = _START_PX
    white: float = _START_PX
    walk: float = _START_PX
    nu: float = np.inf  # degrees of freedom; infinite where all tracks have the same scale
    powers: tuple[float, ...] = ()  # c of each covariate

    @property
    def noise(self) -> TrackNoise:
        """The scale matrices of the bulk."""
        return TrackNoise.isotropic(first=self.first, white=self.white, walk=self.walk)

    @property
    def has_scales(self) -> bool:
        """Whether each track has a scale of its own."""
        return bool(np.isfinite(self.nu))

    @property
    def values(self) -> Array:
        """Logarithms of the standard deviations and of nu if it is finite, and the powers."""
        logs = np.log([self.first, self.white, self.walk, *([self.nu] if self.has_scales else [])])
        return np.concatenate([logs, self.powers])

    def with_values(self, values: Array) -> "TrackLaw":
        """The law of the same form that has these `values`."""
        first, white, walk = np.exp(values[:3]).tolist()
        nu = float(np.exp(values[3])) if self.has_scales else np.inf
        return TrackLaw(first, white, walk, nu, tuple(values[3 + self.has_scales :].tolist()))

    def log_likelihoods(self, tracks: TrackErrors) -> Array:
        """(tracks,) float64, nat."""
        filtered = _Filtered.of(self, tracks)
        return self._log_likelihoods(tracks.size, filtered.squares, filtered.logs)

    def _log_likelihoods(self, size: NDArray[np.int64], squares: Array, logs: Array) -> Array:
        if not self.has_scales:
            return np.asarray(-0.5 * (size * np.log(2.0 * np.pi) + logs + squares))
        half = 0.5 * (self.nu + size)
        constant = special.gammaln(half) - special.gammaln(0.5 * self.nu) - 0.5 * size * np.log(self.nu * np.pi)
        return np.asarray(constant - 0.5 * logs - half * np.log1p(squares / self.nu))

    def with_slopes(self, tracks: TrackErrors) -> tuple[Array, Array]:
        """`log_likelihoods`, and their derivatives (tracks, values) by `values`."""
        filtered, size = _Filtered.of(self, tracks), tracks.size
        squares, nu = filtered.squares, self.nu
        weight = (nu + size) / (nu + squares) if self.has_scales else np.ones(len(size))
        slopes = filtered.slopes(weight)
        if self.has_scales:
            digamma = special.digamma(0.5 * (nu + size)) - special.digamma(0.5 * nu) - size / nu
            by_nu = 0.5 * nu * (digamma - np.log1p(squares / nu) + weight * squares / nu)
            slopes = np.insert(slopes, 3, by_nu, axis=1)
        return self._log_likelihoods(size, squares, filtered.logs), slopes

    def information(self, tracks: TrackErrors, unit: NDArray[np.intp], count: int) -> tuple[Array, Array]:
        """Sums by unit of the derivatives of log likelihoods by `values`: first ones, and minus the second ones.

        Shapes (units, values), (units, values, values). `unit`: (tracks,), from 0 to `count` - 1.
        """

        def summed(law: TrackLaw) -> Array:
            slopes = law.with_slopes(tracks)[1]
            return np.stack([np.bincount(unit, column, count) for column in slopes.T], axis=1)

        values = self.values
        steps = _STEP * np.eye(len(values))
        ends = [(summed(self.with_values(values + step)), summed(self.with_values(values - step))) for step in steps]
        second = np.stack([(low - high) / (2.0 * _STEP) for high, low in ends], axis=2)
        return summed(self), 0.5 * (second + np.swapaxes(second, 1, 2))


@dataclass(frozen=True, slots=True, eq=False)
class _Steps:
    """Errors of tracks, longest first, so that step k concerns the first `alive[k]` of them."""

    order: NDArray[np.intp]  # (tracks,): where each was before
    alive: list[int]
    born: NDArray[np.bool_]  # (tracks,)
    covariates: Array  # (tracks, 1 + n, covariates)
    # (steps, tracks): M_k^2, frames since the observation before, and e_k / M_k along u and v
    square: Array
    frames: Array
    seen_u: Array
    seen_v: Array
    log_magnification: Array  # (tracks,): sum of log M_k


@dataclass(frozen=True, slots=True, eq=False)
class _Filtered:
    """A Kalman filter over tracks."""

    law: TrackLaw
    steps: _Steps
    factor: Array  # (1 + steps, tracks)
    # white, walk, gain, total, right, down: (steps, tracks): The variances of w_k / M_k and q_k / M_k; the gain, the
    # variance of the innovation, and the innovation along u and v. Of steps that a track does not have: 1 in `total`, 0
    # in others.
    white: Array
    walk: Array
    gain: Array
    total: Array
    right: Array
    down: Array
    # squares, logs: (tracks,): s and L, in the former order
    squares: Array
    logs: Array

    @classmethod
    def of(cls, law: TrackLaw, tracks: TrackErrors) -> "_Filtered":
        steps = tracks.steps
        factor = np.ones(steps.covariates.shape[:2][::-1])
        if law.powers:
            factor = _by_step(np.exp(steps.covariates @ np.array(law.powers)))
        inverse = factor[1:] / steps.square
        white = law.white**2 * inverse
        walk = law.walk**2 * inverse * steps.frames
        variance = np.where(steps.born, law.first**2, law.white**2 * factor[0])
        gains, right, down = (np.zeros_like(white) for _ in range(3))
        totals = np.ones_like(white)
        u, v = np.zeros(len(variance)), np.zeros(len(variance))
        for k, n in enumerate(steps.alive):
            variance = variance[:n] + walk[k, :n]
            total = np.add(variance, white[k, :n], out=totals[k, :n])
            gain = np.divide(variance, total, out=gains[k, :n])
            u = u[:n] + gain * np.subtract(steps.seen_u[k, :n], u[:n], out=right[k, :n])
            v = v[:n] + gain * np.subtract(steps.seen_v[k, :n], v[:n], out=down[k, :n])
            variance = variance * (1.0 - gain)
        squares, logs = np.empty(len(steps.order)), np.empty(len(steps.order))
        squares[steps.order] = ((right**2 + down**2) / totals).sum(axis=0)
        logs[steps.order] = 2.0 * np.log(totals).sum(axis=0) + 4.0 * steps.log_magnification
        return cls(law, steps, factor, white, walk, gains, totals, right, down, squares, logs)

    def slopes(self, weight: Array) -> Array:
        """Derivatives of -(weight S + L) / 2 by the logarithms of the standard deviations and by the powers."""
        law, steps = self.law, self.steps
        of_u, of_v, of_variance = (np.zeros(len(weight)) for _ in range(3))
        of_white, of_walk = np.zeros_like(self.white), np.zeros_like(self.walk)
        pull = weight[steps.order] / self.total
        of_total = (2.0 - pull * (self.right**2 + self.down**2)) / self.total
        rest, share = 1.0 - self.gain, self.gain / self.total
        pull_u, pull_v = 2.0 * pull * self.right, 2.0 * pull * self.down
        for k, n in reversed(list(enumerate(steps.alive))):
            kept, before, total = rest[k, :n], of_variance[:n], of_total[k, :n]
            of_gain = of_u[:n] * self.right[k, :n] + of_v[:n] * self.down[k, :n]
            of_white[k, :n] = before * self.gain[k, :n] ** 2 - of_gain * share[k, :n] + total
            of_variance[:n] = before * kept**2 + of_gain * kept / self.total[k, :n] + total
            of_walk[k, :n] = of_variance[:n]
            of_u[:n] = of_u[:n] * kept - pull_u[k, :n]
            of_v[:n] = of_v[:n] * kept - pull_v[k, :n]
        of_white, of_walk = of_white * self.white, of_walk * self.walk
        begun = np.where(steps.born, 0.0, of_variance * law.white**2 * self.factor[0])
        first = np.where(steps.born, of_variance * law.first**2, 0.0)
        white, walk = of_white.sum(axis=0) + begun, of_walk.sum(axis=0)
        both = np.concatenate([begun[None], of_white + of_walk])
        powers = np.einsum("kt,tkc->tc", both, steps.covariates[:, :, : len(law.powers)])
        found = np.hstack([2.0 * np.stack([first, white, walk], axis=1), powers])
        slopes = np.empty_like(found)
        slopes[steps.order] = -0.5 * found
        return slopes


def _by_step(values: Array) -> Array:
    return np.ascontiguousarray(values.T)


Bounds = tuple[float, float]


def fit_law(tracks: TrackErrors, start: TrackLaw, *, powers: Sequence[Bounds] = ()) -> TrackLaw:
    """The law of the form of `start` that is most likely; `powers`: bounds of each of its powers."""
    count = len(tracks.known)

    def cost(values: Array) -> tuple[float, Array]:
        found, slopes = start.with_values(values).with_slopes(tracks)
        return -float(found.sum()) / count, -slopes.sum(axis=0) / count

    of_sigmas = [(np.log(LEAST_PX), np.log(MOST_PX))] * len(BULK)
    of_nu = [(np.log(LEAST_NU), np.log(MOST_NU))] if start.has_scales else []
    found = minimize(cost, start.values, jac=True, method="L-BFGS-B", bounds=[*of_sigmas, *of_nu, *powers])
    return start.with_values(found.x)


def with_scales(law: TrackLaw) -> TrackLaw:
    """The same with a scale of its own for each track, from which a fit begins."""
    return replace(law, nu=_START_NU)
