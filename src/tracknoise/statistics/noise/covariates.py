"""Changes of errors by what a front end knows while it runs: motion of the image, and quality that trackers report.

A covariate is divided into classes of half an octave, c = floor(2 log2(x)) (covariates.class). For each pair of
classes, at the first and the second end of a change (error_products.change), the sums of half its squared length and of
what multiplies the components in its expectation are kept. With a factor f(x) on W and Q, and half traces w, q and d,

    E[|c|^2 / 2] = w (f_now + r^2 f_before) + q s f_now + d (k - r k')^2    (covariates.expected)
"""

from collections.abc import Iterator, Mapping

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.noise.error_products import Products
from tracknoise.statistics.noise.error_tracks import ErrorTracks
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import NOISE_COVARIATES, QUALITY_PREFIX, check, empty

MOTION = "motion_px"
"""Motion of the image: distance of the true positions in two frames in succession of the tracker, px.

That of the observed positions contains the error, and would explain it by itself. A front end knows the motion from its
prediction, or from the features around.
"""
PER_OCTAVE = 2
_FURTHEST = 40
TERMS = ("squares", "white_before", "walk", "drift")
"""Sums over changes, besides their count."""


def class_of(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Classes by (covariates.class), (n,) intp, of numbers that are not NaN; the last ones beyond 2^-20 and 2^20."""
    with np.errstate(divide="ignore"):
        place = np.floor(PER_OCTAVE * np.log2(np.maximum(values, 0.0)))
    return np.asarray(np.clip(place, -_FURTHEST, _FURTHEST), dtype=np.intp)


def log_centre(classes: NDArray[np.int64], per_octave: int = PER_OCTAVE) -> NDArray[np.float64]:
    """Natural logarithm of the middle of each class, (n,) float64."""
    return np.asarray((classes + 0.5) / per_octave * np.log(2.0))


def noise_covariates(sequence: PreparedSequence, tracks: ErrorTracks, changes: Products) -> pl.DataFrame:
    """Sums over changes by the classes of each covariate at both of their ends.

    Parameters
    ----------
    sequence
        Whose observations may have columns ``quality_<name>``.
    tracks
        Its errors.
    changes
        Products of changes, as `tracknoise.statistics.noise.error_products.products` makes them.

    Returns
    -------
    polars.DataFrame
        Schema `NOISE_COVARIATES`, sorted.
    """
    parts = [_summed(sequence, tracks, changes, name, values) for name, values in covariates_of(sequence, tracks)]
    keys = [name for name in NOISE_COVARIATES if name not in ("n", *TERMS)]
    return check(pl.concat([empty(NOISE_COVARIATES), *parts]).sort(keys), NOISE_COVARIATES, "noise covariates")


def covariates_of(sequence: PreparedSequence, tracks: ErrorTracks) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Names, and values of all observations of the tracks, (n,); NaN where unknown."""
    yield MOTION, np.hypot(*tracks.motion_px.T)
    for column in sequence.observations.columns:
        if column.startswith(QUALITY_PREFIX):
            values = sequence.observations[column].to_numpy()[tracks.rows].astype(np.float64)
            yield column.removeprefix(QUALITY_PREFIX), values


def sums_by_class(
    sequence: PreparedSequence, tracks: ErrorTracks, changes: Products, classes: Mapping[str, NDArray[np.float64]]
) -> pl.DataFrame:
    """Sums of every condition and combination of classes.

    Parameters
    ----------
    sequence, tracks, changes
        As in `noise_covariates`.
    classes
        (changes,) by the name of a column; NaN where a covariate is unknown. Such changes do not count.

    Returns
    -------
    polars.DataFrame
        The columns of the conditions, of the classes, n and `TERMS`.
    """
    known = np.flatnonzero(~np.isnan(np.stack(list(classes.values()))).any(axis=0))
    condition = sequence.seen.condition[tracks.rows[changes.rows[known]]]
    numbers = [values[known].astype(np.intp) for values in classes.values()]
    least = [number.min(initial=_FURTHEST) for number in numbers]  # few combinations are found fast
    counted = [number - lowest for number, lowest in zip(numbers, least, strict=True)]
    (conditions, *combined), index = number_combinations([condition, *counted])
    terms = {
        "squares": 0.5 * (changes.values[known, 0] + changes.values[known, 2]),
        "white_before": changes.factors[known, 1] - 1.0,
        "walk": changes.factors[known, 2],
        "drift": changes.factors[known, 3],
    }
    sums = {term: np.bincount(index, each, len(conditions)) for term, each in terms.items()}
    labels = {name: values + lowest for name, values, lowest in zip(classes, combined, least, strict=True)}
    counts = {"n": np.bincount(index, minlength=len(conditions))}
    return sequence.seen.conditions[conditions].hstack(pl.DataFrame({**labels, **counts, **sums}))


def _summed(
    sequence: PreparedSequence, tracks: ErrorTracks, changes: Products, name: str, values: NDArray[np.float64]
) -> pl.DataFrame:
    ends = {"before": changes.rows - 1, "now": changes.rows}
    classes = {end: known_classes(values[rows]) for end, rows in ends.items()}
    table = sums_by_class(sequence, tracks, changes, classes)
    return table.with_columns(covariate=pl.lit(name)).select(
        pl.col(column).cast(kind) for column, kind in NOISE_COVARIATES.items()
    )


def known_classes(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Classes by (covariates.class), (n,) float64; NaN where a value is."""
    unknown = np.isnan(values)
    return np.where(unknown, np.nan, class_of(np.where(unknown, 1.0, values)))
