"""Which features at depth edges are drawn along by the surface in front of them or behind them."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.analysis.places_found import (
    IMAGE_CELLS,
    SPEED_ERRORS,
    SURROUNDING_ERRORS,
    image_cells,
    speed_errors,
    surrounding_errors,
)
from tracknoise.inference.estimates import Estimate
from tracknoise.tables.enumerations import EdgeSide, Surrounding
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables
from tracknoise.topics.measures import short
from tracknoise.topics.topic import NO_ROWS, Topic, pooled
from tracknoise.words import format_estimate, percent, px

IN = {"u": "in u", "v": "in v", "along": "along the motion"}
"""What an error is in, or along."""
_SIDES = {EdgeSide.far: "the far side", EdgeSide.near: "the near side"}
_MOST = 0.5


def depth_edges(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether features beside depth edges have other mean errors than all others."""
    return conditions.headline(
        lambda tracker: _edges_of(conditions.of(tables["surrounding_errors"], tracker), conditions, tracker),
        opening=f"Depth edges {conditions.where(tables)}, in untrimmed errors of visible features.",
        closing="A feature beside a depth edge has two surfaces in its window.",
        figure="error-by-place",
        table="surrounding_errors",
    )


def _edges_of(errors: pl.DataFrame, conditions: ReportedConditions, tracker: str) -> Part | None:
    """Sentences about the oldest age that has intervals; None where no side differs from the other features."""
    sides = errors.filter(surrounding=Surrounding.side)
    bounded = sides.filter(pl.col("class").is_in([*_SIDES]), statistic="mean").drop_nulls(["low", "high"])
    if bounded.is_empty():
        return None
    at = int(bounded["at"].sort()[-1])
    by_coordinate = {name: _rows(sides.filter(at=at, coordinate=name)) for name in IN}
    coordinate = max(by_coordinate, key=lambda name: abs(_mean_of_all(by_coordinate[name])))
    rows = by_coordinate[coordinate]
    differing = [side for side in _SIDES if _differs(rows, side)]
    if not differing:
        return None
    means = [_estimate(rows[side, "mean"]) for side in differing]
    where = f"{conditions.opening_place(at)}, the mean error of {tracker} {IN[coordinate]}"
    sentences = [f"{where} differs beside depth edges."]
    sentences += [
        f"On {_SIDES[side]} it is {format_estimate(mean)}." for side, mean in zip(differing, means, strict=True)
    ]
    sentences += [f"Elsewhere it is {format_estimate(_estimate(rows[EdgeSide.none, 'mean']))}."]
    brief = (
        f"On {_SIDES[differing[0]]} of depth edges, the mean error of {tracker} is {short(means[0])} {IN[coordinate]}."
    )
    return Part(" ".join([*sentences, *_shares(rows, differing[0]), *_removed(rows)]), means, brief)


def _rows(table: pl.DataFrame) -> dict[tuple[str, str], Mapping[str, Any]]:
    """Rows by class and statistic."""
    return {(row["class"], row["statistic"]): row for row in table.to_dicts()}


def _estimate(row: Mapping[str, Any]) -> Estimate:
    return Estimate.of_row(row, "value", "low", "high", row["unit"])


def _mean_of_all(rows: Mapping[tuple[str, str], Mapping[str, Any]]) -> float:
    means = [row for (_, statistic), row in rows.items() if statistic == "mean"]
    return float(sum(row["n"] * row["value"] for row in means) / max(sum(row["n"] for row in means), 1))


def _differs(rows: Mapping[tuple[str, str], Mapping[str, Any]], side: str) -> bool:
    """Whether the interval of the mean on a side excludes both zero and the interval of all features elsewhere."""
    if (side, "mean") not in rows or (EdgeSide.none, "mean") not in rows:
        return False
    on_side, elsewhere = _estimate(rows[side, "mean"]), _estimate(rows[EdgeSide.none, "mean"])
    if elsewhere.low is None or elsewhere.high is None:
        return False
    return on_side.above(max(0.0, elsewhere.high)) or on_side.below(min(0.0, elsewhere.low))


def _shares(rows: Mapping[tuple[str, str], Mapping[str, Any]], side: EdgeSide) -> list[str]:
    """Sentences about the side on which most of the mean error is; empty where that is not established."""
    share, of_mean = (rows.get((side, name)) for name in ("share", "share_of_mean"))
    without = rows.get((side, "mean_without"))
    if share is None or of_mean is None or without is None:
        return []
    if not _estimate(of_mean).above(_MOST):
        return []
    numbers = (
        f"These are {percent(share['value'])} of the features, and have {percent(of_mean['value'])} of the mean error."
    )
    means = f"The mean of all features is {px(_mean_of_all(rows))}, and without {_SIDES[side]} {px(without['value'])}."
    return [f"Most of the drift comes from features on {_SIDES[side]} of depth edges.", numbers, means]


def _removed(rows: Mapping[tuple[str, str], Mapping[str, Any]]) -> list[str]:
    row = rows.get((EdgeSide.none, "second_removed_by_others"))
    if row is None or not _estimate(row).above(0.0):
        return []
    return [f"Without features beside depth edges, the second moment falls by {format_estimate(_estimate(row))}."]


PLACES = Topic(
    "depth edges",
    (
        pooled(SURROUNDING_ERRORS, "surroundings", surrounding_errors, if_fitted=NO_ROWS),
        pooled(IMAGE_CELLS, "image_map", image_cells, if_fitted=NO_ROWS),
        pooled(SPEED_ERRORS, "image_speeds", speed_errors, if_fitted=NO_ROWS),
    ),
    headline=depth_edges,
    of_these_scenes=True,
)
