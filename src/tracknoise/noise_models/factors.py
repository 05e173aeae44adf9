"""Factors on the covariances of white noise and walk, by what is known at run time."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tracknoise.exceptions import UnknownNameError
from tracknoise.noise_models.model import Factor


def factor_of(conditions: Sequence[Factor], at: Mapping[str, ArrayLike], count: int) -> NDArray[np.float64]:
    """Product of the factors, (count,) float64; what is unknown or NaN has the factor 1.

    Raises
    ------
    UnknownNameError
        If there is no factor by one of the names.
    """
    by_name = {factor.of: factor for factor in conditions}
    for name in at:
        if name not in by_name:
            raise UnknownNameError("condition of the noise model", name, by_name)
    total = np.zeros(count)
    for name, values in at.items():
        total += log_factor(by_name[name], np.broadcast_to(np.asarray(values, dtype=np.float64), (count,)))
    return np.asarray(np.exp(total))


def log_factor(factor: Factor, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithms of a factor at values (n,) of its covariate; 0 where they are NaN."""
    least = np.exp(factor.log_knots[0])
    known = np.where(np.isnan(values), least, np.maximum(values, least))
    found = np.interp(np.log(known), factor.log_knots, factor.log_factor)
    return np.where(np.isnan(values), 0.0, found)
