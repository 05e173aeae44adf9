"""How errors behave in time: white, a random walk, a drift, or saturating, by condition, trimming and coordinate.

The second moment about zero is fitted over the ages by (growth) and, where that fails, by (saturating). The changes of
errors from one frame that the tracker saw to the next are correlated by (autocorrelation) of
`tracknoise.statistics.errors.increments`. A verdict agrees with the curve, with the autocorrelations at lags 1 to
`LAGS`, and with the curves of long-lived tracks (`tracknoise.findings.growth.behaviour`).

Errors are zero at birth (or in the key frame) by construction. What is measured at age k is n_k - n_0, where n_0 is the
error of the detected position. If n_0 is independent of the later n_k and has the same variance s^2, the second moment
is 2 s^2 from the first age on. `white_px` is the root of the constant, here sqrt(2) s. It is s if the first position
has no error, as with the template of a tracker, or with the oracle.

The moments at all ages come from the same tracks. Each age is weighted by how much its second moment varies when scenes
are resampled. A twentieth of the moment is added to this spread, so that no single age dominates.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from tracknoise.findings.anchored import NO_KEY_FRAMES, anchored
from tracknoise.findings.estimate import Estimate
from tracknoise.findings.growth.behaviour import Changes, Growth, behaves
from tracknoise.findings.growth.grown import MIN_AGES, fit_ages, mean_drift
from tracknoise.findings.growth.growth_fits import growth_fits
from tracknoise.findings.growth.growth_units import growth_units, with_fourth
from tracknoise.findings.growth.models import Ages
from tracknoise.findings.intervals.change_bounds import CHANGE_SUMS, correlated
from tracknoise.findings.sampling.bounds import Method
from tracknoise.findings.sampling.draws import Draws, draws_by_dataset
from tracknoise.findings.sampling.groups import NO_GROUPS, JoinedScenes, SceneGroups
from tracknoise.findings.sampling.units import additive, units_of
from tracknoise.statistics.conditions import Tables, TablesByCondition, by_condition, scenes_by_dataset
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import group_rows, in_chunks, reduce_each
from tracknoise.tables.defaults import KIND_OF_INTERVAL, LEVEL, MIN_FEATURES
from tracknoise.tables.enumerations import Aspect, Behaviour
from tracknoise.tables.findings_schema import TIME_STRUCTURE
from tracknoise.tables.schema import (
    ASPECT_BLOCKS,
    ASPECTS,
    BLOCKS,
    INCREMENTS,
    MOMENTS,
    ORIGIN,
    SEQUENCE,
    check,
)

_KEY = [*POOLED, "trimming"]
_PAIRS = [*ORIGIN, "block", "trimming", "lag"]
_OF_SCENE = [name for name in _PAIRS if name != "block"]
_COLUMNS = {
    "white": "white_px",
    "walk": "walk_px_per_sqrt_frame",
    "drift": "drift_px_per_frame",
    "saturating_white": "saturating_white_px",
    "saturating": "saturating_px",
    "time_constant": "saturating_frames",
}
_EVERY = pl.lit(value=True)
LONG_LIVED = pl.col("aspect") == Aspect.long_lived
"""Rows of `ASPECTS` that time structure needs."""


def time_structure(
    moments: Tables,
    increments: pl.DataFrame | Iterable[pl.DataFrame],
    *,
    blocks: Tables = (),
    aspects: Tables = (),
    aspect_blocks: Tables = (),
    groups: SceneGroups = NO_GROUPS,
    key_frames: Mapping[str, int] = NO_KEY_FRAMES,
    min_features: int = MIN_FEATURES,
    kind: str = KIND_OF_INTERVAL,
    level: float = LEVEL,
    n_draws: int = 1000,
    seed: int = 0,
) -> pl.DataFrame:
    """How visible errors grow, by condition, trimming and coordinate, with intervals and a verdict.

    Parameters
    ----------
    moments, increments
        Of all scenes, `MOMENTS` and `INCREMENTS`.
    blocks
        Schema `BLOCKS`: what to resample in conditions of too few scenes. They have no bounds without, and no verdict.
    aspects
        Schema `ASPECTS`: the long-lived tracks, in the conditions that have them. Without them it is not checked
        whether the loss of tracks shapes the curve.
    aspect_blocks
        Schema `ASPECT_BLOCKS`: the same by block, for conditions of too few scenes.
    groups
        Groups of scenes that are not independent of each other (`tracknoise.findings.sampling.groups.JoinedScenes`).
    key_frames
        Where a scan makes errors zero in one frame: that frame, by direction. Time is then the distance from it.
    min_features
        Ages are fitted up to the first at which all scenes together have fewer features than this.
    kind, level, n_draws, seed
        As in `tracknoise.findings.intervals.table.interval_table`. For what is fitted, `bca` takes the place of
        `student` (`Method.by_bootstrap`); columns `kind` and `autocorrelation_kind` say which was made. Geometric means
        over scenes always have Student's interval from the jackknife.

    Returns
    -------
    polars.DataFrame
        Schema `TIME_STRUCTURE`, sorted: a row for each condition and trimming that has visible errors, and coordinate.
        Where fewer than `MIN_AGES` ages can be fitted there are no numbers, and the verdict is undecided.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    errors = by_condition(moments, MOMENTS, "moments")
    scenes = scenes_by_dataset(errors.items())
    joined = JoinedScenes.of(scenes, groups)
    by_scene = _sums({key: with_fourth(part) for key, part in errors.items()}, key_frames, joined)
    by_block = _sums(by_condition(blocks, BLOCKS, "blocks"), key_frames, joined)
    chunks = in_chunks(increments, INCREMENTS, "increments")
    changes = reduce_each(chunks, INCREMENTS, "increments", _of_lags).partition_by(_KEY, as_dict=True)
    changes = {key: joined.rename(part, key[0]) for key, part in changes.items()}
    lived = _sums(by_condition(aspects, ASPECTS, "aspects", _long_lived), key_frames, joined, LONG_LIVED)
    lived_blocks = _sums(
        by_condition(aspect_blocks, ASPECT_BLOCKS, "blocks of aspects", _long_lived), key_frames, joined, LONG_LIVED
    )
    drawn = draws_by_dataset(joined.scenes(scenes), n_draws=n_draws, seed=seed, groups=joined.others)
    every: list[dict[str, Any]] = []
    for key, part in by_scene.items():
        sums = _Sums.of(part, *(table.get(key) for table in (changes, by_block, lived, lived_blocks)))
        rows = _rows(sums, drawn[key[0]], Method(kind, level), min_features, key[_KEY.index("speed")])
        labels = {**dict(zip(_KEY, key, strict=True)), "level": level}
        names = part["scene"].unique().sort().to_list()
        of_groups = [{**row, "resampled": joined.resampled(row["resampled"], key[0], names)} for row in rows]
        every += [{**labels, **row} for row in of_groups]
    table = (
        pl.DataFrame(every, schema=dict(TIME_STRUCTURE))
        .with_columns_seq(pl.selectors.float().fill_nan(None))
        .sort(*_KEY, "coordinate")
    )
    return check(table, TIME_STRUCTURE, "time structure")


