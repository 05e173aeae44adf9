"""A run folder from measurements in memory."""

from collections.abc import Iterable
from dataclasses import replace

from tracknoise.experiments.analysis.run_findings import compute_findings
from tracknoise.experiments.analysis.run_statistics import compute_statistics
from tracknoise.experiments.measure import Measurement
from tracknoise.experiments.running.provenance import new_manifest
from tracknoise.experiments.running.task import sequence_entry, tables_to_keep
from tracknoise.experiments.settings import Experiment
from tracknoise.sequences.images import encode_png
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder


def write_measurement(folder: RunFolder, experiment: Experiment, measurement: Measurement) -> SequenceEntry:
    """Write the tables of one sequence, and return its entry for the manifest.

    Parameters
    ----------
    folder
        The run folder, which need not exist yet.
    experiment
        Its population, speeds and `keep` are used.
    measurement
        What was measured.
    """
    entry = sequence_entry(measurement, sha256={})
    tables = tables_to_keep(experiment, measurement.sequence, measurement)
    hashes = folder.write_sequence(entry.key, tables, encode_png(measurement.snapshot))
    return replace(entry, sha256=hashes)


def complete_run(
    folder: RunFolder, experiment: Experiment, entries: Iterable[SequenceEntry], *, findings: bool = True
) -> None:
    """Write the manifest of sequences that have been written, and compute their statistics and findings.

    Parameters
    ----------
    folder
        The run folder.
    experiment
        Whose run it is.
    entries
        What `write_measurement` returned, at least one.
    findings
        Whether findings are wanted. They take longer than everything else.

    Raises
    ------
    StoreError, SchemaError
        If a table is damaged, or the folder cannot be written.
    """
    manifest = new_manifest(experiment)
    manifest.sequences.update({entry.key: entry for entry in entries})
    folder.create(experiment.to_toml(), manifest)
    statistics = compute_statistics(folder, experiment)
    if findings:
        compute_findings(folder, experiment, statistics)
