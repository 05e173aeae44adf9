"""Run an experiment: every sequence measured, in this process or in several, then the statistics of all."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from tracknoise.exceptions import StoreError, TracknoiseError
from tracknoise.experiments.plan import Task, plan
from tracknoise.experiments.pool import pool
from tracknoise.experiments.provenance import new_manifest
from tracknoise.experiments.resolve import resolve
from tracknoise.experiments.settings import Experiment
from tracknoise.experiments.task import run_task
from tracknoise.tables.store import Manifest, RunFolder, SequenceEntry

_THREAD_LIMITS = (
    "OPENCV_FOR_THREADS_NUM",
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "POLARS_MAX_THREADS",
)


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

    def failed(self, key: str, cause: str) -> None:
        """After a sequence that could not be measured."""
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
    experiment: Experiment, run: RunFolder, *, listener: Listener, workers: int = 1, debug: bool = False
) -> Outcome:
    """Measure every sequence of an experiment that is not yet measured, and compute the statistics of all.

    A sequence that fails is recorded with its cause, and the others go on. Results do not depend on `workers`.

    Parameters
    ----------
    experiment
        What to run.
    run
        Where to; if it holds a run of the same experiment, that is resumed.
    listener
        Told how it goes on.
    workers
        Count of processes.
    debug
        Raise the first failure instead of recording it.

    Raises
    ------
    TracknoiseError
        If the experiment cannot be planned, or the folder belongs to another one or cannot be written.
    """
    experiment = resolve(experiment)
    tasks = plan(experiment)
    manifest = _begin(experiment, run)
    manifest.failures.clear()
    due = [task for task in tasks if task.key not in manifest.sequences]
    listener.planned([task.key for task in due], len(tasks) - len(due))
    for task, result in _results(due, run, listener=listener, workers=min(workers, len(due))):
        if isinstance(result, SequenceEntry):
            manifest.sequences[task.key] = result
            listener.measured(task.key, result)
        else:
            if debug:
                raise result
            manifest.failures[task.key] = _cause(result)
            listener.failed(task.key, manifest.failures[task.key])
        run.write_manifest(manifest)
    run.write_failures(manifest.failures)
    if manifest.sequences:
        pool(run, experiment)
    return Outcome(sorted(manifest.sequences), dict(manifest.failures))


def _begin(experiment: Experiment, run: RunFolder) -> Manifest:
    """The manifest of the run to resume, or of a new one."""
    if not run.exists:
        run.create(experiment.to_toml(), new_manifest(experiment))
    manifest = run.manifest()
    if manifest.settings_hash != experiment.digest():
        raise StoreError(
            f"{run.path}: holds a run of other settings, expected another folder, or --fresh to replace it"
        )
    return manifest


def _results(
    tasks: list[Task], run: RunFolder, *, listener: Listener, workers: int
) -> Iterator[tuple[Task, SequenceEntry | Exception]]:
    if workers > 1:
        yield from _in_workers(tasks, run, workers)
        return
    for task in tasks:
        yield task, _attempt(task, run, listener)


def _attempt(task: Task, run: RunFolder, listener: Listener | None = None) -> SequenceEntry | Exception:
    """Measure one sequence; whatever goes wrong is a result, so that the others go on."""
    try:
        return run_task(task, run, progress=partial(listener.frame, task.key) if listener else None)
    except Exception as error:
        return error


def _in_workers(tasks: list[Task], run: RunFolder, workers: int) -> Iterator[tuple[Task, SequenceEntry | Exception]]:
    """Measure in processes of one thread each: more threads would not make the whole faster."""
    import dask
    from distributed import Client, LocalCluster, as_completed

    with (
        dask.config.set({"distributed.nanny.pre-spawn-environ": dict.fromkeys(_THREAD_LIMITS, "1")}),
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        futures = {client.submit(_attempt, task, run, pure=False): task for task in tasks}
        for future in as_completed(futures):
            yield futures[future], future.result()


def _cause(error: Exception) -> str:
    return str(error) if isinstance(error, TracknoiseError) else f"{type(error).__name__}: {error}"
