"""Rows of the table of factor effects: what was found about each question, and the verdict."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.factors.answers import Answer, Question, answer
from tracknoise.findings.factors.differences import Differences
from tracknoise.findings.factors.questions import Cell
from tracknoise.findings.sampling.groups import MIN_WITHIN
from tracknoise.findings.sampling.multiplicity import benjamini_hochberg
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.findings.wording import count
from tracknoise.statistics.grouping import group_rows
from tracknoise.tables.enumerations import EffectIntervalKind, Verdict
from tracknoise.tables.findings_schema import DEPENDENCE
from tracknoise.tables.schema import VERDICT, check

Row: TypeAlias = dict[str, Any]
"""Columns of `DEPENDENCE`, without q-values and verdict, and `gap`: why there can be no `no`, if so."""
_SIGNED = "mean"
_LARGER_IS_BETTER = "lifetime"
_ROUNDING = 1e-12
_FEW = f"at least {MIN_SCENES} are needed"


def row_of(
    cell: Cell,
    role: str,
    statistic: str,
    places: NDArray[np.int64],
    asked: Differences,
    question: Question | None,
    margin: float,
    group: NDArray[np.intp],
) -> Row:
    """What is known about one statistic of a cell.

    Parameters
    ----------
    cell
        The cell.
    role, statistic
        Role and name of the statistic.
    places
        Ages, or frames from the key frame on, of the points: each has two points, u and v.
    asked, question
        Differences between the levels, and what is asked of them; None where too few scenes were measured.
    margin
        Largest difference that counts as no effect: of logarithms, or in px; NaN where it is unknown.
    group
        Number of the group of each scene.
    """
    levels = [str(level) for level in cell.levels]
    found = None if question is None else answer(asked, question)
    shared = asked.both.sum(axis=0)
    row: Row = {
        **cell.key,
        "statistic": statistic,
        "unit": "px" if role == _SIGNED else "ratio",
        "n_levels": len(levels),
        "n_pairs": 0 if found is None else int(found.compared.any(axis=1).sum()),
        "n_scenes": int(shared.min(initial=shared.max(initial=0))),
        "margin": None if np.isnan(margin) else _size(margin, role),
        "gap": _gap(cell.factor, levels, asked, found, group, question),
    }
    if question is not None:
        row |= {"resampled": question.resampled}
    if found is not None:
        row |= _compared(found, places, asked) | _pair(found, levels, asked, role) | _point(found, places)
        row |= _sizes(found, role, asked)
    return row


def _size(difference: float, role: str) -> float:
    """A difference in the unit of the effect."""
    return difference if role == _SIGNED else float(np.exp(difference))


def _sizes(found: Answer, role: str, asked: Differences) -> Row:
    """Effect and bounds of the reported pair, of its larger level over, or minus, its smaller one."""
    low, high = (found.low, found.high) if found.difference >= 0 else (-found.high, -found.low)
    smaller = 1 if found.difference >= 0 else 0
    return {
        "effect": _size(abs(found.difference), role),
        "low": max(low, 0.0) if role == _SIGNED else _size(low, role),
        "high": None if asked.scarce[found.pair, smaller] else _size(high, role),
        "most": None if asked.scarce.any() else _size(found.most, role),
        "p_yes": found.p_yes,
        "p_no": found.p_no,
        "more_scenes": found.more_scenes,
    }


def _pair(found: Answer, levels: Sequence[str], asked: Differences, role: str) -> Row:
    """Levels of the reported pair, and which of them is larger and which is better."""
    a, b = (levels[number] for number in asked.pairs[found.pair])
    horizon = asked.horizon[found.pair]
    larger, smaller = (a, b) if found.difference > 0 else (b, a) if found.difference < 0 else (None, None)
    better = None if role == _SIGNED else larger if role == _LARGER_IS_BETTER else smaller
    until = None if np.isnan(horizon) else float(horizon)
    return {"level_a": a, "level_b": b, "larger": larger, "better": better, "horizon": until}


def _point(found: Answer, places: NDArray[np.int64]) -> Row:
    """Coordinate and age that decide, if a single one does."""
    if found.point is None:
        return {}
    place, coordinate = divmod(found.point, 2)
    return {"coordinate": "uv"[coordinate], "at": int(places[place])}


def _compared(found: Answer, places: NDArray[np.int64], asked: Differences) -> Row:
    """How many ages were compared, and from which to which."""
    if asked.values.shape[2] == 1:
        return {}
    there = places[found.compared.reshape(-1, len(places), 2).any(axis=(0, 2))]
    return {"n_places": len(there), "at_low": int(there.min()), "at_high": int(there.max())}


def _gap(
    factor: str,
    levels: Sequence[str],
    asked: Differences,
    found: Answer | None,
    group: NDArray[np.intp],
    question: Question | None,
) -> str | None:
    """What is missing for a `no`; None if nothing is."""
    if len(levels) < 2:
        return f"only one {factor} was measured: {''.join(levels)}"
    if found is not None and found.compared.any(axis=1).all():
        unlike = (asked.unlike & found.compared).any()
        return "a value of 0 at one of two levels, which has no ratio" if unlike else asked.gap
    fewest = int(asked.both.sum(axis=0).min())
    if fewest < MIN_SCENES:
        return f"two levels share only {count(fewest, 'scene')}; {_FEW}"
    if question is None:
        return _few_groups(asked, group)
    if found is None:
        return f"no age or frame has {MIN_SCENES} scenes with data at two levels"
    missing = _never_compared(levels, asked, found)
    if missing:
        return f"nothing to compare {factor} {', '.join(missing)} by"
    return "some pairs of levels have too few scenes with data at both levels"


def _few_groups(asked: Differences, group: NDArray[np.intp]) -> str:
    """Why nothing could be asked of enough scenes."""
    part = group[asked.both.any(axis=1)]
    n_groups = len(np.unique(part))
    if n_groups < MIN_SCENES and len(part) - n_groups < MIN_WITHIN:
        return f"the scenes form only {count(n_groups, 'group')}; {_FEW}, or {MIN_WITHIN} more scenes than groups"
    return "errors have no scale that a margin could be a share of"


def _never_compared(levels: Sequence[str], asked: Differences, found: Answer) -> list[str]:
    """Levels that are in no pair that was compared."""
    known = set(asked.pairs[found.compared.any(axis=1)].ravel().tolist())
    return [level for number, level in enumerate(levels) if number not in known]


def judged(rows: Sequence[Row], level: float) -> pl.DataFrame:
    """The table (`DEPENDENCE`) of rows, with q-values, verdicts, and why one is undecided.

    Parameters
    ----------
    rows
        Of all questions of a run, in their order.
    level
        q-values may be at most 1 - level.
    """
    known: Mapping[str, Any] = {name: kind for name, kind in DEPENDENCE.items() if name not in ("verdict", "why")}
    table = pl.DataFrame(rows, schema={**known, "gap": pl.String}, orient="row").with_columns_seq(
        pl.lit(level).alias("level"), kind=pl.lit(EffectIntervalKind.paired, dtype=DEPENDENCE["kind"])
    )
    table = table.with_columns_seq(_q(table, "yes"), _q(table, "no")).with_columns_seq(verdict=_verdict(level))
    table = table.with_columns_seq(why=_why(level), more_scenes=pl.when(_is_open()).then("more_scenes"))
    return check(
        table.select_seq(pl.col(name).cast(kind) for name, kind in DEPENDENCE.items()), DEPENDENCE, "dependence"
    )


def _q(table: pl.DataFrame, name: str) -> pl.Series:
    """q-values over the rows of each dataset and factor."""
    values = table[f"p_{name}"].to_numpy().astype(np.float64)
    families = group_rows(table, ["dataset", "factor"])
    for family in range(families.count):
        rows = families.index == family
        values[rows] = benjamini_hochberg(values[rows])
    return pl.Series(f"q_{name}", values).fill_nan(None)


def _is_open() -> pl.Expr:
    return pl.col("verdict") == Verdict.undecided


def _all_below(level: float) -> pl.Expr:
    return pl.col("p_no") <= (1 - level) / 2 + _ROUNDING


def _verdict(level: float) -> pl.Expr:
    largest_q = 1 - level + _ROUNDING
    exceeds = pl.col("q_yes") <= largest_q
    none_does = pl.col("gap").is_null() & _all_below(level) & (pl.col("q_no") <= largest_q)
    answer = pl.when(exceeds).then(pl.lit(Verdict.yes)).when(none_does).then(pl.lit(Verdict.no))
    return answer.otherwise(pl.lit(Verdict.undecided)).cast(VERDICT)


def _why(level: float) -> pl.Expr:
    """Why a verdict is undecided; null for the others."""
    shown = (pl.col("p_yes") <= 1 - level) | _all_below(level)
    holds = (pl.col("low") <= pl.col("margin")) & (pl.col("high").fill_null(math.inf) >= pl.col("margin"))
    return (
        pl.when(~_is_open())
        .then(None)
        .when(pl.col("gap").is_not_null())
        .then("gap")
        .when(shown)
        .then(pl.lit("not significant after the correction for multiple tests"))
        .when(holds)
        .then(pl.lit("the interval contains the margin"))
        .otherwise(pl.lit("at some age, a difference above the margin cannot be excluded"))
    )
