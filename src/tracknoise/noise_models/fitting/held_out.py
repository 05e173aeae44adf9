"""How well components describe scenes that they were not fitted to.

The measure is the log likelihood of an error given the one before, of Gaussian errors with the mean variance of the two
coordinates:

    log p(e_k | e_(k-1)) = -log v - m / v + constant,  v = V(e_k | e_(k-1)),  m its measured mean square    (held_out)

From r e_(k-1), with moments S_00 = `before`, S_11 = `error` and S_01 = (S_11 + S_00 - `change`) / 2, the best
prediction is b r e_(k-1) with b = S_01 / S_00, all as the components have it, and v = S_11 - b S_01.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.tables.enumerations import Product

Array = NDArray[np.float64]


def log_likelihoods(points: pl.DataFrame, counts: Array, measured: Array, modelled: Array) -> Array:
    """Log likelihood of the errors of each scene, per error, by (held_out), nat, without its constant.

    Parameters
    ----------
    points
        Columns product and age: one row per equation.
    counts
        (equations, scenes) float64.
    measured, modelled
        (equations, scenes) float64: half traces, px^2.

    Returns
    -------
    (scenes,) float64
        NaN for scenes without errors.
    """
    kinds = points.with_row_index("row").partition_by("product", as_dict=True)
    rows = {str(kind): dict(part.select("age", "row").iter_rows()) for (kind,), part in kinds.items()}
    total, errors = np.zeros(counts.shape[1]), np.zeros(counts.shape[1])
    for age, place in rows[Product.error].items():
        n = np.nan_to_num(counts[place])
        both = [rows.get(kind, {}).get(age) for kind in (Product.before, Product.change)]
        variance, square = _conditional(measured, modelled, place, both[0], both[1])
        with np.errstate(divide="ignore", invalid="ignore"):
            found = -np.log(variance) - square / variance
        total += np.where(n > 0, n * found, 0.0)
        errors += n
    return np.asarray(total / np.where(errors > 0, errors, np.nan))


def _conditional(
    measured: Array, modelled: Array, error: int, before: int | None, change: int | None
) -> tuple[Array, Array]:
    """Modelled variance and measured mean square of what the error before does not predict."""
    if before is None or change is None:
        return modelled[error], measured[error]
    s11, s00, s01 = _moments(modelled, error, before, change)
    slope = s01 / np.where(s00 > 0.0, s00, np.inf)
    o11, o00, o01 = _moments(measured, error, before, change)
    return s11 - slope * s01, o11 - 2.0 * slope * o01 + slope**2 * o00


def _moments(values: Array, error: int, before: int, change: int) -> tuple[Array, Array, Array]:
    s11, s00 = values[error], np.nan_to_num(values[before])
    return s11, s00, 0.5 * (s11 + s00 - np.nan_to_num(values[change]))
