"""Changes of errors by two covariates together, so that what they have in common does not count twice.

Classes are of an octave, c = floor(log2(x)), twice as wide as those of one covariate, because there are many
combinations. The sums are those of `tracknoise.statistics.noise.covariates`.
"""

from collections.abc import Iterator
from itertools import combinations, islice

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.noise.covariates import PER_OCTAVE, TERMS, covariates_of, known_classes, sums_by_class
from tracknoise.statistics.noise.error_products import Products
from tracknoise.statistics.noise.error_tracks import ErrorTracks
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import NOISE_PAIRS, check, empty

MOST = 5
"""Covariates that are combined, the motion of the image among them."""


def noise_pairs(sequence: PreparedSequence, tracks: ErrorTracks, changes: Products) -> pl.DataFrame:
    """Sums over changes by the classes of two covariates at both of their ends.

    Parameters
    ----------
    sequence, tracks, changes
        As in `tracknoise.statistics.noise.covariates.noise_covariates`.

    Returns
    -------
    polars.DataFrame
        Schema `NOISE_PAIRS`, sorted.
    """
    keys = [name for name in NOISE_PAIRS if name not in ("n", *TERMS)]
    table = pl.concat([empty(NOISE_PAIRS), *_parts(sequence, tracks, changes)])
    return check(table.sort(keys), NOISE_PAIRS, "noise pairs")


def _parts(sequence: PreparedSequence, tracks: ErrorTracks, changes: Products) -> Iterator[pl.DataFrame]:
    octaves = {name: _octaves(values, changes) for name, values in islice(covariates_of(sequence, tracks), MOST)}
    for first, second in combinations(octaves, 2):
        ends = {"first": octaves[first], "second": octaves[second]}
        classes = {f"{place}_{end}": of_end for place, both in ends.items() for end, of_end in both.items()}
        table = sums_by_class(sequence, tracks, changes, classes)
        yield table.with_columns(first=pl.lit(first), second=pl.lit(second)).select(
            pl.col(column).cast(kind) for column, kind in NOISE_PAIRS.items()
        )


def _octaves(values: NDArray[np.float64], changes: Products) -> dict[str, NDArray[np.float64]]:
    """Classes of a covariate at both ends of each change, by the end."""
    backs = {"before": 1, "now": 0}
    return {end: known_classes(values[changes.rows - back]) // PER_OCTAVE for end, back in backs.items()}
