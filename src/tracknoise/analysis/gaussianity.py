"""Whether errors are Gaussian: by condition, in bands of ages, with intervals and a verdict.

With a million errors every test rejects. The verdict is from effect sizes, in nats per error: what an estimator loses
by assuming Gaussian errors, so that one margin applies to all. All are of errors in units of their own scene
(`tracknoise.analysis.error_shape`). The verdict is the first of these that is true for the bounds of the intervals
(shape):

1. undecided: there are no intervals.
2. contaminated: the mixture's gain lies above the margin and above Student's gain.
3. heavy-tailed: Student's gain, or the mixture's, lies above the margin. For either verdict at least as many errors
   as a Gaussian has lie beyond d2 = 9.21, both in units of scenes and of all scenes together; otherwise undecided.
4. skewed: b1 / 12 lies above the margin, and b2 below 16; where b2 is larger, a few errors decide third moments.
5. light-tailed: kurtosis b2 lies below 8 (1 - sqrt(2 margin)), 6.87 for 0.01 nat, which is where an elliptical
   distribution is that far from the Gaussian, and fewer errors than expected are beyond d2 = 9.21.
6. Gaussian: both gains and b1 / 12 lie below the margin, and kurtosis above that bound.
7. undecided: some interval contains its limit.

Skewness and kurtosis come from the moments of all errors. Tails, quantiles and likelihoods come from a sample of errors
(`tracknoise.statistics.samples`). Errors are standardised at each age (`tracknoise.analysis.error_shape`), so
that the ages of a band can be pooled.

Scenes are pooled, and errors that are larger in one scene than in another make the pooled distribution heavy-tailed.
The gains are therefore also measured with each error in units of its own scene (`tracknoise.analysis.error_shape`).
The verdict is about these. What the different scales of scenes add is stated beside them, because the remedies differ:
a sigma that adapts to the scene, or a robust kernel.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import UnitPlaces, unit_places, units_of
from tracknoise.analysis.error_shape import (
    ORDERS,
    POWER_SUMS,
    gains,
    mardia,
    radii,
    standard_sums,
    standardised,
    standards,
    tail_ratios,
    ties,
    within_scenes,
)
from tracknoise.analysis.truth_shares import NO_KEY_FRAMES, anchored
from tracknoise.inference.bootstrap import Draws, draws_by_dataset
from tracknoise.inference.conventions import KIND_OF_INTERVAL, LEVEL
from tracknoise.inference.densities import Gains
from tracknoise.inference.estimates import Estimate, EstimateArray
from tracknoise.inference.intervals import Method, pooled
from tracknoise.inference.units import BLOCKS, NO_GROUPS, JoinedScenes, Resampled, SceneGroups, Units
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import (
    Condition,
    Groups,
    Tables,
    TablesByCondition,
    by_condition,
    names,
    scenes_by_dataset,
)
from tracknoise.statistics.samples import first_tracks, with_bands
from tracknoise.tables.defaults import MIN_FEATURES
from tracknoise.tables.enumerations import Shape
from tracknoise.tables.findings_schema import INTERVAL_KIND, RESAMPLED, SHAPE
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import ALL_ROWS, OF_CONDITION, Rows, RunTable, Value, bounds_of, same
from tracknoise.tables.schema import MOMENTS, SAMPLES, TRIMMING, Schema, empty, typed
from tracknoise.tables.schema import POOLED as CONDITIONS
from tracknoise.words import SPACE, format_as, listing, number, thousandths


def _shape() -> Rows:
    made = same("level", "resampled") | {"interval": "kind"}
    values = [Value("shape", "shape", carried=same("n", "n_scenes", "verdict", "why") | made)]
    for part, suffix in (("pooled", ""), ("within scenes", "_within")):
        bounds = bounds_of(f"kurtosis{suffix}") | made
        values += [
            Value("skewness", f"skewness{suffix}", {"part": part}),
            Value("kurtosis", f"kurtosis{suffix}", {"part": part}, carried=bounds),
            Value("tail_ratio", f"tail_99{suffix}", {"part": part, "against": "99 %"}),
        ]
        for density in ("student", "mixture"):
            stem = f"gain_{density}{suffix}"
            bounds = bounds_of(stem) | made
            values.append(Value("gain", f"{stem}_nats", {"part": part, "against": density}, carried=bounds))
        values += [
            Value("student_nu", f"student_nu{suffix}", {"part": part}),
            Value("mixture_share", f"mixture_share{suffix}", {"part": part}),
            Value("mixture_ratio", f"mixture_ratio{suffix}", {"part": part}),
        ]
    scales = bounds_of("gain_scales") | made
    values += [
        Value("tail_ratio", "tail_999", {"part": "pooled", "against": "99.9 %"}),
        Value("gain", "gain_scales_nats", {"part": "scales of scenes", "against": "student"}, carried=scales),
        Value("student_scale", "student_scale_px", {"part": "pooled"}),
        Value("errors_sampled", "n_sampled"),
    ]
    keys = {**OF_CONDITION, "trimming": "trimming", "at_low": "age_low", "at_high": "age_high"}
    return Rows("shape", keys, values)


GAUSSIANITY = RunTable(
    "gaussianity",
    {
        **CONDITIONS,
        "trimming": TRIMMING,
        "age_low": pl.Int64,
        "age_high": pl.Int64,
        "n": pl.Int64,
        "n_sampled": pl.Int64,
        "n_scenes": pl.Int32,
        **dict.fromkeys(("skewness", "kurtosis", "kurtosis_low", "kurtosis_high", "tail_99", "tail_999"), pl.Float64),
        **dict.fromkeys(("gain_student_nats", "gain_student_low", "gain_student_high"), pl.Float64),
        **dict.fromkeys(("gain_mixture_nats", "gain_mixture_low", "gain_mixture_high"), pl.Float64),
        **dict.fromkeys(("student_nu", "student_scale_px", "mixture_share", "mixture_ratio"), pl.Float64),
        **dict.fromkeys(
            ("skewness_within", "kurtosis_within", "kurtosis_within_low", "kurtosis_within_high", "tail_99_within"),
            pl.Float64,
        ),
        **dict.fromkeys(
            ("gain_student_within_nats", "gain_student_within_low", "gain_student_within_high"), pl.Float64
        ),
        **dict.fromkeys(
            ("gain_mixture_within_nats", "gain_mixture_within_low", "gain_mixture_within_high"), pl.Float64
        ),
        **dict.fromkeys(("gain_scales_nats", "gain_scales_low", "gain_scales_high"), pl.Float64),
        **dict.fromkeys(("student_nu_within", "mixture_share_within", "mixture_ratio_within"), pl.Float64),
        "kind": INTERVAL_KIND,
        "level": pl.Float64,
        "resampled": RESAMPLED,
        "verdict": SHAPE,
        "why": pl.String,
    },
    _shape(),
    title="shape of the error distribution",
    verdicts=ALL_ROWS,
    quantities={
        "shape": Quantity("1", "Verdict on the distribution of the errors, each scene standardised."),
        "skewness": Quantity("1", "Mardia's b1, 0 for a Gaussian."),
        "kurtosis": Quantity("1", "Mardia's b2, 8 for a Gaussian in two dimensions."),
        "tail_ratio": Quantity("1", "Share of errors beyond an ellipse, over that of a Gaussian."),
        "gain": Quantity("nat", "Held-out log-likelihood per error over a Gaussian."),
        "student_nu": Quantity("1", "Degrees of freedom of the fitted Student's t."),
        "student_scale": Quantity("px", "Scale of one coordinate of the fitted Student's t."),
        "mixture_share": Quantity("share", "Share of the wider component of the fitted mixture."),
        "mixture_ratio": Quantity("1", "Covariance of the wider component over that of the narrower one."),
        "errors_sampled": Quantity("1", "Number of errors that densities were fitted to."),
    },
)
"""Are errors Gaussian: one row per band of ages (or of distances from the key frame) of a condition.

