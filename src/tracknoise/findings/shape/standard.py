"""Errors in units of their age: less the mean of all errors of that age, and whitened by their covariance.

Errors grow with age. Were those of several ages put together as they are, a Gaussian that grows would look
heavy-tailed. Of each age of a condition (or each frame, where a scan fixes the features) the mean m and the
covariance C are therefore taken from the moments of all its scenes, and z = L^-1 (x - m), L L^T = C, is looked at in
place of x (standard). What z looks like is then the shape of errors whose age is known.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.units import additive
from tracknoise.findings.shape.mardia import POWER_SUMS, transformed, whitening
from tracknoise.statistics.errors.joint import FOURTH
from tracknoise.statistics.grouping import by_group, group_rows, number_names
from tracknoise.tables.enumerations import Trimming

Rows = NDArray[np.intp]

_PLACE = ["trimming", "at"]
_SUMS = ["n", "u", "v", "uu", "uv", "vv"]
_STANDARD = ["centre_u", "centre_v", "root_a", "root_b", "root_c"]
_CENTRAL = ["m_" + "u" * p + "v" * q for p, q in FOURTH]


def standards(moments: pl.DataFrame, *, min_features: int) -> pl.DataFrame:
    """Return m and L^-1 of (standard) by trimming and age of one condition, where errors are many and have a spread.

    Parameters
    ----------
    moments
        Rows of one condition, of visible errors, with at least one error each.
    min_features
        Fewest errors of an age.

    Returns
    -------
    polars.DataFrame
        trimming, at, the parts of m, and the lower triangle a, b, c of L^-1.
    """
    groups = group_rows(moments, _PLACE)
    columns = additive(moments).select_seq(_SUMS).to_numpy().T
    sums = np.stack([np.bincount(groups.index, column, groups.count) for column in columns]).astype(np.float64)
    found = groups.keys.hstack(pl.DataFrame(dict(zip(_STANDARD, np.concatenate(whitening(sums)), strict=True))))
    return found.filter(pl.Series(sums[0] >= min_features) & pl.col("root_c").is_finite())


def standard_sums(moments: pl.DataFrame, standard: pl.DataFrame) -> pl.DataFrame:
    """Sums of powers of z in place of moments; rows whose age has no standard are left out.

    Parameters
    ----------
    moments
        Rows of one condition.
    standard
        What `standards` returned.

    Returns
    -------
    polars.DataFrame
        The columns that are no moments, and `POWER_SUMS`.
    """
    rows = moments.join(standard, on=_PLACE, maintain_order="left")
    zeros = [pl.lit(0.0).alias(name) for name in ("first_u", "first_v")]  # sums of order 1 about a row's own mean
    central = rows.select_seq("n", *zeros, *_CENTRAL).to_numpy().T.astype(np.float64)
    centre, root = _parts(rows)
    sums = transformed(central, centre - rows.select_seq("mean_u", "mean_v").to_numpy().T, root)
    labels = rows.select_seq(pl.exclude("^(n|m_.*|mean_.*|centre_.|root_.)$"))
    return labels.hstack(pl.DataFrame(dict(zip(POWER_SUMS, sums, strict=True))))


def standardised(samples: pl.DataFrame, standard: pl.DataFrame) -> pl.DataFrame:
    """Single errors as z, untrimmed and trimmed; those whose age has no standard are left out.

    Parameters
    ----------
    samples
        Rows of one condition, as in `SAMPLES`; those of a scene sorted.
    standard
        What `standards` returned.

    Returns
    -------
    polars.DataFrame
        Sorted by scene, otherwise as they were, with `z_u`, `z_v`, and `log_spread`, the logarithm of the mean spread
        of a coordinate at that age, log px: a quarter of that of the determinant of C.
    """
    kept = np.flatnonzero(samples["kept"].to_numpy())
    selected = {Trimming.untrimmed: np.arange(samples.height), Trimming.trimmed: kept}
    found = [_with_standard(samples, rows, standard, trimming) for trimming, rows in selected.items()]
    rows, of = (np.concatenate(parts) for parts in zip(*found, strict=True))
    names, scene = number_names(samples["scene"])
    order = by_group(scene[rows], len(names))
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
