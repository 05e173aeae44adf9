"""Every headline of a run, the most important first."""

import json
import math
from collections.abc import Callable
from typing import Any

import polars as pl

from tracknoise.phrases.bias_topic import bias
from tracknoise.phrases.covariance_topic import covariances
from tracknoise.phrases.depth_topic import depths
from tracknoise.phrases.edge_topic import depth_edges
from tracknoise.phrases.factor_topic import factors
from tracknoise.phrases.growth_topic import growth
from tracknoise.phrases.headline import Headline, ReportedConditions, RunTables
from tracknoise.phrases.lookup_topic import noise_by_condition
from tracknoise.phrases.ratio_topic import ratios
from tracknoise.phrases.scene_topic import copied_scenes, few_scenes, grouped_scenes
from tracknoise.phrases.shape_topic import shape
from tracknoise.phrases.size_topic import size, survivorship
from tracknoise.phrases.track_topics import lifetimes, outliers
from tracknoise.phrases.trimming_topic import trimming_matters
from tracknoise.phrases.truth_topic import between_trackers, noise, pose_errors, self_referential, verdict_on_truth
from tracknoise.phrases.window_topic import depth_noise, estimator_noise
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.schema import check
from tracknoise.tables.trust import TruthVerdict

_TOPICS: tuple[Callable[[RunTables, ReportedConditions], Headline | None], ...] = (
    verdict_on_truth,
    copied_scenes,
    estimator_noise,
    depth_noise,
    depths,
    covariances,
    few_scenes,
    grouped_scenes,
    pose_errors,
    size,
    trimming_matters,
    ratios,
    bias,
    depth_edges,
    shape,
    growth,
    noise_by_condition,
    between_trackers,
    factors,
    survivorship,
    outliers,
    lifetimes,
)
"""Each makes a headline, or none where the tables have no rows about it; the most important first."""

_FITTED_TOPICS: tuple[Callable[[RunTables, ReportedConditions], Headline | None], ...] = (
    copied_scenes,
    self_referential,
    depth_noise,
    few_scenes,
    grouped_scenes,
    noise,
    between_trackers,
    factors,
    outliers,
    lifetimes,
)
"""The same where true positions were fitted to the tracks."""


def headline_table(tables: RunTables, conditions: ReportedConditions) -> pl.DataFrame:
    """Sentences about what was found, the most important first.

    Parameters
    ----------
    tables
        By their names: curves, floor, summary, effects, intervals, seed_spread, zero_mean, gaussianity, time_structure,
        dependence, surrounding_errors, pose_share, advice, tracker_differences, triangulated_noise, noise_lookup,
        trust, window_sigmas, depth_intervals and own_covariances. One without rows has no headline.
    conditions
        Which conditions the sentences are about.

    Returns
    -------
    polars.DataFrame
        Schema `FINDINGS`. value, low and high are those of the first number in the text that has an interval.
        `figure` names a section of the report; `table` the table that holds the numbers.
    """
    topics = _FITTED_TOPICS if conditions.fitted else _TOPICS
    if TruthVerdict.of(tables["trust"]).are_tracks_wrong:
        topics = (verdict_on_truth, copied_scenes)
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
