"""Measure with the workers of a Dask scheduler. Dask is an extra, imported when a scheduler is named."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING

from tracknoise.exceptions import SettingsError, missing_extra
from tracknoise.experiments.failures import Batch, Failure, FailureKind, Measure, Result, Results
from tracknoise.text import counted

if TYPE_CHECKING:
    from distributed import Client, Future

    from tracknoise.experiments.task import Job


@contextmanager
def remote_workers(job: "Job", *, address: str, remark: Callable[[str], None]) -> Iterator[Measure]:
    """Measure with the workers of a scheduler, including workers that join later."""
    place = f"scheduler {address}"
    if find_spec("distributed") is None:
        raise missing_extra(place, "cluster")
    with _silenced(), _connect(address, place) as client:
        remark(f"{place}: {_crew(client)}")
        if client.run_on_scheduler(find_spec, "bokeh"):
            remark(f"dashboard: {client.dashboard_link}")
        yield lambda together: _measure(client, job, together, place)


def _connect(address: str, place: str) -> "Client":
    from distributed import Client
    from distributed.comm.addressing import get_address_host_port, normalize_address

    try:
        get_address_host_port(normalize_address(address), strict=True)  # a client would retry an invalid address
        return Client(address, set_as_default=False)
    except Exception as error:  # errors of addresses and certificates have no common type
        raise SettingsError(
            f"{place}: cannot be reached ({error}), expected tcp://HOST:PORT or tls://HOST:PORT of a running scheduler"
        ) from error


def _crew(client: "Client") -> str:
    threads = client.nthreads().values()
    shared = sum(count > 1 for count in threads)
    said = counted(len(threads), "worker")
    return f"{said}, {shared} of them with several threads; --nthreads 1 is faster" if shared else said


def _measure(client: "Client", job: "Job", together: list[Batch], place: str) -> Results:
    """Submit all batches at once, so that the scheduler can request more workers."""
    from distributed import as_completed

    batches = {client.submit(job, batch, pure=False): batch for batch in together}
    for future in as_completed(list(batches), loop=client.loop):
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
