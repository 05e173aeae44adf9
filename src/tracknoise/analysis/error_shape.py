"""The shape of errors: skewness, kurtosis, tails, ties, and what other densities gain on held-out scenes.

Skewness and kurtosis
---------------------

Both are computed from sums that add up over scenes. Let z be the pairs, less their mean and multiplied by a root of
their inverse covariance, and E their mean:

- b1 = E(z_u^3)^2 + 3 E(z_u^2 z_v)^2 + 3 E(z_u z_v^2)^2 + E(z_v^3)^2, 0 for a Gaussian (skewness)
- b2 = E((z_u^2 + z_v^2)^2), 8 for a Gaussian (kurtosis)

To leading order the distance (Kullback-Leibler) from the Gaussian of the same mean and covariance is, in nats, b1 / 12
for skewed pairs, and (b2 / 8 - 1)^2 / 2 for elliptical ones (negentropy), by the expansion of Edgeworth.

Source: K. V. Mardia, Biometrika 57 (1970).

Tails
-----

Distances are compared with those of a Gaussian of the same mean and covariance. In two dimensions a Gaussian has
P(d2 > x) = exp(-x / 2). A share p of its errors therefore lies within the distance sqrt(-2 log(1 - p)).

Units of an age
---------------

Errors grow with age. If errors of several ages were put together as they are, a Gaussian that grows would look
heavy-tailed. For each age of a condition (or each frame, where a scan fixes the features), the mean m and the
covariance C are therefore taken from the moments of all its scenes. Each error x is then replaced by z = L^-1 (x - m),
L L^T = C (standard). The shape of z is the shape of errors whose age is known.

Units of a scene
----------------

Scenes differ in scale. Put together, Gaussian errors of such scenes look heavy-tailed. Each error is therefore compared
with the n - 1 other errors of its own scene at its own age. Where these are too few, it is compared with the other
errors of its scene in the band of ages, one per track. An error is never compared with itself: one that is far out
would make the covariance larger and hide.

With m others, mean and covariance are estimates, so that the distances of Gaussian errors are heavy-tailed:

    P(T2 > t) = (1 + t / (m - 1))^(-(m - 2) / 2),  T2 = m / (m + 1) (x - mean)^T S^-1 (x - mean)

Each distance is therefore replaced by the one that a Gaussian exceeds as often (within):

    d2 = (m - 2) log(1 + T2 / (m - 1))

Gaussian errors of any scenes are then Gaussian with covariance 1, however few others there are. Tails of other
distributions are pulled in a little where there are few others.

Ties
----

Errors are equal to one another where they lie on a grid, or where many of them are exactly zero. Densities have no
place for equal errors: a fit that shrinks onto them gains without limit. In data without a grid errors are never equal,
so that a few equal ones are enough to say so. A grid that is fine compared with the spread of errors makes few of them
equal, and does not matter.

Gains
-----

Independent units (scenes, or blocks of tracks) are put into a few folds. Each fold is scored by what was fitted to all
others. The score is the log-likelihood that a density gives to what it was not fitted to, less that of the Gaussian
fitted to the same, in nats per error (gain). More parameters alone give no gain.

Student's t is fitted to all errors first. The fits to all folds but one start from there, have not far to go, and reach
their own optimum to 1e-5 nats. Fits of the mixture may not reach it where its components are hardly distinguishable,
and would keep information on the fold that is left out. Each of them therefore starts from its usual start.
"""

from collections.abc import Iterable, Sequence
from functools import reduce
from itertools import product
from math import comb
from operator import add, mul

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import additive
from tracknoise.inference.densities import (
    Gains,
    Mixture,
    Student,
    determinant,
    fit_gaussian,
    fit_mixture,
    fit_student,
    gathered,
    terms,
)
from tracknoise.inference.units import sorting
from tracknoise.statistics.grouping import group_rows, number_names
from tracknoise.statistics.moments import FOURTH
from tracknoise.tables.enumerations import Trimming
from tracknoise.words import number, percent

Array = NDArray[np.float64]
Order = tuple[int, int]

ORDERS = ((0, 0), (1, 0), (0, 1), *FOURTH)
"""Order (p, q) of each power sum: sum(u^p v^q)."""
POWER_SUMS = ["n", *("z_" + "u" * p + "v" * q for p, q in ORDERS[1:])]
"""Names of the sums of z_u^p z_v^q."""
_MARDIA_PLACE = {order: place for place, order in enumerate(ORDERS)}
_OF_SHAPE = ((3, 0), (2, 1), (1, 2), (0, 3), (4, 0), (2, 2), (0, 4))
"""Orders that skewness and kurtosis are made of."""
_ON_A_LINE = 1e-12


