"""The program, also as `python -m tracknoise`. Ctrl-C ends it quietly while its modules are loaded, too."""

import os
import signal
from types import FrameType


def start() -> None:
    """Run the command line and exit with its status."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _end)
    from tracknoise.cli.app import main

    main()


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(128 + number)


if __name__ == "__main__":  # not in a process that starts anew to measure a part
    start()
