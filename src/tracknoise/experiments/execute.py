"""Run an experiment: measure its sequences and compute its findings, or compute these again with another trimming."""

import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import polars as pl

from tracknoise.exceptions import DataWarning, SettingsError, StoreError
from tracknoise.experiments.cluster import remote_workers
from tracknoise.experiments.failures import (
    RETRIES,
    Batch,
    Failure,
    FailureKind,
    Measure,
    Results,
    Settled,
    with_retries,
)
from tracknoise.experiments.geometry_tables import geometry_tables
from tracknoise.experiments.load import resolve
from tracknoise.experiments.local_workers import measure_locally
from tracknoise.experiments.machine import one_blas_thread
from tracknoise.experiments.measured_poses import with_measured_poses
from tracknoise.experiments.plan import batches, excluded_scenes, open_batch, plan
from tracknoise.experiments.resume import begin, due, forget_outdated
from tracknoise.experiments.run_findings import compute_findings
from tracknoise.experiments.run_lock import ManifestWriter, hold
from tracknoise.experiments.run_statistics import compute_statistics
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.experiments.task import Job, attempt, following
from tracknoise.sequences.sequence import Sequence
from tracknoise.sequences.views import PartOfSequence
from tracknoise.statistics.joining import OF_THE_WHOLE, Part, join, rows_of
from tracknoise.statistics.summarise import STATISTICS, statistics_of
from tracknoise.statistics.trimming import trim
from tracknoise.tables.identity import readable
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import OBSERVED, STORED, RunFolder, schema_of