skewness and kurtosis are Mardia's b1 and b2 (0 and 8 for a Gaussian in two dimensions). tail_99 is P(d2 > 9.21) / 0.01,
tail_999 P(d2 > 13.82) / 0.001. Gains are held-out log-likelihood per observation over a Gaussian, nats. All are of
errors in units of the mean and covariance of their age. student_scale_px is the scale of one coordinate at a typical
age; mixture_share is the share of the wider component, mixture_ratio how many times larger its covariance is.

Columns with `_within` are of errors in units of the mean and covariance of their own scene, and the verdict is about
these. gain_scales is what the different scales of scenes add: Student's gain less that within scenes.
"""


def _radii() -> Rows:
    values = [Value("radius", name, {"part": name}) for name in ("expected", "observed")]
    keys = {
        **OF_CONDITION,
        "trimming": "trimming",
        "at_low": "age_low",
        "at_high": "age_high",
        "part_low": "probability",
    }
    return Rows("radii", keys, values)


RADII = RunTable(
    "radii",
    {
        **CONDITIONS,
        "trimming": TRIMMING,
        "age_low": pl.Int64,
        "age_high": pl.Int64,
        **dict.fromkeys(("probability", "expected", "observed"), pl.Float64),
    },
    _radii(),
    quantities={
        "radius": Quantity(
            "1", "Quantile of the Mahalanobis distance: of a Gaussian (expected) and of the errors (observed)."
        ),
    },
)
"""Radial QQ plot: quantiles of the Mahalanobis distance, observed and of a Gaussian of the same covariance."""

Array = NDArray[np.float64]

BAND = ["trimming", "age_low"]
"""Columns that identify the bands of a condition."""
FOLDS, MANY_FOLDS, MANY = 8, 2, 17
"""Folds of scenes, or of the blocks of each, and of as many scenes as `MANY` or more.

