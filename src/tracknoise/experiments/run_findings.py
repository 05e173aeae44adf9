"""Findings of a run from its statistics: the tables of all topics, noise models, and sentences."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import polars as pl

from tracknoise.analysis.condition_units import Sampling, groups_of_scenes
from tracknoise.analysis.factors import option_factors
from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.estimators.run_models import ADVICE, RunModels, advice_table, fitted_models
from tracknoise.estimators.training import RunTruth
from tracknoise.experiments.local_workers import beside
from tracknoise.experiments.machine import keeping_freed_memory, one_blas_thread
from tracknoise.experiments.run_statistics import reference_condition
from tracknoise.experiments.run_truth import run_audit, trust_table
from tracknoise.experiments.settings import FROM_FILES, Experiment
from tracknoise.measurement.reference_tracks import KINDS
from tracknoise.sequences.sequence import TRIANGULATED
from tracknoise.statistics.definitions import dropped_above
from tracknoise.tables.findings_schema import TRIMS
from tracknoise.tables.manifest import Manifest
from tracknoise.tables.result_rows import with_ids
from tracknoise.tables.run_table import RunTable
from tracknoise.tables.schema import VIEW, empty
from tracknoise.tables.store import FINDINGS_JSON, RunFolder
from tracknoise.tables.trust import AssessedTruth
from tracknoise.tables.truth_audit import AuditTables
from tracknoise.topics.catalogue import ANALYSES, FINDINGS_TABLES, by_table
from tracknoise.topics.headline import ReportedConditions
from tracknoise.topics.headlines import basis_of, findings_json, with_findings
from tracknoise.topics.topic import make_tables

_MANY_FRAMES = 150
"""From so many on, it takes longer to audit their truth than to start a process."""


@keeping_freed_memory()
@one_blas_thread()
def compute_findings(
    run: RunFolder, experiment: Experiment, statistics: Mapping[str, pl.DataFrame], *, workers: int = 1
) -> None:
    """Compute the findings of a run from its scenes' moments, and write its tables, findings and models.

    Parameters
    ----------
    run
        With at least one measured sequence.
    experiment
        Says where curves are cut, and which population errors are of.
    statistics
        What `tracknoise.experiments.run_statistics.compute_statistics` made of it.
    workers
        Processes that may take part.

    Raises
    ------
    StoreError, SchemaError
        If a table is damaged, or the folder cannot be written.
    """
    manifest = run.manifest()
    frames = sum(entry.n_frames for entry in manifest.sequences.values())
    with beside(is_wanted=workers > 1 and frames >= _MANY_FRAMES) as begin:
        inputs = _inputs(run, manifest, experiment, statistics, begin(run_audit, run, manifest, experiment))
        left = make_tables(ANALYSES, inputs)
        assert not left, "a table is needed that nothing makes"
        truth = RunTruth(AssessedTruth.of(inputs.named).verdict, AuditTables.of(inputs.named).audit_curves)
        models = fitted_models(run, inputs.trackers, inputs.reference.speed, truth, workers=workers, begin=begin)
    view = {name: getattr(inputs.reference, name) for name in (*VIEW, "speed")}
    asked = experiment.estimator
    inputs.made[ADVICE] = advice_table(models, asked.name, window=asked.window, features=asked.features, condition=view)
    _write_findings(inputs, manifest, experiment, models)


def _inputs(
    run: RunFolder,
    manifest: Manifest,
    experiment: Experiment,
    statistics: Mapping[str, pl.DataFrame],
    audit: Callable[[], AuditTables],
) -> RunInputs:
    asked = experiment.findings
    groups = groups_of_scenes(manifest.sequences, experiment.dataset.groups)
    trackers = {
        choice.label: (choice.kind, choice.options) for choice in experiment.trackers if choice.kind not in FROM_FILES
    }
    return RunInputs(
        run,
        reference_condition(manifest, experiment, statistics["outliers"]),
        Sampling(asked.intervals, asked.level, groups),
        population=experiment.truth.population,
        trimming=asked.trimming,
        min_features=experiment.statistics.min_features,
        margin=asked.margin,
        seeds=experiment.seeds,
        trackers=[tracker.label for tracker in experiment.trackers],
        options=option_factors(trackers),  # files of imported tracks come from any front end
        kinds=KINDS,
        audit=audit,
        assess=partial(trust_table, manifest, experiment),
        made=by_table(statistics),
    )


def _write_findings(inputs: RunInputs, manifest: Manifest, experiment: Experiment, models: RunModels) -> None:
    reported = ReportedConditions(
        inputs.reference,
        inputs.trackers,
        population=inputs.population,
        percentile=dropped_above(inputs[TRIMS]),
        fitted=TRIANGULATED in {entry.truth for entry in manifest.sequences.values()},
        groups=inputs.sampling.groups,
        trimming=inputs.trimming,
    )
    basis = basis_of(AssessedTruth.of(inputs.named).verdict, is_fitted=reported.fitted)
    tables = {**{table: empty(table) for table in FINDINGS_TABLES}, **inputs.made}
    for analysis in ANALYSES:
        for table in analysis.tables:
            tables[table] = tables[table].filter(analysis.remaining(basis))
    cited = {table.name: _cited(table, rows, inputs) for table, rows in tables.items() if table.rows is not None}
    tables = with_findings(tables, cited, reported)
    named = {table.name: rows for table, rows in tables.items()}
    inputs.run.write_statistics(tables, documents={FINDINGS_JSON: findings_json(named), **models.documents})


def _cited(table: RunTable, rows: pl.DataFrame, inputs: RunInputs) -> pl.DataFrame:
    """A table as sentences cite it, with the ids of its rows of results.

    Curves of errors are those of the reference condition: others are most rows of a large run, and in no sentence.
    """
    view: dict[str, Any] = {name: getattr(inputs.reference, name) for name in (*VIEW, "speed")}
    return with_ids(table, rows.filter(**view) if table.are_curves else rows)
