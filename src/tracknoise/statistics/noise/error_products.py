"""Sums from which the components of the noise of tracks are fitted: products of errors, and what they should contain.

Errors e_k are about the first position, at age k, in frames that the tracker saw. The image about the point of a track
is magnified by M_k = Z_0 / Z_k since birth, by r = M_k / M_(k-1) since the frame before. A change is

    c_k = e_k - r e_(k-1)    (error_products.change)

so that an error that was made before, and is carried on by the motion of the image, is no change. For errors of
(noise_model.error), products have the expectation

    E[x y'] = first A + white W + walk Q + drift D    (error_products.expected)

    error   e_k e_k'       M_k^2, 1, P_k M_k^2, k^2
    before  r e_(k-1) ...  M_k^2, r^2, P_(k-1) M_k^2, (r k')^2
    change  c_k c_k'       0, 1 + r^2, s, (k - r k')^2
    lagged  c_k c_(k-1)'   0, -r, 0, (k - r k') (k' - r' k'')

where k' and k'' are the ages one and two frames of the tracker before, s the frames of the recording between two of the
tracker, and P_k the sum of s / M_i^2 over its frames i up to k. The sums of these four factors over tracks are kept, so
that any number of scenes can be added up before the fit.

Tails must not decide what the bulk is like. Errors larger than ten times the median of the condition and sequence, as a
Gaussian of that median would have it, are left out and counted (`tracknoise.statistics.noise.tracked_errors.OUTLIER`).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.statistics.noise.error_tracks import ErrorTracks
from tracknoise.tables.enumerations import Product


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
        Of A, W, Q and D in their expectation, (error_products.expected).
    """

    rows: NDArray[np.intp]
    values: NDArray[np.float64]
    factors: NDArray[np.float64]


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
