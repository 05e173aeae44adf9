"""Sums of products of errors by condition, block, product and age, and counts of outliers."""

from collections.abc import Mapping

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.noise.error_products import Products
from tracknoise.statistics.noise.error_tracks import ErrorTracks
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import Product
from tracknoise.tables.schema import NOISE_OUTLIERS, NOISE_SUMS, PRODUCT, Schema, check, empty

_PRODUCTS, _FACTORS = ("uu", "uv", "vv"), ("first", "white", "walk", "drift")
_MEANS = ("sum_u", "sum_v", "along", "motion")


def noise_sums(sequence: PreparedSequence, tracks: ErrorTracks, found: Mapping[Product, Products]) -> pl.DataFrame:
    """Sums of every condition, block, product and age.

    Parameters
    ----------
    sequence
        Whose blocks they are of.
    tracks
        Its errors.
    found
        What `products` made of them.

    Returns
    -------
    polars.DataFrame
        Schema `NOISE_SUMS`, sorted.
    """
    parts = [_summed(sequence, tracks, kind, each) for kind, each in found.items()]
    return check(pl.concat([empty(NOISE_SUMS), *parts]).sort(_KEYS), NOISE_SUMS, "noise sums")


_KEYS = tuple(name for name in NOISE_SUMS if name not in ("n", *_PRODUCTS, *_FACTORS, *_MEANS))


def _summed(sequence: PreparedSequence, tracks: ErrorTracks, kind: Product, found: Products) -> pl.DataFrame:
    rows = tracks.rows[found.rows]
    block = np.where(sequence.at_slowest[rows], sequence.block[rows], 0)
    (condition, blocks, age), index = number_combinations(
        [sequence.seen.condition[rows], block, sequence.seen.age[rows]]
    )
    columns = dict(zip((*_PRODUCTS, *_FACTORS), np.hstack([found.values, found.factors]).T, strict=True))
    columns |= dict(zip(_MEANS, _means(tracks, kind, found.rows), strict=True))
    sums = {name: np.bincount(index, values, len(age)) for name, values in columns.items()}
    keys = {"block": blocks, "age": age, "n": np.bincount(index, minlength=len(age))}
    table = sequence.seen.conditions[condition].hstack(pl.DataFrame({**keys, **sums}))
    return _typed(table.with_columns(product=pl.lit(kind, dtype=PRODUCT)), NOISE_SUMS)


def _means(tracks: ErrorTracks, kind: Product, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """Errors (u, v), along the motion times it, and its square, (4, n); 0 for products other than `error`."""
    if kind != Product.error:
        return np.zeros((4, len(rows)))
    error, motion = tracks.error_px[rows], tracks.motion_px[rows]
    return np.stack([*error.T, (error * motion).sum(axis=1), (motion**2).sum(axis=1)])


def noise_outliers(sequence: PreparedSequence, tracks: ErrorTracks) -> pl.DataFrame:
    """How many errors each condition has, and how many of them are outliers: schema `NOISE_OUTLIERS`."""
    condition, count = sequence.seen.condition[tracks.rows], sequence.seen.conditions.height
    aged = tracks.age > 0
    known = aged & ~np.isnan(tracks.error_px[:, 0])
    counts = {
        "n_tracks": np.bincount(condition[tracks.age == 0], minlength=count),
        "n": np.bincount(condition[aged & (known | tracks.outlier)], minlength=count),
        "n_outliers": np.bincount(condition[tracks.outlier], minlength=count),
    }
    table = sequence.seen.conditions.hstack(pl.DataFrame({**counts, "limit_px": tracks.limit_px}))
    return check(_typed(table.filter(pl.col("n") > 0), NOISE_OUTLIERS), NOISE_OUTLIERS, "noise outliers")


def _typed(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    return table.select(pl.col(name).cast(kind) for name, kind in schema.items())
