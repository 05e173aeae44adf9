"""The table of results: its columns, the identity of a row, and the choice of rows.

A row is one number (or one verdict) with its interval, its uncertainty between scenes, and what it is of. Its `id` is
made from the columns of `IDENTITY` alone, so that the same number has the same id in every run and after every change
of its value. Nothing else in a run holds a number that is not a row here, but for the sums of single scenes and the
tables of settings and counts that they come from.
"""

import hashlib
from collections.abc import Collection, Iterable
from enum import StrEnum

import polars as pl

from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.units import Resampled
from tracknoise.tables.enumerations import Behaviour, EffectIntervalKind, Shape, Verdict
from tracknoise.tables.schema import ASPECT, POPULATION, TRIMMING, VIEW, WEIGHTING, Schema


class Caveat(StrEnum):
    """What limits a number.

    few_features: fewer features than the cut-off of curves. few_scenes: so few scenes that intervals contain the true
    value less often than they say. these_scenes: the interval holds for the measured scenes only. these_groups: it
    holds for the measured groups of scenes only. no_interval: it has none. untrusted_truth: it is made from errors
    about a truth that is not trusted.
    """

    few_features = "few features"
    few_scenes = "few scenes"
    these_scenes = "these scenes only"
    these_groups = "these groups only"
    no_interval = "no interval"
    untrusted_truth = "truth not trusted"


ENOUGH_SCENES = 8
"""With fewer scenes than this, intervals contain the true value less often than their level says."""
_VERDICTS = list(dict.fromkeys(str(name) for kind in (Verdict, Shape, Behaviour) for name in kind))
_AXES = ("age", "frame", "lag", "lifetime", "window", "length")
_NAME = pl.Categorical()
"""Names: few different ones in many rows."""
IDENTITY: Schema = {
    "quantity": _NAME,
    "dataset": _NAME,
    **{name: _NAME if kind == pl.String else kind for name, kind in VIEW.items()},
    "tracker": _NAME,
    "speed": pl.Int32,
    "topic": _NAME,
    "factor": _NAME,
    "of": _NAME,
    "axis": pl.Enum(_AXES),
    "at": pl.Int64,
    "at_low": pl.Int64,
    "at_high": pl.Int64,
    "coordinate": _NAME,
    "part": _NAME,
    "part_low": pl.Float64,
    "part_high": pl.Float64,
    "against": _NAME,
    "aspect": ASPECT,
    "at_least": pl.UInt32,
    "population": POPULATION,
    "trimming": TRIMMING,
    "weighting": WEIGHTING,
}
"""Columns that say what a row is; null where one does not apply. Together they are different in every row.

of is the statistic that an effect, a spread or a class is about. at is an age, a frame, a lag, a lifetime or the length
of a window, as `axis` says; at_low and at_high bound a range of ages or lengths. part names a class, a cause, a cell or
a kind; part_low and part_high are the bounds of a class. against is what the number is compared with.
"""
RESULTS: Schema = {
    "id": pl.String,
    **IDENTITY,
    "unit": _NAME,
    "value": pl.Float64,
    "low": pl.Float64,
    "high": pl.Float64,
    "level": pl.Float64,
    "interval": pl.Enum([*map(str, IntervalKind), *map(str, EffectIntervalKind)]),
    "resampled": pl.Enum(Resampled),
    "n_units": pl.Int32,
    "n_scenes": pl.Int32,
    "n": pl.Int64,
    "spread": pl.Float64,
    "next_low": pl.Float64,
    "next_high": pl.Float64,
    "coverage": pl.Float64,
    "verdict": pl.Enum(_VERDICTS),
    "level_a": _NAME,
    "level_b": _NAME,
    "larger": _NAME,
    "better": _NAME,
    "why": pl.String,
    "caveats": pl.List(pl.Enum(Caveat)),
}
"""One row per number. Columns after `IDENTITY`:

unit is 1 for ratios and counts. low and high bound the interval of probability `level`, made by the method
`interval` from n_units units, which are `resampled`. n counts what the number is of: errors, windows, tracks or
features. spread, next_low, next_high and coverage are as in `tracknoise.tables.findings_schema.INTERVALS`. level_a and
level_b are the levels of a factor that an effect compares; larger is the one with the larger value, better the better
one. why says in words what a verdict rests on or what is missing. caveats are those of `Caveat`.
"""
_NUMBERS = tuple(name for name in RESULTS if name not in ("id", *IDENTITY, "caveats"))
_BYTES = 6
_AT_ONCE = 20_000
"""Rows whose identities are written out at a time."""


