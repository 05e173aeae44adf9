"""Measure one sequence of an experiment and write its tables; what a worker runs."""

import time
import warnings

import polars as pl

from tracknoise.exceptions import DataWarning
from tracknoise.experiments.inputs import inputs_digest
from tracknoise.experiments.measure import Measurement, measure
from tracknoise.experiments.plan import Task, make_trackers, open_task
from tracknoise.measurement.sweep import Progress
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.sequence import Sequence
from tracknoise.statistics.counts import counts
from tracknoise.tables.store import RunFolder, SequenceEntry


def run_task(task: Task, run: RunFolder, *, progress: Progress | None = None) -> SequenceEntry:
    """Measure a sequence and write its tables into the run folder.

    Parameters
    ----------
    task
        Which sequence of which experiment.
    run
        Where to write.
    progress
        Told after each frame.

    Returns
    -------
    SequenceEntry
        For the manifest: the sequence counts as measured only once that holds it.

    Raises
    ------
    TracknoiseError
        If the data cannot be used, or the folder cannot be written.
    """
    started, inputs = time.monotonic(), inputs_digest(task)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # the sequence's notes say the same, and are kept
        sequence = open_task(task)
        measurement = _measure(task, sequence, progress)
    run.write_sequence(task.key, _tables(measurement), encode_png(measurement.snapshot))
    return SequenceEntry(
        dataset=task.sequence.dataset,
        scene=task.sequence.scene,
        lighting=task.sequence.lighting,
        rotation=task.sequence.rotation,
        n_frames=measurement.n_frames,
        width=sequence.camera.width,
        height=sequence.camera.height,
        truth=measurement.truth,
        snapshot_frame=measurement.snapshot_frame,
        seconds=round(time.monotonic() - started, 3),
        notes=sequence.notes,
        inputs=inputs,
    )


def _measure(task: Task, sequence: Sequence, progress: Progress | None) -> Measurement:
    experiment = task.experiment
    return measure(
        sequence,
        make_trackers(experiment),
        speeds=experiment.speeds,
        truth=experiment.truth.kind,
        population=experiment.truth.population,
        trim_percentile=experiment.statistics.trim_percentile,
        max_frames=experiment.dataset.max_frames,
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
