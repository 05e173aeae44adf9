"""Whether the truth can be trusted, and what does not depend on it."""

import polars as pl

from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.analysis.truth_shares import (
    POSE_DISAGREEMENT,
    TRACKER_DIFFERENCES,
    TRIANGULATED_NOISE,
    TWO_TRUTHS,
    fitted_noise_table,
    pose_disagreement_table,
    tracker_differences,
    two_truths_table,
)
from tracknoise.inference.estimates import Estimate
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.grouping import by_condition
from tracknoise.statistics.prepared import POPULATIONS
from tracknoise.tables.enumerations import Axis, FittedMeasure, FittedTo, Trimming, Trust
from tracknoise.tables.schema import RIGID
from tracknoise.tables.trust import TRUST, AssessedTruth, TruthVerdict
from tracknoise.tables.truth_audit import AUDIT, AUDIT_CURVES
from tracknoise.topics.answer_summary import Answer, Judgement, Measure
from tracknoise.topics.headline import (
    MOST_TRACKERS,
    Headline,
    Part,
    ReportedConditions,
    RunTables,
    TrackerPart,
    brief_of,
    ids_of,
    in_brackets,
    leading,
)
from tracknoise.topics.measures import Subject, card_number, first, short, with_interval
from tracknoise.topics.run_data import RunData
from tracknoise.topics.sentences import each_axis
from tracknoise.topics.topic import ABOUT_TRACKS, NO_ROWS, Analysis, Basis, Topic, pooled
from tracknoise.topics.withheld import excessive_floor
from tracknoise.truth_faults.pose_accuracy import POSE_LAW, POSE_SHARE, RIGID_SHARE, pose_law, pose_share, rigid_share
from tracknoise.words import SELF_REFERENTIAL, count, format_estimate, percent, place

_LEAST_SHARE = 0.1
"""Share of the second moment from which on pose errors are reported."""


