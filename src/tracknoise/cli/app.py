"""The ``tracknoise`` command: how it ends, by itself, with an error or by a signal.

Exit status: 0 success, 1 user error, 2 some scenes failed, 3 and 4 of
``tracknoise check`` (usable with caveats, not usable) and of ``tracknoise compare --gate`` (worse, undecided), 128 + N
ended by signal N (130 for Ctrl-C). Results go to
stdout, everything else to stderr.
"""

import io
import sys
import traceback

from tracknoise import signals, standard_streams
from tracknoise.cli.interruption import Interruption
from tracknoise.cli.terminal import Terminal, finish_results
from tracknoise.exceptions import TracknoiseError, with_type

_INTERRUPTED = 130
"""What typer returns if a command raised KeyboardInterrupt."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its status.

    Parameters
    ----------
    arguments
        Without the program's name. Default: the arguments of the process.
    """
    if arguments is None:
        standard_streams.prepare()
    with Interruption() as interruption:
        terminal = Terminal()
        try:
            status = _reported(terminal, arguments, interruption)
            interruption.end()
        except KeyboardInterrupt:
            interruption.record()
        interruption.end()
        if interruption:
            status = interruption.status
            terminal.error(interruption.text)
        status = _finished(terminal, status)
    if arguments is None:
        signals.ignore()  # while the interpreter exits, it would give them their default effect again
    sys.exit(status)


def _reported(terminal: Terminal, arguments: list[str] | None, interruption: Interruption) -> int:
    """Run a command and report its error. What fails because of an interruption is not reported."""
    try:
        return _status(terminal, arguments)
    except BaseException as error:  # a panic of Polars is no Exception
        signals.raise_if_interruption(error)
        if interruption:
            return interruption.status
        if isinstance(error, SystemExit) and _is_of_parser(error):
            raise  # completion of the shell
        if terminal.debug and isinstance(error, SystemExit):
            raise RuntimeError(_text(error)) from error  # of a plug-in, whose status would be that of the program
        if terminal.debug:
            raise
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


def _status(terminal: Terminal, arguments: list[str] | None) -> int:
    """Run a command. Its modules are loaded here, where signals have their effect already."""
    import typer

    from tracknoise.cli.commands import app

    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # one unprintable character must not hide the rest
    try:
        status: int = typer.main.get_command(app).main(
            args=arguments, prog_name="tracknoise", standalone_mode=False, obj=terminal
        )
    except typer.TyperException as error:
        if message := error.format_message():  # empty if the help was printed instead
            terminal.error(message)
        return 1
    except typer.Abort as error:
        raise KeyboardInterrupt from error
    if status == _INTERRUPTED:
        raise KeyboardInterrupt
    return status


def _text(error: BaseException) -> str:
    if isinstance(error, TracknoiseError):
        return str(error)
    what = "a plug-in ended the program" if isinstance(error, SystemExit) else "internal error"
    return f"{what} ({with_type(error)}); use --debug for a traceback"
