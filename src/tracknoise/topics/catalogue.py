"""All topics, the most important first, and all tables of a run."""

from collections.abc import Collection, Mapping
from typing import Any

import polars as pl

from tracknoise.analysis.estimand import Estimand
from tracknoise.estimators.run_models import ADVICE
from tracknoise.tables.findings_schema import FINDINGS, STATISTICS_TABLES
from tracknoise.tables.quantities import QUANTITIES, Quantity
from tracknoise.tables.result_rows import results_of
from tracknoise.tables.results import beside_untrusted_truth
from tracknoise.tables.run_table import RunTable
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict
from tracknoise.topics.bias_topic import BIAS
from tracknoise.topics.covariance_topic import COVARIANCES
from tracknoise.topics.depth_topic import DEPTHS
from tracknoise.topics.edge_topic import PLACES
from tracknoise.topics.factor_topic import EFFECTS_OF_FACTORS
from tracknoise.topics.growth_topic import GROWTH
from tracknoise.topics.interval_topic import NUMBERS
from tracknoise.topics.lookup_topic import NOISE_BY_CONDITION
from tracknoise.topics.pair_topic import SECOND_CAMERA
from tracknoise.topics.ratio_topic import RATIOS_OF_SUMS
from tracknoise.topics.scene_topic import COPIED_SCENES, FEW_SCENES, GROUPED_SCENES
from tracknoise.topics.shape_topic import SHAPE
from tracknoise.topics.size_topic import SIZE, SURVIVORSHIP
from tracknoise.topics.topic import Analysis, Curve, Topic
from tracknoise.topics.track_topics import LIFETIMES_OF_TRACKS, OUTLIERS_OF_TRACKERS
from tracknoise.topics.trimming_topic import TRIMMING_MATTERS
from tracknoise.topics.truth_topic import (
    DIFFERENCES,
    ERRORS_OF_POSES,
    NOISE_OF_FIT,
    POSITIONS_OF_TRACKS,
    TRUTH_ANALYSES,
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
    SECOND_CAMERA,
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
CURVES_OF_TOPICS: tuple[Curve, ...] = tuple(curve for topic in TOPICS for curve in topic.curves)
_OF_TOPICS: tuple[Analysis, ...] = tuple(analysis for topic in TOPICS for analysis in topic.analyses)
ANALYSES = (*_OF_TOPICS, *TRUTH_ANALYSES)
FINDINGS_TABLES = (
    *(table for analysis in _OF_TOPICS for table in analysis.tables),
    ADVICE,
    *(table for analysis in TRUTH_ANALYSES for table in analysis.tables),
    FINDINGS,
)
"""Tables of a run that are made of others. They are empty where these analyses were not made."""
RUN_TABLES = {table.name: table for table in (*STATISTICS_TABLES, *FINDINGS_TABLES)}
"""Tables of the whole run by their names: a file each."""

EVERY_QUANTITY: Mapping[str, Quantity] = {
    **QUANTITIES,
    **{name: quantity for table in RUN_TABLES.values() for name, quantity in table.quantities.items()},
}
"""What each number of a run is."""
_ROWS = [(table, table.rows) for table in RUN_TABLES.values() if table.rows is not None]
_NAMES: dict[Any, pl.Enum] = {
    "quantity": pl.Enum(list(EVERY_QUANTITY)),
    "topic": pl.Enum(sorted({topic for _, rows in _ROWS for topic in rows.topics})),
}


def run_results(run: RunFolder, only: Collection[str] | None = None) -> pl.DataFrame:
    """The table of results of a run: every number of its tables, or those with some ids.

    Returns: schema `RESULTS`, but for `quantity` and `topic`, which have all their names.

    Raises
    ------
    StoreError, SchemaError
        If the run is not finished, or a file is missing or damaged.
    """
    return results_about({table: run.statistics(table) for table, _ in _ROWS}, TruthVerdict.of_run(run), only)


def results_about(
    tables: Mapping[RunTable, pl.DataFrame], truth: TruthVerdict, only: Collection[str] | None = None
) -> pl.DataFrame:
    """The same of tables that were read."""
    results = results_of(tables, only).cast(_NAMES)
    if truth.is_usable:
        return results
    return beside_untrusted_truth(results, [rows.topic for table, rows in _ROWS if table.without_truth])


def by_table(tables: Mapping[str, pl.DataFrame]) -> dict[RunTable, pl.DataFrame]:
    """Tables of a run by what they are, not by name."""
    return {RUN_TABLES[name]: table for name, table in tables.items()}