Half of so many scenes usually have more errors than are fitted (`MAX_FITTED` of `tracknoise.analysis.error_shape`).
More folds would not be fitted to more, and would share scenes. Verdicts are as with three folds
(`python -m benchmarks.validity.gaussianity --scenes 28`).
"""
_MARDIA = ("skewness", "kurtosis")
_GAINS = ("gain_student", "gain_mixture", "gain_difference")
_MARDIA_WITHIN = ("skewness_within", "kurtosis_within")
_GAINS_WITHIN = ("gain_student_within", "gain_mixture_within", "gain_difference_within", "gain_scales")


def mardia_bounds(
    sums: pl.DataFrame, singles: pl.DataFrame, places: UnitPlaces, draws: Draws, method: Method
) -> pl.DataFrame:
    """Skewness and kurtosis of each band, from the moments of all errors.

    Blocks have no moments beyond order 2. Where scenes are too few, the relative width of the interval is therefore
    that of single errors, resampled by block, which are fewer. Returns: `BAND`, n, and skewness and kurtosis, each with
    its bounds (``_low``, ``_high``); NaN where there is none.
    """
    by_scene = units_of(sums, points=BAND, columns=POWER_SUMS, groups=draws.groups).across_groups()
    totals = by_scene.sums.sum(axis=0).T
    exact = dict(zip(_MARDIA, mardia(totals), strict=True))
    table = by_scene.points.with_columns_seq(n=pl.Series(totals[0], dtype=pl.Int64), **exact)
    units = by_scene if by_scene.resampled else places.units(_powers(singles.select_seq("z_u", "z_v").to_numpy()))
    bounds = _table(units, pooled(units, draws.weights(units), mardia, method), _MARDIA)
    joined = table.join(bounds, on=BAND, how="left", maintain_order="left", suffix=" resampled")
    scaled = [
        (pl.col(f"{name}_{end}") * pl.col(name) / pl.col(f"{name} resampled")).alias(f"{name}_{end}")
        for name in _MARDIA
        for end in ("low", "high")
    ]
    return joined.with_columns_seq(scaled).select_seq(pl.exclude("^.* resampled$"))


def gain_bounds(singles: pl.DataFrame, places: UnitPlaces, gained: Gains, draws: Draws, method: Method) -> pl.DataFrame:
    """Gains of Student's t and of the mixture in each band, and the parameters of their fits.

    Returns: `BAND`, `gain_student`, `gain_mixture` and `gain_difference` (the mixture's above Student's), each with its
    bounds; `nu`, `spread_px`, `share` and `ratio`; NaN where there is none.
    """
    bands, scored = places.points, ~np.isnan(gained.student)
    units = places.units([scored, np.nan_to_num(gained.student), np.nan_to_num(gained.mixture)])
    bounds = _table(units, pooled(units, draws.weights(units), _per_error, method), _GAINS)
    size = np.bincount(bands.index, singles["log_spread"].to_numpy(), bands.count) / np.bincount(bands.index)
    parameters = bands.keys.with_columns_seq(
        nu=gained.nu, spread_px=gained.spread * np.exp(size), share=gained.share, ratio=gained.ratio
    )
    return bounds.join(parameters, on=BAND, maintain_order="left")


def within_bounds(
    pairs: Array, places: UnitPlaces, gained: tuple[Gains, Gains], draws: Draws, method: Method
) -> pl.DataFrame:
    """Numbers of errors in units of their own scene, and what the different scales of scenes add.

    Shapes: pairs (rows, 2). Returns: `BAND`, `skewness_within`, `kurtosis_within`, `gain_student_within`,
    `gain_mixture_within`, `gain_difference_within` and `gain_scales`, which is Student's gain without units of scenes
    less that with them, each with its bounds; NaN where there is none.
    """
    whole, within = gained
    scored = ~(np.isnan(whole.student) | np.isnan(within.student))
    sums = [scored, *(np.where(scored, value, 0.0) for value in (whole.student, within.student, within.mixture))]
    every = places.units([*_powers(pairs), *sums])
    moments, units = (replace(every, sums=part) for part in np.split(every.sums, [len(POWER_SUMS)], axis=-1))
    found = _table(moments, pooled(moments, draws.weights(moments), mardia, method), _MARDIA_WITHIN)
    bounds = _table(units, pooled(units, draws.weights(units), _per_error_within, method), _GAINS_WITHIN)
    return found.join(bounds, on=BAND, maintain_order="left")


def _per_error_within(sums: Array) -> Array:
    """Gains of `_GAINS_WITHIN` from how many errors are scored, and sums of the gains that they are made of."""
    scored, whole, student, mixture = sums
    return np.stack([student, mixture, mixture - student, whole - student]) / np.where(scored > 0, scored, np.nan)


def _powers(pairs: Array) -> list[Array]:
    """What `POWER_SUMS` are sums of, of pairs (rows, 2); 0 where one is NaN."""
    there = ~np.isnan(pairs[:, 0])
    u, v = np.where(there[:, None], pairs, 0.0).T
    of_u, of_v = ([there * 1.0, axis, axis**2, axis**2 * axis, axis**2 * axis**2] for axis in (u, v))
    return [of_u[p] * of_v[q] for p, q in ORDERS]


def _per_error(sums: Array) -> Array:
    """Gains of `_GAINS` from how many errors are scored, and sums of their gains."""
    scored, student, mixture = sums
    return np.stack([student, mixture, mixture - student]) / np.where(scored > 0, scored, np.nan)


def folds_of(places: UnitPlaces, seed: int) -> NDArray[np.intp]:
    """Fold of each row: that of its scene or, where blocks are resampled, that of its block, drawn in each scene."""
    rng, count = np.random.default_rng(seed), len(places.scenes)
    if places.resampled == Resampled.blocks:
        return np.concatenate([rng.permutation(BLOCKS) % FOLDS for _ in range(count)])[places.unit]
    folds = FOLDS if count < MANY else MANY_FOLDS
    return np.asarray(rng.permutation(count)[places.unit] % folds)


def _table(units: Units, bounds: EstimateArray, names: Sequence[str]) -> pl.DataFrame:
    """One row per point; columns for each statistic and its bounds."""
    ends = {"": bounds.value, "_low": bounds.low, "_high": bounds.high}
    columns = {f"{name}{end}": values[row] for row, name in enumerate(names) for end, values in ends.items()}
    return units.points.hstack(pl.DataFrame(columns))


MARGIN_NATS = 0.01
"""Smaller distances from the Gaussian count as none, nats per error."""
_FEW_DECIDE = 16.0
UNKNOWN = Estimate(None)


@dataclass(frozen=True, slots=True)
class ShapeEvidence:
    """What the verdict is made from.

    Attributes
    ----------
    n_sampled
        Single errors behind gains and tails.
    student, mixture, difference
        Gains, nats per error, and how much the mixture's is above Student's.
    skewness, kurtosis
        Mardia's b1 and b2.
    tail_99
        P(d2 > 9.21) / 0.01; None where there are too few errors.
    nu, share, ratio
        Parameters of the fits; None where there are none.
    pooled_tail_99
        As `tail_99`, but of all scenes together.
    scales
        What the different scales of scenes add to Student's gain, nats per error.
    """

    n_sampled: int
    student: Estimate
    mixture: Estimate
    difference: Estimate
    skewness: Estimate
    kurtosis: Estimate
    tail_99: float | None
    nu: float | None
    share: float | None
    ratio: float | None
    pooled_tail_99: float | None = None
    scales: Estimate = UNKNOWN


def judge(evidence: ShapeEvidence, *, margin: float = MARGIN_NATS) -> tuple[Shape, str]:
    """Verdict by (shape), and the reason in words."""
    student, mixture, kurtosis = evidence.student, evidence.mixture, evidence.kurtosis
    if None in (student.low, mixture.low, kurtosis.low):
        return Shape.undecided, f"too few errors ({evidence.n_sampled}), scenes or blocks for intervals"
    light = 8 * (1 - math.sqrt(2 * margin))
    if student.above(margin) or mixture.above(margin):
        verdict, why = _heavy(evidence, margin)
        return verdict, why + _of_scales(evidence)
    if evidence.skewness.above(12 * margin) and kurtosis.below(_FEW_DECIDE):
        return Shape.skewed, f"skewness b1 is {_text(evidence.skewness)}, above {12 * margin:g}"
    if kurtosis.below(light) and evidence.tail_99 is not None and evidence.tail_99 < 1:
        return Shape.light_tailed, f"kurtosis is {_text(kurtosis)}, below {number(light)}; that of a Gaussian is 8"
    open_ = list(_open(evidence, margin, light))
    if not open_:
        gains = f"Student's t gains {_text(student)} nat per error over a Gaussian, a mixture {_text(mixture)}"
        small_gains = f"{gains}. Both are below {margin:g}. Kurtosis is {_text(kurtosis)}. That of a Gaussian is 8"
        return Shape.gaussian, small_gains + _of_scales(evidence)
    return Shape.undecided, f"too few errors ({evidence.n_sampled}) to tell: {listing(open_)}" + _of_scales(evidence)


def _open(evidence: ShapeEvidence, margin: float, light: float) -> Iterator[str]:
    """What keeps errors from being called Gaussian: bounds of intervals that lie beyond their limits."""
    for name, gain in (("Student's t", evidence.student), ("a mixture", evidence.mixture)):
        if not gain.below(margin):
            yield f"{name} may gain {thousandths(gain.high)} nat per error, limit {margin:g}"
    if not evidence.skewness.below(12 * margin):
        yield f"skewness may be {thousandths(evidence.skewness.high)}, limit {12 * margin:g}"
    if not evidence.kurtosis.above(light):
        yield f"kurtosis may be {thousandths(evidence.kurtosis.low)}, limit {number(light)} (a Gaussian has 8)"


def _heavy(evidence: ShapeEvidence, margin: float) -> tuple[Shape, str]:
    """The verdict where tails are heavier than a Gaussian's."""
    tails = [tail for tail in (evidence.tail_99, evidence.pooled_tail_99) if tail is not None]
    if min(tails, default=1.0) < 1:
        few = f"only {number(min(tails))} times as many errors as of a Gaussian lie beyond its 99{SPACE}% ellipse"
        return Shape.undecided, f"Student's t gains {_text(evidence.student)} nat per error over a Gaussian, but {few}"
    mixture = _text(evidence.mixture)
    if evidence.mixture.above(margin) and evidence.difference.above(0.0):
        wider = f"{number(_percent(evidence.share))} % of errors {number(_root(evidence.ratio))} times as wide"
        gains = f"gains {mixture} nat per error over a Gaussian, and {_text(evidence.difference)} more than Student's t"
        return Shape.contaminated, f"a mixture with {wider} {gains}"
    student = f"Student's t with {number(evidence.nu)} degrees of freedom gains {_text(evidence.student)} nat per error"
    return Shape.heavy_tailed, f"{student} over a Gaussian; a mixture gains {mixture}"