def transformed(sums: Array, centre: Array, root: Array, orders: Sequence[Order] = ORDERS) -> Array:
    """Power sums of root (x - centre), from those of x. Shapes: sums (15, ...), centre (2, ...), root (3, ...)."""
    shifted = _shifted(sums, -centre, {(p + q - j, j) for p, q in orders for j in range(q + 1)})
    a, b, c = map(_powers, root)
    rows = []
    for p, q in orders:
        terms = (_product(comb(q, j), b[q - j], c[j], shifted[p + q - j, j]) for j in range(q + 1))
        rows.append(_product(a[p], reduce(add, terms)))
    return np.stack(rows)


def whitening(sums: Array) -> tuple[Array, Array]:
    """Mean, (2, ...), and lower triangular root of the inverse covariance, (3, ...); NaN where pairs lie on a line.

    Shapes: sums (15, ...).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v, uu, uv, vv = sums[1:6] / sums[0]
        uu, uv, vv = uu - u * u, uv - u * v, vv - v * v
        plane = (uu > 0) & (vv > 0) & (uu * vv - uv * uv > _ON_A_LINE * uu * vv)
        a = 1 / np.sqrt(np.where(plane, uu, np.nan))
        c = 1 / np.sqrt(np.where(plane, vv - uv * uv / uu, np.nan))
        return np.stack([u, v]), np.stack([a, -uv / uu * c, c])


def mardia(sums: Array) -> Array:
    """b1 and b2 by (skewness) and (kurtosis), (2, ...); NaN where pairs lie on a line. Shapes: sums (15, ...)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        moments = transformed(sums, *whitening(sums), orders=_OF_SHAPE) / sums[0]
    mean = dict(zip(_OF_SHAPE, moments, strict=True))
    skewness = mean[3, 0] ** 2 + 3 * mean[2, 1] ** 2 + 3 * mean[1, 2] ** 2 + mean[0, 3] ** 2
    return np.stack([skewness, mean[4, 0] + 2 * mean[2, 2] + mean[0, 4]])


def _shifted(sums: Array, shift: Array, orders: Iterable[Order]) -> dict[Order, Array]:
    """Power sums of x + shift, by order."""
    u, v = map(_powers, shift)
    shifted = {}
    for p, q in orders:
        parts = product(range(p + 1), range(q + 1))
        terms = (_product(comb(p, i) * comb(q, j), sums[_MARDIA_PLACE[i, j]], u[p - i], v[q - j]) for i, j in parts)
        shifted[p, q] = reduce(add, terms)
    return shifted


def _powers(values: Array) -> list[Array | int]:
    """Powers of order 0 to 4, as products: the power function takes forty times as long."""
    square = values * values
    return [1, values, square, square * values, square * square]


def _product(*factors: Array | int) -> Array:
    """Product from left to right; most of the time of many draws is spent here, so factors of 1 are left out."""
    return np.asarray(reduce(mul, [factor for factor in factors if not isinstance(factor, int) or factor != 1]))


TAILS = ((9.21, 0.01), (13.82, 0.001))
"""Squared distances, and how many errors of a Gaussian are beyond, rounded."""
PROBABILITIES = (0.05, *(step / 10 for step in range(1, 10)), 0.95, 0.98, 0.99, 0.995, 0.999)
_BEYOND = 5
"""Fewest errors beyond a quantile that is reported."""


def tail_ratios(squared: Array) -> tuple[float, ...]:
    """P(d2 > x) over that of a Gaussian for each of `TAILS`.

    NaN where a Gaussian would have less than one error there.
    """
    n = len(squared)
    return tuple(np.count_nonzero(squared > x) / (n * p) if n * p >= 1 else np.nan for x, p in TAILS)


def radii(squared: Array) -> tuple[Array, Array, Array]:
    """Probabilities, and quantiles of the distance: of a Gaussian and observed, as far as there are errors beyond."""
    probabilities = np.array([p for p in PROBABILITIES if len(squared) * (1 - p) >= _BEYOND])
    if not len(probabilities):
        return probabilities, np.empty(0), np.empty(0)
    places, distances = np.arange(len(squared)), np.sqrt(np.sort(squared))
    observed = np.interp(probabilities * (len(squared) - 1), places, distances)
    return probabilities, np.sqrt(-2 * np.log1p(-probabilities)), observed


