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
    """Why a batch could not be measured."""

    cause: str  # one line
    place: str | None  # the file, the line of the program, or the worker where it failed; None if unknown
    kind: FailureKind  # what the failure means for the run
    attempts: int = 1  # number of attempts so far

    @property
    def entry(self) -> FailureEntry:
        """Entry of the failure in the run folder."""
        return FailureEntry(self.cause, self.place, self.attempts)


Batch = list[Task]


@dataclass(frozen=True, slots=True)
class InParts:
    """A sequence is too long to be measured in one piece."""

    parts: tuple[range, ...]  # its parts


Settled = list[SequenceEntry] | Failure
"""What became of a batch: one entry per sequence, or a failure."""
Result = Settled | InParts
"""Result of measuring a batch, or the parts in which to measure it."""
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
) -> Generator[tuple[Batch, Settled], None, None]:
    """Measure batches. Batches with transient failures are retried after all others, as are those in parts.

    The parts of a sequence are batches of their own. When all are measured, they are joined by one more batch. The
    first part that fails is the failure of its sequence; the others are measured nevertheless, and are kept.
    """
    attempts: dict[tuple[str, int | None], int] = {}
    parts = _Parts()
    while together:
        again: list[Batch] = []
        with closing(measure(together)) as results:
            for batch, result in results:
                task = batch[0]
                if isinstance(result, InParts):
                    again += parts.begin(task, result)
                    continue
                if isinstance(result, Failure):
                    which = task.key, task.part
                    attempts[which] = attempts.get(which, 0) + result.attempts
                    if result.kind is FailureKind.transient and attempts[which] <= retries:
                        retrying(batch, result.cause)
                        again.append(batch)
                        continue
                    result = replace(result, attempts=attempts[which])
                if task.part is None:
                    yield batch, result
                    continue
                left = parts.end(task, result)
                if isinstance(left, Failure):
                    yield [replace(task, part=None)], left
                else:
                    again += left
        together = again


class _Parts:
    """Which parts of which sequences are still to be measured."""

    def __init__(self) -> None:
        self._left: dict[str, int] = {}
        self._failed: dict[str, Failure] = {}

    def begin(self, task: Task, result: InParts) -> list[Batch]:
        """The parts of a sequence, a batch each."""
        self._left[task.key] = len(result.parts)
        return [[replace(task, parts=result.parts, part=number)] for number in range(len(result.parts))]

    def end(self, task: Task, result: Result) -> list[Batch] | Failure:
        """After a part: what joins all parts, if it was the last, or the failure of their sequence."""
        self._left[task.key] -= 1
        if isinstance(result, Failure):
            frames = task.parts[task.part or 0]
            cause = f"frames {frames[0]} to {frames[-1]}: {result.cause}"
            failure = self._failed.setdefault(task.key, replace(result, cause=cause))
            if result.kind is FailureKind.fatal:
                return failure
        if self._left[task.key]:
            return []
        return self._failed.get(task.key) or [[replace(task, part=None)]]


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
