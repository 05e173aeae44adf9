"""Joint central moments of grouped pairs of numbers, of any order, and the pooling of groups.

Arrays only. A central power sum of order (p, q) is sum((x - mean_x)^p (y - mean_y)^q), not divided by the count.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

Order = tuple[int, int]

FOURTH: tuple[Order, ...] = tuple((total - q, q) for total in (2, 3, 4) for q in range(total + 1))
"""(2, 0), (1, 1), (0, 2), (3, 0), ... (0, 4): every joint order from 2 to 4."""
VARIANCES: tuple[Order, ...] = ((2, 0), (0, 2))


@dataclass(frozen=True, slots=True)
class JointMoments:
    """Moments of g samples of pairs (x, y).

    Attributes
    ----------
    orders
        Order (p, q) of each column of `central`. With an order, every lower one down to 2 in total that its binomial
        expansion needs must be there.
    n : (g,) int64
        Pairs in each sample.
    mean : (g, 2) float64
        0 where `n` is 0.
    central : (g, len(orders)) float64
        Central power sums.
    """

    orders: tuple[Order, ...]
    n: NDArray[np.int64]
    mean: NDArray[np.float64]
    central: NDArray[np.float64]

    def of(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> "JointMoments":
        """Moments of some samples: which, (g,) bool, or their numbers."""
        return JointMoments(self.orders, self.n[chosen], self.mean[chosen], self.central[chosen])


def stack_moments(parts: Sequence[JointMoments]) -> JointMoments:
    """The samples of several moments of the same orders, one after another."""
    n, mean, central = (np.concatenate([getattr(part, name) for part in parts]) for name in ("n", "mean", "central"))
    return JointMoments(parts[0].orders, n, mean, central)


def measure_moments(
    pairs: NDArray[np.float64], group: NDArray[np.intp], count: int, *, orders: Sequence[Order] = FOURTH
) -> JointMoments:
    """Moments of each group of pairs, in two passes: means first, then powers of what differs from them.

    Parameters
    ----------
    pairs
        (rows, 2) float64.
    group
        (rows,) intp, under `count`.
    count
        Number of groups; some may be empty.
    orders
        Which central power sums.
    """
    n = np.bincount(group, minlength=count)
    means, deviations = _centre(pairs, group, n)
    highest = max((max(order) for order in orders), default=0)
    x, y = (_powers(deviation, highest) for deviation in deviations)
    central = [np.bincount(group, x[p] * y[q], count) for p, q in orders]
    return JointMoments(tuple(orders), n, np.stack(means, axis=1), _columns(central, count))


def pool_moments(parts: JointMoments, group: NDArray[np.intp], count: int) -> JointMoments:
    """Moments of the union of the samples in each group, from the moments of the samples alone.

    Shifting a sample's central power sums to the pooled mean is a binomial expansion, which is exact (Chan, Golub and
    LeVeque 1979 for order 2, Pebay 2008 for higher and joint orders); the shifted sums then add up.

    Parameters
    ----------
    parts
        Moments of the samples; those with n = 0 change nothing.
    group
        (samples,) intp, under `count`.
    count
        Number of groups.
    """
    n = np.bincount(group, parts.n, count).astype(np.int64)
    means, shifts = _centre(parts.mean, group, n, weight=parts.n)
    central = [np.bincount(group, _about(parts, shifts, order), count) for order in parts.orders]
    return JointMoments(parts.orders, n, np.stack(means, axis=1), _columns(central, count))


def _centre(
    pairs: NDArray[np.float64],
    group: NDArray[np.intp],
    n: NDArray[np.int64],
    *,
    weight: NDArray[np.int64] | None = None,
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Of both columns the weighted mean of each group, (g,), and what each row differs from it, (rows,)."""
    means, deviations = [], []
    for column in np.ascontiguousarray(pairs.T):
        mean, deviation = np.zeros(len(n)), column
        for _ in range(2):  # the second round removes what rounding left of a mean that is large beside the spread
            weighted = deviation if weight is None else weight * deviation
            step = np.bincount(group, weighted, len(n)) / np.maximum(n, 1)
            mean, deviation = mean + step, deviation - step[group]
        means.append(mean)
        deviations.append(deviation)
    return means, deviations


def _columns(values: Sequence[NDArray[Any]], count: int) -> NDArray[np.float64]:
    """Arrays of (count,) side by side; there may be none."""
    return np.array(values, dtype=np.float64).reshape(len(values), count).T


def _about(parts: JointMoments, shifts: Sequence[NDArray[np.float64]], order: Order) -> NDArray[np.float64]:
    """Power sum of one order of each sample about the point that lies `shifts` below its mean, (samples,)."""
    p, q = order
    x, y = _powers(shifts[0], p), _powers(shifts[1], q)
    total = parts.n * x[p] * y[q]  # sums of order 1 about the sample's own mean are 0
    for column, (a, b) in enumerate(parts.orders):
        if a <= p and b <= q:
            total = total + comb(p, a) * comb(q, b) * parts.central[:, column] * x[p - a] * y[q - b]
    return total


def _powers(values: NDArray[np.float64], highest: int) -> list[NDArray[np.float64]]:
    """values^0 to values^highest."""
    powers = [np.ones_like(values)]
    for _ in range(highest):
        powers.append(powers[-1] * values)
    return powers
