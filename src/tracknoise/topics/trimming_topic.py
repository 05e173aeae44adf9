"""Which answers change where the tracks with the largest errors are dropped, and what trimming drops."""

import math
from collections.abc import Mapping, Sequence

import polars as pl

from tracknoise.tables.enumerations import Trimming
from tracknoise.topics.bands import FRAME
from tracknoise.topics.bias_topic import verdict_on_bias
from tracknoise.topics.growth_topic import IN_WORDS, behaviour_of
from tracknoise.topics.headline import Headline, ReportedConditions, RunTables, curve_rows
from tracknoise.topics.measures import first
from tracknoise.topics.run_data import RunData
from tracknoise.topics.sentences import MOST_NAMED, joined, sentences_of, together
from tracknoise.topics.topic import Topic
from tracknoise.words import condition_name, count, number, percent, px, rms_of_tracks

_BOTH = (Trimming.untrimmed, Trimming.trimmed)


def trimming_matters(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Where trimmed and untrimmed errors give different answers; none where they agree or nothing was trimmed."""
    if conditions.percentile is None:
        return None
    verdicts, rankings = _verdicts(tables, conditions), _rankings(tables, conditions)
    if not verdicts and not rankings:
        return None
    changed = f"Trimming the tracks with the largest errors changes {count(len(verdicts), 'answer')}."
    answers = [changed, *verdicts] if verdicts else []
    orders = [*rankings, "Whether this ranking holds in other scenes was not tested."] if rankings else []
    brief = sentences_of(rankings[0])[0] if rankings else changed
    return Headline(" ".join([*answers, *orders]), "trimming", "summary", brief=brief)


def _rankings(tables: RunTables, conditions: ReportedConditions) -> list[str]:
    """Sentences on each axis in which another tracker has the smallest error, with the numbers: it can be by chance.

    All are compared at one age (frame), the nearest to the first of those that their headlines are about.
    """
    rows = [first(conditions.of(tables["summary"], tracker)) for tracker in conditions.trackers]
    ages = [int(row["at"]) for row in rows if row is not None and row["at"] is not None]
    if len(ages) < 2:
        return []
    at = min(ages, key=abs)
    sentences = [_ranking(tables, conditions, at, axis) for axis in "uv"]
    return [sentence for sentence in sentences if sentence]


def _ranking(tables: RunTables, conditions: ReportedConditions, at: int, axis: str) -> str:
    values = {trimming: _rms(tables, conditions, at, axis, trimming) for trimming in _BOTH}
    if len(values[_BOTH[0]]) < 2 or len({frozenset(rms) for rms in values.values()}) > 1:
        return ""
    best = {trimming: min(rms, key=lambda tracker: rms[tracker]) for trimming, rms in values.items()}
    if len(set(best.values())) == 1:
        return ""
    trimmed_leader, leader = best[Trimming.trimmed], best[Trimming.untrimmed]
    claim = (
        f"A few tracks decide the RMS ranking in {axis}: {leader} is first with them, {trimmed_leader} without them."
    )
    sizes = (
        f"{name} has the smallest {rms_of_tracks(trimming)} {conditions.place(at)}, {px(values[trimming][name])}."
        for trimming, name in best.items()
    )
    return joined([claim, *sizes])


def _rms(tables: RunTables, conditions: ReportedConditions, at: int, axis: str, trimming: str) -> Mapping[str, float]:
    """Root mean square errors of the trackers that have one, px, features pooled."""
    rows = {
        tracker: first(curve_rows(intervals, conditions, "second", at, axis, trimming=trimming))
        for tracker in conditions.trackers
        for intervals in [conditions.intervals(tables, tracker)]
    }
    return {
        tracker: math.sqrt(row["value"])
        for tracker, row in rows.items()
        if row is not None and row["value"] is not None
    }


def _verdicts(tables: RunTables, conditions: ReportedConditions) -> list[str]:
    """One sentence for each question and tracker whose verdicts differ."""
    sentences: list[str] = []
    for tracker in conditions.trackers:
        for coordinate in "uv":
            kinds = [behaviour_of(tables, conditions, tracker, coordinate, trimming) for trimming in _BOTH]
            sentences += _differs(kinds, f"growth of the error of {tracker} in {coordinate}")
        summary = first(conditions.of(tables["summary"], tracker))
        at = None if summary is None else summary["at"]
        verdicts = [verdict_on_bias(tables, conditions, tracker, at, trimming) for trimming in _BOTH]
        sentences += _differs(verdicts, f"bias of {tracker}")
    return sentences


def _differs(verdicts: Sequence[str | None], subject: str) -> Sequence[str]:
    words = [IN_WORDS.get(verdict, verdict) for verdict in verdicts if verdict is not None]
    if len(words) < len(_BOTH) or verdicts[0] == verdicts[1]:
        return []
    before, after = words
    return [f"The verdict on {subject} is '{before}' before trimming and '{after}' after it."]


def percentile_of(data: RunData) -> str:
    """The tracks over which the percentile is taken, as part of a sentence."""
    if "followed" not in data["trims"]["among"]:
        return "all tracks of the same scene and condition"
    return f"those tracks of the same scene and condition that were followed beyond {_anchor(data)}"


def cut_at_zero(data: RunData) -> list[tuple[str, str]]:
    """Conditions whose trimming is decided by errors that are zero by construction, each with its warning.

    A track whose only error is that at its anchor has a largest error of about 0 px. Where the share of such tracks
    reaches the percentile, the cut falls among them, and nearly all of the other tracks are dropped.
    """
    trims = data.listed(data["trims"])
    least = pl.col("percentile") / 100 * pl.col("n_measured")
    decided = trims.filter(pl.col("percentile") < 100, pl.col("n_anchor_only") >= least, pl.col("n_anchor_only") > 0)
    decided = decided.filter(among="all")
    names = data.in_order(decided.select(list(data.condition_columns)).unique()).to_dicts()
    if len(names) > MOST_NAMED:
        return [(together([condition_name(condition) for condition in names]), _warning(data, decided, trims))]
    return [
        (condition_name(condition), _warning(data, decided.filter(**condition), trims.filter(**condition)))
        for condition in names
    ]


def _warning(data: RunData, decided: pl.DataFrame, trims: pl.DataFrame) -> str:
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


def _anchor(data: RunData) -> str:
    return "the key frame" if data.axis is FRAME else "their first frame"


TRIMMING_MATTERS = Topic("trimming", headline=trimming_matters)
