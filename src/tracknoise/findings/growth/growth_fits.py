"""Everything that is fitted to the errors of one condition, for the verdict on their growth."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.growth.behaviour import Growth
from tracknoise.findings.growth.grown import Sizes, pooled_saturating, pooled_sizes
from tracknoise.findings.growth.growth_units import GrowthUnits
from tracknoise.findings.growth.long_lived import Loss, loss
from tracknoise.findings.growth.models import Ages, Model, polynomial, saturating
from tracknoise.findings.growth.scene_curves import scene_curves
from tracknoise.findings.sampling.bounds import Method

_DRAWS = 400
"""Draws of the fit of (saturating), which takes longer than that of the polynomial."""


def growth_fits(units: GrowthUnits, ages: Ages, weights: NDArray[np.float64], method: Method) -> tuple[Growth, Growth]:
    """Fit the growth of u and of v.

    Parameters
    ----------
    units
        Of one condition and trimming, with errors that are not all zero at any fitted age.
    ages
        Where curves are, and which are fitted.
    weights : (draws, units)
        How often each unit was drawn.
    method
        How to make intervals of what is fitted to all errors together.
    """
    sizes = pooled_sizes(units.errors, weights, ages.fitted, method)
    curves = [scene_curves(units.of(axis)) for axis in (0, 1)]
    polynomials = [_known(units, *polynomial(curve, ages, method.level)) for curve in curves]
    refused = [model.agreement.refused for model, _ in polynomials]
    limits = pooled_saturating(units.errors, weights[:_DRAWS], ages.fitted, method) if any(refused) else ({}, {})
    u, v = (
        Growth(
            {**sizes[axis], **(limits[axis] if refused[axis] else {})},
            polynomials[axis][1],
            polynomials[axis][0],
            saturating(curves[axis], ages, method.level) if refused[axis] else None,
            _loss(units, ages, axis),
            float(ages.since[ages.fitted].max()),
        )
        for axis in (0, 1)
    )
    return u, v


def _known(units: GrowthUnits, model: Model, sizes: Sizes) -> tuple[Model, Sizes]:
    """The same without bounds, and not refused, where nothing can be resampled."""
    if units.errors.resampled is not None:
        return model, sizes
    shares = {term: Estimate(share.value) for term, share in model.shares.items()}
    unknown = Model(shares, replace(model.agreement, p=1.0))
    return unknown, {term: Estimate(size.value) for term, size in sizes.items()}


def _loss(units: GrowthUnits, ages: Ages, axis: int) -> Loss | None:
    if units.errors.resampled is None:
        return None
    sums, fourth = units.of(axis), None if units.fourth is None else units.fourth[..., axis]
    return loss(sums.n, sums.squares, ages.since, units.lived_of(axis), fourth)
