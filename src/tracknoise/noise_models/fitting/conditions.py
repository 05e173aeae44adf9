"""Conditions at run time: whether white noise and walk depend on what a front end knows while it runs.

For each covariate, a factor that is piecewise linear in its logarithm is fitted to changes of errors by the likelihood

    -sum(n log v + S / v),  v = (covariates.expected) / n    (conditions)

with counts n and sums S of half squared lengths by class of the covariate at both ends. What it gains over a constant
factor is measured on scenes that were left out. Of the covariates whose gain exceeds `LEAST_GAIN` nat per change, with
an interval that does not reach 0, the best one is kept. There is only one, as the sums of single covariates do not show
what two have in common.
"""

from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.optimize import minimize

from tracknoise.findings.sampling.jackknife import student_interval
from tracknoise.noise_models.fitting.components import FittedComponents
from tracknoise.noise_models.model import Factor, Interval
from tracknoise.statistics.covariates import log_centre

Array = NDArray[np.float64]

LEAST_GAIN = 0.01
"""Nat per change."""
_SHARES = (0.05, 0.35, 0.65, 0.95)
"""Shares of the changes below the knots."""
_NARROWEST = 0.25
"""Least distance of two knots, natural logarithm."""
_FOLDS, _LEAST_SCENES = 10, 3
_RIDGE = 1.0
"""Weight of a squared log factor, nat: classes without data stay near 1."""


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """Sums by class of one covariate at both ends of changes, (n,) each, and the half traces of W, Q and D."""

    scene: NDArray[np.intp]
    before: Array
    now: Array
    count: Array
    squares: Array
    white_before: Array
    walk: Array
    drift: Array
    sizes: tuple[float, float, float]

    def chosen(self, rows: NDArray[np.bool_]) -> "_Cells":
        columns = ("scene", "before", "now", "count", "squares", "white_before", "walk", "drift")
        return replace(self, **{name: getattr(self, name)[rows] for name in columns})

    def cost(self, knots: Array, logs: Array) -> tuple[float, Array]:
        """Minus (conditions), and its derivative by the log factors at the knots."""
        now, before = (_weights(knots, place) for place in (self.now, self.before))
        f_now, f_before = (np.exp(weights @ logs) for weights in (now, before))
        white, walk, drift = self.sizes
        new, old = (white * self.count + walk * self.walk) * f_now, white * self.white_before * f_before
        mean = np.maximum((new + old + drift * self.drift) / self.count, 1e-300)
        cost = float((self.count * np.log(mean) + self.squares / mean).sum())
        slope = (self.count - self.squares / mean) / mean / self.count
        return cost, np.asarray((slope * new) @ now + (slope * old) @ before)


def conditions_of(covariates: pl.DataFrame, fitted: FittedComponents, *, level: float) -> tuple[Factor, ...]:
    """The factor that is worth keeping, if any.

    Parameters
    ----------
    covariates
        Schema `NOISE_COVARIATES`, of one tracker and speed.
    fitted
        The components.
    level
        Of the interval of the gain.
    """
    found = candidates(covariates, fitted, level=level)
    kept = [one for one in found if one.gain.value > LEAST_GAIN and one.gain.low is not None and one.gain.low > 0.0]
    return (max(kept, key=lambda one: one.gain.value),) if kept else ()


def candidates(covariates: pl.DataFrame, fitted: FittedComponents, *, level: float) -> list[Factor]:
    """The factor by each covariate that varies, with what it gains; see `conditions_of` for the parameters."""
    sizes = [fitted.components[name].sigma.value ** 2 for name in ("white", "walk", "drift")]
    if covariates["scene"].n_unique() < _LEAST_SCENES or not sizes[0] + sizes[1] > 0.0:
        return []
    found = []
    for (name,), part in sorted(covariates.partition_by("covariate", as_dict=True).items()):
        cells = _cells(part, (sizes[0], sizes[1], sizes[2]))
        knots = _knots(cells)
        if len(knots) > 1:
            logs = _fit(cells, knots)
            gain = _gain(cells, knots, level)
            found.append(Factor(of=name, log_knots=tuple(knots.tolist()), log_factor=tuple(logs.tolist()), gain=gain))
    return found


def _cells(part: pl.DataFrame, sizes: tuple[float, float, float]) -> _Cells:
    scene = part["scene"].rank("dense").to_numpy().astype(np.intp) - 1
    before, now = (log_centre(part[name].to_numpy().astype(np.int64)) for name in ("before", "now"))
    names = ("n", "squares", "white_before", "walk", "drift")
    count, squares, white, walk, drift = (part[name].to_numpy().astype(np.float64) for name in names)
    return _Cells(scene, before, now, count, squares, white, walk, drift, sizes)


def _knots(cells: _Cells) -> Array:
    """Knots at shares of the changes, not too near to each other."""
    order = np.argsort(cells.now, kind="stable")
    share = np.cumsum(cells.count[order]) / cells.count.sum()
    wanted = cells.now[order][np.minimum(np.searchsorted(share, _SHARES), len(order) - 1)]
    kept: list[float] = []
    for knot in wanted:
        if not kept or knot - kept[-1] >= _NARROWEST:
            kept.append(float(knot))
    return np.array(kept)


def _weights(knots: Array, place: Array) -> Array:
    """(n, knots): by how much each knot counts at a place, as in linear interpolation, constant beyond the ends."""
    return np.stack([np.interp(place, knots, row) for row in np.eye(len(knots))], axis=1)


def _fit(cells: _Cells, knots: Array) -> Array:
    """Log factors at the knots."""

    def objective(logs: Array) -> tuple[float, Array]:
        cost, slope = cells.cost(knots, logs)
        return cost + _RIDGE * float(logs @ logs), slope + 2.0 * _RIDGE * logs

    found = minimize(objective, np.zeros(len(knots)), jac=True, method="L-BFGS-B", bounds=[(-10.0, 10.0)] * len(knots))
    return np.asarray(found.x)


def _gain(cells: _Cells, knots: Array, level: float) -> Interval:
    """What the factor gains over a constant one on scenes that were left out, nat per change."""
    count = int(cells.scene.max()) + 1
    gain, n = np.zeros(count), np.zeros(count)
    for fold in range(min(_FOLDS, count)):
        left = cells.scene % min(_FOLDS, count) == fold
        logs, constant = _fit(cells.chosen(~left), knots), _fit(cells.chosen(~left), knots[:1])
        for scene in np.unique(cells.scene[left]):
            own = cells.chosen(cells.scene == scene)
            gain[scene] = own.cost(knots[:1], constant)[0] - own.cost(knots, logs)[0]
            n[scene] = own.count.sum()
    value = gain.sum() / n.sum()
    without = (gain.sum() - gain) / (n.sum() - n)
    low, high = student_interval(value, without, level=level, sizes=n)
    return Interval(value=float(value), low=_known(low), high=_known(high))


def _known(bound: Array) -> float | None:
    return None if np.isnan(bound) else float(bound)
