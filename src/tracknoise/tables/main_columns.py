"""The columns of the table of results that a person reads: at most twelve, in which no two rows are alike.

Columns of the identity that have none of their own are words in the column `what`, where they differ between rows of a
quantity.
"""

from collections.abc import Iterator

import polars as pl

from tracknoise.tables.results import IDENTITY, RESULTS
from tracknoise.tables.schema import Schema

_WHAT = "what"
MAIN: Schema = {
    "quantity": RESULTS["quantity"],
    "tracker": RESULTS["tracker"],
    "speed": RESULTS["speed"],
    _WHAT: pl.String,
    "axis": RESULTS["axis"],
    "at": RESULTS["at"],
    "coordinate": RESULTS["coordinate"],
    "verdict": RESULTS["verdict"],
    "value": RESULTS["value"],
    "low": RESULTS["low"],
    "high": RESULTS["high"],
    "unit": RESULTS["unit"],
}
"""Columns of results that a person reads: those of `RESULTS`, and `what`.

what says in words where a row stands among those of its quantity in the run: everything of `IDENTITY`, but for the
tracker and the speed, that is not the same in all of them, such as "age 10, u, untrimmed, visible". A terminal that
shows the first four columns and the last four shows all that is needed to read a number.
"""
_PLAIN = ("coordinate", "trimming", "population")
"""Columns whose values say by themselves what they are."""
_RANGES = (("at_low", "at_high"), ("part_low", "part_high"))
"""Columns that bound a range together; the first range is one of the axis."""
_DIGITS = 6


def main_columns(rows: pl.DataFrame, results: pl.DataFrame) -> pl.DataFrame:
    """Rows of a table of results with the columns that a person reads.

    Parameters
    ----------
    rows, results
        Some rows, and all of the run. Columns are those of `RESULTS`.

    Returns
    -------
    polars.DataFrame
        The same rows. Columns are those of `MAIN`; no two rows are the same in quantity, tracker, speed and what.
    """
    named = [name for name in IDENTITY if name not in ("quantity", "tracker", "speed")]
    differs = results.group_by("quantity").agg((pl.col(name).n_unique() > 1).name.prefix("differs ") for name in named)
    marked = rows.join(differs, on="quantity", how="left", maintain_order="left")
    words = pl.concat_str(list(_words(named)), separator=", ", ignore_nulls=True)
    return marked.with_columns(words.alias(_WHAT)).select(list(MAIN))


def _words(named: list[str]) -> Iterator[pl.Expr]:
    """Parts of the text of each row, in their order; null where a part does not apply, or is the same in all rows."""
    (at_low, at_high), (part_low, part_high) = _RANGES
    where = (pl.col("at").cast(pl.String), _range(at_low, at_high))
    along = pl.coalesce(pl.col("axis").cast(pl.String), pl.when(pl.coalesce(where).is_not_null()).then(pl.lit("at")))
    yield _where(_joined(along, *where), "axis", "at", at_low, at_high)
    for name in _PLAIN:
        yield _where(pl.col(name).cast(pl.String), name)
    yield _where(_named("of"), "of")
    part = _joined(pl.col("part").cast(pl.String), _range(part_low, part_high))
    yield _where(pl.format("part {}", part.replace("", None)), "part", part_low, part_high)
    done = {"axis", "at", "of", "part", *_PLAIN, *(bound for bounds in _RANGES for bound in bounds)}
    for name in named:
        if name not in done:
            yield _where(_named(name), name)


def _where(text: pl.Expr, *names: str) -> pl.Expr:
    """A text where one of these columns is not the same in all rows of the quantity."""
    differs = pl.any_horizontal(pl.col(f"differs {name}") for name in names)
    return pl.when(differs & (text != "")).then(text)


def _joined(*words: pl.Expr) -> pl.Expr:
    return pl.concat_str(words, separator=" ", ignore_nulls=True)


def _named(name: str) -> pl.Expr:
    return pl.format(f"{name.replace('_', ' ')} {{}}", pl.col(name).cast(pl.String).replace("", None))


def _range(low: str, high: str) -> pl.Expr:
    """Bounds of a range as text; null where there is none."""
    lower, upper = (_number(pl.col(name)) for name in (low, high))
    return pl.coalesce(pl.format("{} to {}", lower, upper), pl.format("from {}", lower), pl.format("to {}", upper))


def _number(value: pl.Expr) -> pl.Expr:
    """A number as text of a few digits; a whole one without a point."""
    return value.cast(pl.Float64).round_sig_figs(_DIGITS).cast(pl.String).str.strip_suffix(".0")
