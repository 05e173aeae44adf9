"""What noise models are fitted to: products of errors of tracks, and changes of errors by what a front end knows.

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
tracker, and P_k the sum of s / M_i^2 over its frames i up to k. All follow from (noise_model.track), and are computed
from it. The sums of these four factors over tracks are kept, so that any number of scenes can be added up before the
fit.

Tails must not decide what the bulk is like. Errors larger than ten times the median of the condition and sequence, as a
Gaussian of that median would have it, are left out and counted (`tracknoise.statistics.noise_sums.OUTLIER`).

Changes are summed by covariates, too: motion of the image, and quality that trackers report. A covariate is divided
into classes of half an octave, c = floor(2 log2(x)) (covariates.class). For each pair of classes, at the first and the
second end of a change, the sums of half its squared length and of what multiplies the components in its expectation are
kept. With a factor f(x) on W and Q, and half traces w, q and d,

    E[|c|^2 / 2] = w (f_now + r^2 f_before) + q s f_now + d (k - r k')^2    (covariates.expected)

Sums by two covariates together show what they have in common. Their classes are of an octave, c = floor(log2(x)),
because there are many combinations.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations, islice, pairwise

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.projection import FrameGeometry
from tracknoise.inference.track_noise import NAMES, Seen, changed, shares
from tracknoise.statistics.changes import followers
from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.prepared import PreparedSequence, track_runs
from tracknoise.tables.enumerations import Product
from tracknoise.tables.schema import (
    CHANGE_TERMS,
    NOISE_COVARIATES,
    NOISE_OUTLIERS,
    NOISE_PAIRS,
    NOISE_SUMS,
    ORIGIN,
    PRODUCT,
    QUALITY_PREFIX,
    TRACK_ERRORS,
    check,
    empty,
    layout_of,
    typed,
)


def true_points(sequence: PreparedSequence, geometry: FrameGeometry, born: NDArray[np.intp]) -> NDArray[np.float64]:
    """Points of tracks in the world, (tracks, 3) float64, metres; NaN where the depth is unknown."""
    depth_m = sequence.tracks["depth_m"].to_numpy()[sequence.track_row[born]]
    return geometry.unproject(sequence.seen.frame[born], sequence.true_px[born], depth_m)


@dataclass(frozen=True, slots=True, eq=False)
class ErrorTracks:
    """Observations of all tracks, in the order of condition, track and frame, each up to the same age."""

    rows: NDArray[np.intp]  # (n,): rows of the observations table
    track: NDArray[np.intp]  # (n,): a number for each track
    # frame, speed: (n,): of each observation
    frame: NDArray[np.int64]
    speed: NDArray[np.int64]
    age: NDArray[np.float64]  # (n,): frames of the recording since birth
    # (n, 2): about the first position; NaN where it is unknown or hidden, and for outliers
    error_px: NDArray[np.float64]
    outlier: NDArray[np.bool_]  # (n,): whether the error is beyond the limit
    limit_px: NDArray[np.float64]  # (conditions,): limit of each condition; NaN where it has no errors
    magnification: NDArray[np.float64]  # (n,): M_k = Z_0 / Z_k; 1 where the depth is unknown
    # (n,): sum of s / M_i^2 over the frames i of the tracker since birth, s frames of the recording apart
    walked: NDArray[np.float64]
    motion_px: NDArray[np.float64]  # (n, 2): motion of the true position since the observation before; NaN at birth

    def before(self, steps: int) -> NDArray[np.intp]:
        """Places of known errors that have a known error so many frames of the tracker before, in the row above."""
        late = followers(self.track, self.frame, self.speed, steps)
        is_known = ~np.isnan(self.error_px[:, 0])
        return late[is_known[late] & is_known[late - steps]]


STEPS = 30
"""Largest age, in frames that the tracker saw."""
OUTLIER = 10.0
"""Errors are outliers beyond this many standard deviations, by the median of their length."""
_MEDIAN_LENGTH = float(np.sqrt(2.0 * np.log(2.0)))
"""Median length of pairs of independent Gaussian numbers of standard deviation 1."""


def error_tracks(sequence: PreparedSequence, geometry: FrameGeometry) -> ErrorTracks:
    """Errors of all tracks of a sequence; visible ones only."""
    seen = sequence.seen
    rows = sequence.ordered[(seen.age <= STEPS * seen.speed)[sequence.ordered]]
    track, frame, age = sequence.track_row[rows], seen.frame[rows], seen.age[rows].astype(np.float64)
    error = np.where(seen.visible[rows, None], seen.error_px[rows], np.nan)
    outlier, limit = _outliers(error, age, seen.condition[rows], seen.conditions.height)
    begins, length = track_runs(track)
    magnification = np.nan_to_num(magnifications(sequence, geometry, rows, begins, length), nan=1.0)
    steps = np.diff(age, prepend=0.0) / magnification**2
    steps[begins] = 0.0
    walked = np.cumsum(steps)
    motion = np.diff(sequence.true_px[rows], axis=0, prepend=np.nan)
    motion[begins] = np.nan
    return ErrorTracks(
        rows=rows,
        track=track,
        frame=frame,
        speed=seen.speed[rows],
        age=age,
        error_px=np.where(outlier[:, None], np.nan, error),
        outlier=outlier,
        limit_px=limit,
        magnification=magnification,
        walked=walked - np.repeat(walked[begins], length),
        motion_px=motion,
    )


def magnifications(
    sequence: PreparedSequence,
    geometry: FrameGeometry,
    rows: NDArray[np.intp],
    begins: NDArray[np.intp],
    length: NDArray[np.intp],
) -> NDArray[np.float64]:
    """(n,) float64: M_k of the observations `rows`; NaN where the point is not in front of both cameras.

    `begins`, `length`: where each track begins in `rows`, and how many of them it has.
    """
    points = np.repeat(true_points(sequence, geometry, rows[begins]), length, axis=0)
    depth = geometry.to_camera(sequence.seen.frame[rows], points)[:, 2]
    first = np.repeat(depth[begins], length)
    in_front = (depth > 0.0) & (first > 0.0)
    return np.where(in_front, first, np.nan) / np.where(in_front, depth, 1.0)


def _outliers(
    error: NDArray[np.float64], age: NDArray[np.float64], condition: NDArray[np.intp], count: int
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which errors are outliers, and the limit of each condition."""
    length = np.hypot(*error.T)
    counted = np.flatnonzero((age > 0) & ~np.isnan(length))
    order = counted[np.lexsort((length[counted], condition[counted]))]
    starts = np.searchsorted(condition[order], np.arange(count + 1))
    limit = np.full(count, np.nan)
    for number, (low, high) in enumerate(pairwise(starts)):
        if high > low:
            limit[number] = OUTLIER / _MEDIAN_LENGTH * np.median(length[order[low:high]])
    with np.errstate(invalid="ignore"):
        return (age > 0) & (length > limit[condition]), limit


