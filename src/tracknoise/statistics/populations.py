"""Which observations a statistic is about."""

from types import MappingProxyType

import polars as pl

from tracknoise.exceptions import SchemaError, UnknownNameError

VISIBLE = ("valid",)
POPULATIONS = MappingProxyType({"visible": VISIBLE, "projected": (*VISIBLE, "occluded", "out_of_image")})
"""Truth statuses of each population.

visible: the true position is known and could be seen. projected: it is known, whether or not it could be seen, which
is what the paper uses.
"""


def measured(observations: pl.DataFrame, *, population: str) -> pl.DataFrame:
    """The observations of a population, all of which have an error.

    Parameters
    ----------
    observations
        An observations table.
    population
        A name in `POPULATIONS`.

    Raises
    ------
    UnknownNameError
        If there is no such population.
    SchemaError
        If an error is missing or not finite although the true position is said to be known.
    """
    if population not in POPULATIONS:
        raise UnknownNameError("population", population, POPULATIONS)
    chosen = observations.filter(pl.col("truth").is_in(POPULATIONS[population]))
    finite = pl.col("du_px").is_finite() & pl.col("dv_px").is_finite()
    broken = chosen.filter(finite.fill_null(value=False).not_())
    if broken.height:
        first = broken.row(0, named=True)
        place = f"track {first['track']} of {first['scene']!r} in frame {first['frame']}"
        raise SchemaError(f"observations: {place} has truth {first['truth']!r} but no finite du_px, dv_px")
    return chosen
