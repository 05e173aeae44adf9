"""Robust fits of corrections of the truth to errors, and what they explain of what took no part.

Minimised is the negative logarithm of Student's density of the residuals r = observed - x(theta) - B beta (audit.fit):
x is that of (audit.prediction), beta a constant and a drift per frame of each tracker, in u and in v. Each tracker and
age has a scale of its own, which is estimated robustly.

A correction fitted without a cluster is applied to this cluster; the fit moves as (audit.jackknife) says. The share
that it explains is 1 - sum min(d^2, 9) / sum min(d0^2, 9) (audit.gain): d and d0 are the lengths of residuals with and
without it, in units of the robust scale of the tracker and age, so that outliers count as three scales.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import special

from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.robust_fits import Jackknife, jackknife, normal_equations, scales, squared, summed
from tracknoise.inference.units import Resampled
from tracknoise.tables.truth_audit import AUDIT_CURVES
from tracknoise.truth_faults.audit_samples import AuditSamples
from tracknoise.truth_faults.corrected_positions import Predicted, predict
from tracknoise.truth_faults.fault_parameters import Fit, Parameter, columns_of, furthest

_STEPS = 12
_INNER_STEPS = 2
_SMALL_STEP = 0.02
"""A step that is small beside the standard errors ends the fit."""
BIAS_AGE = 12.0
"""Ages are in units of this many frames where drifts are fitted, so that constants and drifts are of one size."""
_FURTHEST_BIAS_PX = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """Where a fit stands."""

    theta: NDArray[np.float64]
    beta: NDArray[np.float64]
    error: NDArray[np.float64]
    residual: NDArray[np.float64]
    design: NDArray[np.float64]

    def moved(self, step: NDArray[np.float64], free: NDArray[np.intp]) -> "_State":
        """After a step that is so small that the derivatives do not change."""
        theta = self.theta.copy()
        theta[free] += step[: len(free)]
        error = self.error - self.design[:, :, : len(free)] @ step[: len(free)]
        return _State(theta, self.beta + step[len(free) :], error, self.residual - self.design @ step, self.design)


def fit(samples: AuditSamples, parameters: Sequence[Parameter], start: Predicted, *, with_bias: bool = True) -> Fit:
    """Fit some parameters, all others held where the fit begins: (audit.fit). `parameters`: may be empty."""
    free, limit = columns_of(parameters), furthest(parameters)
    biases = _bias_columns(samples, with_bias=with_bias)
    ridge = 1.0 / np.concatenate([limit, np.full(biases.shape[2], _FURTHEST_BIAS_PX)]) ** 2
    predicted, beta = start, np.zeros(biases.shape[2])
    for steps in range(_STEPS + 1):
        error = samples.observed - predicted.uv
        design = np.concatenate([predicted.by(parameters), biases], axis=2)
        state = _State(predicted.theta, beta, error, error - biases @ beta, design)
        if steps == _STEPS:
            break
        step, information = _solved(samples, state, ridge)
        if _is_small(step[: len(free)], information):
            state = state.moved(step, free)
            break
        theta = state.theta.copy()
        theta[free] = np.clip(theta[free] + step[: len(free)], -limit, limit)
        predicted, beta = predict(samples, theta, predicted), state.beta + step[len(free) :]
    scale = scales(samples.group, state.residual)
    equations = normal_equations(samples.tracker, samples.cluster, state.design, state.residual, scale, ridge)
    slopes = state.design[:, :, : len(free)].copy()
    return Fit(tuple(parameters), with_bias, state.theta, state.error, state.residual, slopes, free, equations)


def design_of(samples: AuditSamples, fitted: Fit) -> NDArray[np.float64]:
    """(n, 2, columns): derivatives by the free numbers of a fit, then by the biases of each tracker.

    It is made where it is needed: of many trackers, those of all fits of a selection would fill the memory.
    """
    return np.concatenate([fitted.slopes, _bias_columns(samples, with_bias=fitted.with_bias)], axis=2)


def _bias_columns(samples: AuditSamples, *, with_bias: bool) -> NDArray[np.float64]:
    """(n, 2, 4 trackers): of each tracker a constant in u and v, and a drift in u and v; no columns without biases."""
    if not with_bias:
        return np.empty((len(samples.age), 2, 0))
    n, rows = len(samples.age), np.arange(len(samples.age))
    columns = np.zeros((n, 2, 4 * len(samples.trackers)))
    for coordinate in (0, 1):
        columns[rows, coordinate, 4 * samples.tracker + coordinate] = 1.0
        columns[rows, coordinate, 4 * samples.tracker + 2 + coordinate] = samples.age / BIAS_AGE
    return columns


def _solved(
    samples: AuditSamples, state: _State, ridge: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Step and information after a few steps of reweighting with fixed derivatives."""
    step = np.zeros(len(ridge))
    residual, scale = state.residual, scales(samples.group, state.residual)
    for _ in range(_INNER_STEPS):
        information, score = summed(state.design, residual, scale, ridge)
        step = step + np.linalg.solve(information, score)
        residual = state.residual - state.design @ step
    return step, information


