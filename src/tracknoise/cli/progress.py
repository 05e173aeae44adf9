"""Progress of a run: bars in a terminal, plain lines elsewhere, nothing when quiet."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

from tracknoise import processes
from tracknoise.cli.terminal import Terminal
from tracknoise.tables.identity import readable
from tracknoise.text import counted, printable
from tracknoise.topics.sentences import together

if TYPE_CHECKING:
    from tracknoise.tables.manifest import SequenceEntry

SILENCE_S = 10.0
"""Shortest time between two status lines, seconds. They are printed only where there are no bars."""


_COMPUTED = "results are being computed"
"""Said once nothing is left to measure: how long the rest takes is not known."""
_FOLLOWED = "reference tracks are being followed"
"""Said before the first frame is measured."""


class Pace:
    """Rate of a run since its start, and the time left at that rate."""

    def __init__(self, to_do: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._to_do, self._done = to_do, 0
        self._clock, self._started = clock, clock()

    def advance(self) -> None:
        """Count one more sequence as done."""
        self._done += 1

    def __str__(self) -> str:
        elapsed_s = self._clock() - self._started
        if not self._done or not elapsed_s:
            return ""
        return f"{_rate(self._done / elapsed_s)}{_left((self._to_do - self._done) * elapsed_s / self._done)}"


class FramePace:
    """Frames of the sequences that are being measured: how many are done, the rate, and the time left at that rate."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._done: dict[str, dict[int, int]] = {}
        self._totals: dict[str, int] = {}
        self._measured = 0
        self._started: float | None = None

    def advance(self, key: str, done: int, total: int, first: int) -> None:
        """Count a frame of a sequence: `done` frames from `first` on are measured, of `total` in all its parts."""
        if self._started is None and done:
            self._started = self._clock()
        pieces = self._done.setdefault(key, {})
        self._measured += done - pieces.get(first, 0) == 1  # parts that an earlier start measured do not count
        pieces[first], self._totals[key] = done, total

    def end(self, key: str) -> None:
        """Count a sequence as done."""
        self._done.pop(key, None)
        self._totals.pop(key, None)

    @property
    def done(self) -> int:
        """Frames that are done, of all sequences that are being measured."""
        return sum(sum(pieces.values()) for pieces in self._done.values())

    @property
    def total(self) -> int:
        """Frames of these sequences."""
        return sum(self._totals.values())

    @property
    def name(self) -> str:
        """What is being measured: the name of a sequence, or how many there are."""
        return readable(next(iter(self._done))) if len(self._done) == 1 else f"{len(self._done)} sequences"

    def __str__(self) -> str:
        elapsed_s = 0.0 if self._started is None else self._clock() - self._started
        if self._done and not self.done:
            return _FOLLOWED
        if not self._done or not self._measured or not elapsed_s:
            return ""
        rate, left = self._measured / elapsed_s, self.total - self.done
        return f"{rate:.1f} frames/s{_left(left / rate)}" if left else _COMPUTED