Rows = NDArray[np.intp]

_STANDARD_PLACE = ["trimming", "at"]
_STANDARD_SUMS = ["n", "u", "v", "uu", "uv", "vv"]
_STANDARD = ["centre_u", "centre_v", "root_a", "root_b", "root_c"]
_CENTRAL = ["m_" + "u" * p + "v" * q for p, q in FOURTH]


def standards(moments: pl.DataFrame, *, min_features: int) -> pl.DataFrame:
    """Return m and L^-1 of (standard) by trimming and age of one condition, where errors are many and have a spread.

    Returns: trimming, at, the parts of m, and the lower triangle a, b, c of L^-1.
    """
    groups = group_rows(moments, _STANDARD_PLACE)
    columns = additive(moments).select_seq(_STANDARD_SUMS).to_numpy().T
    sums = np.stack([np.bincount(groups.index, column, groups.count) for column in columns]).astype(np.float64)
    table = groups.keys.hstack(pl.DataFrame(dict(zip(_STANDARD, np.concatenate(whitening(sums)), strict=True))))
    return table.filter(pl.Series(sums[0] >= min_features) & pl.col("root_c").is_finite())


def standard_sums(moments: pl.DataFrame, standard: pl.DataFrame) -> pl.DataFrame:
    """Sums of powers of z in place of moments; rows whose age has no standard are left out.

    Returns: the columns that are no moments, and `POWER_SUMS`.
    """
    rows = moments.join(standard, on=_STANDARD_PLACE, maintain_order="left")
    zeros = [pl.lit(0.0).alias(name) for name in ("first_u", "first_v")]  # sums of order 1 about a row's own mean
    central = rows.select_seq("n", *zeros, *_CENTRAL).to_numpy().T.astype(np.float64)
    centre, root = _parts(rows)
    sums = transformed(central, centre - rows.select_seq("mean_u", "mean_v").to_numpy().T, root)
    labels = rows.select_seq(pl.exclude("^(n|m_.*|mean_.*|centre_.|root_.)$"))
    return labels.hstack(pl.DataFrame(dict(zip(POWER_SUMS, sums, strict=True))))


def standardised(samples: pl.DataFrame, standard: pl.DataFrame) -> pl.DataFrame:
    """Single errors as z, untrimmed and trimmed; those whose age has no standard are left out.

    Returns: sorted by scene, otherwise as they were, with `z_u`, `z_v`, and `log_spread`, the logarithm of the mean
    spread of a coordinate at that age, log px: a quarter of that of the determinant of C. `samples`: those of a scene
    sorted.
    """
    kept = np.flatnonzero(samples["kept"].to_numpy())
    selected = {Trimming.untrimmed: np.arange(samples.height), Trimming.trimmed: kept}
    standardised_parts = [_with_standard(samples, rows, standard, trimming) for trimming, rows in selected.items()]
    rows, of = (np.concatenate(parts) for parts in zip(*standardised_parts, strict=True))
    _, scene = number_names(samples["scene"])
    order = sorting(scene[rows])
    rows, of = rows[order], of[order]
    (centre_u, centre_v), (a, b, c) = (each[:, of] for each in _parts(standard))
    errors = samples.select_seq("age_low", "at", "dataset", "scene", "block", "track", "du_px", "dv_px")[rows]
    u, v = errors["du_px"].to_numpy() - centre_u, errors["dv_px"].to_numpy() - centre_v
    columns = {"z_u": a * u, "z_v": b * u + c * v, "log_spread": -0.5 * np.log(a * c)}
    labels = [standard["trimming"][of], *errors]
    return pl.DataFrame([*labels, *(pl.Series(name, values, dtype=pl.Float64) for name, values in columns.items())])


def _with_standard(samples: pl.DataFrame, rows: Rows, standard: pl.DataFrame, trimming: Trimming) -> tuple[Rows, Rows]:
    """Those of the rows whose age has a standard, and the row of this; standards are sorted by age."""
    own = np.flatnonzero((standard["trimming"] == trimming).to_numpy())
    at, ages = samples["at"].to_numpy()[rows], standard["at"].to_numpy()[own]
    place = np.searchsorted(ages, at)
    has = np.append(ages, at.max(initial=0) + 1)[place] == at
    return rows[has], own[place[has]]


