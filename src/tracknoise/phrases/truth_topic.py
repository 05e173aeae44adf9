"""Whether the truth can be trusted: its stated errors, its faults, and what does not depend on it."""

import math
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.phrases.answer_summary import (
    Answer,
    Judgement,
    Measure,
)
from tracknoise.phrases.headline import (
    MOST_TRACKERS,
    Headline,
    Part,
    ReportedConditions,
    RunTables,
    TrackerPart,
    brief_of,
    by_tracker,
    ids_of,
    in_brackets,
    leading,
)
from tracknoise.phrases.measures import Subject, answer, card_number, first, short, with_interval
from tracknoise.phrases.run_data import RunData
from tracknoise.phrases.withheld import excessive_floor
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.prepared import POPULATIONS
from tracknoise.tables.enumerations import (
    Axis,
    FittedMeasure,
    FittedTo,
    Trimming,
    Verdict,
)
from tracknoise.tables.findings_schema import AuditVerdict
from tracknoise.truth_faults.audit_summary import NO_FAULT, fault_brief
from tracknoise.truth_faults.fault_parameters import Family
from tracknoise.words import (
    SELF_REFERENTIAL,
    count,
    format_estimate,
    opening_place,
    percent,
    pixels,
    rms_of_tracks,
)

_LEAST_SHARE = 0.1
"""Share of the second moment from which on pose errors are reported."""


def pose_errors(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether the errors of features are a motion of the camera that the stated poses do not have."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _share_of(tables["rigid_share"], conditions, tracker),
        opening=f"Errors that all features of a frame share {conditions.where(tables['summary'])}.",
        topic="pose errors",
        figure="pose-errors",
        table="rigid_share",
    )


