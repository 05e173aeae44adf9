"""Commands that the program had under other names, and what is called instead."""

from collections.abc import Sequence

_IN_REPOSITORY = "`python -m benchmarks.{}` in the repository"
_MOVED = {
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
STATUS = 2
"""Exit status of a command that is called by its old name."""


def moved(arguments: Sequence[str]) -> str | None:
    """What is called in place of a command, as a sentence; None for any other first argument."""
    for length in (2, 1):
        name = " ".join(arguments[:length])
        if name in _MOVED:
            return f"`tracknoise {name}` is no command any more; expected {_MOVED[name]}"
    return None