@dataclass(frozen=True, slots=True)
class Products:
    """Products of one kind."""

    rows: NDArray[np.intp]  # (n,): the observation at the end of each
    values: NDArray[np.float64]  # (n, 3): uu, uv and vv, px^2
    factors: NDArray[np.float64]  # (n, 4): of the components in their expectation, (error_products.expected)


def products(tracks: ErrorTracks) -> Iterator[tuple[Product, Products]]:
    """All products of each kind whose errors are known and not outliers."""
    seen = Seen(tracks.age, tracks.magnification, tracks.walked, np.ones(len(tracks.age)))
    rows = tracks.before(1)
    now, before = seen.at(rows), seen.at(rows - 1)
    r = now.magnification / before.magnification
    of_error, of_both, of_before = shares(now, now), shares(now, before), shares(before, before)
    errors = tracks.error_px[rows]
    yield Product.error, Products(rows, _squares(errors), _stack(*of_error))

    later = before.age > 0
    old = r[:, None] * tracks.error_px[rows - 1]
    of_old = _stack(*(r**2 * share for share in of_before))
    yield Product.before, Products(rows[later], _squares(old)[later], of_old[later])

    change = errors - old
    of_change = _stack(*changed(of_error, of_both, of_before, r))
    yield Product.change, Products(rows[later], _squares(change)[later], of_change[later])

    place = np.full(len(tracks.age), -1)
    place[rows] = np.arange(len(rows))
    twice = np.flatnonzero(later & (place[rows - 1] >= 0))
    last = place[rows[twice] - 1]
    crossed = _crossed(change[twice], change[last])
    with_first, of_first = shares(now.at(twice), before.at(last)), shares(before.at(twice), before.at(last))
    of_lagged = [
        (now_before[twice] - r[twice] * before_before[twice]) - r[last] * (now_first - r[twice] * before_first)
        for now_before, before_before, now_first, before_first in zip(
            of_both, of_before, with_first, of_first, strict=True
        )
    ]
    yield Product.lagged, Products(rows[twice], crossed, _stack(*of_lagged))


