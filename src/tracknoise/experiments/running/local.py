"""Measure in worker processes on this machine. No other process can connect to them, or to this one."""

import signal
from collections import deque
from collections.abc import Callable, Iterator
from multiprocessing.connection import wait

from tracknoise.experiments.running.failures import Batch, Failure, FailureKind, Result, Results
from tracknoise.experiments.running.memory import memory_bytes, used_bytes
from tracknoise.experiments.running.worker import Note, Worker, WorkerDiedError

ENVIRONMENT = {
    # Thread limits set for this process do not apply to workers: there are several of them.
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS"), "1"),
    # Images and descriptors are allocated and freed in every frame. If their memory were returned to the system each
    # time, a worker would spend a sixth of its time in page faults.
    "MALLOC_TRIM_THRESHOLD_": str(512 * 2**20),
    "MALLOC_MMAP_THRESHOLD_": str(32 * 2**20),
}
"""Variables of the environment of every worker."""
_SHARE = 0.95
"""Part of its share of the memory that a worker may use."""
_PAUSE_S = 0.2
"""Time between two checks of the memory, seconds."""
_KILLED = "the worker died while measuring it (killed, or out of memory)"


def measure_locally(
    job: Callable[[Batch], Result],
    together: list[Batch],
    *,
    workers: int,
    frame: Callable[..., None] | None = None,
) -> Results:
    """Measure in worker processes on this machine.

    Each process gets an equal share of the memory. A process that exceeds it is ended, and its batch fails. Each call
    starts new processes, so that retries do not depend on the state of old ones.

    Parameters
    ----------
    job
        What the workers do with each batch.
    together
        What to measure.
    workers
        Maximum number of worker processes.
    frame
        Receives the notes of the job if there is one worker only.

    Yields
    ------
    Batch, Result
        In the order of completion.
    """
    count = min(workers, len(together))
    pool = _Pool(job, deque(together), count, frame if count == 1 else None)
    try:
        yield from pool.results()
    finally:
        pool.close()


class _Pool:
    """At most `count` workers, each with one batch at a time. A worker that dies is replaced."""

    def __init__(
        self,
        job: Callable[[Batch], Result],
        waiting: deque[Batch],
        count: int,
        frame: Callable[..., None] | None,
    ) -> None:
        self._job, self._waiting, self._count, self._frame = job, waiting, count, frame
        self._idle: list[Worker] = []
        self._busy: dict[Worker, Batch] = {}
        self._limit = int(_SHARE * memory_bytes() / count) if count else 0
        self._exceeded: set[Worker] = set()

    def results(self) -> Results:
        error = self._assign()
        while self._busy:
            self._end_the_largest()
            for worker in self._ready():
                result = self._receive(worker)
                if isinstance(result, Note):
                    self._pass_on(result)
                else:
                    batch = self._busy.pop(worker)
                    error = self._assign()
                    yield batch, result
        failure = Failure(f"worker processes could not be started ({error})", None, FailureKind.transient)
        yield from ((batch, failure) for batch in self._waiting)

    def close(self) -> None:
        left = [*self._busy, *self._idle]
        for worker in left:
            worker.kill()
        for worker in left:
            worker.close()

    def _assign(self) -> str | None:
        """Give batches to workers; why one could not be started. An error would keep what was opened for it."""
        while self._waiting and len(self._busy) < self._count:
            try:
                worker = self._idle.pop() if self._idle else Worker(ENVIRONMENT)
            except OSError as error:
                return str(error)
            self._busy[worker] = self._waiting.popleft()
            worker.call(self._job, self._busy[worker])
        return None

    def _ready(self) -> Iterator[Worker]:
        """Workers that have sent something, or died."""
        connections = {worker.connection: worker for worker in self._busy}
        return (connections[item] for item in wait(list(connections), _PAUSE_S))  # type: ignore[index]

    def _receive(self, worker: Worker) -> Result | Note:
        """The result of a worker's batch, or a note that it sent before."""
        try:
            answer: Result | Note = worker.receive()
        except WorkerDiedError as death:
            worker.close()
            return Failure(
                self._cause(worker, death),
                str(death.opened or f"worker process {death.pid}"),
                FailureKind.transient,
            )
        if isinstance(answer, Note):
            return answer
        if self._waiting:
            self._idle.append(worker)
        else:
            worker.close()  # it would keep its memory
        return answer

    def _pass_on(self, note: Note) -> None:
        if self._frame:
            self._frame(*note.values)

    def _cause(self, worker: Worker, death: WorkerDiedError) -> str:
        status = death.exit_status
        if worker in self._exceeded:
            return f"the worker exceeded its share of the memory ({self._limit / 2**30:.1f} GiB); use fewer workers"
        if status in (None, -signal.SIGKILL):
            return _KILLED
        how = f"crashed ({signal.Signals(-status).name})" if status < 0 else f"ended with exit status {status}"
        where = f"; the last file it opened is {death.opened}" if death.opened else ""
        return f"the worker {how} while measuring it{where}"

    def _end_the_largest(self) -> None:
        """End the workers that use more than their share of the memory."""
        for worker in self._busy:
            if used_bytes(worker.pid) > self._limit:
                self._exceeded.add(worker)
                worker.kill()