def pose_errors(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether the errors of features are a motion of the camera that the stated poses do not have."""
    return conditions.headline(
        lambda tracker: _share_of(tables["pose_share"], conditions, tracker),
        opening=f"Errors that all features of a frame share {conditions.where(tables)}.",
        closing=f"Outliers and ages above {REFERENCE_AGE} are left out.",
        figure="pose-errors",
        table="pose_share",
    )


def _share_of(table: pl.DataFrame, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(table, tracker).to_dicts()
    shares = {row["fitted_to"]: Estimate.of_row(row, "share", "low", "high", "share") for row in rows}
    own_share, others_share = shares.get(FittedTo.own), shares.get(FittedTo.others)
    if own_share is None or not own_share.above(_LEAST_SHARE):
        return None
    explained = f"{format_estimate(own_share)} of the squared errors of {tracker}"
    text = f"A camera motion missing in the stated poses explains {explained}."
    brief = (
        f"A camera motion missing in the stated poses explains {short(own_share)} of the squared errors of {tracker}."
    )
    if others_share is None:
        unconfirmed = "No other tracker can confirm this motion, so that it may be an error of the tracker."
        return Part(f"{text} {unconfirmed}", [own_share], brief)
    seen = f"Pose errors that are fitted to the other trackers explain {format_estimate(others_share)}."
    return Part(f"{text} {seen} {_cause(others_share)}", [own_share, others_share], brief)


def _cause(others_share: Estimate) -> str:
    """What it means that other trackers see a motion too, or that they do not."""
    if others_share.above(_LEAST_SHARE):
        return (
            "The trackers agree, so that this part is probably an error of the truth. The cause may be the poses, the "
            "clock, the calibration or a rolling shutter."
        )
    if others_share.below(_LEAST_SHARE):
        return "The other trackers do not have this motion, so that it is probably an error of the tracker."
    return "Whether the other trackers have this motion, too, is undecided."


def between_trackers(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Which trackers have a bias relative to each other, which no error of the truth can cause."""
    means = conditions.reported(tables["tracker_differences"].filter(statistic="mean").sort("other"))
    parts = [_difference(pair, conditions) for _, pair in means.group_by("tracker", "other", maintain_order=True)]
    established = [part for part in parts if part]
    if not established:
        return None
    more = len(established) - MOST_TRACKERS
    opening = f"Mean differences of positions between trackers at the same corners {conditions.where(tables)}."
    remaining = [f"The table has {count(more, 'other pair')}."] if more > 0 else []
    closing = " ".join([*remaining, "Errors of the truth cannot cause such differences."])
    named = established[:MOST_TRACKERS]
    return Headline(
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
    where = place(Axis.age, rows[0]["age"])
    first, *others = sorted(zip(rows, estimates, strict=True), key=lambda pair: not pair[0]["established"])
    pair_of = f"{rows[0]['tracker']} minus that of {rows[0]['other']}"
    names = f"{rows[0]['tracker']} minus {rows[0]['other']}"
    u, v = each_axis([*map(format_estimate, estimates)], f"In u, {names} is")
    return Part(
        f"{u} {v} These differences are {where}.",
        [first[1], *(estimate for _, estimate in others)],
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
    return Headline(f"{SELF_REFERENTIAL} {_WITHHELD}", "limits", "triangulated_noise", brief=_HIDDEN)


def noise(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Noise of one coordinate of a position, corrected for what the fit absorbs."""
    rows = tables["triangulated_noise"].filter(
        pl.col("length_low").is_null(), trimming=conditions.trimming, coordinate="both"
    )
    brackets = in_brackets(conditions.reported(rows))
    return conditions.headline(
        lambda tracker: _noise_of(conditions.of(rows, tracker), tracker, at_most(AssessedTruth.of(tables).verdict)),
        opening=f"Noise of one coordinate {conditions.where(tables)}, as standard deviation.",
        closing=f"A track of N observations has 2 N - 3 degrees of freedom, which the noise allows for.{brackets}",
        figure="findings",
        table="triangulated_noise",
    )


def at_most(truth: TruthVerdict) -> str:
    """What stands before a size of errors: where the truth cannot be trusted, its own are in it."""
    return "" if truth.is_usable else "at most "


def _noise_of(table: pl.DataFrame, tracker: str, most: str) -> Part | None:
    sentences: list[str] = []
    estimates: list[Estimate] = []
    for measure, source in _MEASURES.items():
        for row in table.filter(measure=measure).to_dicts():
            estimates.append(Estimate.of_row(row, "sigma_px", "low", "high", "px"))
            predicate = " it is" if sentences else f", the noise of {tracker} is"
            sentences.append(f"{source}{predicate} {most}{format_estimate(estimates[-1])}.")
    return Part(" ".join(sentences), estimates) if sentences else None


def verdict_on_truth(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """The verdict on the truth, unless it is trusted."""
    trust = AssessedTruth.of(tables).verdict
    if trust.verdict is Trust.trusted:
        return None
    trackers = [] if trust.are_tracks_wrong else conditions.trackers
    rows = (first(conditions.of(tables["summary"], tracker)) for tracker in trackers)
    excess = (excessive_floor(row, Trimming.untrimmed) for row in rows if row is not None)
    text = " ".join([trust.sentence, *list(filter(None, excess))[:1]])
    return Headline(text, "truth", TRUST.name, brief=_BRIEF[trust.verdict])


_BRIEF = {
    Trust.limited: "A part of the measured errors can be errors of the truth.",
    Trust.not_trusted: "The truth is not trusted, so that errors may not be those of the trackers.",
    Trust.unknown: "Whether the truth can be trusted is unknown.",
    Trust.not_assessed: "Tracks do not follow the images, so that no number of this run means anything.",
}


def fitted_measure(subject: Subject, smallest: Answer | None) -> Measure | None:
    """Noise of one coordinate, where true positions are fitted to the tracks."""
    all_lengths = pl.col("length_low").is_null()
    trimming = subject.conditions.trimming
    rows = subject.of("triangulated_noise").filter(all_lengths, trimming=trimming, coordinate="both")
    by_measure = {row["measure"]: row for row in rows.to_dicts()}
    row = next((by_measure[measure] for measure in FittedMeasure if measure in by_measure), None)
    if row is None:
        return None
    shown = card_number(Estimate.of_row(row, "sigma_px", "low", "high", "px"))
    most = at_most(subject.data.truth)
    note = f"{'upper bound of the ' if most else ''}standard deviation of one coordinate, corrected for the fit"
    sentence = f"The noise of {subject.tracker} in one coordinate is {most}{with_interval(shown)}."
    return Measure("noise", "px", shown, None, smallest, note, sentence, "findings")


_MOSTLY = 0.5
"""Share of observations without a true position from which on it is stated."""
_IS_GOOD = {Trust.trusted: True, Trust.not_trusted: False}


def truth(data: RunData) -> Judgement:
    """Whether the true positions can be trusted, and what would help most."""
    trust = data.truth
    step = f" Next: {trust.step}" if trust.step else ""
    answered = Answer("truth", trust.verdict, _IS_GOOD.get(trust.verdict))
    return Judgement(answered, f"{trust.text}{without_truth(data)}{step}", "truth")


def depth_is_from_images(data: RunData) -> bool:
    """Whether depths of any sequence are computed from the images of other frames."""
    return any(entry.depth_is_from_images for entry in data.sequences.values())


def without_truth(data: RunData) -> str:
    """How many observations have no true position, if most or if depth is from images; begins with a space."""
    statuses = data.nominal(data["counts"]).filter(kind="truth")
    total = int(statuses["n"].sum())
    without = total - int(statuses.filter(pl.col("name").is_in(POPULATIONS["projected"]))["n"].sum())
    if without <= (0.0 if depth_is_from_images(data) else _MOSTLY) * total:
        return ""
    consequence = "; no error could be measured" if without == total else ""
    return f" {percent(without / total)} of observations lack true positions{consequence}."


def _motions(inputs: RunInputs) -> tuple[pl.DataFrame, pl.DataFrame]:
    """What errors of the poses explain, by age and of all ages."""
    rigid = by_condition(inputs.run.stored_tables("rigid"), RIGID, "rigid")
    return rigid_share(rigid, inputs.sampling), pose_share(rigid, inputs.sampling)


VERDICT_ON_TRUTH = Topic("truth", headline=verdict_on_truth, holds=(Basis.truth, Basis.none))
POSITIONS_OF_TRACKS = Topic("truth", headline=self_referential, holds=(Basis.fitted,))
NOISE_OF_FIT = Topic(
    "noise",
    (pooled(TRIANGULATED_NOISE, "fitted_noise", fitted_noise_table),),
    headline=noise,
    holds=(Basis.fitted,),
    rows_of_card=("error", "noise"),
)
ERRORS_OF_POSES = Topic(
    "pose errors",
    (
        pooled(TWO_TRUTHS, "truth_differences", two_truths_table),
        pooled(POSE_DISAGREEMENT, "pose_differences", pose_disagreement_table),
        pooled(POSE_LAW, "pose_growth", pose_law, if_wrong=NO_ROWS),
        Analysis((RIGID_SHARE, POSE_SHARE), _motions, if_wrong=NO_ROWS),
    ),
    headline=pose_errors,
    of_these_scenes=True,
)
TRUTH_ANALYSES = (
    Analysis((AUDIT, AUDIT_CURVES), lambda inputs: inputs.audit(), if_wrong=NO_ROWS),
    Analysis((TRUST,), lambda inputs: [inputs.assess(inputs)], needs=(AUDIT, AUDIT_CURVES, POSE_SHARE)),
)
DIFFERENCES = Topic(
    "differences",
    (pooled(TRACKER_DIFFERENCES, "between_trackers", tracker_differences),),
    headline=between_trackers,
    holds=ABOUT_TRACKS,
    of_these_scenes=True,
)
