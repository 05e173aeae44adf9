"""What was measured, and what the number of scenes lets intervals and tests say."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.inference.units import MIN_SCENES, Resampled
from tracknoise.tables.enumerations import Verdict
from tracknoise.tables.results import ENOUGH_SCENES
from tracknoise.text import counted, counted_of
from tracknoise.topics.answer_summary import Judgement
from tracknoise.topics.headline import Headline, ReportedConditions, RunTables, intervals_of
from tracknoise.topics.measures import answer
from tracknoise.topics.run_data import RunData
from tracknoise.topics.sentences import joined
from tracknoise.topics.topic import ABOUT_TRACKS, Basis, Topic
from tracknoise.topics.truth_topic import without_truth
from tracknoise.words import TIMES, count, interval_text, listing, sentence_case

MOST_NAMED = 6
"""More groups than this are counted, but not named."""


def copied_scenes(_tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Warn where scenes are copies of others: they are no further evidence, but are counted."""
    copies = conditions.groups.copies
    if not copies:
        return None
    pairs = [f"{scene} has the images of {original}." for (_, scene), original in sorted(copies.items())[:MOST_NAMED]]
    text = joined(
        [
            f"{count(len(copies), 'scene')} {'has' if len(copies) == 1 else 'have'} the images of another scene.",
            *pairs,
            "Further scenes are copies, too." if len(copies) > MOST_NAMED else "",
            "Copies of a recording are not independent, so that intervals are too narrow.",
            "Leave copies out with dataset.scenes.",
        ]
    )
    brief = "Some scenes have the images of others, so that intervals are too narrow."
    return Headline(text, "limits", "counts", brief=brief)


def few_scenes(tables: RunTables, _conditions: ReportedConditions) -> Headline | None:
    """Warn if there are so few scenes that intervals are less reliable, or hold for these scenes only."""
    measured = tables["summary"].drop_nulls("n_scenes")
    few = measured.filter(pl.col("n_scenes") < ENOUGH_SCENES)
    if few.is_empty():
        return None
    numbers: list[int] = few["n_scenes"].unique().sort().to_list()
    affected = counted_of(few.height, measured.height, "condition", "has", "have")
    scenes = count(numbers[0], "scene") if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]} scenes"
    of_all = f"Every condition has only {scenes}."
    opening = of_all if few.height == measured.height else f"{affected} only {scenes}."
    text = f"{opening} {_limits(numbers[0], intervals_of(tables))}"
    brief = f"Conditions have as few as {count(numbers[0], 'scene')}, which limits what intervals and tests can say."
    return Headline(text, "measured", "summary", Estimate(numbers[0], unit="scenes"), brief=brief)


def _limits(fewest: int, intervals: pl.DataFrame) -> str:
    """What few scenes mean for intervals and tests."""
    if fewest < MIN_SCENES:
        opening = f"With fewer than {MIN_SCENES} scenes,"
    elif intervals.filter(pl.col("n_scenes") >= MIN_SCENES, resampled=Resampled.blocks).height:
        opening = "The scenes form too few groups to be resampled, so that"
    else:
        return f"Intervals from fewer than {ENOUGH_SCENES} scenes are less reliable."
    return (
        f"{opening} intervals come from blocks of tracks within the scenes. Intervals "
        "hold for these scenes only. Tests of the mean error and of factors at the 5 % level are then not possible."
    )


