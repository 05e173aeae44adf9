"""Judges any claim by the tables of the runs that repeat the paper's experiments."""

from collections.abc import Callable, Mapping

from tracknoise.report.claims.cells import judge_cell, judge_effect_bound
from tracknoise.report.claims.claim import Agreement, Claim, Judgement
from tracknoise.report.claims.curves import judge_cut, judge_drift, judge_same_drift
from tracknoise.report.claims.levels import judge_not_zero_mean_gaussian, judge_outlier_level, judge_zero_mean_gaussian
from tracknoise.report.claims.points import tracker_named
from tracknoise.report.claims.trends import judge_motion, judge_trend
from tracknoise.report.report_data import ReportData

Judge = Callable[[Claim, Mapping[str, ReportData]], Judgement]

JUDGES: Mapping[str, Judge] = {
    "cell": judge_cell,
    "effect_bound": judge_effect_bound,
    "trend": judge_trend,
    "motion": judge_motion,
    "drift": judge_drift,
    "same_drift": judge_same_drift,
    "cut": judge_cut,
    "outlier_level": judge_outlier_level,
    "zero_mean_gaussian": judge_zero_mean_gaussian,
    "not_zero_mean_gaussian": judge_not_zero_mean_gaussian,
}
"""How claims of each kind are judged."""


def judge(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """Verdict on a claim.

    Parameters
    ----------
    claim
        Of the paper.
    runs
        By experiment of the paper, all of one reading of its trimming.
    """
    if claim.experiment not in runs:
        return Judgement(Agreement.open, reason="the experiment was not repeated")
    for kind in _trackers(claim):
        if tracker_named(runs[claim.experiment], kind) is None:
            return Judgement(Agreement.open, reason=f"no tracker of the kind {kind} was run")
    return JUDGES[claim.kind](claim, runs)


def _trackers(claim: Claim) -> list[str]:
    """Kinds of the trackers that a claim is about, where it names any."""
    named = [claim.stated.get("tracker"), *claim.stated.get("trackers", ()), *claim.stated.get("ages", ())]
    return [kind for kind in named if kind]
