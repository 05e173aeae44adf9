"""Sums from which the components of the noise of tracks are fitted: products of errors, and what they should contain.

Errors e_k are about the first position, at age k, in frames that the tracker saw. The image about the point of a track
is magnified by M_k = Z_0 / Z_k since birth, by r = M_k / M_(k-1) since the frame before. A change is

    c_k = e_k - r e_(k-1)    (noise_sums.change)

so that an error that was made before, and is carried on by the motion of the image, is no change. For errors of
(noise_model.error), products have the expectation

    E[x y'] = first A + white W + walk Q + drift D    (noise_sums.expected)

    error   e_k e_k'       M_k^2, 1, P_k M_k^2, k^2
    before  r e_(k-1) ...  M_k^2, r^2, P_(k-1) M_k^2, (r k')^2
    change  c_k c_k'       0, 1 + r^2, s, (k - r k')^2
    lagged  c_k c_(k-1)'   0, -r, 0, (k - r k') (k' - r' k'')

where k' and k'' are the ages one and two frames of the tracker before, s the frames of the recording between two of the
tracker, and P_k the sum of s / M_i^2 over its frames i up to k. The sums of these four factors over tracks are kept, so
that any number of scenes can be added up before the fit.

Tails must not decide what the bulk is like. Errors larger than `OUTLIER` times the median of the condition and
sequence, as a Gaussian of that median would have it, are left out and counted.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.error_tracks import ErrorTracks
from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import Product
from tracknoise.tables.schema import NOISE_OUTLIERS, NOISE_SUMS, PRODUCT, Schema, check, empty

_PRODUCTS, _FACTORS = ("uu", "uv", "vv"), ("first", "white", "walk", "drift")
_MEANS = ("sum_u", "sum_v", "along", "motion")


@dataclass(frozen=True, slots=True)
class Products:
    """Products of one kind.

    Attributes
    ----------
    rows : (n,) intp
        The observation at the end of each.
    values : (n, 3) float64
        uu, uv and vv, px^2.
    factors : (n, 4) float64
        Of A, W, Q and D in their expectation, (noise_sums.expected).
    """

    rows: NDArray[np.intp]
    values: NDArray[np.float64]
    factors: NDArray[np.float64]


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


def products(tracks: ErrorTracks) -> Iterator[tuple[Product, Products]]:
    """All products of each kind whose errors are known and not outliers."""
    now, carried, age, before = tracks.error_px, tracks.magnification, tracks.age, tracks.before(1)
    k = age[before]
    walked = np.where(k > 0, tracks.walked[before - 1], 0.0)
    grown, r = carried[before], carried[before] / carried[before - 1]
    earlier = age[before - 1]
    left = k - r * earlier
    one = np.ones_like(grown)
    errors = now[before]
    yield (
        Product.error,
        Products(before, _squares(errors), _stack(grown**2, one, tracks.walked[before] * grown**2, k**2)),
    )
    later = earlier > 0
    old = r[:, None] * now[before - 1]
    of_old = _stack(grown**2, r**2, walked * grown**2, (r * earlier) ** 2)
    yield Product.before, Products(before[later], _squares(old)[later], of_old[later])
    change = errors - old
    of_change = _stack(0.0 * one, 1.0 + r**2, k - earlier, left**2)
    yield Product.change, Products(before[later], _squares(change)[later], of_change[later])
    place = np.full(len(age), -1)
    place[before] = np.arange(len(before))
    twice = np.flatnonzero(later & (place[before - 1] >= 0))
    first = place[before[twice] - 1]
    crossed = _crossed(change[twice], change[first])
    zero = np.zeros(len(twice))
    yield Product.lagged, Products(before[twice], crossed, _stack(zero, -r[twice], zero, left[twice] * left[first]))


def _stack(*columns: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack(columns, axis=1)


def _squares(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return _crossed(vectors, vectors)


def _crossed(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Products uu, uv and vv, (n, 3), of which the second is made symmetric."""
    mixed = 0.5 * (a[:, 0] * b[:, 1] + a[:, 1] * b[:, 0])
    return _stack(a[:, 0] * b[:, 0], mixed, a[:, 1] * b[:, 1])


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
