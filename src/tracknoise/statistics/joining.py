"""Tables of a sequence that was measured in parts: from the tables of its parts.

Rows of single things, such as observations, follow each other, with frames and tracks numbered through the sequence.
Sums add up, and moments are pooled. Blocks of tracks are those of the whole sequence: block b of B of part p of P is
block floor((p B + b) / P).

Three kinds of numbers cannot be added up:

- Robust scales: the core of the sequence is the mean of the logarithms of those of its parts, weighted by the number
  of errors. Errors beyond three cores are counted in each part with its own core.
- Thresholds and limits, such as that of trimming, belong to a part; the largest is stated.
- Errors of relative poses: means over all pairs of frames. A root is stated where parts show that it is positive.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import special

from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.units import BLOCKS
from tracknoise.statistics.grouping import group_rows, total_if_known
from tracknoise.statistics.moments import SECOND, merge
from tracknoise.statistics.samples import MAX_TRACKS, PER_AGE, first_tracks
from tracknoise.statistics.trimming import DROPPED_SHARE
from tracknoise.tables.schema import ORIGIN, Schema, joined, typed

OF_THE_WHOLE = ("poses", "cameras", "path", "pose_differences")
"""Tables that are made of the whole sequence, whose poses and cameras are at hand, rather than of its parts."""
_ROWS = (
    "observations",
    "tracks",
    "frames",
    "seed_frames",
    "samples",
    "audit_samples",
    "noise_tracks",
    "track_errors",
    "pair_tracks",
)
"""Tables of single things, which follow each other."""
_FOURTH = ("moments", "aspects", "seed_moments", "kind_moments")
_SECOND = ("blocks", "aspect_blocks", "between_trackers")
_FRAMES = ("frame", "birth_frame", "first_frame", "anchor_frame")
_BOUNDS = ("low", "high", "bin_low_px", "bin_high_px")
"""Columns of floats that identify a row."""
_NAMES = list(ORIGIN)


@dataclass(frozen=True, slots=True)
class Part:
    """Where a part of a sequence belongs."""

    # place, count: which part it is, from 0, of how many
    place: int
    count: int
    first_frame: int  # its first frame
    first_track: Mapping[tuple[str, int], int]  # number of its first track, by tracker and speed


def join(name: str, parts: Iterable[tuple[Part, pl.DataFrame]], schema: Schema) -> pl.DataFrame:
    """One table of a sequence from those of its parts.

    Sums and moments of each part are added up first: its blocks are few of the sequence, which has many parts.

    Parameters
    ----------
    name
        Of the table, as in `tracknoise.tables.store`.
    parts
        In the order of their frames, with their tables, which may be read one by one.
    schema
        Of the table.
    """
    combined = _JOINS.get(name, _added)
    placed = (place(table, part, name).collect() for part, table in parts)
    if combined in _OF_SUMS:
        placed = (combined(table, schema) for table in placed)
    return combined(joined([*placed], schema), schema)


def place(table: pl.DataFrame | pl.LazyFrame, part: Part, name: str) -> pl.LazyFrame:
    """A table of a part with the frames, tracks and blocks of the whole sequence."""
    lazy = table.lazy()
    kinds = lazy.collect_schema()
    numbered = {column: pl.col(column) + part.first_frame for column in _FRAMES if column in kinds}
    if "track" in kinds:
        numbered["track"] = pl.col("track") + _first_track(part)
    if "block" in kinds:
        n_blocks = BLOCKS // 2 if name in _HALF_AS_MANY_BLOCKS else BLOCKS
        numbered["block"] = (pl.col("block").cast(pl.UInt32) + part.place * n_blocks) // part.count
    return lazy.with_columns(value.cast(kinds[column]).alias(column) for column, value in numbered.items())


def rows_of(table: pl.DataFrame, part: Part, n_frames: int) -> pl.DataFrame:
    """Observations or tracks of a part of so many frames out of those of the sequence, numbered as in the part."""
    frame = next(name for name in ("frame", "first_frame") if name in table.columns)
    rows = table.filter(pl.col(frame).is_between(part.first_frame, part.first_frame + n_frames - 1))
    numbered = {frame: pl.col(frame) - part.first_frame, "track": pl.col("track") - _first_track(part)}
    return rows.with_columns(value.cast(table.schema[column]).alias(column) for column, value in numbered.items())


_HALF_AS_MANY_BLOCKS = ("surroundings", "image_map", "image_speeds")


def _first_track(part: Part) -> pl.Expr:
    """Number of the first track of the tracker and speed of each row."""
    first: pl.Expr = pl.lit(0, dtype=pl.UInt32)
    for (tracker, speed), number in part.first_track.items():
        is_it = (pl.col("tracker") == tracker) & (pl.col("speed") == speed)
        first = pl.when(is_it).then(pl.lit(number, dtype=pl.UInt32)).otherwise(first)
    return first


def keys_of(schema: Schema) -> list[str]:
    """Columns that identify a row of a table of sums: names, classes and numbers, but no counts and no sums."""
    return [name for name, kind in schema.items() if name in _BOUNDS or not _is_value(name, kind)]


def _is_value(name: str, kind: object) -> bool:
    is_float = kind in (pl.Float32, pl.Float64)
    return is_float or name == "n" or name.startswith(("n_", "beyond")) or isinstance(kind, pl.List)


def _added(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Sums of the rows that agree in all keys, sorted; null where one of them is."""
    keys = keys_of(schema)
    if table.is_empty():
        return table
    rows = group_rows(table, keys)
    values = [name for name in schema if name not in keys]
    lists = [name for name in values if isinstance(schema[name], pl.List)]
    totals = rows.sums(table, [name for name in values if name not in lists]).fill_nan(None)
    counts = {name: _added_lists(table[name], rows.index, rows.count) for name in lists}
    summed = rows.keys.hstack(totals).with_columns(pl.Series(name, lists) for name, lists in counts.items())
    return typed(summed, schema)