def _of_scales(evidence: ShapeEvidence) -> str:
    """What the different scales of scenes add, where they do."""
    added = f"Different scales of scenes add {_text(evidence.scales)} nat to the gain of Student's t"
    return f". {added}" if evidence.scales.above(0.0) else ""


def _text(estimate: Estimate) -> str:
    return format_as(estimate, thousandths)


def _percent(share: float | None) -> float | None:
    return None if share is None else 100 * share


def _root(ratio: float | None) -> float | None:
    return None if ratio is None else math.sqrt(ratio)


MAX_SAMPLED = 4096
"""Single errors of a band that are looked at, about, shared out evenly among scenes."""
_EDGES = [*BAND, "age_high"]
_WHERE = ["scene", "direction", "population", "axis", "at", "n"]
"""Columns of moments that say in which bands they are."""


@dataclass(frozen=True, slots=True)
class Shapes:
    """What shape errors have.

    Attributes
    ----------
    gaussianity
        Schema `GAUSSIANITY`, sorted by condition, trimming and band: every band in which there is an error.
    radii
        Schema `RADII`, sorted, in the same way.
    """

    gaussianity: pl.DataFrame
    radii: pl.DataFrame


@dataclass(frozen=True, slots=True)
class _Options:
    method: Method
    min_features: int
    margin: float
    seed: int
    joined: JoinedScenes


