"""Signals that end the program: one exception where it runs, however often they are repeated."""

import signal
import sys
import threading
import time
from types import FrameType, TracebackType
from typing import Self

from tracknoise import signals

_PAUSE_S = 1.0
"""Signals that follow each other sooner than this, seconds, count once."""
_AGAIN_S = 0.02
"""Pause before a signal that had no effect is repeated, seconds."""


class Interruption:
    """Raises KeyboardInterrupt in the main thread when a signal of `tracknoise.signals.ENDING` arrives.

    A signal that is ignored when the program starts stays ignored, as ``nohup`` wants it. If the exception is raised
    where Python can only report it, such as in a finalizer, it is raised again shortly after. After `end`, signals have
    no effect, because the program is about to exit. True once there was a signal.
    """

    def __init__(self) -> None:
        self._number: int | None = None
        self._last_s = -_PAUSE_S
        self._ended = False
        self._report = sys.unraisablehook

    def __bool__(self) -> bool:
        return self._number is not None

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in signals.ENDING:
                if signal.getsignal(number) is not signal.SIG_IGN:
                    signal.signal(number, self._handle)
            sys.unraisablehook = self._unraisable
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()
        sys.unraisablehook = self._report

    @property
    def status(self) -> int:
        """Exit status of the program, as a shell reports it."""
        return 128 + (self._number or 0)

    @property
    def text(self) -> str:
        """Message to the user."""
        number = signal.Signals(self._number or signal.SIGINT)
        how = "interrupted" if number is signal.SIGINT else f"ended by {number.name}"
        return f"{how}; run the same command again to resume"

    def record(self) -> None:
        """Take note of a KeyboardInterrupt that no signal caused, as one of Ctrl-C."""
        self._number = self._number or signal.SIGINT

    def end(self) -> None:
        """Let signals have no effect from now on."""
        self._ended = True

    def _handle(self, number: int, frame: FrameType | None) -> None:
        now_s = time.monotonic()
        if self._ended or now_s - self._last_s < _PAUSE_S:
            return
        self._number, self._last_s = self._number or number, now_s
        raise KeyboardInterrupt

    def _unraisable(self, unraisable: "sys.UnraisableHookArgs") -> None:
        number = self._number
        if number is None or not issubclass(unraisable.exc_type, KeyboardInterrupt):
            self._report(unraisable)
        elif not self._ended:
            self._last_s = -_PAUSE_S
            main = threading.main_thread().ident or 0
            repeat = threading.Timer(_AGAIN_S, signal.pthread_kill, (main, number))
            repeat.daemon = True
            repeat.start()
