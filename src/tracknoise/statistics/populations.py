"""Which observations a statistic is about."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import SchemaError, UnknownNameError
from tracknoise.tables.enumerations import Population

VISIBLE = ("valid",)
POPULATIONS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {Population.visible: VISIBLE, Population.projected: (*VISIBLE, "occluded", "out_of_image")}
)
"""Truth statuses of each population.

visible: the true position is known and was visible. projected: it is known, whether or not it was visible, which is
what the paper uses.
"""


def check_population(population: str) -> str:
    """Return the name of a population.

    Raises
    ------
    UnknownNameError
        If there is no such population.
    """
    if population not in POPULATIONS:
        raise UnknownNameError("population", population, POPULATIONS)
    return population


def in_population(observations: pl.DataFrame, population: str) -> NDArray[np.bool_]:
    """Whether each observation belongs to a population; those that do have an error.

    Parameters
    ----------
    observations
        An observations table.
    population
        A name in `POPULATIONS`.

    Returns
    -------
    (rows,) bool

    Raises
    ------
    UnknownNameError
        If there is no such population.
    SchemaError
        If an error is missing or not finite although the true position is said to be known.
    """
    belongs = pl.col("truth").is_in(POPULATIONS[check_population(population)])
    finite = (pl.col("du_px").is_finite() & pl.col("dv_px").is_finite()).fill_null(value=False)
    chosen = observations.select(belongs=belongs, broken=belongs & ~finite)
    if chosen["broken"].any():
        first = observations.filter(chosen["broken"]).row(0, named=True)
        place = f"track {first['track']} of {first['scene']!r} in frame {first['frame']}"
        raise SchemaError(f"observations: {place} has truth {first['truth']!r} but no finite du_px, dv_px")
    return chosen["belongs"].to_numpy()