@dataclass(frozen=True, slots=True)
class _Sums:
    """Sums of a condition and trimming: of errors by scene and block, of changes, and of long-lived tracks.

    Ages are distances from where errors are zero. `mean_px_per_frame` is of u and of v.
    """

    scenes: pl.DataFrame
    blocks: pl.DataFrame | None
    changes: pl.DataFrame | None
    lived: pl.DataFrame | None
    lived_blocks: pl.DataFrame | None
    mean_px_per_frame: tuple[float, float]

    @classmethod
    def of(cls, scenes: pl.DataFrame, changes: pl.DataFrame | None, *others: pl.DataFrame | None) -> "_Sums":
        """Of tables by the side of the key frame that errors are on."""
        blocks, lived, lived_blocks = map(_apart, others)
        apart = scenes.with_columns_seq(pl.col("since").abs())
        return cls(apart, blocks, changes, lived, lived_blocks, mean_drift(scenes))


def _sums(
    moments: TablesByCondition, key_frames: Mapping[str, int], joined: JoinedScenes, chosen: pl.Expr = _EVERY
) -> dict[tuple[Any, ...], pl.DataFrame]:
    """Sums of each condition and trimming; what is added up in one place is of one scene, and in its order."""
    return {
        (*key, *trimming): sums
        for key, part in moments.items()
        for trimming, sums in additive(anchored(_joined(part.filter(chosen), joined, key[0]), key_frames))
        .partition_by("trimming", as_dict=True)
        .items()
    }


def _joined(moments: pl.DataFrame, joined: JoinedScenes, dataset: str) -> pl.DataFrame:
    """Moments with new names of scenes. Column measured keeps the names of the scenes, which are counted."""
    return joined.rename(moments.with_columns_seq(measured="scene"), dataset)


def lagged(increments: pl.DataFrame, few: pl.DataFrame) -> pl.DataFrame:
    """Rows of `INCREMENTS` of which (autocorrelation) is made: all that time structure needs.

    Parameters
    ----------
    increments
        Of any number of sequences, one after another.
    few
        Conditions of so few scenes that blocks are resampled. In others all blocks are added up, as block 0.
    """
    pairs = increments.filter(pl.col("lag") > 0)
    if few.is_empty():
        return _of_all_blocks(pairs)
    by_block, whole = (pairs.join(few, on=few.columns, how=how, maintain_order="left") for how in ("semi", "anti"))
    return pl.concat([by_block, _of_all_blocks(whole)])


