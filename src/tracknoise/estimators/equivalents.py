"""Standard deviations and gates for estimators, each named by what it makes right.

Gates let through a stated share of good tracks, by length of the window and kind of landmark. Where the first
observation has a residual like any other, gates are those of the measured windows, tails included, but without windows
whose residuals are as large as with one outlier. If there are too few, they are those of Gaussian noise with the
components. Where the first observation is exact or a state, its error is in all residuals. The linear benchmark says
what that does to Gaussian noise, and the gate is larger by as much:

    gate = measured modelled(landmark) / modelled(free)    (gates.landmark)

An estimator that assumes one standard deviation s for all observations claims covariances in proportion to s^2, while
the actual ones are linear in the entries of A, W, Q and D. What makes a purpose right over windows of scenes like those
of the run is therefore

    s^2 = mean over scenes of sum_jk kappa_jk c_jk    (equivalents)

with the entries c_jk of the components of a scene, and kappa_jk from the linear benchmark (`LinearEstimate`), the mean
over windows of that scene, with their motions, depths and track lengths. A scene without windows has those of all
others. Scenes are what is resampled. So intervals contain the variation of noise and of geometry between scenes, of the
two together, and of windows within scenes. What is fixed is the length of the window, the camera, and what an estimator
does with the first observation. With fewer than six scenes, blocks of tracks are resampled, and windows are fixed, too.

A is in tracks that begin in the window. Tracks that began before it have W in their first observation there. If the
first direction is a state with the prior A, the claimed covariances are not in proportion to s^2, and s is found by
trying. Its interval is as wide, relative to it, as that for a free landmark.

Errors that features of a frame have in common do not average out over them, and what is claimed does. Each feature adds

    mean over scenes of kappa_white white + kappa_walk walk    (equivalents.common)

to s^2, with the variances of (common.parts) and kappa from the same. White errors
divide among first positions and others as A and W do. A first direction that is a state has this in proportion to s^2.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import gammaincinv

from tracknoise.estimators.errors_in_common import CommonErrors
from tracknoise.estimators.linear_window import (
    EXACT,
    LinearEstimate,
    LinearTracks,
    TrackGates,
    scalar_variances,
)
from tracknoise.estimators.model import Equivalent, Interval, Landmark, Purpose
from tracknoise.estimators.training import Windows
from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.intervals import Method, column_means, pooled
from tracknoise.inference.track_noise import COMPONENTS, TrackNoise
from tracknoise.inference.units import Units
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
STATE_LENGTH = 60
"""Length of windows for features in the state of a filter, which stay there as long as they are tracked."""
_FIRST_TRIED = np.array([-0.7, 0.0])
"""What is tried first for a state: logarithms of ratios to the sigma that makes all poses right for a free landmark."""
_TRIED_WINDOWS = 6
"""Windows that sigma of a state is compared on with that for a free landmark."""
_CLOSE = 0.02
"""How close to the sigma of a state one must have been tried, as logarithm of a ratio."""


def equivalents(
    fitted: "FittedComponents",
    windows: Windows,
    *,
    length: int,
    speed: int,
    gates: Gates,
    common: CommonErrors | None = None,
) -> list[Equivalent]:
    """Standard deviations for windows of one length: for all kinds of landmarks, or free ones beyond `LENGTHS`."""
    mean = MeanSquares.of(fitted, windows, speed, in_common=common is not None)
    free = mean.sigmas(None)
    named: dict[Landmark, tuple[Mapping[Purpose, Interval], float | None]] = {Landmark.FREE: (free, None)}
    if length <= max(LENGTHS):
        prior = fitted.components["first"].sigma.value
        named |= {Landmark.EXACT: (mean.sigmas(EXACT), 0.0), Landmark.STATE: (_state(fitted, mean, free), prior)}
    found = [replace(one, simulated=windows.simulated) for one in _named(named, length, gates)]
    if common is None:
        return found
    added = {Landmark.FREE: mean.of_common(common, None)}
    if Landmark.STATE in named:
        state, of_free = named[Landmark.STATE][0], added[Landmark.FREE]
        of_state = {purpose: _times(one, state[purpose], free[purpose]) for purpose, one in of_free.items()}
        added |= {Landmark.EXACT: mean.of_common(common, EXACT), Landmark.STATE: of_state}
    return [replace(one, per_feature=added[one.landmark].get(one.purpose)) for one in found]


def _in_common(noise: TrackNoise, speed: int) -> TrackNoise:
    """Errors in common of variance 1 about the first position, and of a walk of variance 1 per frame."""
    first, white = white_parts(noise)
    return TrackNoise.isotropic(first=first**0.5, white=white**0.5, walk=float(speed) ** 0.5)


def white_parts(noise: TrackNoise) -> tuple[float, float]:
    """Shares of A and W in their sum; all is W where there is neither."""
    first, white = (float(np.trace(part)) for part in (noise.first, noise.white))
    share = first / (first + white) if first > 0.0 else 0.0
    return share, 1.0 - share


def _times(one: Interval, state: Interval, free: Interval) -> Interval:
    """What a feature adds where the first direction is a state, from that of a free landmark, and both sigmas."""
    ratio = (state.value / free.value) ** 2 if free.value > 0.0 else 0.0
    return _scaled(one, one.value * ratio) if one.value > 0.0 else one


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


@dataclass(frozen=True, slots=True)
class _Influences:
    """Of a window: as of `LinearEstimate`, and those of errors in common where they were asked for."""

    own: Mapping[Purpose, Array]
    common: Mapping[Purpose, Array] | None


@dataclass(frozen=True, slots=True, eq=False)
class MeanSquares:
    """Actual over claimed mean squares of what each purpose is about, over windows of all scenes."""

    windows: Sequence[Window]
    units: Units  # scenes, or blocks of tracks within them
    noise: Array  # (units, 4, 2, 2) px^2: components of each, those of the walk and the drift per frame of a window
    in_common: TrackNoise | None  # errors in common of variance 1, where they are asked for
    places: Sequence[Sequence[int]]  # of each scene the places of its windows
    level: float
    _known: dict[tuple[int, float, float | None, bool], _Influences] = field(
        default_factory=dict, init=False, repr=False
    )

    @classmethod
    def of(cls, fitted: "FittedComponents", windows: Windows, speed: int, *, in_common: bool = False) -> "MeanSquares":
        """Of the scenes of a fit, and windows of them; `speed`: frames of the recording per frame of a window."""
        units, frames = fitted.sums.units, np.array([float(speed) ** one.power for one in COMPONENTS])
        noise = fitted.of_units() * frames[:, None, None]
        places = [windows.of_scene(name) for name in units.scenes]
        unit = _in_common(fitted.noise, speed) if in_common else None
        return cls(windows.each, units, noise, unit, places, fitted.level)

    def _of_window(self, place: int, sigma: float, first: float | None, *, born_only: bool) -> _Influences:
        """Those of one window; computed once."""
        is_state = born_only and first is not None
        key = place, sigma, first, is_state
        if key not in self._known:
            window = self.windows[place]
            estimate = LinearEstimate.of(window, scalar_variances(window, sigma, first=first, born_only=is_state))
            common = None if self.in_common is None or is_state else estimate.influences_in_common(self.in_common)
            self._known[key] = _Influences(estimate.influences(), common)
        return self._known[key]

    def of_units(
        self, sigma: float, first: float | None, *, born_only: bool, some: Sequence[int] | None = None
    ) -> Array:
        """Of each unit for an estimator that assumes these standard deviations, (units, purposes), by (equivalents)."""
        used = range(len(self.windows)) if some is None else some
        each = {place: self._of_window(place, sigma, first, born_only=born_only).own for place in used}
        found = {place: np.array([own[purpose] for purpose in Purpose]) for place, own in each.items()}
        own = [[found[place] for place in places if place in found] or list(found.values()) for places in self.places]
        mean = np.array([np.mean(some, axis=0) for some in own])
        return np.asarray(np.einsum("upcij,ucij->up", mean[self.units.scene], self.noise))

    def sigmas(self, first: float | None, *, born_only: bool = False) -> dict[Purpose, Interval]:
        """Standard deviations that make each purpose right, over those of first observations where these differ."""
        values = self.of_units(1.0, first, born_only=born_only)
        count = np.broadcast_to(self._counts[:, None], values.shape)
        sums = np.stack([count, count * values], axis=-1)
        units = replace(self.units, sums=sums, points=pl.DataFrame({"purpose": list(Purpose)}))
        method = Method(IntervalKind.student, self.level)
        found = pooled(units, np.zeros((0, len(sums))), column_means, method, scales=["log"])
        bounds = zip(found.value[0], found.low[0], found.high[0], strict=True)
        return {purpose: _root(*(float(one) for one in own)) for purpose, own in zip(Purpose, bounds, strict=True)}

    def of_common(self, common: CommonErrors, first: float | None) -> dict[Purpose, Interval]:
        """What each feature of a frame adds to the squares of sigmas for poses, px^2, by (equivalents.common)."""
        poses = [purpose for purpose in Purpose if purpose is not Purpose.INNOVATIONS]
        each = [self._of_window(place, 1.0, first, born_only=False).common for place in range(len(self.windows))]
        found = np.array([[own[purpose] for purpose in poses] for own in each if own is not None])
        of_scenes = np.array([found[list(places)].mean(axis=0) for places in self.places])
        white, walk = of_scenes.mean(axis=0).T
        return dict(zip(poses, common.variances(white.tolist(), walk.tolist()), strict=True))

    def mean(self, sigma: float, first: float | None, some: Sequence[int]) -> Array:
        """Over some windows, (purposes,), where the first direction is a state with this prior, or free."""
        values = self.of_units(sigma, first, born_only=True, some=some)
        return np.asarray(np.average(values, axis=0, weights=self._counts))

    @property
    def _counts(self) -> Array:
        """How much each unit counts, (units,): every scene counts alike."""
        there = self.units.sums[..., 0].any(axis=1)
        return np.asarray(there / np.maximum(np.bincount(self.units.scene, there), 1.0)[self.units.scene])


def _root(square: float, low: float, high: float) -> Interval:
    """Standard deviations of variances; 0 where there is no noise."""
    if square <= 0.0:
        return Interval(value=0.0)
    bounds = [None if np.isnan(bound) else bound**0.5 for bound in (low, high)]
    return Interval(value=square**0.5, low=bounds[0], high=bounds[1])


def _state(fitted: "FittedComponents", mean: MeanSquares, free: Mapping[Purpose, Interval]) -> dict[Purpose, Interval]:
    """With the prior A on the first direction; where A is 0, the first observation of a track is exact.

    Where only A is not 0, all other observations are exact, and sigma is 0. It is 0, too, where blocks of few tracks
    leave no positive mean square for a free landmark: it is not determined then, as that is not.
    """
    first = fitted.components["first"].sigma.value
    if first == 0.0:
        return mean.sigmas(EXACT, born_only=True)
    if replace(fitted.noise, first=np.zeros((2, 2))).is_zero:
        return dict.fromkeys(Purpose, Interval(value=0.0))
    count = len(mean.windows)
    some = np.unique(np.linspace(0, count - 1, min(_TRIED_WINDOWS, count)).round().astype(int)).tolist()

    def excess(log_sigma: float) -> Array:
        return np.log(np.maximum(mean.mean(float(np.exp(log_sigma)), first, some), 1e-300))

    start = float(np.log(free[Purpose.ALL_POSES].value)) + _FIRST_TRIED
    squares = mean.mean(1.0, None, some)
    if not (squares > 0.0).all():
        return dict.fromkeys(Purpose, Interval(value=0.0))
    ratios = np.exp(shared_roots(excess, start, close=_CLOSE)) / np.sqrt(squares)
    pairs = zip(Purpose, ratios.tolist(), strict=True)
    return {purpose: _scaled(free[purpose], free[purpose].value * ratio) for purpose, ratio in pairs}


def _scaled(interval: Interval, value: float) -> Interval:
    """The value, with bounds in the same ratio to it."""
    low, high = (None if bound is None else bound * value / interval.value for bound in (interval.low, interval.high))
    return Interval(value=value, low=low, high=high)