def _is_small(step: NDArray[np.float64], information: NDArray[np.float64]) -> bool:
    variance = np.diag(np.linalg.inv(information))[: len(step)]
    return bool(np.all(np.abs(step) <= _SMALL_STEP * np.sqrt(variance)))


_MOST = 9.0


@dataclass(frozen=True, slots=True)
class Gain:
    """A share that is explained, with its interval.

    Attributes
    ----------
    value, low, high
        At most 1; negative where the correction makes it worse.
    """

    value: float
    low: float
    high: float


def losses(
    samples: AuditSamples,
    residual: NDArray[np.float64],
    scale: NDArray[np.float64],
    used: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Sums of min(d^2, 9) over each cluster, (clusters,), of all or some; unknown residuals count as outliers."""
    cut = np.minimum(np.nan_to_num(squared(residual, scale), nan=_MOST), _MOST)
    if used is not None:
        cut = np.where(used, cut, 0.0)
    return np.asarray(np.bincount(samples.cluster, cut, minlength=samples.n_clusters))


def gain(corrected: NDArray[np.float64], base: NDArray[np.float64]) -> Gain:
    """Share explained, from losses of clusters with and without the correction, by (audit.gain).

    Its interval is from the jackknife over clusters, by Student's distribution.
    """
    if len(base) < 2 or not base.sum() > 0.0:
        return Gain(0.0, 0.0, 0.0)
    value = 1.0 - float(corrected.sum() / base.sum())
    of_others = np.maximum(base.sum() - base, 1e-300)
    without = 1.0 - (corrected.sum() - corrected) / of_others
    half = jackknife_half_width(without)
    return Gain(value, value - half, min(value + half, 1.0))


def jackknife_half_width(without: NDArray[np.float64]) -> float:
    """Half of Student's interval of a number, from its values without each of the clusters, (n,)."""
    n = len(without)
    error = float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))
    return float(special.stdtrit(max(n - 1, 1), 0.5 + 0.5 * LEVEL)) * error


