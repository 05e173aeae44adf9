"""Survivorship bias: whether tracks that live long have other errors."""

from tracknoise.phrases.headline import Headline, Part, ReportedConditions, RunTables, by_tracker, curve_bounds
from tracknoise.phrases.measures import POOLED_WORDS, first, short, trimmed_word
from tracknoise.phrases.size_topic import rms
from tracknoise.tables.enumerations import Aspect
from tracknoise.words import format_estimate


def survivorship(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether long-lived tracks have smaller errors than all tracks."""
    errors = f"{trimmed_word(conditions)}root mean square errors, {POOLED_WORDS}"
    return by_tracker(
        conditions.trackers,
        lambda tracker: _survivorship_of(tables, conditions, tracker),
        opening=f"Survivorship bias {conditions.where(tables['summary'])}, in {errors}.",
        topic="survivorship",
        figure="survivorship-bias",
        table="intervals",
    )


def _survivorship_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    row, intervals = first(conditions.of(tables["summary"], tracker)), conditions.of(tables["intervals"], tracker)
    if row is None or row["at"] is None:
        return None
    since, trimming = abs(conditions.since(row["at"])), conditions.trimmings[0]
    aspect = Aspect.long_lived
    for age in sorted(intervals.filter(aspect=aspect)["at_least"].unique()):
        long = curve_bounds(
            intervals, conditions, "second", row["at"], "u", trimming=trimming, aspect=aspect, at_least=age
        )
        if age > since and long:
            every = rms(intervals, conditions, row, "u", trimming)
            text = (
                f"{conditions.opening_place(row['at'])}, tracks of {tracker} that live to age {age} are compared with "
                f"all. Their error in u is {format_estimate(long)}. For all tracks it is {format_estimate(every)}."
            )
            brief = f"The RMS over the tracks of {tracker} that live long is {short(long)} in u."
            return Part(text, [long, every], brief)
    return None
