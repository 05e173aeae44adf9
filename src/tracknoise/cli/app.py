"""The ``tracknoise`` command: how it ends, by itself, with an error or by a signal.

Exit status: 0 success, 1 user error, 2 some scenes failed, 4 of ``tracknoise check`` (the truth is not
trusted, or this is unknown), 3 and 4 of ``tracknoise compare --gate`` (worse, undecided), 128 + N ended by
signal N (130 for Ctrl-C). Results go to stdout, everything else to stderr.
"""

import io
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from types import FrameType, TracebackType
from typing import Self

from tracknoise import processes
from tracknoise.cli.moved import STATUS, moved
from tracknoise.cli.terminal import Terminal, finish_results
from tracknoise.exceptions import TracknoiseError, with_type

_PAUSE_S = 1.0
"""Signals that follow each other sooner than this, seconds, count once."""
_AGAIN_S = 0.02
"""Pause before a signal that had no effect is repeated, seconds."""


class Interruption:
    """Raises KeyboardInterrupt in the main thread when a signal of `tracknoise.processes.ENDING` arrives.

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
            for number in processes.ENDING:
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
        """What happened, for the user."""
        number = signal.Signals(self._number or signal.SIGINT)
        return "interrupted" if number is signal.SIGINT else f"ended by {number.name}"

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


_COMPLETION = "_TRACKNOISE_COMPLETE"
"""Set by the shell where it asks for suggestions."""
_INTERRUPTED = 130
"""What typer returns if a command raised KeyboardInterrupt."""


class _UsageError(Exception):
    """The parser of the command line has no command for the arguments. Without a message, it printed the help."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    if arguments is None:
        processes.prepare()
    with Interruption() as interruption:
        terminal = Terminal()
        try:
            try:
                processes.require_memory()
                if sentence := moved(sys.argv[1:] if arguments is None else arguments):
                    terminal.error(sentence)
                    status = STATUS
                else:
                    command = _loaded(terminal, arguments)
                    with _parsing():
                        status = command()
                if status == _INTERRUPTED:
                    raise KeyboardInterrupt
            except BaseException as error:  # a panic of Polars is no Exception
                status = _status_after(error, terminal, interruption)
            interruption.end()
        except KeyboardInterrupt:
            interruption.record()
        interruption.end()
        if interruption:
            status = interruption.status
            terminal.error("; ".join(filter(None, [interruption.text, terminal.to_resume])))
        status = _finished(terminal, status)
    if arguments is None:
        processes.ignore()  # while the interpreter exits, it would give them their default effect again
    sys.exit(status)


def _loaded(terminal: Terminal, arguments: list[str] | None) -> Callable[[], int]:
    """What parses the arguments and runs a command. Modules are loaded here: signals have their effect already."""
    import typer

    from tracknoise.cli.commands import app
    from tracknoise.cli.shared_options import require_values

    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # one unprintable character must not hide the rest
    require_values(sys.argv[1:] if arguments is None else arguments)
    parser = typer.main.get_command(app)
    return partial(parser.main, args=arguments, prog_name="tracknoise", standalone_mode=False, obj=terminal)


@contextmanager
def _parsing() -> Iterator[None]:
    """Tell errors of the parser from those of a command."""
    import typer

    try:
        yield
    except typer.TyperException as error:
        raise _UsageError(error.format_message()) from error
    except typer.Abort as error:
        raise KeyboardInterrupt from error


def _status_after(error: BaseException, terminal: Terminal, interruption: Interruption) -> int:
    """Report the error of a command. What fails because of an interruption is not reported."""
    processes.raise_if_interruption(error)
    if interruption:
        return interruption.status
    if isinstance(error, SystemExit) and _is_of_parser(error):
        raise error  # completion of the shell
    if _COMPLETION in os.environ:
        return 1  # the shell shows no suggestions, and no message in the middle of its line
    if isinstance(error, _UsageError):
        if message := str(error):
            terminal.error(message)
        return 1
    if terminal.debug and isinstance(error, SystemExit):
        raise RuntimeError(_text(error)) from error  # of a plug-in, whose status would be that of the program
    if terminal.debug:
        raise error
    terminal.error(_text(error))
    return 1


def _is_of_parser(error: BaseException) -> bool:
    """Whether the parser of the command line raised an error."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    return frames[-1].f_globals["__name__"].partition(".")[0] in ("click", "typer")


def _finished(terminal: Terminal, status: int) -> int:
    """Exit status of a command, once its results are written as far as they can be."""
    try:
        finish_results()
    except TracknoiseError as error:
        terminal.error(str(error))
        return status or 1
    return status


def _text(error: BaseException) -> str:
    if isinstance(error, TracknoiseError):
        return str(error)
    what = "a plug-in ended the program" if isinstance(error, SystemExit) else "internal error"
    return f"{what} ({with_type(error)}); use --debug for a traceback"
