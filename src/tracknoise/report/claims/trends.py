"""Judges claims that compare error sizes: between speeds, and between two experiments."""

from collections.abc import Mapping

from tracknoise.findings.wording import number
from tracknoise.report.claims.claim import Agreement, Claim, Judgement
from tracknoise.report.claims.points import Point, at_place, curve, estimate, last, overlap, tracker_named
from tracknoise.report.report_data import ReportData


def judge_trend(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the curves of the lowest and the highest speed that can be compared, and their intervals.

    With ``place = "shared"`` they are compared at the last age (or frame) that both have. With ``step``, each is taken
    one step of the tracker from where errors are zero.
    """
    data, stated = runs[claim.experiment], claim.stated
    tracker = tracker_named(data, stated["tracker"]) or ""
    found = (
        _steps(data, tracker, stated["role"]) if stated["place"] == "step" else _shared(data, tracker, stated["role"])
    )
    if len(found) < 2:
        return Judgement(Agreement.open, reason="no two speeds have a point in common")
    (slow, *_, fast) = found.values()
    shown = ", ".join(number(_size(point)) for point in found.values())
    value = f"{shown} px at speeds {', '.join(map(str, found))}"
    place = "one step from zero" if stated["place"] == "step" else data.axis.place(slow["since"])
    sizes = f"sizes are means of u and v {place}"
    apart = [axis for axis in "uv" if overlap(estimate(slow, axis), estimate(fast, axis)) is False]
    if not apart:
        why = "intervals of the lowest and highest speed overlap or are unknown"
        return Judgement(Agreement.open, value, f"{why}; {sizes}")
    rises = {fast[axis] > slow[axis] for axis in apart}
    if len(rises) > 1:
        return Judgement(Agreement.open, value, f"u and v change in opposite directions; {sizes}")
    return Judgement(Agreement.agrees if rises == {stated["rises"]} else Agreement.opposite, value, sizes)


def judge_motion(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By root second moments of two experiments at the last age that both have, for each tracker."""
    other = claim.stated["other"]
    if other not in runs:
        return Judgement(Agreement.open, reason=f"{other} was not measured")
    values, differ = [], []
    for tracker in runs[claim.experiment].trackers:
        pair = _pair(runs[claim.experiment], runs[other], tracker)
        if pair is not None:
            sizes = [at_place(runs[claim.experiment], estimate(point, "u"), point["since"]) for point in pair]
            values.append(f"{tracker}, u: {sizes[0]} and {sizes[1]}")
            differ.append(any(overlap(estimate(pair[0], axis), estimate(pair[1], axis)) is False for axis in "uv"))
    if any(differ):
        return Judgement(Agreement.agrees, "; ".join(values))
    return Judgement(Agreement.open, "; ".join(values), "intervals overlap or are unknown")


def _pair(one: ReportData, other: ReportData, tracker: str) -> tuple[Point, Point] | None:
    curves = [curve(data, tracker, "second") for data in (one, other)]
    at = last(curves[0].join(curves[1], on="since", how="semi"))
    if at is None:
        return None
    return at, curves[1].filter(since=at["since"]).row(0, named=True)


def _steps(data: ReportData, tracker: str, role: str) -> dict[int, Point]:
    """The point of each speed one step from where errors are zero."""
    points = {speed: curve(data, tracker, role, speed=speed).filter(since=speed) for speed in data.speeds}
    return {speed: table.row(0, named=True) for speed, table in points.items() if table.height}


def _shared(data: ReportData, tracker: str, role: str) -> dict[int, Point]:
    """Points of the lowest speed and the highest that shares a place with it, at the last place that both have."""
    slow = curve(data, tracker, role)
    for speed in reversed(data.speeds[1:]):
        fast = curve(data, tracker, role, speed=speed)
        at = last(fast.join(slow, on="since", how="semi"))
        if at is not None:
            return {data.slowest: slow.filter(since=at["since"]).row(0, named=True), speed: at}
    return {}


def _size(point: Point) -> float:
    """Mean of both coordinates."""
    return float(point["u"] + point["v"]) / 2.0
