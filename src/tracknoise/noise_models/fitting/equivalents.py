"""Standard deviations for all observations, each named by what it makes right.

An estimator that assumes one standard deviation s for all observations claims covariances in proportion to s^2, while
the actual ones are linear in A, W, Q and D. What makes a purpose right is therefore

    s^2 = sum_j kappa_j a_j    (equivalents)

with half the trace a_j of each component, and kappa_j from the linear benchmark with one component of 1 px^2 alone. It
is the mean over windows of the recordings, with their motions, depths and track lengths. A is in tracks that begin in
the window; those that began before it have W in their first observation there. If the first direction is a state with
the prior A, the claimed covariances are not in proportion to s^2; s is then found by trying. Its interval is
as wide, relative to it, as that for a free landmark.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tracknoise.noise_models.fitting.equations import NAMES
from tracknoise.noise_models.fitting.gates import Gates
from tracknoise.noise_models.fitting.shared_roots import shared_roots
from tracknoise.noise_models.linear_benchmark import (
    EXACT,
    Covariances,
    consistencies,
    scalar_covariances,
    true_covariances,
)
from tracknoise.noise_models.linear_window import LinearTracks
from tracknoise.noise_models.model import Equivalent, Interval, Landmark, Purpose
from tracknoise.noise_models.track_noise import TrackNoise

if TYPE_CHECKING:
    from tracknoise.noise_models.fitting.components import FittedComponents

Array = NDArray[np.float64]
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
    """Standard deviations for all kinds of landmarks and purposes, for windows of one length.

    Parameters
    ----------
    fitted
        The components.
    windows
        Windows of this length.
    length
        Frames of the tracker.
    speed
        Frames of the recording per frame of the tracker.
    gates
        Of windows of this length.
    """
    alone = [[true_covariances(window, noise) for noise in _units_of_noise(speed)] for window in windows]
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
                gate_95=ratios[0],
                gate_99=ratios[1],
            )


def _gates_of(sigma: float, prior: float | None, gates: Gates, *, born_only: bool) -> tuple[float, ...]:
    if sigma <= 0.0:
        return 1.0, 1.0
    return gates.factors(sigma, first=None if prior is None else max(prior / sigma, EXACT), born_only=born_only)


def _linear(
    fitted: "FittedComponents",
    windows: Sequence[Window],
    alone: Sequence[Sequence[Covariances]],
    first: float | None,
    *,
    born_only: bool = False,
) -> dict[Purpose, Interval]:
    """By (equivalents), with the true covariances of each component alone, and sigma of first observations."""
    pairs = zip(windows, alone, strict=True)
    rows = [_ratios(window, actual, 1.0, first, born_only=born_only) for window, actual in pairs]
    kappa = np.array([[[one[purpose] for one in row] for purpose in Purpose] for row in rows]).mean(axis=0)
    return dict(zip(Purpose, fitted.combined(kappa), strict=True))


def _units_of_noise(speed: int) -> list[TrackNoise]:
    """Noise of one component of 1 px^2 alone; walk and drift are per frame of the recording."""
    scales = (1.0, 1.0, speed**0.5, float(speed))
    return [TrackNoise.isotropic(**{name: scale}) for name, scale in zip(NAMES, scales, strict=True)]


def _ratios(
    window: Window, actual: Sequence[Covariances], sigma: float, first: float | None, *, born_only: bool
) -> list[dict[Purpose, float]]:
    return consistencies(window, actual, scalar_covariances(window, sigma, first=first, born_only=born_only))


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
    if not any(part.any() for part in (noise.white, noise.walk, noise.drift)):
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
