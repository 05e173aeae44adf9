"""Measure in several processes: Dask's, on this machine or wherever a scheduler has its workers."""

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
    # Whoever set these for this process meant it alone; a worker is one of several.
    **{f"distributed.nanny.pre-spawn-environ.{name}": 1 for name in _PINNED},
    # Images and descriptors come and go with every frame. Dask has their memory given back each time, which is a sixth
    # of a worker's time spent in page faults.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 512 * 2**20,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 32 * 2**20,
    # Batches are small to send, and a killed worker's are tried again by `with_retries`, which counts them.
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.work-stealing": False,
    # A worker that dies while it starts is not started again. When none is left, batches fail, and new ones start.
    "distributed.scheduler.no-workers-timeout": "60s",
    # A worker that holds much memory between batches shall go on. One that needs more than its share is ended.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
}


@dataclass(frozen=True, slots=True)
class Job:
    """What every worker needs to know besides its batch.

    Attributes
    ----------
    run
        Where to write.
    claim
        The hold on it that the work is for.
    versions
        Of the libraries that decide the numbers, as the run was begun with.
    debug
        Raise what goes wrong instead of recording it.
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
    """Measure in processes of one thread each on this machine: more threads would not make the whole faster.

    They share its memory: a process that needs more than its part is ended, and its batch fails. New processes are
    started each time, so that batches that are tried again do not depend on what became of the old ones.

    Parameters
    ----------
    job
        What they do.
    together
        What to measure.
    workers
        How many there are at most.
    remark
        Told where the dashboard is.

    Yields
    ------
    Batch, Result
        In the order in which they are done.
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
                silence_logs=logging.CRITICAL,  # of the workers; `_silenced` is about this process
            )
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        restore()
        if find_spec("bokeh"):  # without it, what Dask calls its dashboard is an empty page
            remark(f"dashboard: {cluster.dashboard_link}")
        yield client


@contextmanager
def _ended(cluster: "LocalCluster") -> Iterator["LocalCluster"]:
    """End a cluster, whose results are all there, even where Dask fails to.

    It cannot end a worker that it is about to start in the place of one that died; that one ends with this process.
    """
    cluster.__enter__()
    try:
        yield cluster
    finally:
        with suppress(AssertionError):
            cluster.__exit__(None, None, None)


@contextmanager
def remote_workers(job: Job, *, address: str, remark: Callable[[str], None]) -> Iterator[Measure]:
    """The workers of a scheduler, those that join later included.

    Parameters
    ----------
    job
        What they do.
    address
        Of the scheduler, such as ``tcp://host:8786``. How to speak to it (TLS and such) is Dask's own configuration.
    remark
        Told how many workers there are, and where the dashboard is.

    Raises
    ------
    SettingsError
        If nothing answers there.
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
        get_address_host_port(normalize_address(address), strict=True)  # a client would go on trying to reach it
        return Client(address, set_as_default=False)
    except Exception as error:  # what is wrong with an address or a certificate has no common type
        raise SettingsError(
            f"{place}: cannot be reached ({error}), expected tcp://HOST:PORT of one that runs"
        ) from error


def _crew(client: "Client") -> str:
    threads = client.nthreads().values()
    shared = sum(count > 1 for count in threads)
    said = f"{len(threads)} worker{'s' if len(threads) != 1 else ''}"
    return f"{said}, {shared} of them with several threads: one each (--nthreads 1) is faster" if shared else said


def _measure(client: "Client", job: Job, together: list[Batch], *, at_once: int, place: str) -> Results:
    """Have batches measured, so many at the same time.

    A worker that dies takes all batches down that it was given, so that a local one is given one at a time. For a
    scheduler elsewhere to call more workers, it must know how much there is to do.
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
    """What became of a batch that a worker was given."""
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
            f"{place}: its workers cannot load what is to be run ({error}), expected the same packages there as here"
        ) from error
    except CancelledError as error:
        raise SettingsError(f"{place}: lost, expected it to go on; start the run again to resume it") from error
    return result


@contextmanager
def _silenced() -> Iterator[None]:
    """Keep Dask from telling what becomes known as a result anyway."""
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
