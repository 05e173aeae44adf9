"""Run an experiment: measure its sequences, in this process or in several, then compute the statistics."""

from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

from tracknoise.exceptions import StoreError
from tracknoise.experiments.analysis.run_findings import compute_findings
from tracknoise.experiments.analysis.run_statistics import compute_statistics
from tracknoise.experiments.resolve import resolve
from tracknoise.experiments.running.cluster import remote_workers
from tracknoise.experiments.running.failures import (
    RETRIES,
    Batch,
    Failure,
    FailureKind,
    Measure,
    Result,
    Results,
    with_retries,
)
from tracknoise.experiments.running.job import Job
from tracknoise.experiments.running.local import measure_locally
from tracknoise.experiments.running.lock import hold
from tracknoise.experiments.running.manifest_writer import ManifestWriter
from tracknoise.experiments.running.plan import batches, excluded_scenes, plan
from tracknoise.experiments.running.resume import begin, due, forget_outdated
from tracknoise.experiments.running.task import attempt
from tracknoise.experiments.settings import Experiment
from tracknoise.tables.identity import readable
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import STORED, RunFolder


class Listener(Protocol):
    """Receives the progress of a run."""

    def planned(self, keys: list[str], done: int) -> None:
        """Before the first sequence: the keys to be measured, and the number of sequences already measured."""
        ...

    def frame(self, key: str, done: int, total: int) -> None:
        """After each frame of a sequence, if sequences are measured one at a time on this machine."""
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
    """Result of a run.

    Attributes
    ----------
    measured
        Keys of the measured sequences, those of earlier starts included.
    failures
        Cause of each failure, by key.
    """

    measured: list[str]
    failures: dict[str, str]


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
        job = Job(RunFolder(run.path.absolute()), shown, manifest.versions, debug, one_thread=len(together) > 1)

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
        if todo:
            run.discard_unfinished()  # files of workers that died while they wrote
        if manifest.sequences:
            _replace_results(run, experiment)
        else:
            run.discard_results()
    return Outcome(sorted(manifest.sequences), dict(manifest.failures))


def _replace_results(run: RunFolder, experiment: Experiment) -> None:
    """Compute the statistics and findings. Earlier results stay in the folder until the new ones can be written."""
    outdated = not run.manifest().statistics.keys() >= {*STORED}
    statistics = compute_statistics(run, experiment)
    if outdated:
        run.discard_documents()
    compute_findings(run, experiment, statistics)


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
        progress = partial(listener.frame, batch[0].key)
        yield batch, attempt(batch, job.run, claim=job.claim, progress=progress, debug=job.debug)


def _settle(batch: Batch, result: Result, manifest_writer: ManifestWriter, listener: Listener) -> None:
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
