"""How a run goes on: bars in a terminal, plain lines elsewhere, nothing when quiet."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

from tracknoise.cli.terminal import Terminal
from tracknoise.report.names import together
from tracknoise.tables.store import SequenceEntry

SILENCE_S = 10.0
"""Where there are no bars, a line comes no sooner than this after the last one of its kind."""


class Pace:
    """How fast a run goes, and how long it will still take, by what was done since it was started.

    Parameters
    ----------
    to_do
        Count of sequences still to be measured.
    clock
        Gives the time, seconds.
    """

    def __init__(self, to_do: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._to_do, self._done = to_do, 0
        self._clock, self._started = clock, clock()

    def advance(self) -> None:
        """Note that one more is done."""
        self._done += 1

    def __str__(self) -> str:
        elapsed_s = self._clock() - self._started
        if not self._done or not elapsed_s:
            return ""
        rate, left_s = self._done / elapsed_s, (self._to_do - self._done) * elapsed_s / self._done
        return f"{_rate(rate)}, {_duration(left_s)} left"


class Heartbeat:
    """Says now and then that a run goes on, from a thread of its own, since nothing may happen for long.

    Lines come farther apart the longer it takes: a twentieth of the time until then, and no less than `SILENCE_S`.

    Parameters
    ----------
    say
        Prints a line.
    status
        Gives the line, by the seconds since the start; an empty one is not printed.
    clock
        Gives the time, seconds.
    pause_s
        How long the thread sleeps between two looks at the clock.
    """

    def __init__(
        self,
        say: Callable[[str], None],
        status: Callable[[float], str],
        *,
        clock: Callable[[], float] = time.monotonic,
        pause_s: float = 1.0,
    ) -> None:
        self._say, self._status, self._clock, self._pause_s = say, status, clock, pause_s
        self._started = self._last = clock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._go, daemon=True)

    def start(self) -> None:
        """Begin to say so."""
        self._thread.start()

    def stop(self) -> None:
        """Be silent from now on."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def beat(self) -> None:
        """Print the line, if it is time."""
        now = self._clock()
        if now - self._last >= max(SILENCE_S, (now - self._started) / 20):
            self._last = now
            if text := self._status(now - self._started):
                self._say(text)

    def _go(self) -> None:
        while not self._ended.wait(self._pause_s):
            self.beat()


class RunProgress:
    """Shows sequences and frames as they are measured; a `tracknoise.experiments.running.execute.Listener`.

    Parameters
    ----------
    terminal
        Where to.
    clock
        Gives the time, seconds.

    Attributes
    ----------
    heartbeat
        Says where the run stands, where there are no bars.
    """

    def __init__(self, terminal: Terminal, clock: Callable[[], float] = time.monotonic) -> None:
        self._terminal, self._clock = terminal, clock
        self._bars = _bars(terminal, TextColumn("{task.fields[pace]}"))
        self.heartbeat = Heartbeat(terminal.say, self._status, clock=clock)
        self._pace = Pace(0, clock)
        self._total, self._done = 0, 0
        self._all: TaskID | None = None
        self._frames: TaskID | None = None
        self._at = ""

    def __enter__(self) -> Self:
        self._bars.start()
        if self._bars.disable:
            self.heartbeat.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.heartbeat.stop()
        self._bars.stop()

    def planned(self, keys: list[str], done: int) -> None:
        """Begin, with some sequences perhaps measured earlier."""
        if done:
            self._terminal.say(f"measured already: {done}; to go: {len(keys)}")
        self._pace = Pace(len(keys), self._clock)
        self._total, self._done = len(keys) + done, done
        self._all = self._bars.add_task("sequences", total=self._total, completed=done, pace="")

    def frame(self, key: str, done: int, total: int) -> None:
        """Show the frames of the sequence at hand."""
        self._at = f"{key} at frame {done} of {total}"
        if self._frames is None:
            self._frames = self._bars.add_task(key, total=total, pace="")
        self._bars.update(self._frames, description=key, completed=done, total=total)

    def measured(self, key: str, entry: SequenceEntry) -> None:
        """Say that a sequence is done, and what its reader had to correct."""
        self._advance()
        self._terminal.say(f"measured {key}: {entry.n_frames} frames in {entry.seconds:.1f} s ({self._position()})")
        for note in entry.notes:
            self._terminal.say(f"note: {key}: {note}")

    def failed(self, keys: list[str], cause: str) -> None:
        """Say that sequences failed, and why, once for those that were read together."""
        for _ in keys:
            self._advance()
        self._terminal.error(f"{together(keys)}: {cause}")

    def remark(self, text: str) -> None:
        """Say what else is worth a line."""
        self._terminal.say(text)

    def _advance(self) -> None:
        self._done += 1
        self._pace.advance()
        if self._all is not None:
            self._bars.update(self._all, completed=self._done, pace=str(self._pace))

    def _position(self) -> str:
        of_all = f"{self._done} of {self._total}"
        return f"{of_all}; {self._pace}" if self._done < self._total else of_all

    def _status(self, elapsed_s: float) -> str:
        """What there is to say while a sequence is measured; nothing before and after."""
        if self._done == self._total:
            return ""
        of_all = f"{self._done} of {self._total} sequences done after {_duration(elapsed_s)}"
        return "; ".join(filter(None, [of_all, str(self._pace), self._at]))


@contextmanager
def frame_progress(terminal: Terminal, label: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar over frames; yields what is to be called with the count of frames done and of all."""
    with _bars(terminal, TimeRemainingColumn()) as bars:
        bar = bars.add_task(label, total=None)
        yield lambda done, total: bars.update(bar, completed=done, total=total)


def _rate(per_second: float) -> str:
    """Sequences in the shortest unit of time in which at least one is done, or else in an hour."""
    units = {"s": 1, "min": 60, "h": 3600}
    unit = next((name for name, seconds in units.items() if per_second * seconds >= 1), "h")
    return f"{per_second * units[unit]:.1f}/{unit}"


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60)
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60:02d} min"


def _bars(terminal: Terminal, last: ProgressColumn) -> Progress:
    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        last,
        console=console,
        transient=True,
        disable=terminal.quiet or not console.is_terminal,
    )
