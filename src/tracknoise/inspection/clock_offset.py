"""Offset between the clocks of images and poses, from the rotation rates that images and poses show."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

MOST_FRAMES = 3.5
"""Offsets up to this many frames are looked for."""

_GRID_FRAMES = 0.1
_FEWEST_STEPS, _FEWEST_IN_RUN, _FEWEST_SHARE = 8, 5, 0.5
_BLOCKS = 10
_SCALE_LIMITS = 0.7, 1.4
"""Rates may differ by a factor for each axis, such as that of a wrong focal length."""
_REFINED_FRAMES, _AT_BOUND_FRAMES = 0.5, 0.01
"""An offset is refined within the first of its start. Nearer than the second to that bound, it is no minimum."""
_MOST_REFINEMENTS = 4
_FEWEST_REFINED = 4
"""Steps of a refinement; one less than those of a run, because the jackknife leaves out at least one."""


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """Rotation rates between consecutive frames.

    Attributes
    ----------
    steps
        (n,) float64, increasing: first frame of each step.
    by_image, by_poses
        (n, 3) float64, radians per frame, in the axes of the camera; NaN where unknown.
    """

    steps: NDArray[np.float64]
    by_image: NDArray[np.float64]
    by_poses: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """How many frames later than it says a pose belongs.

    Attributes
    ----------
    frames, sd_frames
        Offset, and its standard deviation by a jackknife over stretches of the recording. The pose at the time of
        frame i plus the offset fits image i. The standard deviation is infinite where no minimum of the differences is
        found from the best offset of the grid, with all steps or without some. Then the offset is not known.
    unexplained
        Median difference of the rates at this offset, relative to the median variation of the image's rate.
    rate_change
        Median change of the rate of the poses from step to step, radians per frame.
    """

    frames: float
    sd_frames: float
    unexplained: float
    rate_change: float


def estimate_offset(rates: Rates) -> ClockOffset | None:
    """Offset at which the rates agree best; None where there are too few steps.

    Parameters
    ----------
    rates
        At consecutive frames; gaps are allowed.
    """
    runs = _runs(rates)
    if sum(len(run.steps) for run in runs) < _FEWEST_STEPS:
        return None
    splines = [CubicSpline(run.steps, run.by_poses, extrapolate=False) for run in runs]
    observed = np.concatenate([run.by_image for run in runs])

    def predicted(offset: float) -> NDArray[np.float64]:
        return np.concatenate([spline(run.steps + offset) for spline, run in zip(splines, runs, strict=True)])

    grid = np.arange(-MOST_FRAMES, MOST_FRAMES + _GRID_FRAMES / 2, _GRID_FRAMES)
    start = float(grid[int(np.nanargmin([_unexplained(predicted(offset), observed) for offset in grid]))])
    refined = _Refinement(predicted, observed, start)
    every = np.arange(len(observed))
    left_out = [refined(np.setdiff1d(every, block)) for block in np.array_split(every, _BLOCKS)]
    offset = refined(every)
    is_known = bool(np.isfinite([offset, *left_out]).all())
    sd = float(np.sqrt((_BLOCKS - 1) * np.var(left_out))) if is_known else np.inf
    offset = offset if np.isfinite(offset) else start
    changes = np.concatenate([np.linalg.norm(np.diff(run.by_poses, axis=0), axis=1) for run in runs])
    return ClockOffset(offset, sd, _unexplained(predicted(offset), observed), float(np.median(changes)))


def _runs(rates: Rates) -> list[Rates]:
    """Stretches of steps that follow each other and have both rates."""
    usable = np.isfinite(rates.by_image).all(axis=1) & np.isfinite(rates.by_poses).all(axis=1)
    places = np.flatnonzero(usable)
    cuts = np.flatnonzero(np.diff(rates.steps[places]) != 1) + 1
    parts = [part for part in np.split(places, cuts) if len(part) >= _FEWEST_IN_RUN]
    return [Rates(rates.steps[part], rates.by_image[part], rates.by_poses[part]) for part in parts]


def _unexplained(predicted: NDArray[np.float64], observed: NDArray[np.float64]) -> float:
    """Median difference of two rates after a factor per axis, relative to the median variation; NaN for few values."""
    known = np.isfinite(predicted).all(axis=1)
    if known.sum() < max(_FEWEST_IN_RUN, _FEWEST_SHARE * len(observed)):
        return np.nan
    left = observed[known] - _factors(predicted[known], observed[known]) * predicted[known]
    variation = observed[known] - np.median(observed[known], axis=0)
    return float(np.mean(_cut_length(left))) / max(float(np.mean(_cut_length(variation))), 1e-12)


def _cut_length(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) float64: lengths, cut at three times their median."""
    length = np.linalg.norm(vectors, axis=1)
    return np.asarray(np.minimum(length, 3.0 * np.median(length)), dtype=np.float64)


def _factors(predicted: NDArray[np.float64], observed: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) float64: factor per axis that fits best, within `_SCALE_LIMITS`."""
    products, squares = (predicted * observed).sum(axis=0), (predicted**2).sum(axis=0)
    factors: NDArray[np.float64] = np.clip(products / np.maximum(squares, 1e-30), *_SCALE_LIMITS)
    return factors


@dataclass(frozen=True, slots=True, eq=False)
class _Refinement:
    """Robust least squares from a start; the same steps are used at every offset around a start."""

    predicted: Callable[[float], NDArray[np.float64]]
    observed: NDArray[np.float64]
    start: float

    def __call__(self, chosen: NDArray[np.intp]) -> float:
        """Offset from some of the steps, frames; NaN where there are few of them, or no minimum is found.

        A search that ends at its bound is started again from there. All searches of a jackknife that end at the same
        bound agree without having found anything.
        """
        start = self.start
        for _ in range(_MOST_REFINEMENTS):
            found = self._around(start, chosen)
            if not abs(found - start) >= _REFINED_FRAMES - _AT_BOUND_FRAMES:  # also of NaN
                return found
            start = found
        return np.nan

    def _around(self, start: float, chosen: NDArray[np.intp]) -> float:
        """Best offset within `_REFINED_FRAMES` of a start, frames; NaN for few steps."""
        ends = [self.predicted(start + sign * _REFINED_FRAMES) for sign in (-1.0, 1.0)]
        finite: NDArray[np.bool_] = np.isfinite(np.concatenate(ends, axis=1).sum(axis=1))
        known = chosen[finite[chosen]]
        if len(known) < _FEWEST_REFINED:
            return np.nan
        observed = self.observed[known]
        factors = _factors(self.predicted(start)[known], observed)
        at_start = observed - factors * self.predicted(start)[known]
        scale = max(1.4826 * float(np.median(np.abs(at_start))), 1e-9)

        def left(moved: NDArray[np.float64]) -> NDArray[np.float64]:
            there = self.predicted(start + float(moved[0]) - 1.0)[known]
            return np.asarray((observed - _factors(there, observed) * there).ravel() / scale, dtype=np.float64)

        limits = 1.0 - _REFINED_FRAMES, 1.0 + _REFINED_FRAMES  # around 1, because differences are relative
        fit = least_squares(left, [1.0], bounds=limits, loss="soft_l1", diff_step=[1e-3])
        return start + float(fit.x[0]) - 1.0
