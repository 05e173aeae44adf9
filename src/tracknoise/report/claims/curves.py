"""Judges claims on drift and on where curves end."""

from collections.abc import Mapping
from math import inf, log

import polars as pl

from tracknoise.findings.wording import number, percent
from tracknoise.report.claims.claim import Agreement, Claim, Judgement
from tracknoise.report.claims.points import (
    at_place,
    curve,
    excludes_zero,
    is_within,
    last,
    mean_chosen_among,
    overlap,
    tracker_named,
)
from tracknoise.report.report_data import ReportData
from tracknoise.tables.defaults import MARGIN

_FACTOR = 1.5
"""Ages within this factor of each other count as the same size."""
_NO_CURVE = "too few features for a curve"


def judge_drift(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the mean error, and its interval, at the last age (or frame) that the curve has and the paper's has.

    Where the paper names no coordinate, a drift in either of them will do, and the intervals allow for this choice.
    There is none only where both are small.
    """
    data, stated = runs[claim.experiment], claim.stated
    if stated["direction"] not in data.directions:
        return Judgement(Agreement.open, reason=f"not played {stated['direction']}")
    tracker = tracker_named(data, stated["tracker"]) or ""
    curves = (curve(data, tracker, role, direction=stated["direction"]) for role in ("mean", "absolute"))
    mean, absolute = (last(points.filter(pl.col("since") <= stated.get("last_age", inf))) for points in curves)
    if mean is None or absolute is None:
        return Judgement(Agreement.open, reason=_NO_CURVE)
    axes = [stated["coordinate"]] if "coordinate" in stated else list("uv")
    drifts = {axis: mean_chosen_among(data, mean, axis, len(axes)) for axis in axes}
    value = ", ".join(f"{axis}: {at_place(data, drift, mean['since'])}" for axis, drift in drifts.items())
    large = {axis: drift for axis, drift in drifts.items() if not is_within(drift, MARGIN * absolute[axis])}
    if not large:
        return Judgement(Agreement.disagrees, value, f"less than {percent(MARGIN)} of the mean absolute error")
    known = [axis for axis, drift in large.items() if excludes_zero(drift)]
    if not known:
        return Judgement(Agreement.open, value, "the interval contains zero, or there is none")
    same = stated.get("sign") is None or all(stated["sign"] * mean[axis] > 0 for axis in known)
    return Judgement(Agreement.agrees if same else Agreement.opposite, value)


def judge_same_drift(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the mean errors of both trackers at the last age (or frame) that both curves have.

    They are compared in the coordinate in which the first drifts more. Their intervals allow for this choice.
    """
    data = runs[claim.experiment]
    one, other = (curve(data, tracker_named(data, kind) or "", "mean") for kind in claim.stated["trackers"])
    at = last(one.join(other, on="since", how="semi"))
    if at is None:
        return Judgement(Agreement.open, reason=_NO_CURVE)
    points = [table.filter(since=at["since"]).row(0, named=True) for table in (one, other)]
    axis = max("uv", key=lambda name: abs(at[name]))
    first, second = (mean_chosen_among(data, point, axis, len("uv")) for point in points)
    value = f"{axis}: {at_place(data, first, at['since'])} and {at_place(data, second, at['since'])}"
    if not excludes_zero(first) or not excludes_zero(second):
        return Judgement(Agreement.open, value, "not both drift")
    if len({point[axis] > 0 for point in points}) > 1:
        return Judgement(Agreement.opposite, value)
    return Judgement(Agreement.agrees if overlap(first, second) else Agreement.disagrees, value)


def judge_cut(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the last age that has enough features, which is comparable only with as many scenes."""
    data, wanted = runs[claim.experiment], claim.stated["ages"]
    scenes = len({entry.sequence.scene for entry in data.sequences.values()})
    ends = {kind: last(curve(data, tracker_named(data, kind) or "", "mean")) for kind in wanted}
    ages = {kind: int(end["since"]) for kind, end in ends.items() if end is not None}
    value = ", ".join(f"{kind}: {number(age)}" for kind, age in ages.items())
    if scenes < claim.stated["scenes"]:
        return Judgement(Agreement.open, value, f"{scenes} of the paper's {claim.stated['scenes']} scenes")
    longest = max((entry.n_frames for entry in data.sequences.values()), default=0)
    if longest <= max(wanted.values()):
        return Judgement(Agreement.open, value, f"sequences of {number(longest)} frames have no such ages")
    if len(ages) < len(wanted):
        return Judgement(Agreement.open, value, _NO_CURVE)
    if sorted(ages, key=ages.__getitem__) != sorted(wanted, key=wanted.__getitem__):
        return Judgement(Agreement.opposite, value, "the other tracker has the longer curve")
    alike = all(abs(log(ages[kind] / wanted[kind])) <= log(_FACTOR) for kind in wanted)
    return Judgement(Agreement.agrees if alike else Agreement.disagrees, value)
