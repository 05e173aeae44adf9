"""Whether errors are Gaussian: by condition, in bands of ages, before and after trimming.

Skewness and kurtosis come from the moments of all errors. Tails, quantiles and likelihoods come from a sample of errors
(`tracknoise.statistics.errors.samples`). Errors are standardised at each age (`tracknoise.findings.shape.standard`), so
that the ages of a band can be pooled.

Scenes are pooled, and errors that are larger in one scene than in another make the pooled distribution heavy-tailed.
The gains are therefore also measured with each error in units of its own scene (`tracknoise.findings.shape.within`).
The verdict is about these. What the different scales of scenes add is stated beside them, because the remedies differ:
a sigma that adapts to the scene, or a robust kernel.

With a million errors every test rejects. The result is therefore how far from Gaussian errors are
(`tracknoise.findings.shape.verdict`).
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.anchored import NO_KEY_FRAMES, anchored
from tracknoise.findings.estimate import Estimate
from tracknoise.findings.sampling.bounds import Method
from tracknoise.findings.sampling.draws import Draws, draws_by_dataset
from tracknoise.findings.sampling.groups import NO_GROUPS, JoinedScenes, SceneGroups
from tracknoise.findings.sampling.units import UnitPlaces, unit_places
from tracknoise.findings.shape.gains import Gains
from tracknoise.findings.shape.held_out import gains
from tracknoise.findings.shape.shape_bounds import BAND, folds_of, gain_bounds, mardia_bounds, within_bounds
from tracknoise.findings.shape.standard import standard_sums, standardised, standards
from tracknoise.findings.shape.tails import radii, tail_ratios
from tracknoise.findings.shape.ties import ties
from tracknoise.findings.shape.verdict import MARGIN_NATS, ShapeEvidence, judge
from tracknoise.findings.shape.within import within_scenes
from tracknoise.statistics.conditions import (
    Condition,
    Tables,
    TablesByCondition,
    by_condition,
    names,
    scenes_by_dataset,
)
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.errors.samples import first_tracks, with_bands
from tracknoise.statistics.grouping import Groups
from tracknoise.tables.defaults import KIND_OF_INTERVAL, LEVEL, MIN_FEATURES
from tracknoise.tables.enumerations import Shape
from tracknoise.tables.findings_schema import GAUSSIANITY, RADII
from tracknoise.tables.schema import MOMENTS, SAMPLES, Schema, check, empty

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
        Groups of scenes that are not independent of each other (`tracknoise.findings.sampling.groups.JoinedScenes`).
    key_frames
        Where a scan makes errors zero in one frame: that frame, by direction. Bands are then of distances from it.
    min_features
        Fewest errors, of all scenes together, of an age that is looked at.
    margin
        Largest distance from the Gaussian that does not matter, nats per error.
    kind, level
        Of the intervals. `bca` takes the place of `student` (`Method.by_bootstrap`); column `kind` says which was made.
    n_draws, seed
        As in `tracknoise.findings.sampling.draws.draws`; the seed decides, too, which scenes are fitted together.

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
    shapes = (
        _typed(rows, GAUSSIANITY).sort(*POOLED, *BAND),
        _typed(quantiles, RADII).sort(*POOLED, *BAND, "probability"),
    )
    return Shapes(check(shapes[0], GAUSSIANITY, "gaussianity"), check(shapes[1], RADII, "radii"))


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
    known = table.with_columns_seq(pl.selectors.float().fill_nan(None))
    judged = [_judged(row, options) for row in known.iter_rows(named=True)]
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
    return rows.select_seq(pl.col(name).cast(kind) for name, kind in schema.items()).with_columns_seq(
        pl.selectors.float().fill_nan(None)
    )
