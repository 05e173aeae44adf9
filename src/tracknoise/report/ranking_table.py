"""The table of ranks, for the page and the terminal: what to set, ranks, and the cost of a step, by tracker."""

from collections.abc import Mapping

import polars as pl

from tracknoise.analysis.factors import RANKED
from tracknoise.report.answer import noise_to_set
from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData
from tracknoise.tables.costs import read_costs
from tracknoise.text import significant
from tracknoise.topics.factor_topic import disputed_ranks, ranks_by_role
from tracknoise.words import count

TITLES: Mapping[str, str] = dict(
    zip(RANKED, ("typical error (core)", "RMS error", "lifetime", "outlier ratio"), strict=True)
)
"""What trackers are ranked by, by the roles of the statistics, in the order of the table."""


def roles_of(ranks: pl.DataFrame) -> list[str]:
    """The roles that there are, in the order of the table."""
    return [role for role in TITLES if role in set(ranks["role"])]


def order_of(ranks: pl.DataFrame) -> list[str]:
    """Names of trackers by the middle of their ranks by the core, then by the other statistics."""
    middle = ranks.with_columns(middle=pl.col("best") + pl.col("worst"))
    wide = middle.pivot("role", index="tracker", values="middle", aggregate_function="first")
    return wide.sort(*roles_of(ranks), "tracker", nulls_last=True)["tracker"].to_list()


def how_to_read(data: ReportData, ranks: pl.DataFrame) -> str:
    """What ranks say, and from how many scenes."""
    scenes = count(min(ranks["n_scenes"].to_list()), "scene")
    return (
        f"Ranks from {scenes}: a tracker of rank 2 to 5 is shown to be worse than one other, by more than a factor of "
        f"{1.0 + data.margin:.3g}.{disputed_ranks(ranks)}"
    )


def ranking_table(data: ReportData) -> Cells | None:
    """What to set, ranks, and the cost of a step, a row for each tracker; None where trackers have no ranks."""
    ranks, costs = ranks_by_role(data), read_costs(data.run)
    if ranks.is_empty():
        return None
    sigmas = {one.tracker: f"{one.sigma.text}{', upper bound' if one.is_bound else ''}" for one in noise_to_set(data)}
    spans = {
        (tracker, role): str(best) if best == worst else f"{best} to {worst}"
        for tracker, role, best, worst in ranks.select("tracker", "role", "best", "worst").iter_rows()
    }
    roles = roles_of(ranks)
    rows = [
        [
            tracker,
            sigmas.get(tracker, ""),
            *(spans.get((tracker, role), "") for role in roles),
            *([f"{significant(costs[tracker], 2)} ms" if tracker in costs else ""] if costs else []),
        ]
        for tracker in order_of(ranks)
    ]
    headings = ["tracker", "set", *(TITLES[role] for role in roles), *(["CPU per step"] if costs else [])]
    return Cells(how_to_read(data, ranks), headings, rows, [False, *([True] * (len(headings) - 1))])
