"""Run an experiment: every sequence measured, in this process or in several, then the statistics of all."""

import logging
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from tracknoise.exceptions import TracknoiseError
from tracknoise.experiments.plan import Task, batches, left_out, plan
from tracknoise.experiments.pool import pool
from tracknoise.experiments.resolve import resolve
from tracknoise.experiments.resume import begin, due
from tracknoise.experiments.settings import Experiment
from tracknoise.experiments.task import run_batch
from tracknoise.tables.store import RunFolder, SequenceEntry

_THREAD_LIMITS = (
    "OPENCV_FOR_THREADS_NUM",
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "POLARS_MAX_THREADS",
)


Result = list[SequenceEntry] | Exception
"""What measuring a batch came to."""


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
    experiment: Experiment,
    run: RunFolder,
    *,
    listener: Listener,
    workers: int = 1,
    fresh: bool = False,
    debug: bool = False,
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
    fresh
        Remove the run that the folder holds, once the new one is known to be possible.
    debug
        Raise the first failure instead of recording it.

    Raises
    ------
    TracknoiseError
        If the experiment cannot be planned, or the folder belongs to another one or cannot be written.
    """
    experiment = resolve(experiment)
    tasks = plan(experiment)
    manifest = begin(experiment, run, fresh=fresh)
    manifest.failures.clear()
    manifest.left_out = left_out(experiment)
    todo = due(tasks, run, manifest)
    listener.planned([task.key for task in todo], len(tasks) - len(todo))
    if todo:
        run.discard_results()
    for task in todo:  # an earlier measurement that is stale must not stand in for one that fails
        manifest.sequences.pop(task.key, None)
    run.write_manifest(manifest)
    together = batches(todo)
    for batch, result in _results(together, run, listener=listener, workers=min(workers, len(together))):
        if isinstance(result, Exception):
            if debug:
                raise result
            for task in batch:
                manifest.failures[task.key] = _cause(result)
                listener.failed(task.key, manifest.failures[task.key])
        else:
            for task, entry in zip(batch, result, strict=True):
                manifest.sequences[task.key] = entry
                listener.measured(task.key, entry)
        run.write_manifest(manifest)
    run.write_failures(manifest.failures)
    if manifest.sequences:
        pool(run, experiment)
    return Outcome(sorted(manifest.sequences), dict(manifest.failures))


def _results(
    together: list[list[Task]], run: RunFolder, *, listener: Listener, workers: int
) -> Iterator[tuple[list[Task], Result]]:
    if workers > 1:
        yield from _in_workers(together, run, workers)
        return
    for batch in together:
        yield batch, _attempt(batch, run, listener)


def _attempt(batch: list[Task], run: RunFolder, listener: Listener | None = None) -> Result:
    """Measure a batch; whatever goes wrong is a result, so that the others go on."""
    try:
        return run_batch(batch, run, progress=partial(listener.frame, batch[0].key) if listener else None)
    except Exception as error:
        return error


def _in_workers(together: list[list[Task]], run: RunFolder, workers: int) -> Iterator[tuple[list[Task], Result]]:
    """Measure in processes of one thread each: more threads would not make the whole faster."""
    import dask
    from distributed import Client, LocalCluster, as_completed

    with (
        dask.config.set({"distributed.nanny.pre-spawn-environ": dict.fromkeys(_THREAD_LIMITS, "1")}),
        _interrupts_ignored() as restore,
        LocalCluster(
            n_workers=workers, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL
        ) as cluster,
        Client(cluster) as client,
    ):
        restore()
        futures = {client.submit(_attempt, batch, run, pure=False): batch for batch in together}
        for future in as_completed(futures):
            yield futures[future], future.result()


@contextmanager
def _interrupts_ignored() -> Iterator[Callable[[], None]]:
    """Let processes started now ignore Ctrl-C, which a terminal sends to all: this one alone shall act on it.

    Yields what ends that; so does leaving the context.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None  # only the main thread may say what signals do, and only it is interrupted
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)

    def restore() -> None:
        signal.signal(signal.SIGINT, before)

    try:
        yield restore
    finally:
        restore()


def _cause(error: Exception) -> str:
    return str(error) if isinstance(error, TracknoiseError) else f"{type(error).__name__}: {error}"
