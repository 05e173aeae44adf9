"""What went wrong in measuring a batch of sequences, and whether trying again can help."""

import errno
import traceback
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from enum import Enum, auto
from pathlib import Path

from tracknoise.exceptions import DataError, StoreError, TracknoiseError
from tracknoise.experiments.running.plan import Task
from tracknoise.tables.store import FailureEntry, SequenceEntry

RETRIES = 2
"""How often a batch is tried again where that can help."""
_PACKAGE = Path(__file__).parents[2]
_TRANSIENT = {
    getattr(errno, name)
    for name in (
        *("EAGAIN", "EBUSY", "EINTR", "EIO", "ENOMEM", "EMFILE", "ENFILE", "ESTALE", "ETIMEDOUT", "EREMOTEIO"),
        *("ECONNABORTED", "ECONNREFUSED", "ECONNRESET", "EHOSTDOWN", "EHOSTUNREACH", "ENETDOWN", "ENETUNREACH"),
    )
    if hasattr(errno, name)
}
_OPENCV_NO_MEMORY = -4


class FailureKind(Enum):
    """What a failure means for the run."""

    permanent = auto()
    """It is in the data: they must be repaired first."""
    transient = auto()
    """It may not come again: memory, a killed worker, a network file system."""
    fatal = auto()
    """No other sequence would fare better: the run folder cannot be written."""


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a batch could not be measured.

    Attributes
    ----------
    cause
        One line.
    place
        The file, the line of the program, or the worker that it happened at; None if unknown.
    kind
        What follows.
    attempts
        How often the batch was tried.
    """

    cause: str
    place: str | None
    kind: FailureKind
    attempts: int = 1

    @property
    def entry(self) -> FailureEntry:
        """What is recorded of it."""
        return FailureEntry(self.cause, self.place, self.attempts)


Batch = list[Task]
Result = list[SequenceEntry] | Failure
"""What measuring a batch came to."""
Results = Generator[tuple[Batch, Result], None, None]
"""Results in the order in which they come; closing it ends the work."""
Measure = Callable[[list[Batch]], Results]
"""Measures batches."""


def diagnose(error: BaseException) -> Failure:
    """Put in words what went wrong, where, and what follows."""
    cause = str(error) if isinstance(error, TracknoiseError) else f"{type(error).__name__}: {error}"
    return Failure(" ".join(cause.split()), _place(error), _kind(error))


def with_retries(
    measure: Measure, together: list[Batch], *, retries: int, retrying: Callable[[Batch, str], None]
) -> Results:
    """Measure batches; those that fail of what may pass are tried again when all others are done.

    Parameters
    ----------
    measure
        Measures batches.
    together
        What to measure.
    retries
        How often at most a batch is tried again.
    retrying
        Told batch and cause before it is tried again.

    Yields
    ------
    Batch, Result
        In the order in which they are done.
    """
    attempts: dict[str, int] = {}
    while together:
        again = []
        with closing(measure(together)) as results:
            for batch, result in results:
                if isinstance(result, Failure):
                    key = batch[0].key
                    attempts[key] = attempts.get(key, 0) + result.attempts
                    if result.kind is FailureKind.transient and attempts[key] <= retries:
                        retrying(batch, result.cause)
                        again.append(batch)
                        continue
                    result = replace(result, attempts=attempts[key])
                yield batch, result
        together = again


def _kind(error: BaseException) -> FailureKind:
    if any(_is_transient(link) for link in _chain(error)):
        return FailureKind.transient
    return FailureKind.fatal if isinstance(error, StoreError) else FailureKind.permanent


def _chain(error: BaseException) -> Iterator[BaseException]:
    """An error, what it was raised from, and so on."""
    link: BaseException | None = error
    while link is not None:
        yield link
        link = link.__cause__ or (None if link.__suppress_context__ else link.__context__)


def _is_transient(error: BaseException) -> bool:
    if isinstance(error, OSError):
        return error.errno in _TRANSIENT
    is_opencv = type(error).__module__.partition(".")[0] == "cv2"
    return isinstance(error, MemoryError) or (is_opencv and getattr(error, "code", None) == _OPENCV_NO_MEMORY)


def _place(error: BaseException) -> str | None:
    """The file that an error is about, or else the innermost line of this package that it came through."""
    if isinstance(error, DataError):
        return error.place
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if _PACKAGE in Path(frame.filename).parents]
    if isinstance(error, TracknoiseError) or not frames:
        return None
    return f"{Path(frames[-1].filename).relative_to(_PACKAGE.parent)}:{frames[-1].lineno}"