def _parts(rows: pl.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    columns = rows.select_seq(_STANDARD).to_numpy().T
    return columns[:2], columns[2:]


MIN_OTHERS = 30
"""Fewest other errors that one is compared with."""
_OWN_AGE = ["trimming", "at", "scene"]
_OWN_BAND = ["trimming", "age_low", "scene"]
_WITHIN_SUMS = ["n", "z_u", "z_v", "z_uu", "z_uv", "z_vv"]


def within_scenes(singles: pl.DataFrame, sums: pl.DataFrame) -> Array:
    """Single errors by (within), (rows, 2); NaN where there are too few others, or these lie on a line."""
    z = singles.select_seq("z_u", "z_v").to_numpy()
    own = np.stack([np.ones(len(z)), *z.T, z[:, 0] ** 2, z[:, 0] * z[:, 1], z[:, 1] ** 2])
    ages = singles.select_seq(_OWN_AGE).join(
        sums.select_seq(*_OWN_AGE, *_WITHIN_SUMS), on=_OWN_AGE, how="left", maintain_order="left"
    )
    others = ages.select_seq(pl.col(_WITHIN_SUMS).fill_null(0.0)).to_numpy().T - own
    few = others[0] < MIN_OTHERS
    if few.any():
        others = np.where(few, _of_bands(singles, own) - own, others)
    return _compared(z, np.where(others[0] < MIN_OTHERS, np.nan, others))


def _of_bands(singles: pl.DataFrame, own: Array) -> Array:
    """Sums over the single errors of the same scene and band, (6, rows)."""
    groups = group_rows(singles, _OWN_BAND)
    return np.stack([np.bincount(groups.index, row, groups.count)[groups.index] for row in own])


def _compared(z: Array, others: Array) -> Array:
    """(within) of each error, given the sums of the others."""
    mean, (a, b, c) = whitening(others)
    u, v = z.T - mean
    m = others[0]
    white = np.stack([a * u, b * u + c * v]) * np.sqrt((m - 1) / m)  # S divides by m - 1
    distance = np.square(white).sum(axis=0)
    expected = (m - 2) * np.log1p(distance * m / (m + 1) / (m - 1))
    scale = np.sqrt(expected / np.where(distance > 0, distance, 1.0))
    return np.asarray((white * scale).T)


ON_GRID = "errors lie on a grid of"
"""How the words begin that name a grid."""
MIN_EQUAL = 3
"""Fewest equal errors that count."""
MAX_SHARE, MAX_SHARE_OF_AXIS = 0.005, 0.05
"""Largest share of errors that may be equal in u and v, or in one of them."""
_WHOLE = 1e-3
"""How far from a whole number of steps a value on a grid may be, in steps."""
_FINEST = 1e-6
"""Steps that are smaller than this, relative to the largest error, are rounding."""


def ties(errors: Array) -> str | None:
    """What makes errors equal to one another, in words; None if too few are to matter. Shapes: errors (n, 2) px."""
    of_axis = max((_commonest(axis) for axis in errors.T), default=0.0)
    pairs = np.ascontiguousarray(errors + 0.0).view(np.complex128)  # -0.0 counts as 0.0
    share = _commonest(pairs) if of_axis else 0.0  # equal pairs are equal in u
    if share <= MAX_SHARE and of_axis <= MAX_SHARE_OF_AXIS:
        return None
    zero = float(np.mean((errors == 0).any(axis=1)))
    steps = [_step(axis) for axis in errors.T]
    grid = next((step for step in steps if step is not None), None)
    if grid is not None:
        return f"{ON_GRID} {_fraction(grid)} px: a density cannot be fitted to them"
    what = (
        f"{percent(zero)} of errors are exactly zero" if zero > share / 2 else f"{percent(share)} of errors are equal"
    )
    return f"{what}: a density cannot be fitted to them"


def _commonest(values: NDArray[np.complex128] | Array) -> float:
    """Share of the commonest value; 0 if fewer than `MIN_EQUAL` are equal."""
    ordered = np.sort(values)
    if not (ordered[1:] == ordered[:-1]).any():  # as mostly: counting takes longer than sorting
        return 0.0
    most = int(np.unique(ordered, return_counts=True)[1].max())
    return most / values.size if most >= MIN_EQUAL else 0.0


def _step(values: Array) -> float | None:
    """Step of the grid that all values are on; None if there is none."""
    places = np.unique(values)
    apart = np.diff(places)
    apart = apart[apart > _FINEST * np.abs(values).max(initial=0.0)]
    if not len(apart) or len(places) == values.size:
        return None
    step = float(apart.min())
    return step if (np.abs(places / step - np.round(places / step)) < _WHOLE).all() else None


def _fraction(step: float) -> str:
    parts = round(1 / step) if step < 1 else 0
    return f"1/{parts}" if parts and abs(parts * step - 1) < _WHOLE else number(step)


MIN_FITTED = 50
"""Fewest errors outside of each fold."""
MAX_FITTED = 768
"""Most errors that are fitted; all errors of a fold are scored."""
ROUNDS = 15
"""Of the fits of Student's t that start from that of all errors."""


def gains(pairs: Array, sample: Rows, fold: Rows, count: int) -> Gains:
    """Work out (gain) for several samples at once. Shapes: pairs (rows, 2), sample (rows,), fold (rows,)."""
    every = terms([pairs])[0]
    samples = [np.flatnonzero(sample == place) for place in range(count)]
    split = [_split(rows, fold) for rows in samples]
    sums = _sums(every, sample, fold, count)
    usable = [place for place, parts in enumerate(split) if parts and _can_be_fitted(sums[:, place])]
    student, mixture = np.full(len(pairs), np.nan), np.full(len(pairs), np.nan)
    parameters = np.full((4, count), np.nan)
    if usable:
        parts = [part for place in usable for part in split[place]]
        of = np.repeat(np.arange(len(usable)), [len(split[place]) for place in usable])
        whole = fit_student(gathered(every, [_thinned(samples[place]) for place in usable]))
        start = Student(whole.mean[of], whole.scatter[of], whole.nu[of])
        heavy, mixed, gained = _scored(every, parts, start)
        for (rows, _), one, other in zip(parts, *gained, strict=True):
            student[rows], mixture[rows] = one[: len(rows)], other[: len(rows)]
        parameters[:, usable] = _parameters(heavy, mixed, of)
    return Gains(student, mixture, *parameters)


def _scored(every: Array, parts: list[tuple[Rows, Rows]], start: Student) -> tuple[Student, Mixture, Array]:
    """Fits to all folds but one, and their (gain) on that fold, (2, folds, most errors). The t starts at `start`."""
    fitted = gathered(every, [_thinned(rest) for _, rest in parts])
    heavy, mixed = fit_student(fitted, rounds=ROUNDS, start=start), fit_mixture(fitted)
    scored = gathered(every, [rows for rows, _ in parts])
    base = fit_gaussian(fitted).log_density(scored)
    return heavy, mixed, np.stack([heavy.log_density(scored), mixed.log_density(scored)]) - base


def _parameters(heavy: Student, mixed: Mixture, of: Rows) -> Array:
    """nu, spread, share and ratio of each sample, from the fits of its folds, which follow one another."""
    each = np.log([heavy.nu, determinant(heavy.scatter) ** 0.25, mixed.share, mixed.ratio])
    means: Array = np.exp(np.stack([np.bincount(of, row) for row in each]) / np.bincount(of))
    return means


def _split(rows: Rows, fold: Rows) -> list[tuple[Rows, Rows]]:
    """Rows of each fold of a sample, and all others; empty if there is only one fold."""
    own = fold[rows]
    names = np.flatnonzero(np.bincount(own))
    inside = [own == name for name in names]
    return [(rows[each], rows[~each]) for each in inside] if len(names) > 1 else []


def _sums(every: Array, sample: Rows, fold: Rows, count: int) -> Array:
    """Sums of the terms over each fold of each sample, (6, count, folds); 0 where it has no such fold."""
    folds = int(fold.max(initial=0)) + 1
    place = sample * folds + fold
    totals: Array = np.stack([np.bincount(place, term, count * folds) for term in every])
    return totals.reshape(len(every), count, folds)


def _can_be_fitted(sums: Array) -> bool:
    """Whether there is enough outside of each fold, with a spread, from the sums of the terms over each."""
    folds = sums[:, sums[0] > 0]
    rest = folds.sum(axis=1, keepdims=True) - folds
    return bool(rest[0].min() >= MIN_FITTED and np.isfinite(whitening(rest)[1]).all())


def _thinned(rows: Rows) -> Rows:
    """At most `MAX_FITTED` of the rows, evenly spread over them."""
    if len(rows) <= MAX_FITTED:
        return rows
    return rows[np.arange(MAX_FITTED) * len(rows) // MAX_FITTED]
