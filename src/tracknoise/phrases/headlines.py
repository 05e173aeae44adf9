"""The findings of a run in a few sentences, what limits them, and the same as a document for programs.

- Headlines that limit what the others mean: doubtful data, few scenes, groups of them, and a measured truth.
- The findings of a run in a few sentences: the noise to set in an estimator first, then caveats and the rest.
- The findings of a run as one JSON document, for programs.
"""

import json
import math
from collections.abc import Callable
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.inference.units import MIN_SCENES, Resampled
from tracknoise.phrases import error_headlines, track_headlines, truth_headlines
from tracknoise.phrases.error_headlines import first, size, trimming_matters
from tracknoise.phrases.headline import Headline, ReportedConditions, RunTables
from tracknoise.phrases.noise_headlines import depths, estimator_noise, noise_by_condition
from tracknoise.phrases.ratio_headlines import ratios
from tracknoise.phrases.track_headlines import factors
from tracknoise.phrases.withheld import excessive_floor
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.results import ENOUGH_SCENES
from tracknoise.tables.schema import check
from tracknoise.text import counted_of
from tracknoise.words import count, listing

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


_TOPICS: tuple[Callable[[RunTables, ReportedConditions], Headline | None], ...] = (
    doubtful_data,
    copied_scenes,
    estimator_noise,
    depths,
    few_scenes,
    grouped_scenes,
    recorded_truth,
    truth_headlines.pose_errors,
    size,
    trimming_matters,
    ratios,
    error_headlines.bias,
    truth_headlines.depth_edges,
    error_headlines.shape,
    error_headlines.growth,
    noise_by_condition,
    truth_headlines.between_trackers,
    factors,
    error_headlines.survivorship,
    track_headlines.outliers,
    track_headlines.lifetimes,
)
"""Each makes a headline, or none where the tables have no rows about it; the most important first."""
_FITTED_TOPICS: tuple[Callable[[RunTables, ReportedConditions], Headline | None], ...] = (
    doubtful_data,
    copied_scenes,
    truth_headlines.self_referential,
    estimator_noise,
    few_scenes,
    grouped_scenes,
    truth_headlines.noise,
    truth_headlines.between_trackers,
    factors,
    track_headlines.outliers,
    track_headlines.lifetimes,
)
"""The same where true positions were fitted to the tracks."""


def headline_table(tables: RunTables, conditions: ReportedConditions) -> pl.DataFrame:
    """Sentences about what was found, the most important first.

    Parameters
    ----------
    tables
        By their names: curves, floor, summary, effects, intervals, seed_spread, zero_mean, gaussianity, time_structure,
        dependence, surrounding_errors, rigid_share, tracker_differences, triangulated_noise, noise_lookup,
        window_sigmas and depth_intervals. One without rows has no headline.
    conditions
        Which conditions the sentences are about.

    Returns
    -------
    polars.DataFrame
        Schema `FINDINGS`. value, low and high are those of the first number in the text that has an interval.
        `figure` names a section of the report; `table` the table that holds the numbers.
    """
    topics = _FITTED_TOPICS if conditions.fitted else _TOPICS
    found = [headline for make in topics if (headline := make(tables, conditions))]
    rows = [headline.row(rank) for rank, headline in enumerate(found, start=1)]
    return check(pl.DataFrame(rows, schema=dict(FINDINGS)), FINDINGS, "findings")


FORMAT = 1


def findings_json(tables: RunTables) -> str:
    """The sentences, and the verdicts with the numbers behind them.

    Parameters
    ----------
    tables
        By their names: findings, zero_mean, gaussianity, time_structure, dependence, intervals and triangulated_noise.

    Returns
    -------
    str
        An object with `format`; the rows of each table, but of `zero_mean` only those of all ages together, and of
        `intervals` only those of numbers that have no axis. A row is an object of its columns. What is missing is
        null, what is infinite the string ``Infinity`` or ``-Infinity``.
    """
    chosen = {
        "findings": tables["findings"],
        "zero_mean": tables["zero_mean"].filter(pl.col("at").is_null()),
        "gaussianity": tables["gaussianity"],
        "time_structure": tables["time_structure"],
        "dependence": tables["dependence"],
        "intervals": tables["intervals"].filter(pl.col("at").is_null()),
        "triangulated_noise": tables["triangulated_noise"],
    }
    document = {"format": FORMAT, **{name: _rows(table) for name, table in chosen.items()}}
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _rows(table: pl.DataFrame) -> list[dict[str, Any]]:
    return [{name: _value(value) for name, value in row.items()} for row in table.iter_rows(named=True)]


def _value(value: object) -> object:
    if isinstance(value, float) and math.isinf(value):
        return "Infinity" if value > 0 else "-Infinity"
    return value
