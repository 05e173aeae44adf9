"""All topics, the most important first, and all tables of a run."""

from collections.abc import Mapping

import polars as pl

from tracknoise.analysis.estimand import Estimand
from tracknoise.estimators.run_models import ADVICE
from tracknoise.tables.findings_schema import AUDIT, AUDIT_CURVES, FINDINGS, STATISTICS_TABLES, TRUST
from tracknoise.tables.run_table import RunTable
from tracknoise.topics.bias_topic import BIAS
from tracknoise.topics.covariance_topic import COVARIANCES
from tracknoise.topics.depth_topic import DEPTHS
from tracknoise.topics.edge_topic import PLACES
from tracknoise.topics.factor_topic import EFFECTS_OF_FACTORS
from tracknoise.topics.growth_topic import GROWTH
from tracknoise.topics.interval_topic import NUMBERS
from tracknoise.topics.lookup_topic import NOISE_BY_CONDITION
from tracknoise.topics.ratio_topic import RATIOS_OF_SUMS
from tracknoise.topics.scene_topic import COPIED_SCENES, FEW_SCENES, GROUPED_SCENES
from tracknoise.topics.shape_topic import SHAPE
from tracknoise.topics.size_topic import SIZE, SURVIVORSHIP
from tracknoise.topics.topic import Analysis, Topic
from tracknoise.topics.track_topics import LIFETIMES_OF_TRACKS, OUTLIERS_OF_TRACKERS
from tracknoise.topics.trimming_topic import TRIMMING_MATTERS
from tracknoise.topics.truth_topic import (
    DIFFERENCES,
    ERRORS_OF_POSES,
    NOISE_OF_FIT,
    POSITIONS_OF_TRACKS,
    VERDICT_ON_TRUTH,
)
from tracknoise.topics.window_topic import DEPTH_NOISE, ESTIMATOR

TOPICS: tuple[Topic, ...] = (
    VERDICT_ON_TRUTH,
    COPIED_SCENES,
    POSITIONS_OF_TRACKS,
    ESTIMATOR,
    DEPTH_NOISE,
    DEPTHS,
    COVARIANCES,
    FEW_SCENES,
    GROUPED_SCENES,
    ERRORS_OF_POSES,
    SIZE,
    NOISE_OF_FIT,
    TRIMMING_MATTERS,
    RATIOS_OF_SUMS,
    BIAS,
    PLACES,
    SHAPE,
    GROWTH,
    NOISE_BY_CONDITION,
    DIFFERENCES,
    EFFECTS_OF_FACTORS,
    SURVIVORSHIP,
    OUTLIERS_OF_TRACKERS,
    LIFETIMES_OF_TRACKS,
    NUMBERS,
)

_COMPARED_FIRST = (SIZE, BIAS, SHAPE, GROWTH, OUTLIERS_OF_TRACKERS, LIFETIMES_OF_TRACKS)
ESTIMANDS: Mapping[str, Estimand] = {
    estimand.name: estimand for topic in (*_COMPARED_FIRST, *TOPICS) for estimand in topic.compared
}
"""What runs are compared by, in the order in which it is reported."""
ANALYSES: tuple[Analysis, ...] = tuple(analysis for topic in TOPICS for analysis in topic.analyses)
FINDINGS_TABLES = (
    *(table for analysis in ANALYSES for table in analysis.tables),
    ADVICE,
    AUDIT,
    AUDIT_CURVES,
    TRUST,
    FINDINGS,
)
"""Tables of a run that are made of others. They are empty where these analyses were not made."""
RUN_TABLES = {table.name: table for table in (*STATISTICS_TABLES, *FINDINGS_TABLES)}
"""Tables of the whole run by their names: a file each."""


def by_table(tables: Mapping[str, pl.DataFrame]) -> dict[RunTable, pl.DataFrame]:
    """Tables of a run by what they are, not by name."""
    return {RUN_TABLES[name]: table for name, table in tables.items()}
