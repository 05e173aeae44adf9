"""Whether errors grow with age, as far as the truth lets it be known."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.findings.headlines.error_topics import rises
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.headlines.withheld import audited_rise, growth_cover
from tracknoise.findings.wording import count, ratio
from tracknoise.report.axis import AGE
from tracknoise.report.report_data import ReportData
from tracknoise.report.reported import reported_conditions
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.enumerations import Behaviour, Verdict

_GROWING = (Behaviour.random_walk, Behaviour.drift, Behaviour.saturating)


def growth_verdict(data: ReportData, conditions: ReportedConditions, row: Mapping[str, Any], at: int | None) -> Verdict:
    """Whether the error of one coordinate grows; undecided where the errors of the truth can grow as much.

    An error that is mostly constant grows where a part of it does, by its interval.

    Parameters
    ----------
    data
        The run.
    conditions
        Which errors.
    row
        Of the table of fitted growth.
    at
        Age or frame up to which it may grow; None where no age has enough features.
    """
    if row["verdict"] in (Behaviour.undecided, Behaviour.none):
        return Verdict.undecided
    if (row["verdict"] not in _GROWING and not rises(row)) or at is None:
        return Verdict.no
    tables = {"curves": data.curves, "floor": data.floor, "audit_curves": data.audit_curves}
    where = tables, conditions, row["tracker"], row["coordinate"], at
    cover = growth_cover(*where)
    is_covered = (cover is not None and cover.is_covered) or audited_rise(*where) is not None
    return Verdict.undecided if is_covered else Verdict.yes


def growth_message(data: ReportData) -> str:
    """The RMS error that grows most, where growth is established; empty where it is not."""
    found = [(times, text) for row in _fits(data).to_dicts() for times, text in _grown(data, row)]
    return max(found)[1] if found else ""


def behaviour(data: ReportData, tracker: str) -> str | None:
    """How the error of a tracker grows, where this is established and the same in u and in v; otherwise None."""
    rows = _fits(data).filter(tracker=tracker).to_dicts()
    ends = [_ends(data, row) for row in rows]
    found = {
        (row["verdict"], growth_verdict(data, reported_conditions(data, data.slowest), row, points["at"].last()))  # type: ignore[arg-type]
        for row, points in zip(rows, ends, strict=True)
    }
    if len(rows) < 2 or len(found) > 1:
        return None
    kind, verdict = found.pop()
    if verdict == Verdict.undecided or (kind == Behaviour.white and verdict == Verdict.yes):
        return None
    return str(kind)


def _fits(data: ReportData) -> pl.DataFrame:
    return data.nominal(data.time_structure).filter(pl.col("tracker").is_in(data.trackers), trimming=data.trimming)


def _grown(data: ReportData, row: Mapping[str, Any]) -> list[tuple[float, str]]:
    """How many times the RMS of one tracker and coordinate grows up to the reference age; nothing if it does not."""
    axis, ends = row["coordinate"], _ends(data, row)
    if row["verdict"] not in _GROWING or ends.height < 2 or not ends[axis][0]:
        return []
    at, since, last = ends.row(-1)
    verdict = growth_verdict(data, reported_conditions(data, data.slowest), row, at)
    times = last / ends[axis][0]
    if verdict != Verdict.yes or times <= 1.0:
        return []
    place = f"up to age {since}" if data.axis is AGE else f"within {count(since, 'frame')}"
    return [(times, f"The RMS error of {row['tracker']} in {axis} grows {ratio(times)} times {place}")]


def _ends(data: ReportData, row: Mapping[str, Any]) -> pl.DataFrame:
    """RMS of one tracker and coordinate up to the reference age: columns at, since and that of the coordinate."""
    points = data.nominal(data.points).filter(
        pl.col("since").is_between(1, REFERENCE_AGE),
        role="second",
        trimming=data.trimming,
        population=data.population,
        tracker=row["tracker"],
    )
    return points.sort("since").select("at", "since", row["coordinate"])