def gaussianity(
    moments: Tables,
    samples: Tables,
    *,
    groups: SceneGroups = NO_GROUPS,
    key_frames: Mapping[str, int] = NO_KEY_FRAMES,
    min_features: int = MIN_FEATURES,
    margin: float = MARGIN_NATS,
    kind: str = KIND_OF_INTERVAL,
    level: float = LEVEL,
    n_draws: int = 1000,
    seed: int = 0,
) -> Shapes:
    """Shape of visible errors, by condition, trimming and band of ages.

    Parameters
    ----------
    moments, samples
        Of all scenes, `MOMENTS` and `SAMPLES`.
    groups
        Groups of scenes that are not independent of each other (`tracknoise.inference.units.JoinedScenes`).
    key_frames
        Where a scan makes errors zero in one frame: that frame, by direction. Bands are then of distances from it.
    min_features
        Fewest errors, of all scenes together, of an age that is looked at.
    margin
        Largest distance from the Gaussian that does not matter, nats per error.
    kind, level
        Of the intervals. `bca` takes the place of `student` (`Method.by_bootstrap`); column `kind` says which was made.
    n_draws, seed
        As in `tracknoise.inference.bootstrap.draws`; the seed decides, too, which scenes are fitted together.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    errors = by_condition(moments, MOMENTS, "moments")
    places = {key: part.select_seq(_WHERE) for key, part in errors.items()}
    scenes = scenes_by_dataset(_banded(places, key_frames))
    count = math.ceil(MAX_SAMPLED / min(map(len, scenes.values()), default=1))
    singles = by_condition(samples, SAMPLES, "samples", lambda table: first_tracks(table, count))
    joined = JoinedScenes.of(scenes, groups)
    drawn = draws_by_dataset(joined.scenes(scenes), n_draws=n_draws, seed=seed, groups=joined.others)
    options = _Options(Method(kind, level).by_bootstrap(), min_features, margin, seed, joined)
    rows, quantiles = [empty(GAUSSIANITY)], [empty(RADII)]
    for key, part in _banded(errors, key_frames):
        of_scenes = part if part["scene"].is_sorted() else part.sort("scene", maintain_order=True)
        found, distances = _condition(of_scenes, singles.get(key, empty(SAMPLES)), drawn[key[0]], options)
        rows.append(found.with_columns_seq(names(key, GAUSSIANITY)))
        quantiles.append(distances.with_columns_seq(names(key, RADII)))
    return Shapes(
        _typed(rows, GAUSSIANITY).sort(*POOLED, *BAND),
        _typed(quantiles, RADII).sort(*POOLED, *BAND, "probability"),
    )


def _banded(moments: TablesByCondition, key_frames: Mapping[str, int]) -> Iterator[tuple[Condition, pl.DataFrame]]:
    """Moments of each condition that has any in one of the bands."""
    for key, part in moments.items():
        banded = with_bands(anchored(part, key_frames), pl.col("since").abs())
        if not banded.is_empty():
            yield key, banded


def _condition(
    moments: pl.DataFrame, samples: pl.DataFrame, draws: Draws, options: _Options
) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Rows of `GAUSSIANITY` and `RADII` of one condition."""
    standard = standards(moments, min_features=options.min_features)
    bands = moments.group_by(_EDGES).agg(all=pl.col("n").sum(), n_scenes=pl.col("scene").n_unique()).sort(_EDGES)
    sums, singles = standard_sums(moments, standard), standardised(samples, standard)
    if sums.is_empty() or singles.is_empty():
        rows = bands.with_columns_seq(n="all", n_sampled=0, verdict=pl.lit(Shape.undecided), why=pl.lit(_few(options)))
        return rows, empty(RADII)
    pairs, dataset = within_scenes(singles, sums), str(moments["dataset"][0])
    sums, singles = (options.joined.rename(table, dataset) for table in (sums, singles))
    places = unit_places(singles, points=BAND, groups=draws.groups).across_groups()
    gained = _gains(singles, pairs, places, draws, options)
    tails, quantiles = _tails(singles, pairs, places.points)
    table = bands.join(mardia_bounds(sums, singles, places, draws, options.method), on=BAND, how="left")
    table = table.join(gained, on=BAND, how="left").join(tails, on=BAND, how="left").sort(_EDGES)
    finite = table.with_columns_seq(pl.selectors.float().fill_nan(None))
    judged = [_judged(row, options) for row in finite.iter_rows(named=True)]
    named = table.hstack(pl.DataFrame(judged, schema=["verdict", "why"], orient="row")).with_columns_seq(
        pl.coalesce("n", "all").alias("n"),
        pl.col("n_sampled").fill_null(0),
        kind=pl.lit(options.method.kind),
        level=options.method.level,
        resampled=pl.lit(options.joined.resampled(places.resampled, dataset, places.scenes)),
    )
    return named.rename(_NAMES), quantiles.join(bands.select_seq(_EDGES), on=BAND)


