"""Commands and options that the program had under other names, and what is called instead."""

from collections.abc import Sequence

_IN_REPOSITORY = "`python -m benchmarks.{}` in the repository"
_COMMANDS = {
    "audit": "`tracknoise check RUN`",
    "findings": "`tracknoise report RUN --text`",
    "effects": "`tracknoise run effects`",
    "prove": _IN_REPOSITORY.format("noise.prove"),
    "selfcheck": _IN_REPOSITORY.format("selfcheck"),
    "noise": "`tracknoise export RUN --to NAME`",
    "noise fit": "`tracknoise export RUN --to text --model FILE`",
    "noise show": "`tracknoise export MODEL --to text`",
    "noise export": "`tracknoise export MODEL --to NAME`",
    "noise check": _IN_REPOSITORY.format("noise.check"),
    "noise table": _IN_REPOSITORY.format("noise.table"),
}
_OPTIONS = {
    ("run", "--schema"): "`docs/experiment.schema.json` in the repository",
    ("simulate", "--scenes"): "`--option worlds=N`",
    ("replicate", "--models"): "`--data FOLDER`",
}
"""By command and name."""
STATUS = 2
"""Exit status of a command that is called by an old name, or with an old option."""


def moved(arguments: Sequence[str]) -> str | None:
    """What is called in place of a command or an option, as a sentence; None for any other arguments."""
    for length in (2, 1):
        name = " ".join(arguments[:length])
        if name in _COMMANDS:
            return f"`tracknoise {name}` is no command any more; expected {_COMMANDS[name]}"
    command, *words = arguments or [""]
    for option in (word.partition("=")[0] for word in words):
        if instead := _OPTIONS.get((command, option)):
            return f"`tracknoise {command} {option}` is no option any more; expected {instead}"
    return None
