"""The program, also as `python -m tracknoise`. Ctrl-C ends it quietly while its modules are loaded, too."""

import os
import signal
from types import FrameType

_OF_POLARS = "dirty_decay_ms:500,muzzy_decay_ms:0"
"""Its allocator, which reads this when Polars is loaded, returns memory half a second after it was freed, not ten."""


def start() -> None:
    """Run the command line and exit with its status."""
    os.environ.setdefault("_RJEM_MALLOC_CONF", _OF_POLARS)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _end)
    from tracknoise.cli.app import main

    main()


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(128 + number)


if __name__ == "__main__":  # not in a process that starts anew to measure a part
    start()
