"""P-values of several tests at once, and intervals that allow for a choice among several numbers.

With p_(1) <= ... <= p_(m) the p-values that there are, those that are missing left out:

- Holm's adjusted p_(i) = max over j <= i of min(1, (m - j + 1) p_(j)) (holm): to reject where it is at most alpha
  keeps the probability of any false rejection under alpha, however the tests depend on each other.
- Benjamini and Hochberg's q_(i) = min over j >= i of min(1, m p_(j) / j) (bh): to reject where it is at most alpha
  keeps the expected share of false rejections among all rejections under alpha, if the tests are independent or
  positively dependent.

The interval of a number that was chosen among k has the level 1 - (1 - level) / k (bonferroni): then all k hold
together with at least the probability `level`, however they depend on each other. Student's intervals grow by the ratio
of the quantiles of both levels.

Sources: S. Holm, Scandinavian Journal of Statistics 6 (1979); Y. Benjamini and Y. Hochberg, Journal of the Royal
Statistical Society B 57 (1995).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from tracknoise.findings.estimate import Estimate

Values = Sequence[float | None] | ArrayLike


def holm(p: Values) -> NDArray[np.float64]:
    """Adjusted p-values by (holm).

    Parameters
    ----------
    p : (tests,)
        P-values; None or NaN where there was no test, which then does not count.

    Returns
    -------
    (tests,) float64
        NaN where there was no test.
    """
    return _adjusted(p, lambda ordered: np.maximum.accumulate(np.arange(len(ordered), 0, -1) * ordered))


def benjamini_hochberg(p: Values) -> NDArray[np.float64]:
    """q-values by (bh).

    Parameters
    ----------
    p : (tests,)
        P-values; None or NaN where there was no test, which then does not count.

    Returns
    -------
    (tests,) float64
        NaN where there was no test.
    """
    return _adjusted(p, lambda ordered: np.minimum.accumulate((_shares(len(ordered)) * ordered)[::-1])[::-1])


def chosen_among(one: Estimate, choices: int, *, degrees: float) -> Estimate:
    """An estimate whose interval allows for a choice by (bonferroni).

    Parameters
    ----------
    one
        A number without limits, such as a mean, with Student's interval and its level.
    choices
        How many numbers it was chosen among; with one, nothing changes.
    degrees
        Degrees of freedom of the interval.
    """
    if choices == 1 or one.value is None or one.low is None or one.high is None or one.level is None:
        return one
    level = 1 - (1 - one.level) / choices
    before, after = (special.stdtrit(max(degrees, 1.0), (1 + each) / 2) for each in (one.level, level))
    low, high = (one.value + float(after / before) * (end - one.value) for end in (one.low, one.high))
    return replace(one, low=low, high=high, level=level)


def _shares(count: int) -> NDArray[np.float64]:
    return count / np.arange(1, count + 1)


def _adjusted(p: Values, adjust: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> NDArray[np.float64]:
    """What `adjust` makes of the p-values that there are, from the least to the largest, put back in their places."""
    values = np.array(p, dtype=np.float64)
    places = np.flatnonzero(~np.isnan(values))
    order = places[np.argsort(values[places], kind="stable")]
    values[order] = np.minimum(adjust(values[order]), 1.0)
    return values
