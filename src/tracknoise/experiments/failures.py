"""Failures of batches: their cause, their kind, and retries."""

import errno
import traceback
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from enum import Enum, auto
from pathlib import Path

from tracknoise.exceptions import DataError, StoreError, TracknoiseError, with_type
from tracknoise.experiments.plan import Task
from tracknoise.tables.manifest import FailureEntry, SequenceEntry
from tracknoise.text import printable

RETRIES = 2
"""Maximum number of retries of a batch after transient failures."""
_PACKAGE = Path(__file__).parents[1]
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
    """Whether a retry can help, and whether the run can continue."""

    permanent = auto()
    """A retry fails again, as with damaged data. The run continues with other sequences."""
    transient = auto()
    """A retry may succeed, as after a lack of memory, a killed worker or an error of a network file system."""
    fatal = auto()
    """Every other sequence would fail too, as when the run folder cannot be written. The run ends."""


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a batch could not be measured.

    Attributes
    ----------
    cause
        One line.
    place
        The file, the line of the program, or the worker where it failed; None if unknown.
    kind
        What the failure means for the run.
    attempts
        Number of attempts so far.
    """

    cause: str
    place: str | None
    kind: FailureKind
    attempts: int = 1

    @property
    def entry(self) -> FailureEntry:
        """Entry of the failure in the run folder."""
        return FailureEntry(self.cause, self.place, self.attempts)


Batch = list[Task]
Result = list[SequenceEntry] | Failure
"""Result of measuring a batch: one entry per sequence, or a failure."""
Results = Generator[tuple[Batch, Result], None, None]
"""Results in the order of completion. Closing the generator stops the work."""
Measure = Callable[[list[Batch]], Results]
"""Measures batches."""


def diagnose(error: BaseException) -> Failure:
    """Describe an exception: cause, place and kind of failure."""
    cause = str(error) if isinstance(error, TracknoiseError) else with_type(error)
    place = _place(error)
    return Failure(printable(" ".join(cause.split())), place and printable(place), _kind(error))


def with_retries(
    measure: Measure, together: list[Batch], *, retries: int, retrying: Callable[[Batch, str], None]
) -> Results:
    """Measure batches. Batches with transient failures are retried after all others."""
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
    """An error and the errors that caused it."""
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
    """The file that an error names, otherwise the innermost line of this package in the traceback."""
    if isinstance(error, DataError):
        return error.place
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if _PACKAGE in Path(frame.filename).parents]
    if isinstance(error, TracknoiseError) or not frames:
        return None
    return f"{Path(frames[-1].filename).relative_to(_PACKAGE.parent)}:{frames[-1].lineno}"
