"""Headlines that limit what the others mean: doubtful data, few scenes, groups of them, and a measured truth."""

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.headlines.error_size import first
from tracknoise.findings.headlines.headline import Headline, RunTables
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.headlines.withheld import excessive_floor
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.findings.wording import count, listing
from tracknoise.printable import counted_of
from tracknoise.tables.enumerations import Resampled, Trimming

ENOUGH_SCENES = 8
"""With fewer scenes than this, intervals contain the true value less often than their level says."""
MOST_DOUBTS = 3
"""More reasons to doubt the data than this are counted, but not named."""
MOST_NAMED = 6
"""More groups than this are counted, but not named."""


def doubtful_data(_tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Warn where the data themselves look wrong: then the numbers are not those of the trackers."""
    if not conditions.doubts and not conditions.mistakes:
        return None
    of_scenes = [sentence for found in conditions.doubts.values() for sentence in found]
    sentences = list(dict.fromkeys([*of_scenes, *conditions.mistakes]))
    more = len(sentences) - MOST_DOUBTS
    others = [f"There are {count(more, 'further reason')}: see the measurement section."] if more > 0 else []
    opening = f"{_whose(list(conditions.doubts))} wrong, so that errors are not those of the trackers."
    text = " ".join([opening, *sentences[:MOST_DOUBTS], *others])
    return Headline("data", text, "limits", "counts")


def _whose(scenes: list[str]) -> str:
    """``Data of office look``; of all scenes where none is doubtful by itself."""
    if not scenes:
        return "Data look"
    return f"Data of {listing(scenes)} look" if len(scenes) <= MOST_NAMED else f"Data of {len(scenes)} scenes look"


def copied_scenes(_tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Warn where scenes are copies of others: they are no further evidence, but are counted."""
    copies = conditions.groups.copies
    if not copies:
        return None
    pairs = [f"{scene} those of {original}" for (_, scene), original in sorted(copies.items())[:MOST_NAMED]]
    more = ", and others" if len(copies) > MOST_NAMED else ""
    text = (
        f"{count(len(copies), 'scene')} {'has' if len(copies) == 1 else 'have'} the images of another "
        f"({listing(pairs)}{more}). Copies of a recording are not independent, so that intervals are too narrow: leave "
        "them out with dataset.scenes."
    )
    return Headline("copies", text, "limits", "counts")


def few_scenes(tables: RunTables, _conditions: ReportedConditions) -> Headline | None:
    """Warn if there are so few scenes that intervals are less reliable, or hold for these scenes only."""
    measured = tables["summary"].drop_nulls("n_scenes")
    few = measured.filter(pl.col("n_scenes") < ENOUGH_SCENES)
    if few.is_empty():
        return None
    numbers: list[int] = few["n_scenes"].unique().sort().to_list()
    some = counted_of(few.height, measured.height, "condition", "has", "have")
    whose = "Every condition has" if few.height == measured.height else some
    there = count(numbers[0], "scene") if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]} scenes"
    text = f"{whose} only {there}. {_limits(numbers[0], tables['intervals'])}"
    return Headline("scenes", text, "measured", "summary", Estimate(numbers[0], unit="scenes"))


def _limits(fewest: int, intervals: pl.DataFrame) -> str:
    """What few scenes mean for intervals and tests."""
    if fewest < MIN_SCENES:
        opening = f"With fewer than {MIN_SCENES} scenes,"
    elif intervals.filter(pl.col("n_scenes") >= MIN_SCENES, resampled=Resampled.blocks).height:
        opening = "They form too few groups to be resampled, so that"
    else:
        return f"Intervals from fewer than {ENOUGH_SCENES} scenes are less reliable."
    return (
        f"{opening} intervals come from blocks of tracks within the scenes. They "
        "hold for these scenes only. Tests of the mean error and of factors at the 5 % level are then not possible."
    )


def grouped_scenes(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Say how many groups the scenes come in, and what is resampled."""
    resampled = tables["intervals"].filter(pl.col("resampled").is_in([Resampled.groups, Resampled.within]))
    if resampled.is_empty():
        return None
    names = conditions.groups.names
    groups = sorted(set(names.values()))
    opening = f"{count(len(names), 'scene')} come in {count(len(groups), 'group')} of scenes that may be alike"
    if (resampled["resampled"] == Resampled.within).any():
        named = f" ({listing(groups)})" if len(groups) <= MOST_NAMED else ""
        text = (
            f"{opening}{named}. Scenes are resampled within their groups, so that intervals and tests hold for these "
            "groups only."
        )
    else:
        text = f"{opening}. Intervals resample whole groups."
    return Headline("groups", text, "measured", "intervals", Estimate(len(groups), unit="groups"))


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
    return Headline("truth", text, "limits", "counts")