_NAMES = {
    **{f"gain_{name}": f"gain_{name}_nats" for name in ("student", "mixture", "student_within", "mixture_within")},
    "gain_scales": "gain_scales_nats",
    "nu": "student_nu",
    "spread_px": "student_scale_px",
    "share": "mixture_share",
    "ratio": "mixture_ratio",
    "nu_within": "student_nu_within",
    "share_within": "mixture_share_within",
    "ratio_within": "mixture_ratio_within",
}


def _gains(
    singles: pl.DataFrame, pairs: NDArray[np.float64], places: UnitPlaces, draws: Draws, options: _Options
) -> pl.DataFrame:
    """Gains by band with their intervals, also in units of scenes."""
    bands = places.points
    tied = _tied(singles, bands)
    untied = np.array([reason is None for reason in tied])[bands.index]
    folds = folds_of(places, options.seed)

    def of(values: NDArray[np.float64]) -> Gains:
        rows = untied & ~np.isnan(values[:, 0])
        return gains(values[rows], bands.index[rows], folds[rows], bands.count).expanded(rows)

    whole, within = of(singles.select_seq("z_u", "z_v").to_numpy()), of(pairs)
    table = gain_bounds(singles, places, whole, draws, options.method)
    parameters = {"nu_within": within.nu, "share_within": within.share, "ratio_within": within.ratio}
    named = bands.keys.with_columns_seq(tied=pl.Series(tied, dtype=pl.String), **parameters)
    added = within_bounds(pairs, places, (whole, within), draws, options.method)
    return table.join(named, on=BAND).join(added, on=BAND)


