"""Robust fits of corrections of the truth to errors, beside biases of the trackers.

Minimised is the negative logarithm of Student's density of the residuals r = observed - x(theta) - B beta (audit.fit):
x is that of (audit.prediction), beta a constant and a drift per frame of each tracker, in u and in v. Each tracker and
age has a scale of its own, which is estimated robustly.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.fitted import Fit
from tracknoise.audit.normal import normal_equations, summed
from tracknoise.audit.parameters import Parameter, columns_of, furthest
from tracknoise.audit.prediction import Predicted, predict
from tracknoise.audit.robust import scales
from tracknoise.audit.samples import AuditSamples

_STEPS = 12
_INNER_STEPS = 2
_SMALL_STEP = 0.02
"""A step that is small beside the standard errors ends the fit."""
BIAS_AGE = 12.0
"""Ages are in units of this many frames where drifts are fitted, so that constants and drifts are of one size."""
_FURTHEST_BIAS_PX = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Where fits begin: numbers of all parameters (COUNT,), and what they predict."""

    theta: NDArray[np.float64]
    predicted: Predicted

    @classmethod
    def at(cls, samples: AuditSamples, theta: NDArray[np.float64]) -> "Start":
        """Begin at these numbers."""
        return cls(theta, predict(samples, theta))


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


def fit(samples: AuditSamples, parameters: Sequence[Parameter], start: Start, *, with_bias: bool = True) -> Fit:
    """Fit some parameters, all others held where the fit begins: (audit.fit).

    Parameters
    ----------
    samples
        At least one of each cluster.
    parameters
        What is free; may be empty.
    start
        Where the fit begins; what it predicts is shared by all fits that begin there.
    with_bias
        Whether trackers have biases of their own.
    """
    free, limit = columns_of(parameters), furthest(parameters)
    biases = _bias_columns(samples) if with_bias else np.empty((len(samples.age), 2, 0))
    ridge = 1.0 / np.concatenate([limit, np.full(biases.shape[2], _FURTHEST_BIAS_PX)]) ** 2
    state = _state(samples, start, np.zeros(biases.shape[2]), parameters, biases)
    for _ in range(_STEPS):
        step, information = _solved(samples, state, ridge)
        if _is_small(step[: len(free)], information):
            state = state.moved(step, free)
            break
        theta = state.theta.copy()
        theta[free] = np.clip(theta[free] + step[: len(free)], -limit, limit)
        state = _state(samples, Start.at(samples, theta), state.beta + step[len(free) :], parameters, biases)
    scale = scales(samples.group, state.residual)
    equations = normal_equations(samples.tracker, samples.cluster, state.design, state.residual, scale, ridge)
    return Fit(tuple(parameters), with_bias, state.theta, state.error, state.residual, state.design, free, equations)


def _state(
    samples: AuditSamples,
    there: Start,
    beta: NDArray[np.float64],
    parameters: Sequence[Parameter],
    biases: NDArray[np.float64],
) -> _State:
    error = samples.observed - there.predicted.uv
    design = np.concatenate([there.predicted.by(parameters), biases], axis=2)
    return _State(there.theta, beta, error, error - biases @ beta, design)


def _bias_columns(samples: AuditSamples) -> NDArray[np.float64]:
    """(n, 2, 4 trackers): of each tracker a constant in u and v, and a drift in u and v."""
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
