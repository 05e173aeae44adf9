"""Ranks of trackers by a statistic: which are shown to differ, and which cannot be distinguished.

Every two trackers are compared like the levels of a factor of two (`tracknoise.analysis.factors`). A tracker of n is
between the ranks

    best = 1 + number of trackers that are shown to be better,  worst = n - number that are shown to be worse    (ranks)

where a difference within the margin counts as none, and one at a single age neither. Of all pairs that are said to
differ by one statistic, at most 1 - level are alike, on average.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import combinations

import polars as pl

from tracknoise.analysis.factor_values import CORE, DISAGREE, Cell
from tracknoise.tables.enumerations import Verdict
from tracknoise.tables.quantities import ResultTopic
from tracknoise.tables.run_table import OF_CONDITION, Rows, RunTable, Value, same
from tracknoise.tables.schema import CONDITION, check, empty

RANKS = RunTable(
    "ranks",
    {
        "dataset": pl.String,
        **{name: kind for name, kind in CONDITION.items() if name != "tracker"},
        "statistic": pl.String,
        "axis": pl.String,
        "tracker": pl.String,
        "best": pl.Int32,
        "worst": pl.Int32,
        "n_trackers": pl.Int32,
        "n_scenes": pl.Int32,
        "level": pl.Float64,
        "why": pl.String,
    },
    Rows(
        ResultTopic.ranks,
        {**OF_CONDITION, "axis": "axis", "of": "statistic"},
        [
            *(
                Value("rank", name, {"part": name}, carried=same("n_scenes", "level", "why"))
                for name in ("best", "worst")
            ),
            Value("rank_count", "n_trackers"),
        ],
    ),
)
"""Ranks of trackers at the lowest speed, one row per statistic and tracker, where three or more are compared.

A tracker is between the ranks best and worst of n_trackers, by (ranks). n_scenes is the smallest number of scenes that
it shares with another tracker. level is that of the comparisons. why names the trackers about which references of the
two kinds disagree, if any.
"""

RANKED = (CORE, "second", "lifetime", "outlier_ratio")
"""Roles of the statistics that trackers are ranked by."""
LEAST_TRACKERS = 3


def pairs_of_trackers(cells: Iterable[Cell]) -> Iterator[Cell]:
    """Every two trackers, at the lowest speed at which three or more are compared."""
    many = [cell for cell in cells if cell.factor == "tracker" and len(cell.levels) >= LEAST_TRACKERS]
    slowest = min((cell.held["speed"] for cell in many), key=lambda speed: int(str(speed)), default=None)
    for cell in many:
        if cell.held["speed"] == slowest:
            asked = {role: name for role, name in cell.statistics.items() if role in RANKED}
            for pair in combinations(cell.levels.items(), 2):
                yield replace(cell, levels=dict(pair), statistics=asked)


def ranking(pairs: pl.DataFrame) -> pl.DataFrame:
    """Ranks by (ranks) from comparisons of every two trackers.

    Parameters
    ----------
    pairs
        Schema `DEPENDENCE`, of the cells of `pairs_of_trackers`: every pair has a row.

    Returns
    -------
    polars.DataFrame
        Schema `RANKS`, by statistic and tracker, the best first. Nothing of statistics by which no pair was tested.
    """
    held = ["dataset", *(name for name in CONDITION if name != "tracker"), "statistic", "axis"]
    known = pairs.filter(pl.col("p_yes").is_not_null().any().over(held))
    if known.is_empty():
        return empty(RANKS)
    shown = (pl.col("verdict") == Verdict.yes) & pl.col("at").is_null()
    disputed = pl.when(pl.col("why").str.starts_with(DISAGREE))
    sides = pl.concat(
        known.select(
            *held,
            "n_scenes",
            "level",
            shown=shown,
            tracker=own,
            better=pl.col("better") == pl.col(other),
            disputed=disputed.then(other),
        )
        for own, other in (("level_a", "level_b"), ("level_b", "level_a"))
    )
    worse = pl.col("shown") & pl.col("better").not_()
    counted = sides.group_by(*held, "tracker", maintain_order=True).agg(
        best=1 + (pl.col("shown") & pl.col("better")).sum(),
        beaten=worse.sum(),
        n_trackers=1 + pl.len(),
        n_scenes=pl.col("n_scenes").min(),
        level=pl.col("level").first(),
        disputed=pl.col("disputed").drop_nulls().str.join(", "),
    )
    why = pl.format("{} {} and {}", pl.lit(DISAGREE), "tracker", "disputed")
    found = counted.with_columns(
        worst=pl.col("n_trackers") - pl.col("beaten"), why=pl.when(pl.col("disputed") != "").then(why)
    )
    ordered = found.sort(*held, pl.col("best") + pl.col("worst"), "best", "tracker", nulls_last=True)
    return check(ordered.select(pl.col(name).cast(kind) for name, kind in RANKS.items()), RANKS, "ranks")
