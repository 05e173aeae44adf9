"""Findings of a run from its statistics: the tables of all topics, noise models, and sentences."""

from collections.abc import Mapping
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
from tracknoise.tables.findings_schema import AUDIT, AUDIT_CURVES, FINDINGS, TRIMS, TRUST
from tracknoise.tables.manifest import Manifest
from tracknoise.tables.result_rows import with_ids
from tracknoise.tables.run_table import RunTable
from tracknoise.tables.schema import VIEW, empty
from tracknoise.tables.store import FINDINGS_JSON, RunFolder
from tracknoise.tables.trust import TruthVerdict
from tracknoise.topics.catalogue import FINDINGS_TABLES, TOPICS, by_table
from tracknoise.topics.headline import ReportedConditions
from tracknoise.topics.headlines import basis_of, findings_json, headline_table
from tracknoise.topics.topic import NO_ROWS, Analysis, make_tables

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
    inputs = _inputs(run, manifest, experiment, statistics)
    frames = sum(entry.n_frames for entry in manifest.sequences.values())
    with beside(is_wanted=workers > 1 and frames >= _MANY_FRAMES) as begin:
        audited = begin(run_audit, run, manifest, experiment)
        waiting = make_tables([analysis for topic in TOPICS for analysis in topic.analyses], inputs)
        inputs.made.update(by_table(audited()))
        inputs.made[TRUST] = trust_table(run, manifest, experiment, inputs.made, inputs.reference)
        left = make_tables(waiting, inputs)
        assert not left, "a table is needed that nothing makes"
        truth = RunTruth(TruthVerdict.of(inputs[TRUST]), inputs[AUDIT_CURVES])
        models = fitted_models(run, inputs.trackers, inputs.reference.speed, truth, workers=workers, begin=begin)
    view = {name: getattr(inputs.reference, name) for name in (*VIEW, "speed")}
    asked = experiment.estimator
    inputs.made[ADVICE] = advice_table(models, asked.name, window=asked.window, features=asked.features, condition=view)
    _write_findings(inputs, manifest, experiment, models)


def _inputs(
    run: RunFolder, manifest: Manifest, experiment: Experiment, statistics: Mapping[str, pl.DataFrame]
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
        made=by_table(statistics),
    )


_AUDIT = Analysis((AUDIT, AUDIT_CURVES), lambda _: (), if_wrong=NO_ROWS)


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
    basis = basis_of(inputs[TRUST], is_fitted=reported.fitted)
    tables = {**{table: empty(table) for table in FINDINGS_TABLES}, **inputs.made}
    for analysis in (_AUDIT, *(analysis for topic in TOPICS for analysis in topic.analyses)):
        for table in analysis.tables:
            tables[table] = tables[table].filter(analysis.remaining(basis))
    named = {table.name: rows for table, rows in tables.items()}
    cited = {table.name: _cited(table, rows, inputs) for table, rows in tables.items() if table.rows is not None}
    named[FINDINGS.name] = tables[FINDINGS] = headline_table({**named, **cited}, reported)
    inputs.run.write_statistics(tables, documents={FINDINGS_JSON: findings_json(named), **models.documents})


def _cited(table: RunTable, rows: pl.DataFrame, inputs: RunInputs) -> pl.DataFrame:
    """A table as sentences cite it, with the ids of its rows of results.

    Curves of errors are those of the reference condition: others are most rows of a large run, and in no sentence.
    """
    view: dict[str, Any] = {name: getattr(inputs.reference, name) for name in (*VIEW, "speed")}
    return with_ids(table, rows.filter(**view) if table.are_curves else rows)
