"""The findings of a run in a few sentences: the noise to set in an estimator first, then caveats and the rest."""

from collections.abc import Callable

import polars as pl

from tracknoise.findings.headlines import (
    caveats,
    error_topics,
    fitted_topics,
    place_topic,
    tracking_topics,
    truth_topics,
)
from tracknoise.findings.headlines.depth_topic import depths
from tracknoise.findings.headlines.error_size import size
from tracknoise.findings.headlines.factor_topic import factors
from tracknoise.findings.headlines.headline import Headline, RunTables
from tracknoise.findings.headlines.lookup_topic import noise_by_condition
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.headlines.trimming_topic import trimming_matters
from tracknoise.findings.headlines.window_topic import estimator_noise
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.schema import check

_TOPICS: tuple[Callable[[RunTables, ReportedConditions], Headline | None], ...] = (
    caveats.doubtful_data,
    caveats.copied_scenes,
    estimator_noise,
    depths,
    caveats.few_scenes,
    caveats.grouped_scenes,
    caveats.recorded_truth,
    truth_topics.pose_errors,
    size,
    trimming_matters,
    error_topics.bias,
    place_topic.depth_edges,
    error_topics.shape,
    error_topics.growth,
    noise_by_condition,
    truth_topics.between_trackers,
    factors,
    error_topics.survivorship,
    tracking_topics.outliers,
    tracking_topics.lifetimes,
)
"""Each makes a headline, or none where the tables have no rows about it; the most important first."""
_FITTED_TOPICS: tuple[Callable[[RunTables, ReportedConditions], Headline | None], ...] = (
    caveats.doubtful_data,
    caveats.copied_scenes,
    fitted_topics.self_referential,
    estimator_noise,
    caveats.few_scenes,
    caveats.grouped_scenes,
    fitted_topics.noise,
    truth_topics.between_trackers,
    factors,
    tracking_topics.outliers,
    tracking_topics.lifetimes,
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