class Listener(Protocol):
    """Receives the progress of a run."""

    def planned(self, keys: list[str], done: int) -> None:
        """Before the first sequence: the keys to be measured, and the number of sequences already measured."""
        ...

    def frame(self, key: str, done: int, total: int, first: int) -> None:
        """After each frame of a sequence that is measured on this machine.

        The number of frames done from the frame `first` on, of `total` frames of the sequence: parts of a long one are
        measured side by side. It is 0 after each frame through which reference tracks are followed.
        """
        ...

    def measured(self, key: str, entry: SequenceEntry) -> None:
        """After each measured sequence."""
        ...

    def failed(self, keys: list[str], cause: str) -> None:
        """After each batch that could not be measured: the keys of its sequences and the cause."""
        ...

    def remark(self, text: str) -> None:
        """Any other message: the workers of a scheduler, the address of their dashboard, a retry."""
        ...


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a run."""

    measured: list[str]  # keys of the measured sequences, those of earlier starts included
    failures: dict[str, str]  # cause of each failure, by key


def execute(
    experiment: Experiment,
    run: RunFolder,
    *,
    listener: Listener,
    workers: int = 1,
    scheduler: str | None = None,
    retries: int = RETRIES,
    fresh: bool = False,
    verify: bool = False,
    debug: bool = False,
) -> Outcome:
    """Measure the sequences of an experiment that are not measured yet, then compute the statistics of all.

    A sequence that fails is recorded with its cause, and the run continues. Transient failures are retried first.
    Results do not depend on the number of workers.

    Parameters
    ----------
    experiment
        What to run.
    run
        The run folder. A run of the same experiment is resumed.
    listener
        Receives the progress.
    workers
        Maximum number of worker processes on this machine. With 1, this process measures.
    scheduler
        Address of a Dask scheduler whose workers are used instead.
    retries
        Maximum number of retries per batch.
    fresh
        Delete the run that the folder holds, once the new experiment has been checked.
    verify
        Compare the contents of all files that measured sequences were read from, not only size and time of
        modification of images and depth maps.
    debug
        Raise the first failure instead of recording it.

    Raises
    ------
    TracknoiseError
        If the experiment is invalid, the folder belongs to another experiment, is in use or cannot be written, or the
        scheduler cannot be reached. Sequences measured before that are kept.
    """
    experiment = resolve(experiment)
    tasks = plan(experiment)
    with hold(run) as claim, claim.explained():
        manifest, changed = begin(experiment, run, fresh=fresh, remark=listener.remark)
        manifest.excluded_scenes = excluded_scenes(experiment)
        todo = due(tasks, run, manifest, verify=verify, remark=listener.remark)
        forget_outdated(todo, run, manifest, experiment)
        listener.planned([task.key for task in todo], len(tasks) - len(todo))
        together = batches(todo)
        shown = claim if scheduler else replace(claim, patience_s=0.0)  # this machine sees the folder as it is
        job = Job(
            RunFolder(run.path.absolute()), shown, manifest.versions, debug, one_thread=len(together) > 1, verify=verify
        )

        def retrying(batch: Batch, cause: str) -> None:
            listener.remark(f"{readable(batch[0].key)}: {cause}; retrying")

        with _crew(job, together, listener, workers=workers, scheduler=scheduler) as measure:
            if changed:
                run.replace_experiment(experiment.to_toml(), manifest)
            results = with_retries(measure, together, retries=retries, retrying=retrying)
            with ManifestWriter(run, manifest, claim) as manifest_writer, closing(results):
                for batch, result in results:
                    _settle(batch, result, manifest_writer, listener)
                    manifest_writer.write_if_due()
        run.discard_parts(but={task.key for task in tasks} - manifest.sequences.keys())
        run.discard_references(but={task.key for task in tasks})
        if todo:
            run.discard_unfinished()  # files of workers that died while they wrote
        if manifest.sequences:
            outdated = not manifest.statistics.keys() >= {*STORED}
            statistics = compute_statistics(run, experiment)
            if outdated:  # earlier results stay in the folder until the new ones can be written
                run.discard_documents()
            compute_findings(run, experiment, statistics, workers=workers)
        else:
            run.discard_results()
    return Outcome(sorted(manifest.sequences), dict(manifest.failures))


def _crew(
    job: Job, together: list[Batch], listener: Listener, *, workers: int, scheduler: str | None
) -> AbstractContextManager[Measure]:
    """Select what measures: the workers of a scheduler, local processes, or this process if one is requested.

    A single batch is measured in a process of its own too: it may be the one that ended a worker in an earlier start.
    """
    if scheduler is not None and together:
        return remote_workers(job, address=scheduler, remark=listener.remark)
    if workers > 1:
        return nullcontext(partial(measure_locally, job, workers=workers, frame=listener.frame))
    return nullcontext(partial(_here, job, listener))


def _here(job: Job, listener: Listener, together: list[Batch]) -> Results:
    for batch in together:
        progress = following(batch[0], listener.frame)
        yield batch, attempt(batch, job.run, claim=job.claim, progress=progress, debug=job.debug, verify=job.verify)


def _settle(batch: Batch, result: Settled, manifest_writer: ManifestWriter, listener: Listener) -> None:
    """Record the result of a batch. A fatal failure ends the run."""
    if not isinstance(result, Failure):
        for task, entry in zip(batch, result, strict=True):
            manifest_writer.measured(entry)
            listener.measured(task.key, entry)
        return
    if result.kind is FailureKind.fatal:
        raise StoreError(result.cause)
    for task in batch:
        manifest_writer.failed(task.key, result)
    listener.failed([task.key for task in batch], result.cause)


@one_blas_thread()
def remake(run: RunFolder, experiment: Experiment, into: RunFolder) -> None:
    """Write the run that an experiment would have measured, if it differs from that of a run in its trimming only.

    Parameters
    ----------
    run
        With at least one measured sequence. It keeps observations, or is trimmed as the experiment wants.
    experiment
        That of the run with other `statistics`, `findings` or `keep`, and all options resolved.
    into
        Folder of the new run. A run that it holds is replaced.

    Raises
    ------
    SettingsError
        If the experiment has several random seeds, whose observations are not kept.
    TracknoiseError
        If the run keeps no observations, its data are no longer there, or the folder cannot be written.
    """
    if experiment.seeds > 1:
        raise SettingsError(f"seeds = {experiment.seeds}: observations of one seed are kept, expected 1")
    trimmed_alike = parse_experiment(run.experiment_toml(), place=str(run.path)).statistics == experiment.statistics
    tables_of = _stored if trimmed_alike else _trimmed_again
    with hold(into) as claim, claim.explained():
        manifest, _ = begin(experiment, into, fresh=True, remark=lambda _: None)
        for sequence, entry in _opened(run, experiment):
            tables = tables_of(run, experiment, sequence, entry)
            hashes = into.write_sequence(entry.key, tables, run.snapshot(entry.key))
            manifest.sequences[entry.key] = replace(entry, sha256=hashes)
        manifest.excluded_scenes = run.manifest().excluded_scenes
        into.write_manifest(manifest)
        compute_findings(into, experiment, compute_statistics(into, experiment))


def _is_kept(name: str, experiment: Experiment) -> bool:
    return name not in OBSERVED or experiment.keep == "observations"


def _opened(run: RunFolder, experiment: Experiment) -> Iterator[tuple[Sequence, SequenceEntry]]:
    """The sequences that were measured, opened again. Nothing but their poses and cameras is needed."""
    entries = run.manifest().sequences
    for batch in batches([task for task in plan(experiment) if task.key in entries]):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DataWarning)  # the notes of the run contain the same text
            sequences = open_batch(batch)
        for sequence, task in zip(sequences, batch, strict=True):
            entry = entries[task.key]
            yield with_measured_poses(sequence, [(run, entry, 0)]), entry


def _stored(
    run: RunFolder, experiment: Experiment, sequence: Sequence, entry: SequenceEntry
) -> dict[str, pl.DataFrame]:
    """All tables of a sequence that the experiment keeps, as they are."""
    names = [name for name in run.names_of_tables(entry.key) if _is_kept(name, experiment)]
    return {name: run.sequence_table(name, entry.key) for name in names}


def _trimmed_again(
    run: RunFolder, experiment: Experiment, sequence: Sequence, entry: SequenceEntry
) -> dict[str, pl.DataFrame]:
    """The same with all that depends on trimming computed again from the observations, of each part on its own."""
    observed = [run.sequence_table(name, entry.key) for name in OBSERVED]
    stored = _stored(run, experiment, sequence, entry)
    if not entry.parts:
        return {**stored, **_trimmed(experiment, sequence, entry, observed)}
    parts = []
    first: dict[tuple[str, int], int] = {}
    for number, (start, stop) in enumerate(entry.parts):
        part = Part(number, len(entry.parts), start, dict(first))
        own = [rows_of(table, part, stop - start) for table in observed]
        for tracker, speed, count in own[1].group_by("tracker", "speed").len().rows():
            first[tracker, speed] = first.get((tracker, speed), 0) + count
        if own[0].height:
            shown = replace(entry, n_frames=stop - start)
            parts.append((part, _trimmed(experiment, PartOfSequence(sequence, range(start, stop)), shown, own)))
    names = [name for name in parts[0][1] if name not in OF_THE_WHOLE]
    joined = {name: join(name, [(part, tables[name]) for part, tables in parts], schema_of(name)) for name in names}
    return {**stored, **joined}


def _trimmed(
    experiment: Experiment, sequence: Sequence, entry: SequenceEntry, observed: list[pl.DataFrame]
) -> dict[str, pl.DataFrame]:
    """Tables that depend on trimming, from observations and tracks."""
    asked, population = experiment.statistics, experiment.truth.population
    slowest = min(experiment.speeds)
    trimmed = trim(
        *observed,
        percentile=asked.trim_percentile,
        population=population,
        among=asked.trim_among,
        key_frame=entry.key_frame,
    )
    prepared = replace(trimmed.sequence, slowest=slowest)
    kept = {"observations": trimmed.observations, "tracks": trimmed.tracks}
    return {
        **{name: table for name, table in kept.items() if _is_kept(name, experiment)},
        "trims": trimmed.trims,
        **statistics_of(trimmed.sequence, tuple(STATISTICS), population=population, slowest=slowest),
        **geometry_tables(experiment, sequence, prepared, entry.n_frames, entry.truth),
    }