def _stack(*columns: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack(columns, axis=1)


def _squares(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return _crossed(vectors, vectors)


def _crossed(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Products uu, uv and vv, (n, 3), of which the second is made symmetric."""
    mixed = 0.5 * (a[:, 0] * b[:, 1] + a[:, 1] * b[:, 0])
    return _stack(a[:, 0] * b[:, 0], mixed, a[:, 1] * b[:, 1])


_PRODUCTS = ("uu", "uv", "vv")
_MEANS = ("sum_u", "sum_v", "along", "motion")


def noise_sums(sequence: PreparedSequence, tracks: ErrorTracks, found: Mapping[Product, Products]) -> pl.DataFrame:
    """Sums of every condition, block, product and age. Returns schema `NOISE_SUMS`, sorted."""
    parts = [_summed_products(sequence, tracks, kind, of_kind) for kind, of_kind in found.items()]
    return pl.concat([empty(NOISE_SUMS), *parts]).sort(_KEYS)


_KEYS = tuple(name for name in NOISE_SUMS if name not in ("n", *_PRODUCTS, *NAMES, *_MEANS))


def _summed_products(
    sequence: PreparedSequence, tracks: ErrorTracks, kind: Product, products: Products
) -> pl.DataFrame:
    rows = tracks.rows[products.rows]
    block = np.where(sequence.at_slowest[rows], sequence.block[rows], 0)
    (condition, blocks, age), index = number_combinations(
        [sequence.seen.condition[rows], block, sequence.seen.age[rows]]
    )
    columns = dict(zip((*_PRODUCTS, *NAMES), np.hstack([products.values, products.factors]).T, strict=True))
    columns |= dict(zip(_MEANS, _means(tracks, kind, products.rows), strict=True))
    sums = {name: np.bincount(index, values, len(age)) for name, values in columns.items()}
    keys = {"block": blocks, "age": age, "n": np.bincount(index, minlength=len(age))}
    table = sequence.seen.conditions[condition].hstack(pl.DataFrame({**keys, **sums}))
    return typed(table.with_columns(product=pl.lit(kind, dtype=PRODUCT)), NOISE_SUMS)


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
    is_known = aged & ~np.isnan(tracks.error_px[:, 0])
    counts = {
        "n_tracks": np.bincount(condition[tracks.age == 0], minlength=count),
        "n": np.bincount(condition[aged & (is_known | tracks.outlier)], minlength=count),
        "n_outliers": np.bincount(condition[tracks.outlier], minlength=count),
    }
    table = sequence.seen.conditions.hstack(pl.DataFrame({**counts, "limit_px": tracks.limit_px}))
    return typed(table.filter(pl.col("n") > 0), NOISE_OUTLIERS)


MOTION = "motion_px"
"""Motion of the image: distance of the true positions in two frames in succession of the tracker, px.

That of the observed positions contains the error, and would explain it by itself. A front end knows the motion from its
prediction, or from the features around.
"""
PER_OCTAVE = 2
_FURTHEST = 40


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

    Returns schema `NOISE_COVARIATES`, sorted. `sequence`: whose observations may have columns ``quality_<name>``.
    """
    parts = [
        _summed_covariates(sequence, tracks, changes, name, values) for name, values in covariates_of(sequence, tracks)
    ]
    keys = [name for name in NOISE_COVARIATES if name not in ("n", *CHANGE_TERMS)]
    return pl.concat([empty(NOISE_COVARIATES), *parts]).sort(keys)


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

    Returns: the columns of the conditions, of the classes, n and `CHANGE_TERMS`. `classes`: NaN where unknown.
    """
    classed = np.flatnonzero(~np.isnan(np.stack(list(classes.values()))).any(axis=0))
    condition = sequence.seen.condition[tracks.rows[changes.rows[classed]]]
    numbers = [values[classed].astype(np.intp) for values in classes.values()]
    least = [number.min(initial=_FURTHEST) for number in numbers]  # few combinations are found fast
    counted = [number - lowest for number, lowest in zip(numbers, least, strict=True)]
    (conditions, *combined), index = number_combinations([condition, *counted])
    factors = dict(zip(NAMES, changes.factors[classed].T, strict=True))
    terms = {
        "squares": 0.5 * (changes.values[classed, 0] + changes.values[classed, 2]),
        "white_before": factors["white"] - 1.0,
        **{name: factors[name] for name in CHANGE_TERMS if name in factors},
    }
    sums = {term: np.bincount(index, weights, len(conditions)) for term, weights in terms.items()}
    labels = {name: values + lowest for name, values, lowest in zip(classes, combined, least, strict=True)}
    counts = {"n": np.bincount(index, minlength=len(conditions))}
    return sequence.seen.conditions[conditions].hstack(pl.DataFrame({**labels, **counts, **sums}))


def _summed_covariates(
    sequence: PreparedSequence, tracks: ErrorTracks, changes: Products, name: str, values: NDArray[np.float64]
) -> pl.DataFrame:
    ends = {"before": changes.rows - 1, "now": changes.rows}
    classes = {end: known_classes(values[rows]) for end, rows in ends.items()}
    table = sums_by_class(sequence, tracks, changes, classes)
    return typed(table.with_columns(covariate=pl.lit(name)), NOISE_COVARIATES)


def known_classes(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Classes by (covariates.class), (n,) float64; NaN where a value is."""
    unknown = np.isnan(values)
    return np.where(unknown, np.nan, class_of(np.where(unknown, 1.0, values)))


MOST = 5
"""Covariates that are combined, the motion of the image among them."""


def noise_pairs(sequence: PreparedSequence, tracks: ErrorTracks, changes: Products) -> pl.DataFrame:
    """Sums over changes by the classes of two covariates at both of their ends.

    Returns schema `NOISE_PAIRS`, sorted.
    """
    keys = [name for name in NOISE_PAIRS if name not in ("n", *CHANGE_TERMS)]
    return pl.concat([empty(NOISE_PAIRS), *_parts(sequence, tracks, changes)]).sort(keys)


def _parts(sequence: PreparedSequence, tracks: ErrorTracks, changes: Products) -> Iterator[pl.DataFrame]:
    octaves = {name: _octaves(values, changes) for name, values in islice(covariates_of(sequence, tracks), MOST)}
    for first, second in combinations(octaves, 2):
        ends = {"first": octaves[first], "second": octaves[second]}
        classes = {f"{place}_{end}": of_end for place, of_ends in ends.items() for end, of_end in of_ends.items()}
        table = sums_by_class(sequence, tracks, changes, classes)
        yield typed(table.with_columns(first=pl.lit(first), second=pl.lit(second)), NOISE_PAIRS)


def _octaves(values: NDArray[np.float64], changes: Products) -> dict[str, NDArray[np.float64]]:
    """Classes of a covariate at both ends of each change, by the end."""
    backs = {"before": 1, "now": 0}
    return {end: known_classes(values[changes.rows - back]) // PER_OCTAVE for end, back in backs.items()}


MOST_TRACKS = 200
"""Tracks of a sequence and condition whose errors are kept."""


def track_errors(sequence: PreparedSequence, tracks: ErrorTracks) -> pl.DataFrame:
    """Errors of some tracks of every condition, spread evenly over those with at least one known error.

    Returns schema `TRACK_ERRORS`, sorted. A track ends before its first outlier or hidden observation.
    """
    place, length = until_unknown(tracks)
    chosen = _some_tracks(sequence.seen.condition[tracks.rows[place]], length >= _LEAST_OBSERVATIONS)
    counts = length[chosen]
    kept = np.repeat(place[chosen] - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
    rows, covariates = tracks.rows[kept], dict(covariates_of(sequence, tracks))
    columns = {
        "track": sequence.seen.track[rows],
        "block": np.where(sequence.at_slowest[rows], sequence.block[rows], 0),
        "age": tracks.age[kept],
        **dict(zip(("du_px", "dv_px"), tracks.error_px[kept].T, strict=True)),
        "magnification": tracks.magnification[kept],
        MOTION: covariates.pop(MOTION)[kept],
        **{QUALITY_PREFIX + name: covariates[name][kept] for name in sorted(covariates)},
    }
    values = {name: pl.Series(name, column, nan_to_null=True) for name, column in columns.items()}
    table = sequence.seen.conditions[sequence.seen.condition[rows]].hstack(pl.DataFrame(values))
    kept_errors = typed(table, layout_of(TRACK_ERRORS, table.columns))
    return check(kept_errors.sort(*ORIGIN, "track", "age"), TRACK_ERRORS, "track errors")


_LEAST_OBSERVATIONS = 2
"""Of a track with a known error: the first one is where it is about."""


def until_unknown(tracks: ErrorTracks) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Where each track begins, and how many observations it has before the first one without a known error."""
    begins, length = track_runs(tracks.track)
    since = np.arange(len(tracks.track)) - np.repeat(begins, length)
    unknown = np.where(np.isnan(tracks.error_px[:, 0]), since, np.repeat(length, length))
    return begins, np.minimum.reduceat(unknown, begins) if len(begins) else length


def _some_tracks(condition: NDArray[np.intp], usable: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Places of at most `MOST_TRACKS` usable tracks of each condition, in order."""
    usable_places = (np.flatnonzero(usable & (condition == number)) for number in np.unique(condition))
    counts = [(places, min(len(places), MOST_TRACKS)) for places in usable_places]
    parts = [places[np.arange(count) * len(places) // max(count, 1)] for places, count in counts]
    return np.concatenate([np.empty(0, np.intp), *parts])


_SCHEMAS = {
    "noise_sums": NOISE_SUMS,
    "noise_outliers": NOISE_OUTLIERS,
    "noise_covariates": NOISE_COVARIATES,
    "noise_pairs": NOISE_PAIRS,
    "track_errors": TRACK_ERRORS,
}


def noise_tables(sequence: PreparedSequence, geometry: FrameGeometry) -> dict[str, pl.DataFrame]:
    """Sums of products of errors, their outliers, and changes of errors by what is known at run time.

    Parameters
    ----------
    sequence
        With errors about the first position of each track. Where a scan makes them zero elsewhere, tables have no rows.
    geometry
        Poses and cameras of its frames.

    Returns
    -------
    dict
        Tables of the schemas `NOISE_SUMS`, `NOISE_OUTLIERS`, `NOISE_COVARIATES`, `NOISE_PAIRS` and `TRACK_ERRORS` by
        their names in lower case, sorted.
    """
    if sequence.key_frame is not None:
        return {name: empty(schema) for name, schema in _SCHEMAS.items()}
    tracks = error_tracks(sequence, geometry)
    by_kind = dict(products(tracks))
    return {
        "noise_sums": noise_sums(sequence, tracks, by_kind),
        "noise_outliers": noise_outliers(sequence, tracks),
        "noise_covariates": noise_covariates(sequence, tracks, by_kind[Product.change]),
        "noise_pairs": noise_pairs(sequence, tracks, by_kind[Product.change]),
        "track_errors": track_errors(sequence, tracks),
    }
