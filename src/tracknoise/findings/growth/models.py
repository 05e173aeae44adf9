"""The two models of growth, fitted in units of the scale of each scene, and how they agree with what was measured."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.growth.agreement import Agreement, agreement, curve_directions
from tracknoise.findings.growth.fit import TERMS, GrowthFit, contributions
from tracknoise.findings.growth.predicted import Parts, predicted
from tracknoise.findings.growth.saturating import SaturatingFit, saturating_curve
from tracknoise.findings.growth.scene_curves import SceneCurves
from tracknoise.findings.sampling.jackknife import degrees, parts

Array = NDArray[np.float64]

OWN = 0.05
"""How far off a model may be, relative to the second moment: that much is added to each age's standard error."""


@dataclass(frozen=True, slots=True)
class Ages:
    """Where curves are, and which of it is fitted.

    Attributes
    ----------
    since : (ages,)
        Frames from where errors are zero.
    fitted : (ages,) bool
        Ages with enough errors.
    step
        Frames between two changes of errors.
    """

    since: Array
    fitted: NDArray[np.bool_]
    step: float


@dataclass(frozen=True, slots=True)
class Model:
    """A fitted model of one coordinate.

    Attributes
    ----------
    shares
        By term, of the fitted second moment, mean over the ages.
    agreement
        With the curve and the autocorrelations.
    """

    shares: Mapping[str, Estimate]
    agreement: Agreement


@dataclass(frozen=True, slots=True)
class _Curve:
    since: Array
    second: Array
    weight: Array


def polynomial(curves: SceneCurves, ages: Ages, level: float) -> tuple[Model, dict[str, Estimate]]:
    """Fit (growth): the model, and its sizes as geometric means over scenes.

    Parameters
    ----------
    curves
        In units of scale.
    ages
        Where they are.
    level
        Of the intervals.
    """
    curve = _fitted(curves, ages)
    fit = GrowthFit.at(curve.since, curve.weight)
    bounded, free = fit.bounded(curve.second), fit.free(curve.second)
    white, walk, drift = bounded
    none = np.zeros_like(white)
    process = Parts(white, walk * ages.step, drift * ages.step**2, none, none)
    found = _agreement(curves, ages, curve, curve.since[:, None] ** np.arange(len(TERMS)) @ bounded, process)
    shares = _shares(TERMS, contributions(bounded, curve.since), curves.sizes, level)
    scale = np.exp(curves.log_scale)
    return Model(shares, found), {
        term: _size(one * scale, other * scale, level) for term, one, other in zip(TERMS, bounded, free, strict=True)
    }


def saturating(curves: SceneCurves, ages: Ages, level: float) -> Model:
    """Fit (saturating); errors may be measured from birth or from the first error, whichever agrees better.

    Parameters
    ----------
    curves, ages, level
        As in `polynomial`.
    """
    curve = _fitted(curves, ages)
    white, size, tau = SaturatingFit.at(curve.since, curve.weight).fit(curve.second)
    none = np.zeros_like(white)
    fitted = saturating_curve(np.stack([white, size, tau]), curve.since)
    decays = ((np.exp(-ages.step / (2 * tau)), False), (np.exp(-ages.step / tau), True))
    both = [_agreement(curves, ages, curve, fitted, Parts(white, none, none, size, *decay)) for decay in decays]
    share = size * -np.expm1(-curve.since[:, None] / tau).mean(axis=0) / fitted.mean(axis=0)
    shares = _shares(("white", "saturating"), np.stack([1 - share, share]), curves.sizes, level)
    return Model(shares, max(both, key=lambda found: found.p))


def _fitted(curves: SceneCurves, ages: Ages) -> _Curve:
    second = curves.second[ages.fitted]
    influence = second[:, 1:] - second[:, :1]
    weight = 1 / ((influence**2).sum(axis=1) + (OWN * second[:, 0]) ** 2)
    return _Curve(ages.since[ages.fitted], second, weight)


def _agreement(curves: SceneCurves, ages: Ages, curve: _Curve, fitted: Array, process: Parts) -> Agreement:
    directions = curve_directions(curve.since, curve.second[:, 0], curve.weight)
    expected = predicted(process, curves.n, np.round(ages.since / ages.step), curves.related[0])
    return agreement(curve.second, fitted, curves.related, expected, directions, curves.sizes)


def _shares(names: tuple[str, ...], shares: Array, sizes: Array, level: float) -> dict[str, Estimate]:
    there = sizes > 0
    moved = parts((shares[:, :1] - shares[:, 1:]).T[there], sizes[there, None])
    width = special.stdtrit(degrees(sizes[there, None]), (1 + level) / 2) * np.sqrt((moved**2).sum(axis=0))
    ends = np.clip(shares[:, 0] - width, 0.0, 1.0), np.clip(shares[:, 0] + width, 0.0, 1.0)
    rows = zip(names, shares[:, 0], *ends, strict=True)
    return {name: Estimate(float(value), float(low), float(high)) for name, value, low, high in rows}


def _size(square: Array, free: Array, level: float) -> Estimate:
    """Root of a coefficient of all units and of all but one, with Student's interval.

    It is on the log scale where the coefficient is clearly not zero, otherwise on that of the coefficient without
    bounds, which is right on average where the true one is zero.
    """
    units = len(square) - 1
    tail = special.stdtrit(units - 1.0, (1 + level) / 2)

    def width(values: Array) -> float:
        return float(tail * np.sqrt((units - 1) / units * np.square(values[1:] - values[0]).sum()))

    value = float(square[0])
    if value > 0 and (square > 0).all() and width(free) < value:
        factor = np.exp(width(np.log(square)) / 2)
        return Estimate(value**0.5, value**0.5 / factor, value**0.5 * factor)
    low, high = min(value, float(free[0])) - width(free), max(value, float(free[0])) + width(free)
    return Estimate(value**0.5, max(low, 0.0) ** 0.5, high**0.5)
