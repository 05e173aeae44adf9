"""The conditions that the first screen is about, what it says of growth, and of trimming.

- The conditions that the first screen and its sentences are about.
- Whether errors grow with age, as far as the truth lets it be known.
- What the report says about trimming: the tracks that its percentile includes, and where it drops nearly all.
"""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.phrases.error_headlines import rises
from tracknoise.phrases.headline import ReportedConditions
from tracknoise.phrases.withheld import audited_rise, growth_cover
from tracknoise.report.bands import AGE, FRAME
from tracknoise.report.names import MOST_NAMED, condition_name, together
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.enumerations import Behaviour, Verdict
from tracknoise.words import count, number, percent, ratio


def reported_conditions(data: ReportData, speed: int) -> ReportedConditions:
    """Every tracker at a speed, in the view that the report shows."""
    found = {name: data.key_frame(name) for name in data.directions}
    frames = {name: frame for name, frame in found.items() if frame is not None}
    reference = ReferenceCondition(**data.view, speed=speed, key_frames=frames)
    return ReportedConditions(
        reference,
        data.trackers,
        data.population,
        data.percentile,
        fitted=data.truth_is_fitted,
        trimming=data.trimming,
    )


_GROWING = (Behaviour.random_walk, Behaviour.drift, Behaviour.saturating)


def growth_verdict(data: ReportData, conditions: ReportedConditions, row: Mapping[str, Any], at: int | None) -> Verdict:
    """Whether the error of one coordinate grows; undecided where the errors of the truth can grow as much.

    An error that is mostly constant grows where a part of it does, by its interval. `at`: None where no age has enough
    features.
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


def percentile_of(data: ReportData) -> str:
    """The tracks over which the percentile is taken, as part of a sentence."""
    if "followed" not in data.trims["among"]:
        return "all tracks of the same scene and condition"
    return f"those tracks of the same scene and condition that were followed beyond {_anchor(data)}"


def cut_at_zero(data: ReportData) -> list[tuple[str, str]]:
    """Conditions whose trimming is decided by errors that are zero by construction, each with its warning.

    A track whose only error is that at its anchor has a largest error of about 0 px. Where the share of such tracks
    reaches the percentile, the cut falls among them, and nearly all of the other tracks are dropped.
    """
    trims = data.listed(data.trims)
    least = pl.col("percentile") / 100 * pl.col("n_measured")
    decided = trims.filter(pl.col("percentile") < 100, pl.col("n_anchor_only") >= least, pl.col("n_anchor_only") > 0)
    decided = decided.filter(among="all")
    names = data.in_order(decided.select(list(data.condition_columns)).unique()).to_dicts()
    if len(names) > MOST_NAMED:
        return [(together([condition_name(one) for one in names]), _warning(data, decided, trims))]
    return [(condition_name(one), _warning(data, decided.filter(**one), trims.filter(**one))) for one in names]


def _warning(data: ReportData, decided: pl.DataFrame, trims: pl.DataFrame) -> str:
    """What is left in the scenes and conditions of `trims` whose percentile falls among errors that are zero."""
    n_measured, n_anchor_only, n_dropped = (
        int(decided[name].sum()) for name in ("n_measured", "n_anchor_only", "n_followed_dropped")
    )
    n_followed = n_measured - n_anchor_only
    scenes = f"{number(decided['scene'].n_unique())} of {count(trims['scene'].n_unique(), 'scene')}"
    return (
        f"{percent(n_anchor_only / n_measured)} of the tracks with a known error were seen only in {_anchor(data)}, "
        f"where the error is zero by construction. This affects {scenes}. The percentile falls among these tracks, so "
        f"trimming cuts at about 0 px. Of the {count(n_followed, 'track')} seen for longer, "
        f"{number(n_followed - n_dropped)} are kept. The trimmed errors mean little here. Set "
        'statistics.trim_among = "followed" to take the percentile over the tracks seen for longer.'
    )


def _anchor(data: ReportData) -> str:
    return "the key frame" if data.axis is FRAME else "their first frame"