def _tied(singles: pl.DataFrame, bands: Groups) -> list[str | None]:
    """What makes the errors of each band equal to one another."""
    errors = singles.select_seq("du_px", "dv_px").to_numpy()
    return [ties(errors[bands.index == band]) for band in range(bands.count)]


def _tails(singles: pl.DataFrame, pairs: NDArray[np.float64], bands: Groups) -> tuple[pl.DataFrame, pl.DataFrame]:
    """By band how many single errors there are and how many lie far out; and the quantiles of their distances."""
    tails, quantiles = [], []
    distances = singles["z_u"].to_numpy() ** 2 + singles["z_v"].to_numpy() ** 2
    of_pairs = np.square(pairs).sum(axis=1)
    for band, key in enumerate(bands.keys.rows()):
        squared, within = (values[bands.index == band] for values in (distances, of_pairs))
        near = tail_ratios(within[~np.isnan(within)])[0]
        tails.append((*key, len(squared), *tail_ratios(squared), near))
        quantiles += [(*key, *point) for point in zip(*radii(squared), strict=True)]
    place = {name: singles.schema[name] for name in BAND}
    numbers = {"n_sampled": pl.Int64, "tail_99": pl.Float64, "tail_999": pl.Float64, "tail_99_within": pl.Float64}
    points = dict.fromkeys(("probability", "expected", "observed"), pl.Float64)
    return (
        pl.DataFrame(tails, schema={**place, **numbers}, orient="row"),
        pl.DataFrame(quantiles, schema={**place, **points}, orient="row"),
    )


