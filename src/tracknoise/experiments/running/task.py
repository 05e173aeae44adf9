"""Measure a batch of sequences of an experiment and write their tables; what a worker runs."""

import time
import warnings
from collections.abc import Iterator

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataWarning
from tracknoise.experiments.measure import Measurement, measure_together
from tracknoise.experiments.running.failures import Result, diagnose
from tracknoise.experiments.running.lock import Claim
from tracknoise.experiments.running.plan import Task, make_trackers, open_batch
from tracknoise.experiments.settings import Experiment
from tracknoise.measurement.tracking import Progress
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.sequence import Sequence
from tracknoise.statistics.aspect_blocks import aspect_blocks
from tracknoise.statistics.aspects import scene_aspects
from tracknoise.statistics.block_moments import block_moments
from tracknoise.statistics.counts import counts
from tracknoise.statistics.histogram import error_histogram
from tracknoise.statistics.increments import increments
from tracknoise.statistics.lifetimes import count_ends
from tracknoise.statistics.samples import samples
from tracknoise.tables.schema import POSES, SEQUENCE
from tracknoise.tables.store import RunFolder, SequenceEntry
from tracknoise.truth.scan import ScanRule


def attempt(
    batch: list[Task],
    run: RunFolder,
    *,
    claim: Claim | None = None,
    progress: Progress | None = None,
    debug: bool = False,
) -> Result:
    """Do what `run_batch` does; whatever goes wrong is a result, so that the others go on, or raised to debug it."""
    try:
        return run_batch(batch, run, claim=claim, progress=progress)
    except (Exception, pl.exceptions.PanicException) as error:
        if debug:
            raise
        return diagnose(error)


def run_batch(
    batch: list[Task], run: RunFolder, *, claim: Claim | None = None, progress: Progress | None = None
) -> list[SequenceEntry]:
    """Measure the sequences of a batch and write their tables into the run folder.

    Parameters
    ----------
    batch
        Sequences of one experiment that share what they read.
    run
        Where to write.
    claim
        The hold on the folder that the work is for, checked before anything is written; by default none is needed.
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
    started, entries = time.monotonic(), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # the sequence's notes say the same, and are kept
        sequences = open_batch(batch)
        measured = _measure(batch[0], sequences, progress)
        for task, sequence, measurement in zip(batch, sequences, measured, strict=True):
            tables, snapshot = tables_to_keep(task.experiment, sequence, measurement), encode_png(measurement.snapshot)
            if claim:
                claim.check()
            hashes = run.write_sequence(task.key, tables, snapshot)
            seconds = (time.monotonic() - started) / len(batch)
            entries.append(_entry(task, sequence, measurement, seconds=seconds, sha256=hashes))
    return entries


def _entry(
    task: Task,
    sequence: Sequence,
    measurement: Measurement,
    *,
    seconds: float,
    sha256: dict[str, str],
) -> SequenceEntry:
    return SequenceEntry(
        sequence=task.sequence,
        n_frames=measurement.n_frames,
        width=sequence.camera.width,
        height=sequence.camera.height,
        truth=measurement.truth,
        snapshot_frame=measurement.snapshot_frame,
        seconds=round(seconds, 3),
        notes=sequence.notes,
        inputs=task.inputs,
        key_frame=measurement.key_frame,
        sha256=sha256,
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
        trim_among=experiment.statistics.trim_among,
        seed=experiment.seed,
        progress=progress,
    )


def tables_to_keep(experiment: Experiment, sequence: Sequence, measurement: Measurement) -> dict[str, pl.DataFrame]:
    """The tables of a sequence by name, those of single observations and tracks only where they are wanted."""
    observed = {"observations": measurement.observations, "tracks": measurement.tracks}
    axis = "age" if measurement.key_frame is None else "frame"
    populations = list(dict.fromkeys(["visible", experiment.truth.population]))
    slowest = measurement.observations.filter(pl.col("speed") == min(experiment.speeds))  # which figures show
    return {
        **(observed if experiment.keep == "observations" else {}),
        "frames": measurement.frames,
        "poses": _poses(sequence, measurement.n_frames),
        "moments": measurement.moments,
        "trims": measurement.trims,
        "counts": counts(measurement.observations, measurement.tracks),
        "ends": count_ends(measurement.tracks),
        "errors": error_histogram(measurement.tracks),
        "blocks": block_moments(measurement.observations, measurement.tracks, axis=axis, populations=populations),
        "aspects": scene_aspects(measurement.observations, measurement.tracks, axis=axis),
        "aspect_blocks": aspect_blocks(slowest, measurement.tracks, axis=axis),
        "increments": increments(measurement.observations, measurement.tracks),
        "samples": samples(measurement.observations, measurement.tracks, key_frame=measurement.key_frame),
    }


def _poses(sequence: Sequence, n_frames: int) -> pl.DataFrame:
    """Table `POSES` of the frames that were read."""
    poses = sequence.world_from_camera[:n_frames]
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True)
    columns = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
    values = dict(zip(columns, np.hstack([poses[:, :3, 3], quaternions]).T, strict=True))
    labels = {column: [getattr(sequence.id, column)] * n_frames for column in SEQUENCE}
    return pl.DataFrame({**labels, "frame": np.arange(n_frames), **values}, schema=dict(POSES))
