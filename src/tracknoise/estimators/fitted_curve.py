"""Whether a noise model fits the errors that it was fitted to: how large they are at each age.

Both the measured size and that of the model are the root of half the trace of the mean product of errors about the
first position. The model's is (error_products.expected) with the magnification that the tracks had.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.components import COLUMNS, Equations
from tracknoise.inference.conventions import LEVEL, IntervalKind
from tracknoise.inference.intervals import Method, pooled
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.inference.units import NO_GROUPS, SceneGroups
from tracknoise.tables.enumerations import Product
from tracknoise.tables.findings_schema import RESAMPLED

Array = NDArray[np.float64]


def fitted_curve(sums: pl.DataFrame, noise: TrackNoise, *, groups: SceneGroups = NO_GROUPS) -> pl.DataFrame:
    """Root mean square of a coordinate of the errors by age, outliers left out.

    Parameters
    ----------
    sums
        Schema `NOISE_SUMS`, of one tracker and speed.
    noise
        Components of the model.
    groups
        Groups of scenes that are not independent of each other.

    Returns
    -------
    polars.DataFrame
        One row per age (frames of the recording): age, n, n_scenes, level, resampled, and px: measured, low, high (null
        where there is no interval) and modelled.
    """
    errors = sums.filter(pl.col("product") == Product.error)
    units = units_of(errors.drop("block"), errors, points=["age"], columns=COLUMNS, groups=groups)

    def half_traces(columns: Array) -> Array:
        return Equations.of(columns).half_trace[None]

    sizes = units.sums[..., 0].T[None]
    method = Method(IntervalKind.student, LEVEL)
    found = pooled(units, np.zeros((0, len(units.sums))), half_traces, method, scales=["log"], sizes=sizes)
    factors = Equations.of(units.sums.sum(axis=0).T).factors
    modelled = factors @ np.array([0.5 * np.trace(component) for component in noise])
    squares = {"measured": found.value[0], "low": found.low[0], "high": found.high[0], "modelled": modelled}
    return units.points.with_columns(
        pl.Series("n", units.sums[..., 0].sum(axis=0).astype(np.int64)),
        pl.Series("n_scenes", found.n_scenes[0]),
        *(pl.Series(name, np.sqrt(values), nan_to_null=True) for name, values in squares.items()),
        level=pl.lit(LEVEL),
        resampled=pl.lit(units.resampled, dtype=RESAMPLED),
    ).sort("age")