def grouped_scenes(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Say how many groups the scenes come in, and what is resampled."""
    resampled = intervals_of(tables).filter(pl.col("resampled").is_in([Resampled.groups, Resampled.within]))
    if resampled.is_empty():
        return None
    names = conditions.groups.names
    groups = sorted(set(names.values()))
    opening = f"{count(len(names), 'scene')} come in {count(len(groups), 'group')} of scenes that may be alike"
    if (resampled["resampled"] == Resampled.within).any():
        group_names = f": {listing(groups)}" if len(groups) <= MOST_NAMED else ""
        brief = f"Results hold only for these {count(len(groups), 'group')} of scenes{group_names}."
        text = f"{brief} Intervals resample {count(len(names), 'scene')} within their groups."
    else:
        brief = f"{opening}; intervals allow for it."
        text = f"{opening}. Intervals resample whole groups."
    return Headline(text, "measured", estimate=Estimate(len(groups), unit="groups"), brief=brief)


_HOLD: dict[str, tuple[str, Verdict]] = {
    Resampled.scenes: ("hold for similar scenes", Verdict.yes),
    Resampled.groups: ("hold for similar groups of scenes", Verdict.yes),
    Resampled.within: ("hold for these groups of scenes only", Verdict.undecided),
    Resampled.blocks: ("hold for these scenes only", Verdict.undecided),
}
_NO_INTERVALS = "No intervals were computed: the numbers hold for these scenes only."


def certainty(data: RunData) -> Judgement:
    """What intervals were made from, and what they hold for."""
    row = _interval_kind(data)
    if row is None:
        return Judgement(answer("other scenes", Verdict.undecided, wished=Verdict.yes), _NO_INTERVALS, "measured")
    text = f"{sentence_case(interval_text(row['level'], row['resampled'], [row['n_scenes']]))}. They {_hold(row)}"
    verdict = _HOLD[row["resampled"]][1]
    return Judgement(answer("other scenes", verdict, wished=Verdict.yes), text, "measured")


def holds(data: RunData) -> str:
    """On how much a run was measured, and what its results hold for."""
    entries, row = list(data.sequences.values()), _interval_kind(data)
    names = listing(sorted({entry.sequence.dataset for entry in entries}))
    scenes = count(len({entry.sequence.scene for entry in entries}), "scene")
    hold = _NO_INTERVALS if row is None else f"Results {_hold(row)}"
    return f"Measured on {scenes} ({names}).{_missing(data)}{without_truth(data)} {hold}" if entries else measured(data)


def _interval_kind(data: RunData) -> dict[str, Any] | None:
    """Level, resampled and n_scenes of most intervals at the lowest speed; None where there are none."""
    intervals = data.nominal(data.intervals).drop_nulls(["level", "resampled", "n_scenes"])
    kinds = intervals.group_by("resampled", "level").agg(pl.len(), pl.col("n_scenes").max())
    return kinds.sort("len", "resampled", "level").row(-1, named=True) if kinds.height else None


def _hold(row: dict[str, Any]) -> str:
    """What intervals hold for; the end of a sentence."""
    few = row["n_scenes"] < ENOUGH_SCENES and row["resampled"] != Resampled.blocks
    return f"{_HOLD[row['resampled']][0]}{'; with few scenes they are less reliable' if few else ''}."


_TRUTHS: Mapping[str, str] = {
    "raycast": "ray casting of the exact surface",
    "birth": "poses and depth",
    "scan": "scan and poses",
    "swept": "poses, and depth from the images",
    "triangulated": "points fitted to the tracks",
}


def measured(data: RunData) -> str:
    """What was measured: data, scenes, frames, what could not be measured, truth, speed and view."""
    entries = list(data.sequences.values())
    if not entries:
        return "No sequence was measured."
    scenes = len({entry.sequence.scene for entry in entries})
    frames = {entry.n_frames for entry in entries}
    sizes = sorted({f"{entry.width} {TIMES} {entry.height}" for entry in entries})
    lengths = f"{min(frames)}" if len(frames) == 1 else f"{min(frames)} to {max(frames)}"
    image = f"{sizes[0]} px" if len(sizes) == 1 else "several sizes"
    data_names = listing(sorted({entry.sequence.dataset for entry in entries}))
    truth = listing(_TRUTHS.get(kind, kind) for kind in sorted({entry.truth for entry in entries}))
    image += "".join(f", {count(len(values), name)}" for name, values in data.varied.items())
    shown = f"{data.errors_shown} at speed {data.slowest}{data.where}"
    extent = f"{count(scenes, 'scene')} of {lengths} frames, {image}.{_missing(data)}"
    return f"Data: {data_names}, {extent} Truth: {truth}. {shown}."


def _missing(data: RunData) -> str:
    """How many scenes could not be measured; sequences, if some of their scenes were. Begins with a space."""
    failed, processed = list(data.manifest.failures), list(data.manifest.sequences)
    if not failed:
        return ""
    without, scenes = ({key.partition("@")[0] for key in keys} for keys in (failed, processed))
    if without & scenes:
        return f" {len(failed)} of {counted(len(failed) + len(processed), 'sequence')} could not be measured."
    return f" {len(without)} of {counted(len(without | scenes), 'scene')} could not be measured."


COPIED_SCENES = Topic("copies", headline=copied_scenes, holds=tuple(Basis))
FEW_SCENES = Topic("scenes", headline=few_scenes, holds=ABOUT_TRACKS)
GROUPED_SCENES = Topic("groups", headline=grouped_scenes, holds=ABOUT_TRACKS)
