"""Covariances of the errors of a track, from the components of its noise.

With the magnification M_k = Z_0 / Z_k of the image about the point since birth, the covariance of the errors about the
first position is, for ages j, k >= 1,

    Cov(e_j, e_k) = M_j M_k A + W [j = k] + Q sum_{1 <= i <= min(j, k)} M_j M_k / M_i^2 + j k D    (noise_model.track)

and 0 where j or k is 0. An estimator that solves for the 3-D point does not need to know from where errors are counted.
For it the first observation may have the covariance A, and the others lose M_j M_k A: both lead to the same estimate.

Fits, models and exports take what multiplies A, W, Q and D from here: a component is one row of `COMPONENTS` and one
field of `TrackNoise` and of noise models. Scales of tracks (`tracknoise.estimators.track_likelihood`) have a law of
their own.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Reference(StrEnum):
    """From where the errors of a track are counted."""

    BIRTH = "birth"
    """From the first position: its own error is 0, and A is in all others."""
    FREE = "free"
    """From the true position: the first observation has the covariance A."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Observations of tracks, as arrays of one shape."""

    age: Array  # frames since birth
    magnification: Array  # M_k
    walked: Array  # sum of factor / M_i^2 over the frames i since birth, frames
    factor: Array  # on W

    def at(self, *place: Any) -> "Seen":
        """Some of the observations, or the same with further axes, as an index of arrays does."""
        return Seen(*(values[place] for values in (self.age, self.magnification, self.walked, self.factor)))


@dataclass(frozen=True, slots=True)
class ComponentCode:
    """What multiplies a component, as exports write it. `walked`: what multiplies Q; squared depths in C++."""

    error: str  # C++: for an error at `age`, with the magnification m and the factor f; `later` is 1 after the birth
    change: str  # C++: for a change over a number of `frames` after the first one
    cpp: str  # C++: for frames j and k of a track, about its true positions, from the `depth` of each
    python: str  # the same for all frames, (n, n), from the `age` of each


@dataclass(frozen=True, slots=True)
class NoiseComponent:
    """One covariance of the noise, and what multiplies it."""

    name: str  # field of `TrackNoise` and of noise models, and column of sums
    letter: str  # in formulas
    phrase: str  # what makes this noise
    power: int  # of the age in the covariance of an error, where nothing is magnified
    has_factor: bool  # whether what is known at run time multiplies it
    shared: Callable[[Seen, Seen, Reference], Array]  # what multiplies it in the covariance of two errors of a track
    code: ComponentCode

    @property
    def unit(self) -> str:
        """Of its standard deviation."""
        return {0: "px", 1: "px per sqrt(frame)", 2: "px per frame"}.get(self.power, f"px per frame^{self.power / 2:g}")

    @property
    def title(self) -> str:
        """Phrase and letter."""
        return f"{self.phrase} ({self.letter})"


def _first(one: Seen, other: Seen, reference: Reference) -> Array:
    if reference is Reference.FREE:
        return np.where((one.age == 0.0) & (other.age == 0.0), 1.0, 0.0)
    return np.where((one.age > 0.0) & (other.age > 0.0), one.magnification * other.magnification, 0.0)


def _white(one: Seen, other: Seen, _: Reference) -> Array:
    return np.where((one.age == other.age) & (one.age > 0.0), one.factor, 0.0)


def _walk(one: Seen, other: Seen, _: Reference) -> Array:
    return np.asarray(one.magnification * other.magnification * np.minimum(one.walked, other.walked))


def _drift(one: Seen, other: Seen, _: Reference) -> Array:
    return np.asarray(one.age * other.age)


COMPONENTS = (
    NoiseComponent(
        *("first", "A", "first position", 0, False, _first),
        ComponentCode("later * m * m", "0.0", "1.0 * (j == 0 && k == 0)", "np.diag(age == 0)"),
    ),
    NoiseComponent(
        *("white", "W", "each frame", 0, True, _white),
        ComponentCode("later * f", "2.0 * f", "1.0 * (j == k && j > 0)", "np.diag(age > 0)"),
    ),
    NoiseComponent(
        *("walk", "Q", "walk", 1, True, _walk),
        ComponentCode(
            "f * age * (1.0 + m + m * m) / 3.0",
            "f * frames",
            "walked[std::min(j, k)] / (depth[j] * depth[k])",
            "walked",
        ),
    ),
    NoiseComponent(
        *("drift", "D", "drift", 2, False, _drift),
        ComponentCode("age * age", "frames * frames", "1.0 * j * k", "np.outer(age, age)"),
    ),
)
"""In the order of their factors in sums and fits."""
NAMES = tuple(component.name for component in COMPONENTS)


