"""Which of the problems that pydantic finds in settings is reported."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
"""Types of problems with keys that models and dataclasses do not have."""


def likeliest_problem(problems: "Sequence[ErrorDetails]") -> "ErrorDetails":
    """The first problem, or instead of a missing key an unknown one of the same section: it may be a misspelling."""
    first = problems[0]
    if first["type"] != "missing":
        return first
    unknown = (one for one in problems if one["type"] in _UNKNOWN and one["loc"][:-1] == first["loc"][:-1])
    return next(unknown, first)


def in_one_line(problems: "Sequence[ErrorDetails]") -> str:
    """The likeliest problem: where, and what was expected."""
    problem = likeliest_problem(problems)
    return f"{'.'.join(map(str, problem['loc']))}: {problem['msg'].lower()}"