class Heartbeat:
    """Prints a status line from time to time, from its own thread: a sequence can take long.

    The pause between two lines is a twentieth of the time since the start, and at least `SILENCE_S`.
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
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread. Nothing is printed afterwards."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def beat(self) -> None:
        """Print the line if it is due."""
        now = self._clock()
        if now - self._last >= max(SILENCE_S, (now - self._started) / 20):
            self._last = now
            if text := self._status(now - self._started):
                self._say(text)

    def _go(self) -> None:
        while not self._ended.wait(self._pause_s):
            self.beat()


class RunProgress:
    """Shows sequences and frames as they are measured; a `tracknoise.experiments.execute.Listener`.

    Attributes
    ----------
    heartbeat
        Prints status lines where there are no bars.
    """

    def __init__(self, terminal: Terminal, clock: Callable[[], float] = time.monotonic) -> None:
        self._terminal, self._clock = terminal, clock
        self._bars = _bars(terminal, TextColumn("{task.fields[pace]}"))
        self.heartbeat = Heartbeat(terminal.say, self._status, clock=clock)
        self._pace = Pace(0, clock)
        self._total, self._done = 0, 0
        self._all: TaskID | None = None
        self._frames: TaskID | None = None
        self._of_frames = FramePace(clock)

    def __enter__(self) -> Self:
        processes.end_system_calls()
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
        """Show how many sequences are to be measured, and how many were measured by an earlier start."""
        if done:
            self._terminal.say(f"resuming: {done} of {counted(len(keys) + done, 'sequence')} already measured")
        self._pace = Pace(len(keys), self._clock)
        self._total, self._done = len(keys) + done, done
        self._all = self._bars.add_task("sequences", total=self._total, completed=done, pace="")

    def frame(self, key: str, done: int, total: int, first: int) -> None:
        """Show the progress within the sequences that are being measured."""
        self._of_frames.advance(key, done, total, first)
        name, bar = escape(printable(self._of_frames.name)), self._of_frames
        if self._frames is None:
            self._frames = self._bars.add_task(name, total=total, pace="")
        self._bars.update(self._frames, description=name, completed=bar.done, total=bar.total, pace=str(bar))

    def measured(self, key: str, entry: "SequenceEntry") -> None:
        """Print that a sequence is done, the notes of its reader, and why its data look wrong."""
        self._advance(key)
        name = readable(key)
        self._terminal.say(f"measured {name}: {entry.n_frames} frames in {entry.seconds:.1f} s ({self._position()})")
        for note in entry.notes:
            self._terminal.say(f"note: {name}: {note}")
        for doubt in (*entry.doubts, *entry.cautions):
            self._terminal.warn(f"{name}: {doubt}")

    def failed(self, keys: list[str], cause: str) -> None:
        """Print that sequences failed, and why. Sequences that were read together share one line."""
        for key in keys:
            self._advance(key)
        self._terminal.error(f"{together([*map(readable, keys)])}: {cause}")

    def remark(self, text: str) -> None:
        """Print any other message."""
        self._terminal.say(text)

    def _advance(self, key: str) -> None:
        self._of_frames.end(key)
        self._done += 1
        self._pace.advance()
        if self._all is not None:
            pace = _COMPUTED if self._done == self._total else str(self._pace)
            self._bars.update(self._all, completed=self._done, pace=pace)

    def _position(self) -> str:
        of_all = f"{self._done} of {self._total}"
        return f"{of_all}; {self._pace}" if self._done < self._total else of_all

    def _status(self, elapsed_s: float) -> str:
        """Status line while sequences are measured, and while the results of all are computed; empty before."""
        if not self._total:
            return ""
        of_all = f"{self._done} of {counted(self._total, 'sequence')} done after {_duration(elapsed_s)}"
        if self._done == self._total:
            return f"{of_all}; {_COMPUTED}"
        bar = self._of_frames
        at = f"{printable(bar.name)} at frame {bar.done} of {bar.total}" if bar.total else ""
        return "; ".join(filter(None, [of_all, str(self._pace), at, str(bar)]))


@contextmanager
def frame_progress(terminal: Terminal, label: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar over frames. Yields a function that takes the number of frames done and the total."""
    with _bars(terminal, TimeRemainingColumn()) as bars:
        bar = bars.add_task(label, total=None)
        yield lambda done, total: bars.update(bar, completed=done, total=total)


def _rate(per_second: float) -> str:
    """Rate per second, minute or hour: the shortest of these in which at least one sequence is done, else per hour."""
    units = {"s": 1, "min": 60, "h": 3600}
    unit = next((name for name, seconds in units.items() if per_second * seconds >= 1), "h")
    return f"{per_second * units[unit]:.1f}/{unit}"


def _left(seconds: float) -> str:
    """Time left to measure, after a comma; empty where nothing is left."""
    return f", {_duration(max(seconds, 1.0))} left" if seconds > 0.0 else ""


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60)
    if round(seconds) < 100:
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