def shares(one: Seen, other: Seen, reference: Reference = Reference.BIRTH) -> list[Array]:
    """What multiplies each component in the covariances of errors of the same tracks, by (noise_model.track)."""
    return [component.shared(one, other, reference) for component in COMPONENTS]


def _none() -> Array:
    return np.zeros((2, 2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackNoise:
    """Components of the noise of a track, each (2, 2) float64 and symmetric."""

    first: Array = field(default_factory=_none)  # A: covariance of the error of the first position, px^2
    white: Array = field(default_factory=_none)  # W: covariance of what is independent in each frame, px^2
    walk: Array = field(default_factory=_none)  # Q: covariance of what each frame adds, px^2 per frame
    drift: Array = field(default_factory=_none)  # D: covariance of the rate at which a track drifts, px^2 per frame^2

    @classmethod
    def isotropic(cls, **sigmas: float) -> "TrackNoise":
        """The same in all directions, from standard deviations by name, in `NoiseComponent.unit`."""
        return cls(**{name: sigma**2 * np.eye(2) for name, sigma in sigmas.items()})

    def __iter__(self) -> Iterator[Array]:
        """The covariances in the order of `COMPONENTS`."""
        return (getattr(self, name) for name in NAMES)

    @property
    def is_zero(self) -> bool:
        """Whether there is no noise."""
        return not any(covariance.any() for covariance in self)

    def per_frames(self, frames: float) -> "TrackNoise":
        """The same noise of a track that is seen once in so many frames: walk and drift are of all of them."""
        grown = {
            component.name: part * frames**component.power
            for component, part in zip(COMPONENTS, self, strict=True)
            if component.power
        }
        return replace(self, **grown)

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
        steps = scale * np.diff(aged, axis=1, prepend=aged[:, :1]) / magnification**2
        seen = Seen(aged.astype(np.float64), magnification, np.cumsum(steps, axis=1), scale)
        rows, columns = seen.at(slice(None), slice(None), None), seen.at(slice(None), None)
        summed = np.zeros((len(magnification), count, 2, count, 2))
        for component, part in zip(COMPONENTS, self, strict=True):
            if part.any():  # most models have two of the four
                summed += np.einsum("tjk,uv->tjukv", component.shared(rows, columns, reference), part)
        return summed.reshape(len(magnification), 2 * count, 2 * count)


def error_covariances(noise: TrackNoise, age: Array, magnification: Array, factor: Array) -> Array:
    """Covariances of errors about the first position, (n, 2, 2) px^2, at magnifications and factors (n,); 0 at age 0.

    The depth is taken to have changed evenly since birth, and the factor to have been the same.
    """
    walked = factor * age * (1.0 + magnification + magnification**2) / (3.0 * magnification**2)
    seen = Seen(age, magnification, walked, factor)
    return _summed(noise, shares(seen, seen))


def change_covariances(noise: TrackNoise, frames: Array, factor: Array) -> Array:
    """Covariances of changes over a number of frames (n,) after the first one, (n, 2, 2) px^2."""
    ones = np.ones_like(frames)
    before, now = (Seen(age, ones, factor * age, factor) for age in (ones, 1.0 + frames))
    return _summed(noise, changed(shares(now, now), shares(now, before), shares(before, before), ones))


def changed(new: list[Array], mixed: list[Array], old: list[Array], r: Array) -> list[Array]:
    """What multiplies the components in the covariance of e_k - r e_j, from that of e_k, of both, and of e_j."""
    return [a - 2.0 * r * b + r**2 * c for a, b, c in zip(new, mixed, old, strict=True)]


def track_covariance(
    noise: TrackNoise, ages: Array, reference: Reference, magnification: Array, factor: Array
) -> Array:
    """Covariance of the errors of a track, (2 m, 2 m) px^2, at ages (m,) that need not begin with 0."""
    seen = np.stack([ages, magnification, factor])
    missing = int(ages[0] > 0)
    birth = np.array([[0.0], [1.0], [1.0]])
    aged, carried, scale = np.hstack([birth, seen])[:, None, 1 - missing :]
    return noise.covariance(carried, ages=aged, factor=scale, reference=reference)[0, 2 * missing :, 2 * missing :]


def _summed(noise: TrackNoise, component_shares: list[Array]) -> Array:
    parts = zip(component_shares, noise, strict=True)
    return np.asarray(sum(share[:, None, None] * covariance for share, covariance in parts))