def _judged(row: Mapping[str, Any], options: _Options) -> tuple[Shape, str]:
    """Verdict on one band, and the reason."""
    if row["n"] is None:
        return Shape.undecided, _few(options)
    if row["tied"] is not None:
        return Shape.undecided, row["tied"]

    def estimate(name: str) -> Estimate:
        return Estimate.of_row(row, name, f"{name}_low", f"{name}_high")

    evidence = ShapeEvidence(
        n_sampled=row["n_sampled"] or 0,
        student=estimate("gain_student_within"),
        mixture=estimate("gain_mixture_within"),
        difference=estimate("gain_difference_within"),
        skewness=estimate("skewness_within"),
        kurtosis=estimate("kurtosis_within"),
        **{name: row[f"{name}_within"] for name in ("tail_99", "nu", "share", "ratio")},
        scales=estimate("gain_scales"),
        pooled_tail_99=row["tail_99"],
    )
    return judge(evidence, margin=options.margin)


def _few(options: _Options) -> str:
    return f"every age has fewer than {options.min_features} errors, or errors that do not vary"


def _typed(tables: Sequence[pl.DataFrame], schema: Schema) -> pl.DataFrame:
    """Rows of all conditions with the columns of a schema, null where there is no number."""
    rows = pl.concat(tables, how="diagonal_relaxed")
    return typed(rows, schema).with_columns_seq(pl.selectors.float().fill_nan(None))