def finished(rows: Iterable[pl.DataFrame]) -> pl.DataFrame:
    """One table of results from parts of it: rows of one identity become one, and every row gets its id and caveats.

    `rows`: with columns of `RESULTS`, of which any but the quantity, the topic and `cut` may be missing.
    """
    kinds = {name: kind for name, kind in RESULTS.items() if name not in ("id", "caveats")} | {"cut": pl.Boolean}
    table = pl.concat(
        [pl.DataFrame(schema=kinds), *(_typed(part, kinds) for part in rows if part.height)], how="diagonal"
    )
    table = _merged(table.insert_column(0, _ids(table)))
    return table.with_columns(caveats=_caveats()).select(list(RESULTS))


def ids(rows: Iterable[pl.DataFrame]) -> pl.Series:
    """Ids of rows of results, one part after the other.

    `rows`: with columns of `RESULTS`, of which any but quantity and topic may be missing.
    """
    return _ids(pl.concat([pl.DataFrame(schema=IDENTITY), *(_typed(part, IDENTITY) for part in rows)], how="diagonal"))


def quantity_of(name: str) -> str:
    """The quantity of a row of results, by its id."""
    return name.rpartition("-")[0]


def _typed(rows: pl.DataFrame, kinds: Schema) -> pl.DataFrame:
    """Those columns of rows that have a kind, of their kinds."""
    return pl.DataFrame([column.cast(kinds[column.name]) for column in rows.iter_columns() if column.name in kinds])


def beside_untrusted_truth(results: pl.DataFrame, without_truth: Collection[str]) -> pl.DataFrame:
    """The same results, where numbers that are made from errors have the caveat that their truth is not trusted.

    `without_truth`: topics of the others.
    """
    is_made_from_errors = ~pl.col("topic").is_in(list(without_truth))
    caveat = pl.when(is_made_from_errors).then(pl.lit(str(Caveat.untrusted_truth)))
    marked = pl.concat_list(pl.col("caveats").cast(pl.List(pl.String)), caveat).list.drop_nulls()
    return results.with_columns(caveats=marked.cast(RESULTS["caveats"]))


def _merged(table: pl.DataFrame) -> pl.DataFrame:
    """One row for each id, at the place of its first, whose missing cells are those of the next that has them."""
    place = table.select(place=pl.col("id").cum_count().over("id")).to_series()
    merged = table.filter(place == 1)
    for later in range(2, int(place.max() or 0) + 1):  # type: ignore[arg-type]
        more = table.filter(place == later)
        filled = [name for name in (*_NUMBERS, "cut") if more[name].null_count() < more.height]
        merged = merged.join(more.select("id", *filled), on="id", how="left", suffix=" later", maintain_order="left")
        merged = merged.with_columns(pl.coalesce(name, f"{name} later").alias(name) for name in filled)
        merged = merged.drop(f"{name} later" for name in filled)
    return merged


def _ids(table: pl.DataFrame) -> pl.Series:
    """The quantity and a checksum of the identity of each row."""
    cells = [pl.col(name).cast(pl.String).fill_null("") for name in IDENTITY]
    parts = [pl.Series("id", [], dtype=pl.String)]
    for chunk in table.iter_slices(_AT_ONCE):
        words = chunk.select_seq(name=pl.col("quantity").cast(pl.String), words=pl.concat_str(cells, separator="|"))
        sums = (hashlib.blake2b(text.encode(), digest_size=_BYTES).hexdigest() for text in words["words"])
        names = [f"{name}-{checksum}" for name, checksum in zip(words["name"], sums, strict=True)]
        parts.append(pl.Series("id", names, dtype=pl.String))
    return pl.concat(parts)


def _caveats() -> pl.Expr:
    """Caveats of each row, from its numbers."""
    bounded = pl.col("low").is_not_null() | pl.col("high").is_not_null()
    when = {
        Caveat.few_features: pl.col("cut").fill_null(False),
        Caveat.few_scenes: bounded & (pl.col("n_scenes") < ENOUGH_SCENES),
        Caveat.these_scenes: bounded & (pl.col("resampled") == Resampled.blocks),
        Caveat.these_groups: bounded & (pl.col("resampled") == Resampled.within),
        Caveat.no_interval: ~bounded & pl.col("value").is_not_null(),
    }
    names = [pl.when(holds).then(pl.lit(str(name))) for name, holds in when.items()]
    return pl.concat_list(names).list.drop_nulls().cast(RESULTS["caveats"])