def _of_all_blocks(pairs: pl.DataFrame) -> pl.DataFrame:
    """Sums over the blocks of each scene, as block 0; sequences stay in their order."""
    numbered = pairs.with_columns_seq(sequence=pl.struct(list(SEQUENCE)).rle_id())
    groups = group_rows(numbered, ["sequence", *_OF_SCENE])
    known = {name: pl.col(name) for name in (*_OF_SCENE, *CHANGE_SUMS)} | {"block": pl.lit(0)}
    columns = [known.get(name, pl.lit(None)).cast(kind).alias(name) for name, kind in INCREMENTS.items()]
    return groups.keys.hstack(groups.sums(pairs, CHANGE_SUMS)).select_seq(columns)


def _long_lived(aspects: pl.DataFrame) -> pl.DataFrame:
    return aspects.filter(LONG_LIVED)


def _rows(tables: _Sums, draws: Draws, method: Method, min_features: int, step: int) -> Iterator[dict[str, Any]]:
    """Rows of a condition and trimming, by the columns of `TIME_STRUCTURE`."""
    units = growth_units(tables.scenes, tables.blocks, tables.changes, tables.lived, tables.lived_blocks, draws.groups)
    errors, fitted = units.errors, fit_ages(units.errors, min_features=min_features)
    ages = Ages(errors.points["since"].to_numpy().astype(np.float64), fitted, step)
    related = _related(tables.changes, draws, method, resampled=errors.resampled is not None)
    made, n_ages = method.by_bootstrap(), int(np.count_nonzero(fitted))
    n_scenes = tables.scenes["measured"].n_unique()
    labels = {"n_ages": n_ages, "n_scenes": n_scenes, "resampled": errors.resampled, "kind": made.kind,
              "autocorrelation_kind": method.kind}  # fmt: skip
    usable = n_ages >= MIN_AGES and bool((errors.sums[:, fitted, 1:].sum(axis=0) > 0).all())
    fits = growth_fits(units, ages, draws.weights(errors), made) if usable else (None, None)
    for place, (coordinate, fit) in enumerate(zip("uv", fits, strict=True)):
        correlations = {f"autocorrelation{end}": found[place] for end, found in related.items()}
        if fit is None:
            few = f"ages with enough errors: {n_ages}; at least {MIN_AGES} are needed"
            why = few if n_ages < MIN_AGES else "all errors are zero at some age"
            found = {**_bounds(correlations), "verdict": Behaviour.undecided, "why": why}
        else:
            verdict, why = behaves(fit, Changes(correlations.get("autocorrelation"), tables.mean_px_per_frame[place]))
            found = {**_bounds({**correlations, **_named(fit)}), "verdict": verdict, "why": why}
        yield {"coordinate": coordinate, **labels, **found}


def _named(fit: Growth) -> dict[str, Estimate]:
    """Sizes by their columns."""
    geometric = {f"{_COLUMNS[term]}_geometric": size for term, size in fit.geometric.items()}
    return {_COLUMNS[term]: size for term, size in fit.sizes.items()} | geometric


def _bounds(found: Mapping[str, Estimate]) -> dict[str, float | None]:
    """Values and bounds by their columns."""
    return {
        f"{name}{end}": getattr(estimate, which)
        for name, estimate in found.items()
        for end, which in (("", "value"), ("_low", "low"), ("_high", "high"))
    }


def _of_lags(increments: pl.DataFrame) -> pl.DataFrame:
    """Rows of `INCREMENTS` and columns that (autocorrelation) is made of."""
    return increments.filter(pl.col("lag") > 0).select_seq(*_PAIRS, *CHANGE_SUMS)


def _related(
    changes: pl.DataFrame | None, draws: Draws, method: Method, *, resampled: bool
) -> dict[str, tuple[Estimate, Estimate]]:
    """(autocorrelation) of u and of v by the end of the name of its column; if `resampled`, of blocks too."""
    if changes is None:
        return {}
    blocks = changes if resampled else None
    units = units_of(changes, blocks, points=["lag"], columns=CHANGE_SUMS, groups=draws.groups).across_groups()
    found = correlated(units, draws.weights(units), method)
    ends = ["" if lag == 1 else f"_{lag}" for lag in units.points["lag"]]
    return {end: (found.at(0, place), found.at(1, place)) for place, end in enumerate(ends)}


def _apart(moments: pl.DataFrame | None) -> pl.DataFrame | None:
    """Moments by how far they are from where errors are zero, before or after."""
    return None if moments is None else moments.with_columns_seq(pl.col("since").abs())
