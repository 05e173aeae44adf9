"""Mardia's skewness and kurtosis of pairs, from sums that add up over scenes.

With z the pairs, less their mean and multiplied by a root of their inverse covariance, and E their mean:

- b1 = E(z_u^3)^2 + 3 E(z_u^2 z_v)^2 + 3 E(z_u z_v^2)^2 + E(z_v^3)^2, 0 for a Gaussian (skewness)
- b2 = E((z_u^2 + z_v^2)^2), 8 for a Gaussian (kurtosis)

To leading order the distance (Kullback-Leibler) from the Gaussian of the same mean and covariance is, in nats, b1 / 12
of skewed pairs, and (b2 / 8 - 1)^2 / 2 of elliptical ones (negentropy), by the expansion of Edgeworth.

Source: K. V. Mardia, Biometrika 57 (1970).
"""

from collections.abc import Iterable, Sequence
from functools import reduce
from itertools import product
from math import comb
from operator import add, mul

import numpy as np
from numpy.typing import NDArray

from tracknoise.statistics.errors.joint import FOURTH

Array = NDArray[np.float64]
Order = tuple[int, int]

ORDERS = ((0, 0), (1, 0), (0, 1), *FOURTH)
"""Order (p, q) of each power sum: sum(u^p v^q)."""
POWER_SUMS = ["n", *("z_" + "u" * p + "v" * q for p, q in ORDERS[1:])]
"""Names of the sums of z_u^p z_v^q."""
_PLACE = {order: place for place, order in enumerate(ORDERS)}
_OF_SHAPE = ((3, 0), (2, 1), (1, 2), (0, 3), (4, 0), (2, 2), (0, 4))
"""Orders that skewness and kurtosis are made of."""
_ON_A_LINE = 1e-12


def transformed(sums: Array, centre: Array, root: Array, orders: Sequence[Order] = ORDERS) -> Array:
    """Power sums of root (x - centre), from those of x.

    Parameters
    ----------
    sums : (15, ...)
        By `ORDERS`.
    centre : (2, ...)
        Of x.
    root : (3, ...)
        Lower triangular: a, b, c of ((a, 0), (b, c)).
    orders
        Of the sums that are returned; each is one of `ORDERS`.
    """
    shifted = _shifted(sums, -centre, {(p + q - j, j) for p, q in orders for j in range(q + 1)})
    a, b, c = map(_powers, root)
    rows = []
    for p, q in orders:
        terms = (_product(comb(q, j), b[q - j], c[j], shifted[p + q - j, j]) for j in range(q + 1))
        rows.append(_product(a[p], reduce(add, terms)))
    return np.stack(rows)


def whitening(sums: Array) -> tuple[Array, Array]:
    """Mean, (2, ...), and lower triangular root of the inverse covariance, (3, ...); NaN where pairs lie on a line.

    Parameters
    ----------
    sums : (15, ...)
        Power sums by `ORDERS`; of the first six, those to order 2, only.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v, uu, uv, vv = sums[1:6] / sums[0]
        uu, uv, vv = uu - u * u, uv - u * v, vv - v * v
        plane = (uu > 0) & (vv > 0) & (uu * vv - uv * uv > _ON_A_LINE * uu * vv)
        a = 1 / np.sqrt(np.where(plane, uu, np.nan))
        c = 1 / np.sqrt(np.where(plane, vv - uv * uv / uu, np.nan))
        return np.stack([u, v]), np.stack([a, -uv / uu * c, c])


def mardia(sums: Array) -> Array:
    """b1 and b2 by (skewness) and (kurtosis), (2, ...); NaN where pairs lie on a line.

    Parameters
    ----------
    sums : (15, ...)
        Power sums by `ORDERS`.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        moments = transformed(sums, *whitening(sums), orders=_OF_SHAPE) / sums[0]
    mean = dict(zip(_OF_SHAPE, moments, strict=True))
    skewness = mean[3, 0] ** 2 + 3 * mean[2, 1] ** 2 + 3 * mean[1, 2] ** 2 + mean[0, 3] ** 2
    return np.stack([skewness, mean[4, 0] + 2 * mean[2, 2] + mean[0, 4]])


def _shifted(sums: Array, shift: Array, orders: Iterable[Order]) -> dict[Order, Array]:
    """Power sums of x + shift, by order."""
    u, v = map(_powers, shift)
    found = {}
    for p, q in orders:
        parts = product(range(p + 1), range(q + 1))
        terms = (_product(comb(p, i) * comb(q, j), sums[_PLACE[i, j]], u[p - i], v[q - j]) for i, j in parts)
        found[p, q] = reduce(add, terms)
    return found


def _powers(values: Array) -> list[Array | int]:
    """Powers of order 0 to 4, as products: the power function takes forty times as long."""
    square = values * values
    return [1, values, square, square * values, square * square]


def _product(*factors: Array | int) -> Array:
    """Product from left to right; most of the time of many draws is spent here, so factors of 1 are left out."""
    return np.asarray(reduce(mul, [factor for factor in factors if not isinstance(factor, int) or factor != 1]))
