"""One line for whatever a parser of a foreign file raises."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tracknoise.exceptions import DataError, TracknoiseError, first_line


@contextmanager
def damage_reported(place: str | Path, found: str, expected: str, *, with_reason: bool = False) -> Iterator[None]:
    """Turn all exceptions of a parser into one that names the file.

    Parsers raise exceptions of many types for damaged files, and new versions raise others. Therefore the block must
    contain only the call of the parser. Lack of memory is no damage and passes.

    Parameters
    ----------
    place
        The file.
    found, expected
        For the error.
    with_reason
        Add the first line of what the parser said to `found`.

    Raises
    ------
    DataError
        If the block raised another exception.
    """
    try:
        yield
    except (TracknoiseError, MemoryError):
        raise
    except Exception as error:
        raise DataError(place, f"{found} ({first_line(error)})" if with_reason else found, expected) from error
