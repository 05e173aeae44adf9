"""Measure a batch of sequences of an experiment and write their tables; what a worker runs."""

import time
import warnings
from collections.abc import Iterator

import polars as pl

from tracknoise.exceptions import DataWarning
from tracknoise.experiments.inputs import inputs_digest
from tracknoise.experiments.measure import Measurement, measure_together
from tracknoise.experiments.plan import Task, make_trackers, open_batch
from tracknoise.measurement.sweep import Progress
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.sequence import Sequence
from tracknoise.statistics.counts import counts
from tracknoise.tables.store import RunFolder, SequenceEntry
from tracknoise.truth.scan import ScanRule


def run_batch(batch: list[Task], run: RunFolder, *, progress: Progress | None = None) -> list[SequenceEntry]:
    """Measure the sequences of a batch and write their tables into the run folder.

    Parameters
    ----------
    batch
        Sequences of one experiment that share what they read.
    run
        Where to write.
    progress
        Told after each frame.

    Returns
    -------
    list of SequenceEntry
        For the manifest, one a task: a sequence counts as measured only once that holds it.

    Raises
    ------
    TracknoiseError
        If the data cannot be used, or the folder cannot be written.
    """
    started, inputs = time.monotonic(), [inputs_digest(task) for task in batch]
    entries = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # the sequence's notes say the same, and are kept
        sequences = open_batch(batch)
        measured = _measure(batch[0], sequences, progress)
        for task, sequence, digest, measurement in zip(batch, sequences, inputs, measured, strict=True):
            run.write_sequence(task.key, _tables(measurement), encode_png(measurement.snapshot))
            seconds = (time.monotonic() - started) / len(batch)
            entries.append(_entry(task, sequence, measurement, seconds, digest))
    return entries


def _entry(task: Task, sequence: Sequence, measurement: Measurement, seconds: float, inputs: str) -> SequenceEntry:
    name = task.sequence
    return SequenceEntry(
        dataset=name.dataset,
        scene=name.scene,
        lighting=name.lighting,
        rotation=name.rotation,
        direction=str(name.direction),
        n_frames=measurement.n_frames,
        width=sequence.camera.width,
        height=sequence.camera.height,
        truth=measurement.truth,
        snapshot_frame=measurement.snapshot_frame,
        seconds=round(seconds, 3),
        notes=sequence.notes,
        inputs=inputs,
        key_frame=measurement.key_frame,
    )


def _measure(task: Task, sequences: list[Sequence], progress: Progress | None) -> Iterator[Measurement]:
    experiment = task.experiment
    truth = experiment.truth
    return measure_together(
        sequences,
        make_trackers(experiment),
        speeds=task.speeds,
        truth=truth.kind,
        scan_rule=ScanRule(truth.scan_radius_px, truth.scan_anchoring),
        population=truth.population,
        trim_percentile=experiment.statistics.trim_percentile,
        seed=experiment.seed,
        progress=progress,
    )


def _tables(measurement: Measurement) -> dict[str, pl.DataFrame]:
    return {
        "observations": measurement.observations,
        "tracks": measurement.tracks,
        "frames": measurement.frames,
        "moments": measurement.moments,
        "trims": measurement.trims,
        "counts": counts(measurement.observations, measurement.tracks),
    }
