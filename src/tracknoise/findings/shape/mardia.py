"""Mardia's skewness and kurtosis of pairs, from sums that add up over scenes.

With z the pairs, less their mean and multiplied by a root of their inverse covariance, and E their mean:

- b1 = E(z_u^3)^2 + 3 E(z_u^2 z_v)^2 + 3 E(z_u z_v^2)^2 + E(z_v^3)^2, 0 for a Gaussian (skewness)
- b2 = E((z_u^2 + z_v^2)^2), 8 for a Gaussian (kurtosis)

To leading order the distance (Kullback-Leibler) from the Gaussian of the same mean and covariance is, in nats, b1 / 12
of skewed pairs, and (b2 / 8 - 1)^2 / 2 of elliptical ones (negentropy), by the expansion of Edgeworth.

Source: K. V. Mardia, Biometrika 57 (1970).
"""

from itertools import product
from math import comb

import numpy as np
from numpy.typing import NDArray

from tracknoise.statistics.joint import FOURTH

Array = NDArray[np.float64]

ORDERS = ((0, 0), (1, 0), (0, 1), *FOURTH)
"""Order (p, q) of each power sum: sum(u^p v^q)."""
POWER_SUMS = ["n", *("z_" + "u" * p + "v" * q for p, q in ORDERS[1:])]
"""Names of the sums of z_u^p z_v^q."""
_PLACE = {order: place for place, order in enumerate(ORDERS)}
_ON_A_LINE = 1e-12


def transformed(sums: Array, centre: Array, root: Array) -> Array:
    """Power sums of root (x - centre), from those of x.

    Parameters
    ----------
    sums : (15, ...)
        By `ORDERS`.
    centre : (2, ...)
        Of x.
    root : (3, ...)
        Lower triangular: a, b, c of ((a, 0), (b, c)).
    """
    shifted = _shifted(sums, -centre)
    a, b, c = root
    rows = []
    for p, q in ORDERS:
        terms = [comb(q, j) * b ** (q - j) * c**j * shifted[_PLACE[p + q - j, j]] for j in range(q + 1)]
        rows.append(a**p * sum(terms[1:], terms[0]))
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
        mean = dict(zip(ORDERS, transformed(sums, *whitening(sums)) / sums[0], strict=True))
    skewness = mean[3, 0] ** 2 + 3 * mean[2, 1] ** 2 + 3 * mean[1, 2] ** 2 + mean[0, 3] ** 2
    return np.stack([skewness, mean[4, 0] + 2 * mean[2, 2] + mean[0, 4]])


def _shifted(sums: Array, shift: Array) -> Array:
    """Power sums of x + shift."""
    u, v = ([axis**power for power in range(5)] for axis in shift)
    rows = []
    for p, q in ORDERS:
        terms = [
            comb(p, i) * comb(q, j) * sums[_PLACE[i, j]] * u[p - i] * v[q - j]
            for i, j in product(range(p + 1), range(q + 1))
        ]
        rows.append(sum(terms[1:], terms[0]))
    return np.stack(rows)