def _share_of(table: pl.DataFrame, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = _at_reference(conditions.of(table, tracker).filter(coordinate="both"))
    found = {row["fitted_to"]: Estimate.of_row(row, "share", "low", "high", "share") for row in rows.to_dicts()}
    own, others = found.get(FittedTo.own), found.get(FittedTo.others)
    if own is None or not own.above(_LEAST_SHARE):
        return None
    text = (
        f"{conditions.opening_distance(rows['age'][0])}, {format_estimate(own)} of the second moment of {tracker} is a "
        "motion of the camera that the stated poses do not have."
    )
    brief = f"A motion that the stated poses lack is {short(own)} of the second moment of {tracker}."
    if others is None:
        unconfirmed = "No other tracker can confirm it, so that a motion common to all features may be its own."
        return Part(f"{text} {unconfirmed}", [own], brief)
    seen = f"Pose errors that are fitted to the other trackers explain {format_estimate(others)}."
    return Part(f"{text} {seen} {_cause(others)}", [own, others], brief)


def _cause(others: Estimate) -> str:
    """What it means that other trackers see a motion too, or that they do not."""
    if others.above(_LEAST_SHARE):
        return (
            "As the trackers agree, this part is probably an error of the truth: of the poses, the clock, the "
            "calibration, or a rolling shutter."
        )
    if others.below(_LEAST_SHARE):
        return "They do not have this motion, so that it is probably the tracker's own."
    return "It is undecided whether they have this motion too."


def between_trackers(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Which trackers have a bias relative to each other, which no error of the truth can cause."""
    table = tables["tracker_differences"].filter(statistic="mean").sort("other")
    means = pl.concat([table.clear(), *(conditions.of(table, tracker) for tracker in conditions.trackers)])
    parts = [_difference(pair, conditions) for _, pair in means.group_by("tracker", "other", maintain_order=True)]
    known = [part for part in parts if part]
    if not known:
        return None
    more = len(known) - MOST_TRACKERS
    opening = (
        f"Mean differences of positions between trackers at the same corners {conditions.where(tables['summary'])}."
    )
    others = [f"The table has {count(more, 'other pair')}."] if more > 0 else []
    closing = " ".join([*others, "No error of the truth can cause such a difference."])
    named = known[:MOST_TRACKERS]
    return Headline(
        "differences",
        " ".join([opening, *(part.text for part in named), closing]),
        "between-trackers",
        "tracker_differences",
        leading([estimate for part in named for estimate in part.estimates]),
        brief=brief_of(named),
        opening=opening,
        closing=closing,
        parts=tuple(TrackerPart(None, part.text, ids_of(part.estimates)) for part in named),
    )


def _difference(pair: pl.DataFrame, conditions: ReportedConditions) -> Part | None:
    """The means of a pair, if one of them is established; of the estimates an established one comes first."""
    rows = _at_reference(pair).sort("coordinate").to_dicts()
    if not any(row["established"] for row in rows):
        return None
    estimates = [Estimate.of_row(row, "value", "low", "high", "px") for row in rows]
    u, v = map(format_estimate, estimates)
    place = opening_place(Axis.age, rows[0]["age"])
    first, *others = sorted(zip(rows, estimates, strict=True), key=lambda pair: not pair[0]["established"])
    pair_of = f"{rows[0]['tracker']} less that of {rows[0]['other']}"
    return Part(
        f"{place}, {rows[0]['tracker']} less {rows[0]['other']} is {u} in u and {v} in v.",
        [first[1], *(one for _, one in others)],
        f"At the same corners, the mean position of {pair_of} is {short(first[1])} in {first[0]['coordinate']}.",
    )


def _at_reference(table: pl.DataFrame) -> pl.DataFrame:
    """Rows of the last age up to the reference age."""
    return table.filter(pl.col("age") <= REFERENCE_AGE).filter(pl.col("age") == pl.col("age").max())


_HIDDEN = "True positions are fitted to the tracks, which hides drift along epipolar lines."
_WITHHELD = (
    "Bias, shape and growth of the errors, survivorship bias, and effects of factors on errors are therefore not "
    "reported. True positions also contain the errors of poses and calibration."
)


_MEASURES = {
    FittedMeasure.triangulated: "From errors about the fitted points",
    FittedMeasure.epipolar: "From distances to epipolar lines",
}


def self_referential(_tables: RunTables, _conditions: ReportedConditions) -> Headline:
    """Say what errors about fitted points cannot contain."""
    return Headline("truth", f"{SELF_REFERENTIAL} {_WITHHELD}", "limits", "triangulated_noise", brief=_HIDDEN)


def noise(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Noise of one coordinate of a position, corrected for what the fit absorbs."""
    known = tables["triangulated_noise"].filter(
        pl.col("length_low").is_null(), trimming=conditions.trimming, coordinate="both"
    )
    brackets = in_brackets(conditions.reported(known))
    return by_tracker(
        conditions.trackers,
        lambda tracker: _noise_of(conditions.of(known, tracker), tracker),
        opening=f"Noise of one coordinate {conditions.where(tables['summary'])}, as standard deviation.",
        closing=f"A track of N observations has 2 N - 3 degrees of freedom, which the noise allows for.{brackets}",
        topic="noise",
        figure="findings",
        table="triangulated_noise",
    )


def _noise_of(table: pl.DataFrame, tracker: str) -> Part | None:
    sentences: list[str] = []
    estimates: list[Estimate] = []
    for measure, source in _MEASURES.items():
        for row in table.filter(measure=measure).to_dicts():
            estimates.append(Estimate.of_row(row, "sigma_px", "low", "high", "px"))
            of = " it is" if sentences else f", the noise of {tracker} is"
            sentences.append(f"{source}{of} {format_estimate(estimates[-1])}.")
    return Part(" ".join(sentences), estimates) if sentences else None


def recorded_truth(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Warn where the truth was measured too."""
    if not conditions.recorded:
        return None
    size = (
        "Nothing is known of their size."
        if tables["floor"].is_empty()
        else "The truth floor is the size of those that are known."
    )
    text = (
        "True positions come from recorded poses, depth and calibration. Their own errors are part of every number. "
        f"{size} The errors of the trackers alone may be smaller."
    )
    rows = (first(conditions.of(tables["summary"], tracker)) for tracker in conditions.trackers)
    excess = (excessive_floor(row, Trimming.untrimmed) for row in rows if row is not None)
    text = " ".join([text, *list(filter(None, excess))[:1]])
    brief = "True positions were recorded, so that their own errors are part of every number."
    return Headline("truth", text, "limits", "counts", brief=brief)


def fitted_measure(subject: Subject, smallest: Answer | None) -> Measure | None:
    """Noise of one coordinate, where true positions are fitted to the tracks."""
    whole = pl.col("length_low").is_null()
    trimming = subject.conditions.trimming
    rows = subject.of("triangulated_noise").filter(whole, trimming=trimming, coordinate="both")
    found = {row["measure"]: row for row in rows.to_dicts()}
    row = next((found[measure] for measure in FittedMeasure if measure in found), None)
    if row is None:
        return None
    shown = card_number(Estimate.of_row(row, "sigma_px", "low", "high", "px"))
    note = "standard deviation of one coordinate, corrected for the fit"
    sentence = f"The noise of {subject.tracker} in one coordinate is {with_interval(shown)}."
    return Measure("noise", "px", shown, None, smallest, note, sentence, "findings")


_MOST_SHARE = 0.5
"""Share of the second moment from which on it is the truth's rather than the tracker's."""


_MOSTLY = 0.5
"""Share of observations without a true position from which on it is stated."""


def truth(data: RunData) -> Judgement:
    """Whether the true positions can be trusted: doubts about the data, faults that were found, and the floor."""
    verdict, text = _doubts(data) or _fitted_truth(data) or _faults(data) or _floor(data)
    return Judgement(answer("trusted", verdict, wished=Verdict.yes), f"{text}{_unknown(data)}", "truth")


def _unknown(data: RunData) -> str:
    """How many observations have no true position, where these are most; begins with a space."""
    statuses = data.nominal(data.counts).filter(kind="truth")
    total = int(statuses["n"].sum())
    without = total - int(statuses.filter(pl.col("name").is_in(POPULATIONS["projected"]))["n"].sum())
    if without <= _MOSTLY * total:
        return ""
    rest = "no error could be measured" if without == total else "errors are those of the rest"
    return f" {percent(without / total)} of the observations have no true position; {rest}."


def _doubts(data: RunData) -> tuple[Verdict, str] | None:
    doubtful = [entry for entry in data.manifest.sequences.values() if entry.doubts]
    if not doubtful:
        return None
    noun = "sequence looks" if len(doubtful) == 1 else "sequences look"
    return Verdict.no, f"The data of {len(doubtful)} {noun} wrong. Errors may not be those of the trackers."


def _fitted_truth(data: RunData) -> tuple[Verdict, str] | None:
    if not data.truth_is_fitted:
        return None
    return Verdict.undecided, _HIDDEN


def _faults(data: RunData) -> tuple[Verdict, str] | None:
    """The first fault of the audit."""
    faults = data.audit.filter(pl.col("rank").is_not_null()).unique("rank", keep="first").sort("rank")
    if faults.is_empty():
        return None
    others = f"; {count(faults.height - 1, 'other fault')} as well" if faults.height > 1 else ""
    return Verdict.no, f"{fault_brief(faults.row(0, named=True))}{others}. Correct this before using the numbers."


def _floor(data: RunData) -> tuple[Verdict, str]:
    """Whether known errors of the truth are small beside the errors of the trackers."""
    audited, opening = _checked(data)
    points = data.nominal(data.points).filter(
        pl.col("since").is_between(1, REFERENCE_AGE),
        role="second",
        trimming=data.trimming,
        population=data.population,
    )
    known = points.drop_nulls(["floor_u", "floor_v"]).sort("since")
    if known.is_empty():
        return Verdict.undecided, f"{opening} Its accuracy is not stated."
    share, floor_px, row = max(
        (_share(known.filter(tracker=name)) for name in known["tracker"].unique().sort()), key=lambda found: found[:2]
    )
    if floor_px == 0.0:
        return Verdict.yes if audited else Verdict.undecided, f"{opening} It is stated to be exact."
    error_px = math.hypot(row["u"], row["v"])
    of = f"{pixels(error_px)} px {rms_of_tracks(data.trimming)} of {row['tracker']} {data.axis.place(row['since'])}"
    text = f"{opening} Its errors can cause {pixels(min(floor_px, error_px))} of the {of}."
    return Verdict.no if share > _MOST_SHARE else Verdict.yes, text


def _checked(data: RunData) -> tuple[bool, str]:
    """Whether the audit could have found a fault, and what it says where it found none."""
    about = data.audit.filter(pl.col("family") == Family.alone).unique("parameter", keep="first")
    if about.is_empty():
        return False, "The truth was not checked for faults."
    unknown = about.filter(verdict=str(AuditVerdict.undetermined)).height
    if unknown == about.height:
        return False, "The audit could determine no parameter of the truth."
    return True, f"{NO_FAULT} {unknown} of {about.height} parameters cannot be determined." if unknown else NO_FAULT


def _share(points: pl.DataFrame) -> tuple[float, float, dict[str, Any]]:
    """Share of the second moment that the floor can cause at the last age, its length in px, and that point."""
    row = points.row(-1, named=True)
    error_px, floor_px = math.hypot(row["u"], row["v"]), math.hypot(row["floor_u"], row["floor_v"])
    return min((floor_px / error_px) ** 2 if error_px else 1.0, 1.0), floor_px, row
