"""Measure in Dask workers, on this machine or at a scheduler's address."""

import logging
import signal
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from tracknoise.exceptions import SettingsError
from tracknoise.experiments.running.failures import Batch, Failure, FailureKind, Measure, Result, Results
from tracknoise.experiments.running.lock import Claim
from tracknoise.experiments.running.provenance import require_versions
from tracknoise.experiments.running.task import attempt
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.threads import use_one_thread

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

_PINNED = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")
_LOCAL: dict[str, Any] = {
    # Thread limits set for this process do not apply to workers: there are several of them.
    **{f"distributed.nanny.pre-spawn-environ.{name}": 1 for name in _PINNED},
    # Images and descriptors are allocated and freed in every frame. By default Dask returns their memory to the system
    # each time, and a worker spends a sixth of its time in page faults.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 512 * 2**20,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 32 * 2**20,
    # Batches are small to send. `with_retries` retries those of a killed worker, and counts the attempts.
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.work-stealing": False,
    # A worker that dies during its start is not restarted. When none is left, batches fail, and new workers start.
    "distributed.scheduler.no-workers-timeout": "60s",
    # A worker that uses much memory between batches must continue. One that exceeds its share is ended.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
}


@dataclass(frozen=True, slots=True)
class Job:
    """What every worker needs besides its batch.

    Attributes
    ----------
    run
        The run folder.
    claim
        Proof that the run still holds the lock of the folder.
    versions
        Versions at the start of the run of the libraries that affect results.
    debug
        Raise failures instead of recording them.
    """

    run: RunFolder
    claim: Claim
    versions: dict[str, str]
    debug: bool

    def __call__(self, batch: Batch) -> Result:
        """Measure a batch in a worker."""
        use_one_thread()
        require_versions(self.versions, place=f"worker on {socket.gethostname()}")
        self.claim.check()
        return attempt(batch, self.run, claim=self.claim, debug=self.debug)


def measure_locally(job: Job, together: list[Batch], *, workers: int, remark: Callable[[str], None]) -> Results:
    """Measure in worker processes on this machine, with one thread each: more threads would not be faster.

    Each process gets an equal share of the memory. A process that exceeds it is ended, and its batch fails. Each call
    starts new processes, so that retries do not depend on the state of old ones.

    Parameters
    ----------
    job
        What the workers do.
    together
        What to measure.
    workers
        Maximum number of worker processes.
    remark
        Receives the address of the dashboard.

    Yields
    ------
    Batch, Result
        In the order of completion.
    """
    count = min(workers, len(together))
    with ExitStack() as stack:
        try:
            client = stack.enter_context(_local_cluster(count, remark))
        except (RuntimeError, OSError) as error:
            failure = Failure(f"worker processes could not be started ({error})", None, FailureKind.transient)
            yield from ((batch, failure) for batch in together)
        else:
            yield from _measure(client, job, together, at_once=count, place="local scheduler")


@contextmanager
def _local_cluster(workers: int, remark: Callable[[str], None]) -> Iterator["Client"]:
    import dask
    from distributed import Client, LocalCluster

    with (
        dask.config.set(_LOCAL),
        _silenced(),
        _interrupts_ignored() as restore,
        _ended(
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,  # of the workers; `_silenced` is for this process
            )
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        restore()
        if find_spec("bokeh"):  # without bokeh, Dask's dashboard is an empty page
            remark(f"dashboard: {cluster.dashboard_link}")
        yield client


@contextmanager
def _ended(cluster: "LocalCluster") -> Iterator["LocalCluster"]:
    """Close a cluster after all results have arrived, even if Dask fails to close it.

    Dask cannot end a worker that it is about to start as a replacement. That worker ends with this process.
    """
    cluster.__enter__()
    try:
        yield cluster
    finally:
        with suppress(AssertionError):
            cluster.__exit__(None, None, None)


@contextmanager
def remote_workers(job: Job, *, address: str, remark: Callable[[str], None]) -> Iterator[Measure]:
    """Measure with the workers of a scheduler, including workers that join later.

    Parameters
    ----------
    job
        What the workers do.
    address
        Address of the scheduler, such as ``tcp://host:8786``. Dask's own configuration covers TLS and similar options.
    remark
        Receives the number of workers and the address of the dashboard.

    Raises
    ------
    SettingsError
        If the scheduler cannot be reached.
    """
    place = f"scheduler {address}"
    with _silenced(), _connect(address, place) as client:
        remark(f"{place}: {_crew(client)}")
        if client.run_on_scheduler(find_spec, "bokeh"):
            remark(f"dashboard: {client.dashboard_link}")
        yield lambda together: _measure(client, job, together, at_once=len(together), place=place)


def _connect(address: str, place: str) -> "Client":
    from distributed import Client
    from distributed.comm.addressing import get_address_host_port, normalize_address

    try:
        get_address_host_port(normalize_address(address), strict=True)  # a client would retry an invalid address
        return Client(address, set_as_default=False)
    except Exception as error:  # errors of addresses and certificates have no common type
        raise SettingsError(
            f"{place}: cannot be reached ({error}), expected tcp://HOST:PORT of a running scheduler"
        ) from error


def _crew(client: "Client") -> str:
    threads = client.nthreads().values()
    shared = sum(count > 1 for count in threads)
    said = f"{len(threads)} worker{'s' if len(threads) != 1 else ''}"
    return f"{said}, {shared} of them with several threads; --nthreads 1 is faster" if shared else said


def _measure(client: "Client", job: Job, together: list[Batch], *, at_once: int, place: str) -> Results:
    """Submit batches, at most `at_once` at the same time.

    All batches of a worker that dies fail, so that a local worker gets one batch at a time. A remote scheduler gets all
    batches at once, so that it can request more workers.
    """
    from distributed import as_completed

    batches, waiting = {}, deque(together)
    running = as_completed(loop=client.loop)

    def submit(count: int) -> None:
        for _ in range(min(count, len(waiting))):
            batch = waiting.popleft()
            future = client.submit(job, batch, pure=False)
            batches[future] = batch
            running.add(future)

    submit(at_once)
    for future in running:
        submit(1)
        yield batches.pop(future), _result(future, place)


def _result(future: "Future[Result]", place: str) -> Result:
    """Result of a batch that a worker measured."""
    from distributed import CancelledError, KilledWorker
    from distributed.scheduler import NoWorkerError

    try:
        result: Result = future.result()
    except KilledWorker as error:
        deaths = error.allowed_failures + 1
        cause = "the worker died while measuring it (killed, or out of memory)"
        return Failure(cause, error.last_worker.address, FailureKind.transient, attempts=deaths)
    except NoWorkerError:
        return Failure("all workers died", None, FailureKind.transient)
    except ImportError as error:
        raise SettingsError(
            f"{place}: its workers cannot import the program ({error}), expected the same packages as on this machine"
        ) from error
    except CancelledError as error:
        raise SettingsError(
            f"{place}: connection lost, expected a running scheduler; run the same command again to resume"
        ) from error
    return result


@contextmanager
def _silenced() -> Iterator[None]:
    """Silence Dask's log messages about failures that are reported as results."""
    import distributed.config  # noqa: F401 (when first imported, it sets their levels)

    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


@contextmanager
def _interrupts_ignored() -> Iterator[Callable[[], None]]:
    """Start processes that ignore Ctrl-C, which a terminal sends to all processes. Only this one must handle it.

    Yields a function that ends this; leaving the context ends it too.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None  # only the main thread can set signal handlers, and only it is interrupted
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)

    def restore() -> None:
        signal.signal(signal.SIGINT, before)

    try:
        yield restore
    finally:
        restore()
