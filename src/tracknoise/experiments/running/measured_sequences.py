"""Sequences of a run folder from measurements in memory."""

from collections.abc import Iterable
from dataclasses import replace

from tracknoise.experiments.blas import one_blas_thread
from tracknoise.experiments.measure import Measurement
from tracknoise.experiments.running.provenance import new_manifest
from tracknoise.experiments.running.task import sequence_entry, tables_to_keep
from tracknoise.experiments.settings import Experiment
from tracknoise.sequences.images import encode_png
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder


@one_blas_thread()
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


def write_settings(folder: RunFolder, experiment: Experiment, entries: Iterable[SequenceEntry]) -> None:
    """Write the manifest and the settings of a run whose sequences have been written.

    Parameters
    ----------
    folder
        The run folder.
    experiment
        Whose run it is.
    entries
        What `write_measurement` returned, at least one.

    Raises
    ------
    StoreError
        If the folder cannot be written.
    """
    manifest = new_manifest(experiment)
    manifest.sequences.update({entry.key: entry for entry in entries})
    folder.create(experiment.to_toml(), manifest)
