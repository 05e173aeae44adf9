"""Standard deviations and gates for estimators, each named by what it makes right.

Gates let through a stated share of good tracks, by length of the window and kind of landmark. Where the first
observation has a residual like any other, gates are those of the measured windows, tails included, but without windows
whose residuals are as large as with one outlier. If there are too few, they are those of Gaussian noise with the
components. Where the first observation is exact or a state, its error is in all residuals. The linear benchmark says
what that does to Gaussian noise, and the gate is larger by as much:

    gate = measured modelled(landmark) / modelled(free)    (gates.landmark)

An estimator that assumes one standard deviation s for all observations claims covariances in proportion to s^2, while
the actual ones are linear in A, W, Q and D. What makes a purpose right is therefore

    s^2 = sum_j kappa_j a_j    (equivalents)

with half the trace a_j of each component, and kappa_j from the linear benchmark with that component alone, of half a
trace of 1 px^2. kappa_j is the mean over windows of the recordings, with their motions, depths and track lengths.

The component has the shape that was fitted: an error across the motion of the image counts otherwise than one along it.
The shape is that of all scenes, while errors of a tracker follow the motions of each: with it alone, Lucas-Kanade in
the demo had a NEES of 2.0 instead of 1.1. So sigma for poses is not below that of isotropic noise.

A is in tracks that begin in the window. Tracks that began before it have W in their first observation there. If the
first direction is a state with the prior A, the claimed covariances are not in proportion to s^2, and s is found by
trying. Its interval is as wide, relative to it, as that for a free landmark.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import gammaincinv

from tracknoise.estimators.linear_window import (
    EXACT,
    Covariances,
    LinearTracks,
    TrackGates,
    consistencies,
    scalar_variances,
    true_covariances,
)
from tracknoise.estimators.model import Equivalent, Interval, Landmark, Purpose
from tracknoise.inference.track_noise import NAMES, TrackNoise
from tracknoise.statistics.histograms import LOG_HISTOGRAM_BINS, quantile, share_below
from tracknoise.tables.enumerations import Trimming

if TYPE_CHECKING:
    from tracknoise.estimators.components import FittedComponents


Array = NDArray[np.float64]

_MOST_WIDENED, _MOST_ROUNDS = 12, 4
"""Steps by which a range is widened at most, at either end, and rounds of interpolation."""


def shared_roots(values: Callable[[float], Array], start: Array, *, close: float) -> Array:
    """Roots of n smooth decreasing functions, (n,), by repeated linear interpolation."""
    known = {float(at): values(float(at)) for at in start}
    step = float(start[1] - start[0])
    _widen(known, values, -step)
    _widen(known, values, step)
    for _ in range(_MOST_ROUNDS):
        roots = _interpolated(known)
        for root in roots.tolist():
            if min(abs(root - at) for at in known) > close:
                known[root] = values(root)
    return _interpolated(known)


def _widen(known: dict[float, Array], values: Callable[[float], Array], step: float) -> None:
    """Add places below all others (negative step) or above them, as long as a root is beyond."""
    for _ in range(_MOST_WIDENED):
        end = min(known) if step < 0.0 else max(known)
        if not (known[end] * step > 0.0).any():
            return
        known[end + step] = values(end + step)


def _interpolated(known: dict[float, Array]) -> Array:
    places = sorted(known)
    table = -np.array([known[at] for at in places])
    return np.array([np.interp(0.0, column, places) for column in table.T])


LEVELS = (0.8, 0.95, 0.99)
_LEAST = 200
_NEAR = 0.2
"""Windows may differ in length by this share."""


@dataclass(frozen=True, slots=True, eq=False)
class Gates:
    """Gates of windows of one length."""

    # innovations of tracks of a window of this length, with Gaussian noise; walk and drift per frame of the window
    modelled: TrackGates
    # quantiles of `LEVELS` of the sum of squared residuals of a track, px^2, over those of chi square with as many
    # degrees of freedom, for a free landmark, of good tracks; None if too few were measured
    measured: tuple[float, ...] | None
    _known: dict[tuple[float | None, bool], tuple[float, ...]] = field(default_factory=dict, init=False, repr=False)

    def factors(self, sigma: float, *, first: float | None, born_only: bool = False) -> tuple[float, ...]:
        """What to multiply gates at `LEVELS` by, (gates.landmark). `first`: None for a free landmark.

        Noise of first positions alone leaves most tracks without innovations: 1 where the model has none at a level,
        and none were measured.
        """
        free = self._of_model(None, False)
        measured = free if self.measured is None else self.measured
        whitened = free if first is None else self._of_model(first, born_only)
        scaled = zip(whitened, measured, free, strict=True)
        squares = (own * good / model if model > 0.0 else max(own, good) for own, good, model in scaled)
        return tuple(square / sigma**2 if square > 0.0 else 1.0 for square in squares)

    def _of_model(self, first: float | None, born_only: bool) -> tuple[float, ...]:
        """Quantiles of the model, of residuals whitened by this ratio for first observations; computed once."""
        key = first, born_only
        if key not in self._known:
            self._known[key] = self.modelled.factors(LEVELS, sigma=1.0, first=first, born_only=born_only)
        return self._known[key]


def gates(
    windows: pl.DataFrame, length: int, *, limit_px: float, window: Sequence[LinearTracks], noise: TrackNoise
) -> Gates:
    """Gates of windows of a length. `windows`: schema `WINDOW_NOISE`, of one tracker and speed."""
    return Gates(TrackGates.of(window, noise), _measured(windows, length, limit_px))


def _measured(windows: pl.DataFrame, length: int, limit_px: float) -> tuple[float, ...] | None:
    """Those of the measured windows of nearly this length; None if there are too few, or if they have no noise."""
    apart = (pl.col("window").cast(pl.Int64) - length).abs()
    near = windows.filter(pl.col("trimming") == Trimming.untrimmed, apart <= _NEAR * length)
    if near["n"].to_numpy().sum() < _LEAST:
        return None
    nearest = near.filter(apart == near.select(apart.min()).item())
    counts = (
        np.array(nearest["residual_counts"].to_list(), dtype=np.float64).reshape(-1, LOG_HISTOGRAM_BINS).sum(axis=0)
    )
    freedom = (nearest["freedom_u"].to_numpy().sum() + nearest["freedom_v"].to_numpy().sum()) / nearest[
        "n"
    ].to_numpy().sum()
    good = float(share_below(counts, np.array(limit_px / np.sqrt(freedom))))
    squares = [float(quantile(counts, level * good)) ** 2 * freedom for level in LEVELS]
    if not np.isfinite(squares).all():
        return None
    return tuple(
        float(square / (2.0 * gammaincinv(freedom / 2.0, level))) for square, level in zip(squares, LEVELS, strict=True)
    )


Window = Sequence[LinearTracks]

LENGTHS = (5, 10, 11, 20, 30)
"""Lengths of windows, frames of the tracker."""
_FIRST_TRIED = np.array([-0.7, 0.0])
"""What is tried first for a state: logarithms of ratios to the sigma that makes all poses right for a free landmark."""
_CLOSE = 0.02
"""How close to the sigma of a state one must have been tried, as logarithm of a ratio."""


def equivalents(
    fitted: "FittedComponents",
    windows: Sequence[Window],
    *,
    length: int,
    speed: int,
    gates: Gates,
) -> list[Equivalent]:
    """Standard deviations for all kinds of landmarks and purposes, for windows of one length."""
    units = _units_of_noise(fitted, speed)
    alone = [[true_covariances(window, noise) for noise in units] for window in windows]
    free, exact = (_linear(fitted, windows, alone, first) for first in (None, EXACT))
    state = _state(fitted, windows, alone, speed, free)
    prior = fitted.components["first"].sigma.value
    named = {Landmark.FREE: (free, None), Landmark.EXACT: (exact, 0.0), Landmark.STATE: (state, prior)}
    return [*_named(named, length, gates)]


def _named(
    sigmas: Mapping[Landmark, tuple[Mapping[Purpose, Interval], float | None]], length: int, gates: Gates
) -> Iterator[Equivalent]:
    """From sigmas by purpose, and the standard deviation of first observations, px; None if it is that of all."""
    for landmark, (by_purpose, prior) in sigmas.items():
        for purpose, sigma in by_purpose.items():
            ratios = _gates_of(sigma.value, prior, gates, born_only=landmark is Landmark.STATE)
            yield Equivalent(
                landmark=landmark,
                purpose=purpose,
                window=length,
                sigma=sigma,
                gate_80=ratios[0],
                gate_95=ratios[1],
                gate_99=ratios[2],
            )


def _gates_of(sigma: float, prior: float | None, gates: Gates, *, born_only: bool) -> tuple[float, ...]:
    if sigma <= 0.0:
        return tuple(1.0 for _ in LEVELS)
    return gates.factors(sigma, first=None if prior is None else max(prior / sigma, EXACT), born_only=born_only)


def _linear(
    fitted: "FittedComponents",
    windows: Sequence[Window],
    alone: Sequence[Sequence[Covariances]],
    first: float | None,
    *,
    born_only: bool = False,
) -> dict[Purpose, Interval]:
    """By (equivalents), with the true covariances of each component alone, and sigma of first observations.

    `alone`: of the components as fitted, and then of isotropic ones.
    """
    pairs = zip(windows, alone, strict=True)
    rows = [_ratios(window, actual, 1.0, first, born_only=born_only) for window, actual in pairs]
    kappa = np.array([[[one[purpose] for one in row] for purpose in Purpose] for row in rows]).mean(axis=0)
    fits, isotropic = np.split(kappa, 2, axis=1)
    halves = np.array([part.sigma.value**2 for part in fitted.components.values()])
    is_larger = (isotropic @ halves > fits @ halves) & [purpose is not Purpose.INNOVATIONS for purpose in Purpose]
    chosen = np.where(is_larger[:, None], isotropic, fits)
    return dict(zip(Purpose, fitted.combined(chosen), strict=True))


def _units_of_noise(fitted: "FittedComponents", speed: int) -> list[TrackNoise]:
    """One component alone, with half a trace of 1 px^2: each in the shape that was fitted, and then each isotropic."""
    shapes = {name: part.covariance for name, part in fitted.components.items() if part.covariance.any()}
    fits = [{name: 2.0 * shapes.get(name, np.eye(2)) / np.trace(shapes.get(name, np.eye(2)))} for name in NAMES]
    return [TrackNoise(**unit).per_frames(speed) for unit in [*fits, *({name: np.eye(2)} for name in NAMES)]]


def _ratios(
    window: Window, actual: Sequence[Covariances], sigma: float, first: float | None, *, born_only: bool
) -> list[dict[Purpose, float]]:
    return consistencies(window, actual, scalar_variances(window, sigma, first=first, born_only=born_only))


def _state(
    fitted: "FittedComponents",
    windows: Sequence[Window],
    alone: Sequence[Sequence[Covariances]],
    speed: int,
    free: Mapping[Purpose, Interval],
) -> dict[Purpose, Interval]:
    """With the prior A on the first direction; where A is 0, the first observation of a track is exact.

    Where only A is not 0, all other observations are exact, and sigma is 0.
    """
    first, noise = fitted.components["first"].sigma.value, fitted.noise.per_frames(speed)
    if first == 0.0:
        return _linear(fitted, windows, alone, EXACT, born_only=True)
    if replace(noise, first=np.zeros((2, 2))).is_zero:
        return dict.fromkeys(Purpose, Interval(value=0.0))
    pairs = [(window, [true_covariances(window, noise)]) for window in windows]

    def excess(log_sigma: float) -> Array:
        sigma = float(np.exp(log_sigma))
        each = [_ratios(window, actual, sigma, first, born_only=True)[0] for window, actual in pairs]
        return np.log([np.mean([one[purpose] for one in each]) for purpose in Purpose])

    start = float(np.log(free[Purpose.ALL_POSES].value)) + _FIRST_TRIED
    sigmas = np.exp(shared_roots(excess, start, close=_CLOSE)).tolist()
    return {purpose: _scaled(free[purpose], sigma) for purpose, sigma in zip(Purpose, sigmas, strict=True)}


def _scaled(interval: Interval, value: float) -> Interval:
    """The value, with bounds in the same ratio to it."""
    low, high = (None if bound is None else bound * value / interval.value for bound in (interval.low, interval.high))
    return Interval(value=value, low=low, high=high)
