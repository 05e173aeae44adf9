"""Standard streams that are closed, that lead to a full disk, or whose reader has gone."""

import errno
import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_STDOUT, _STDERR = 1, 2


def prepare() -> None:
    """Let what cannot be written to stdout and stderr be dropped, so that it stops nothing. See `error_of_stdout`."""
    _reserve_numbers()
    sys.stdout, sys.stderr = _dropping(_STDOUT, sys.stdout), _dropping(_STDERR, sys.stderr)


def error_of_stdout() -> OSError | None:
    """Why something could not be written to stdout since `prepare`. None if its reader has gone: that has read enough.

    What is still in memory is written first.
    """
    try:
        sys.stdout.flush()
    except OSError as flushing:  # of a stream that drops nothing
        return flushing
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    error = raw.error if isinstance(raw, _Dropping) else None
    return None if isinstance(error, BrokenPipeError) else error


class _Dropping(io.FileIO):
    """A file that is open. What cannot be written to it is dropped, and not written later either.

    Parameters
    ----------
    number
        Of the file.

    Attributes
    ----------
    error
        The first that occurred.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number, "w", closefd=False)
        self.error: OSError | None = None

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write some bytes, and return how many were written or dropped."""
        try:
            written: int | None = super().write(data)
            if written is None:
                raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        except OSError as error:
            self.error = self.error or error
            return memoryview(data).nbytes
        return written


def _dropping(number: int, like: TextIO | None) -> TextIO:
    """A stream of text in place of another, which is None if it is closed."""
    raw = _Dropping(number)
    by_lines = number == _STDERR or raw.isatty() or getattr(like, "write_through", False)
    encoding = "utf-8" if like is None else like.encoding
    return io.TextIOWrapper(io.BufferedWriter(raw), encoding, errors="replace", line_buffering=by_lines)


def _reserve_numbers() -> None:
    """Open something in place of closed streams. Other files would get their numbers, and what is printed with them.

    Stdout is opened for reading, so that writing to it still fails.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if number == _STDOUT else os.O_RDWR)  # the lowest number that is free
            os.set_inheritable(number, True)