def _added_lists(column: pl.Series, index: NDArray[np.intp], count: int) -> list[list[int] | None]:
    """Sums of lists of counts, element by element, by group."""
    longest = max(column.list.len().drop_nulls().to_list(), default=0)
    total = np.zeros((count, longest), dtype=np.int64)
    has_counts = np.zeros(count, dtype=bool)
    for row, values in zip(index.tolist(), column.to_list(), strict=True):
        if values is not None:
            total[row, : len(values)] += values
            has_counts[row] = True
    return [line.tolist() if is_known else None for line, is_known in zip(total, has_counts, strict=True)]


def _rows(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Rows of each tracker and speed together, in the order of the parts."""
    numbers = table.select("tracker", "speed").unique(maintain_order=True).with_row_index("condition")
    numbered = table.join(numbers, on=["tracker", "speed"], how="left", maintain_order="left")
    return numbered.sort("condition", maintain_order=True).drop("condition")


def _pooled(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    return merge(table, by=keys_of(schema)).select(list(schema)) if table.height else table


def _pooled_to_second(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """As `_pooled`, of means and sums to order 2; tables without means of absolute errors get none."""
    if table.is_empty():
        return table
    absolute = {name: pl.lit(0.0) for name in ("mean_abs_u", "mean_abs_v") if name not in schema}
    return merge(table.with_columns(**absolute), by=keys_of(schema), orders=SECOND).select(list(schema))


def _increments(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Changes by age are pooled, and products of changes added up."""
    moments = {name: kind for name, kind in schema.items() if not name.startswith(("lagged", "squares"))}
    by_age = _pooled_to_second(table.filter(lag=0).select(list(moments)), moments)
    products = _added(table.filter(pl.col("lag") > 0), schema)
    return joined([by_age, products], schema).sort(keys_of(schema))


def _trims(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Counts of tracks added up, with the largest threshold of a part."""
    counts = [name for name in schema if name.startswith("n_")]
    totals = table.group_by(_NAMES, maintain_order=True).agg(
        pl.col("percentile", "among").first(), pl.col("threshold_px").max(), pl.col(counts).sum()
    )
    return totals.with_columns(dropped_share=DROPPED_SHARE).select(list(schema)).sort(_NAMES)


def _scales(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Of the parts that have both cores, where there are any; null elsewhere."""
    keys = keys_of(schema)
    cores = ["core_u_px", "core_v_px"]
    has_cores = pl.all_horizontal(pl.col(cores).is_not_null())
    used = table.filter(has_cores | ~has_cores.any().over(keys))
    means = {name: _mean(pl.col(name).log(), pl.col("n")).exp() for name in cores}
    scales = {name: pl.when(pl.col(name).null_count() == 0).then(value) for name, value in means.items()}
    counts = [total_if_known(name, pl.col(name).sum()) for name in ("n", "beyond_u", "beyond_v")]
    return used.group_by(keys, maintain_order=True).agg(*counts, **scales).select(list(schema)).sort(keys)


def _mean(value: pl.Expr, weight: pl.Expr) -> pl.Expr:
    return (value * weight).sum() / weight.sum()


def _largest_limit(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    keys = keys_of(schema)
    counts = pl.col([name for name in schema if _is_value(name, schema[name]) and name != "limit_px"]).sum()
    return (
        table.group_by(keys, maintain_order=True).agg(counts, pl.col("limit_px").max()).select(list(schema)).sort(keys)
    )


_SQUARES = {"rotation_deg": "rotation_{0}{0}_deg2", "translation_m": "translation_{0}{0}_m2"}


def _pose_growth(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Means over pairs of frames; a root where Student's test over the parts shows that the mean is positive."""
    keys = keys_of(schema)
    squares = [form.format(axis) for form in _SQUARES.values() for axis in "xyz"]
    image = [name for name in schema if "px2" in name]
    weights = {name: pl.when(pl.col(name).is_not_null()).then(pl.col("n")) for name in image}
    means = {name: _mean(pl.col(name), weights.get(name, pl.col("n"))) for name in [*squares, *image]}
    counts = range(_FEWEST_PARTS, max(table.height, _FEWEST_PARTS) + 1)
    bounds = {count: float(special.stdtrit(count - 1, 0.5 + LEVEL / 2)) for count in counts}
    bound = pl.col("n").len().replace_strict(bounds, default=None, return_dtype=pl.Float64)
    roots = {}
    for root, form in _SQUARES.items():
        of_part = pl.mean_horizontal(form.format(axis) for axis in "xyz")
        mean, error = _mean(of_part, pl.col("n")), of_part.std() / pl.col("n").len().sqrt()
        shown = (mean > 0) & (mean > bound * error)
        roots[root] = pl.when(shown).then(mean.sqrt())
    totals = table.group_by(keys, maintain_order=True).agg(pl.col("n").sum(), **means, **roots)
    without_nan = totals.with_columns(pl.col(image).fill_nan(None))
    return typed(without_nan, schema).sort(keys)


_FEWEST_PARTS = 4


def _samples(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    return first_tracks(table, MAX_TRACKS).sort([*_NAMES, "age_low", "track"])


def _audit_samples(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    return first_tracks(table.with_columns(age_low="age"), PER_AGE).drop("age_low").sort("tracker", "track", "frame")


def _metrics(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Metrics of point tracking: means over the points of all parts."""
    keys = keys_of(schema)
    values = [name for name in schema if name not in (*keys, "n_points")]
    means = {name: _mean(pl.col(name), pl.when(pl.col(name).is_not_null()).then(pl.col("n_points"))) for name in values}
    totals = table.group_by(keys, maintain_order=True).agg(pl.col("n_points").sum(), **means)
    return totals.select(list(schema)).with_columns(pl.col(values).fill_nan(None)).sort(keys)


def _patches(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Of each tracker and age the pictures of the part with the largest error."""
    keys = [*_NAMES, "at"]
    largest = (pl.col("du_px").list.first() ** 2 + pl.col("dv_px").list.first() ** 2).alias("largest")
    ordered = table.with_columns(largest).sort("largest", descending=True, maintain_order=True)
    return ordered.unique(keys, keep="first", maintain_order=True).drop("largest").sort(keys)


def _depth_repeats(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Cells of all parts, in the order of their depths."""
    return table.sort("depth_m")


def _rig(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """The second camera, which is that of all parts."""
    return table.head(1)


def _film(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Images of frames, in their order."""
    return table.sort("frame")


_OF_SUMS = _added, _pooled, _pooled_to_second
_JOINS: Mapping[str, Callable[[pl.DataFrame, Schema], pl.DataFrame]] = MappingProxyType(
    {
        **dict.fromkeys(_ROWS, _rows),
        **dict.fromkeys(_FOURTH, _pooled),
        **dict.fromkeys(_SECOND, _pooled_to_second),
        "increments": _increments,
        "trims": _trims,
        "scales": _scales,
        "scale_blocks": _scales,
        "kind_scales": _scales,
        "noise_outliers": _largest_limit,
        "pose_growth": _pose_growth,
        "samples": _samples,
        "audit_samples": _audit_samples,
        "point_tracking": _metrics,
        "patches": _patches,
        "film": _film,
        "rig": _rig,
        "depth_repeats": _depth_repeats,
    }
)