@dataclass(frozen=True)
class ResampledFit:
    """A fit and its jackknife.

    Attributes
    ----------
    samples
        The observations, whose clusters are left out.
    fitted
        With normal equations of these clusters.
    moves
        How the fit moves.
    """

    samples: AuditSamples
    fitted: Fit
    moves: Jackknife

    @classmethod
    def of(cls, samples: AuditSamples, fitted: Fit) -> "ResampledFit":
        """Leave out the clusters of the samples of the fit."""
        return cls(samples, fitted, jackknife(fitted.equations))

    @cached_property
    def by_blocks(self) -> "ResampledFit":
        """The same fit, of which blocks of tracks are left out."""
        if self.samples.resampled == Resampled.blocks:
            return self
        samples, fitted = self.samples.by_blocks, self.fitted
        scale = scales(samples.group, fitted.residual)
        equations = normal_equations(
            samples.tracker,
            samples.cluster,
            design_of(samples, fitted),
            fitted.residual,
            scale,
            fitted.equations.ridge,
        )
        return ResampledFit(samples, replace(fitted, equations=equations), jackknife(equations))

    def like(self, other: "ResampledFit") -> "ResampledFit":
        """The same fit, of which blocks are left out if they are of another."""
        return self.by_blocks if other.samples.resampled == Resampled.blocks else self

    @cached_property
    def half_widths(self) -> NDArray[np.float64]:
        """Half of the interval of each column."""
        return self.moves.half_widths(LEVEL)

    @cached_property
    def residual(self) -> NDArray[np.float64]:
        """Residuals, (n, 2), px, each about the fit without its cluster."""
        moves = self.moves.moves[self.samples.cluster]
        moved = np.einsum("nij,nj->ni", design_of(self.samples, self.fitted), moves)
        return np.asarray(self.fitted.residual - moved)

    @cached_property
    def error(self) -> NDArray[np.float64]:
        """Errors, (n, 2), px, about the truth corrected by the fit without the cluster of each observation."""
        moves = self.moves.moves[self.samples.cluster, : len(self.fitted.free)]
        moved = np.einsum("nij,nj->ni", self.fitted.slopes, moves)
        return np.asarray(self.fitted.error - moved)

    def gain_beyond(
        self, base: "ResampledFit", scale: NDArray[np.float64], used: NDArray[np.bool_] | None = None
    ) -> Gain:
        """Share that this fit explains of its held-out clusters beyond another fit, of all or some observations."""
        return gain(self.losses(scale, used), base.like(self).losses(scale, used))

    def losses(self, scale: NDArray[np.float64], used: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
        """(clusters,): see `tracknoise.truth_faults.audit_fit.losses`."""
        return losses(self.samples, self.residual, scale, used)


_CORES = 5.0
"""Errors longer than so many median lengths are outliers."""
MEDIAN_TO_CORE = 1.4826
"""Standard deviation of a Gaussian, in median absolute values."""


def curves(samples: AuditSamples, errors: Mapping[str, NDArray[np.float64]], dataset: str) -> pl.DataFrame:
    """Table `AUDIT_CURVES`."""
    good = _inliers(samples, errors)
    squares = {name: np.sum(error**2, axis=1) for name, error in errors.items()}
    near = {name: squares[name] <= _MOST * scales(samples.group, error) ** 2 for name, error in errors.items()}
    rows = [
        {
            "dataset": dataset,
            "tracker": name,
            "correction": correction,
            "age": int(age),
            **_moments(error[chosen]),
            "near_px": _rms(squares[correction][chosen & near[correction]]),
        }
        for tracker, name in enumerate(samples.trackers)
        for age in np.unique(samples.age[samples.tracker == tracker]).tolist()
        for chosen in [good & (samples.tracker == tracker) & (samples.age == age)]
        for correction, error in errors.items()
        if chosen.any()
    ]
    return pl.DataFrame(rows, schema=dict(AUDIT_CURVES))


def _rms(squares: NDArray[np.float64]) -> float:
    return float(np.sqrt(squares.sum() / max(len(squares), 1)))


def second_moments(samples: AuditSamples, errors: Mapping[str, NDArray[np.float64]]) -> dict[str, float]:
    """Mean squared error of both coordinates together, px^2, by correction."""
    good = _inliers(samples, errors)
    return {
        name: float(np.mean(np.sum(error[good] ** 2, axis=1))) if good.any() else 0.0 for name, error in errors.items()
    }


def _inliers(samples: AuditSamples, errors: Mapping[str, NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Observations that are known for every correction, and are no outliers after the last."""
    is_known = np.asarray(np.logical_and.reduce([np.isfinite(error).all(axis=1) for error in errors.values()]))
    last = list(errors.values())[-1]
    length = np.hypot(last[:, 0], last[:, 1])
    return np.asarray(is_known & (length <= _CORES * _medians(samples, length, is_known)))


def _medians(samples: AuditSamples, length: NDArray[np.float64], is_known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Median length of the errors of the same tracker and age, (n,)."""
    medians = np.zeros(len(length))
    for group in np.unique(samples.group).tolist():
        rows = samples.group == group
        chosen = length[rows & is_known]
        medians[rows] = np.median(chosen) if len(chosen) else 0.0
    return medians


def _moments(error: NDArray[np.float64]) -> dict[str, float | int]:
    mean, second = error.mean(axis=0), np.mean(error**2, axis=0)
    core = MEDIAN_TO_CORE * np.median(np.abs(error), axis=0)
    return {
        "n": len(error),
        "mean_u_px": float(mean[0]),
        "mean_v_px": float(mean[1]),
        "second_uu": float(second[0]),
        "second_vv": float(second[1]),
        "core_u_px": float(core[0]),
        "core_v_px": float(core[1]),
    }
