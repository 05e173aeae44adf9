"""Run an experiment: every sequence measured, in this process or in several, then the statistics of all."""

from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from tracknoise.exceptions import StoreError
from tracknoise.experiments.analysis.run_findings import compute_findings
from tracknoise.experiments.analysis.run_statistics import compute_statistics
from tracknoise.experiments.resolve import resolve
from tracknoise.experiments.running.cluster import Job, measure_locally, remote_workers
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
from tracknoise.experiments.running.inputs import with_inputs
from tracknoise.experiments.running.lock import hold
from tracknoise.experiments.running.manifest_writer import ManifestWriter
from tracknoise.experiments.running.plan import batches, excluded_scenes, plan
from tracknoise.experiments.running.resume import begin, due, set_out
from tracknoise.experiments.running.task import attempt
from tracknoise.experiments.settings import Experiment
from tracknoise.tables.store import RunFolder, SequenceEntry


class Listener(Protocol):
    """Who is told how a run goes on."""

    def planned(self, keys: list[str], done: int) -> None:
        """Before the first sequence: the keys still to be measured, and the count of those that already are."""
        ...

    def frame(self, key: str, done: int, total: int) -> None:
        """After a frame, where the sequence is measured in this process."""
        ...

    def measured(self, key: str, entry: SequenceEntry) -> None:
        """After a sequence."""
        ...

    def failed(self, keys: list[str], cause: str) -> None:
        """After sequences that share what they read, or a single one, that could not be measured."""
        ...

    def remark(self, text: str) -> None:
        """Whatever else is worth a line: which workers there are, where their dashboard is, what is tried again."""
        ...


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    measured
        Keys of the sequences whose tables are whole, those of an earlier start included.
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
    debug: bool = False,
) -> Outcome:
    """Measure every sequence of an experiment that is not yet measured, and compute the statistics of all.

    A sequence that fails is recorded with its cause, and the others go on. Where trying again can help, that is done
    first. Results do not depend on who measures.

    Parameters
    ----------
    experiment
        What to run.
    run
        Where to; if it holds a run of the same experiment, that is resumed.
    listener
        Told how it goes on.
    workers
        Count of processes on this machine.
    scheduler
        Address of a Dask scheduler whose workers measure instead of those.
    retries
        How often at most a batch is tried again.
    fresh
        Remove the run that the folder holds, once the new one is known to be possible.
    debug
        Raise the first failure instead of recording it.

    Raises
    ------
    TracknoiseError
        If the experiment cannot be planned, the folder belongs to another one, is in use or cannot be written, or the
        scheduler cannot be reached. What was measured until then is kept.
    """
    experiment = resolve(experiment)
    tasks = with_inputs(plan(experiment))
    with hold(run) as claim:
        manifest, changed = begin(experiment, run, fresh=fresh)
        manifest.excluded_scenes = excluded_scenes(experiment)
        todo = due(tasks, run, manifest)
        set_out(todo, run, manifest, experiment, changed=changed)
        listener.planned([task.key for task in todo], len(tasks) - len(todo))
        job = Job(RunFolder(run.path.absolute()), claim, manifest.versions, debug)
        together = batches(todo)

        def retrying(batch: Batch, cause: str) -> None:
            listener.remark(f"{batch[0].key}: {cause}; it is tried again")

        with _crew(job, together, listener, workers=workers, scheduler=scheduler) as measure:
            if todo or changed:
                run.discard_results()
            if changed:
                run.write_experiment(experiment.to_toml())
            results = with_retries(measure, together, retries=retries, retrying=retrying)
            with ManifestWriter(run, manifest) as manifest_writer, closing(results):
                for batch, result in results:
                    _settle(batch, result, manifest_writer, listener)
                    manifest_writer.write_if_due()
        if manifest.sequences:
            compute_findings(run, experiment, compute_statistics(run, experiment))
    return Outcome(sorted(manifest.sequences), dict(manifest.failures))


def _crew(
    job: Job, together: list[Batch], listener: Listener, *, workers: int, scheduler: str | None
) -> AbstractContextManager[Measure]:
    """Who measures: a scheduler's workers, several processes, or this one, to which nothing needs to be sent."""
    if scheduler is not None and together:
        return remote_workers(job, address=scheduler, remark=listener.remark)
    if min(workers, len(together)) > 1:
        return nullcontext(partial(measure_locally, job, workers=workers, remark=listener.remark))
    return nullcontext(partial(_here, job, listener))


def _here(job: Job, listener: Listener, together: list[Batch]) -> Results:
    for batch in together:
        progress = partial(listener.frame, batch[0].key)
        yield batch, attempt(batch, job.run, progress=progress, debug=job.debug)


def _settle(batch: Batch, result: Result, manifest_writer: ManifestWriter, listener: Listener) -> None:
    """Record what became of a batch, or end the run where no other would fare better."""
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
