"""Changes of errors by two covariates together, so that what they have in common does not count twice.

Classes are of an octave, c = floor(log2(x)), twice as wide as those of one covariate, because there are many
combinations. The sums are those of `tracknoise.statistics.noise.covariates`.
"""

from collections.abc import Iterator
from itertools import combinations, islice

import polars as pl

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
    known = islice(covariates_of(sequence, tracks), MOST)
    for (first, of_first), (second, of_second) in combinations(known, 2):
        classes = {
            f"{place}_{end}": known_classes(values[changes.rows - back]) // PER_OCTAVE
            for place, values in (("first", of_first), ("second", of_second))
            for end, back in (("before", 1), ("now", 0))
        }
        table = sums_by_class(sequence, tracks, changes, classes)
        yield table.with_columns(first=pl.lit(first), second=pl.lit(second)).select(
            pl.col(column).cast(kind) for column, kind in NOISE_PAIRS.items()
        )
