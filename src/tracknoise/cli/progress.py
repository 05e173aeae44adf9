"""How a run goes on: bars in a terminal, plain lines elsewhere, nothing when quiet."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from tracknoise.cli.terminal import Terminal
from tracknoise.tables.store import SequenceEntry


class RunProgress:
    """Shows sequences and frames as they are measured; a `tracknoise.experiments.execute.Listener`."""

    def __init__(self, terminal: Terminal) -> None:
        self._terminal = terminal
        self._bars = _bars(terminal)
        self._all: TaskID | None = None
        self._frames: TaskID | None = None

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()

    def planned(self, keys: list[str], done: int) -> None:
        """Begin, with some sequences perhaps measured earlier."""
        if done:
            self._terminal.say(f"measured already: {done}; to go: {len(keys)}")
        self._all = self._bars.add_task("sequences", total=len(keys) + done, completed=done)

    def frame(self, key: str, done: int, total: int) -> None:
        """Show the frames of the sequence at hand."""
        if self._frames is None:
            self._frames = self._bars.add_task(key, total=total)
        self._bars.update(self._frames, description=key, completed=done, total=total)

    def measured(self, key: str, entry: SequenceEntry) -> None:
        """Say that a sequence is done, and what its reader had to correct."""
        self._advance()
        self._terminal.say(f"measured {key}: {entry.n_frames} frames in {entry.seconds:.1f} s")
        for note in entry.notes:
            self._terminal.say(f"note: {key}: {note}")

    def failed(self, key: str, cause: str) -> None:
        """Say that a sequence failed, and why."""
        self._advance()
        self._terminal.error(f"{key}: {cause}")

    def _advance(self) -> None:
        if self._all is not None:
            self._bars.advance(self._all)


@contextmanager
def frame_progress(terminal: Terminal, label: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar over frames; yields what is to be called with the count of frames done and of all."""
    with _bars(terminal) as bars:
        bar = bars.add_task(label, total=None)
        yield lambda done, total: bars.update(bar, completed=done, total=total)


def _bars(terminal: Terminal) -> Progress:
    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=terminal.quiet or not console.is_terminal,
    )
