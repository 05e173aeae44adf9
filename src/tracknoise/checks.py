"""Range checks of settings, whose messages name the field, and which of pydantic's complaints is reported.

Bounds of numbers are part of the types of the fields (`Positive`, ``Annotated[int, Ge(1)]``). From there they reach the
JSON schema too.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from enum import StrEnum
from functools import cache
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Interval, Le, Lt

from tracknoise.exceptions import InvalidValueError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


Positive = Annotated[float, Gt(0)]
NotNegative = Annotated[float, Ge(0)]
Share = Annotated[float, Ge(0), Le(1)]
Between0And1 = Annotated[float, Gt(0), Lt(1)]

MOST_LEVELS = 16
"""How deep lists and tables in settings can nest."""
_LONGEST_VALUE = 300
"""Characters of a value in a message; of a longer one the type is named."""
_WHOLE = range(-(2**63), 2**63)


def require(holds: bool, field: str, value: object, expected: str) -> None:
    """Raise InvalidValueError, naming field, value and what was expected, unless `holds`."""
    if not holds:
        shown = repr(value)
        given = shown if len(shown) <= _LONGEST_VALUE else f"of type {type(value).__name__}"
        raise InvalidValueError(f"{field} is {given}, expected {expected}")


def require_whole(field: str, value: object, least: int | None = None) -> None:
    """Raise InvalidValueError unless `value` is a whole number, and not below `least`."""
    expected = "a whole number" if least is None else f"a whole number of at least {least}"
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    require(whole and (least is None or _is_within(value, {"ge": least})), field, value, expected)


def path_of(field: str, value: str | PathLike[str]) -> Path:
    """A path from what names it. Raises InvalidValueError unless that is a text or a path."""
    require(isinstance(value, str | PathLike), field, value, "a path")
    return Path(value)


def require_list(field: str, value: object, of: str) -> None:
    """Raise InvalidValueError unless `value` holds several things; a text does not."""
    holds = isinstance(value, Collection) and not isinstance(value, str | bytes | Mapping)
    require(holds, field, value, f"a list of {of}")


def settle_members(settings: object, **kinds: type[StrEnum]) -> None:
    """Replace names by the members of enumerations that they are of, in fields of a frozen dataclass.

    Raises ValueError, naming the field, where a value is neither.
    """
    for name, kind in kinds.items():
        value = getattr(settings, name)
        require(value in tuple(kind), name, value, f"one of {', '.join(kind)}")
        object.__setattr__(settings, name, kind(value))


def require_bounds(settings: Any) -> None:
    """Raise ValueError unless all fields of a dataclass that have bounds are finite and within them.

    A field may be None, or several numbers with the same bounds, as many as its type says. A field that is settings
    must be settings.
    """
    for name, count in _counts_of(settings.__class__).items():
        value = getattr(settings, name)
        holds = value is None or (isinstance(value, tuple | list) and len(value) == count)
        require(holds, name, value, f"{count} values")
    for name, bounds in bounds_of(settings.__class__).items():
        value = getattr(settings, name)
        for number in value if isinstance(value, tuple | list) else (value,):
            if number is not None:
                require_within(name, number, bounds)
    for name, kinds in _settings_among(settings.__class__).items():
        value = getattr(settings, name)
        require(isinstance(value, kinds), name, value, " or ".join(f"{kind.__name__}(...)" for kind in kinds))


@cache
def _counts_of(settings_type: type) -> dict[str, int]:
    """How many values the fields have that are tuples of a fixed length."""
    return {
        name: len(get_args(kind))
        for name, kinds in _kinds_of(settings_type)
        for kind in kinds
        if get_origin(kind) is tuple and Ellipsis not in get_args(kind)
    }


@cache
def _settings_among(settings_type: type) -> dict[str, tuple[type, ...]]:
    """The fields that are dataclasses themselves, and the classes that their values may have."""
    return {
        name: parts
        for name, parts in _kinds_of(settings_type)
        if any(map(is_dataclass, parts)) and all(isinstance(part, type) for part in parts)
    }


def _kinds_of(settings_type: type) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """The fields, and the types that their values may have."""
    for name, hint in get_type_hints(settings_type).items():
        yield name, get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def require_within(field: str, value: object, bounds: Mapping[str, float]) -> None:
    """Raise ValueError unless `value` is a finite number within bounds: ``gt``, ``ge``, ``lt`` and ``le``."""
    require(_is_within(value, bounds), field, value, in_words(bounds))


def require_finite(field: str, value: float) -> None:
    """Raise ValueError unless `value` is finite."""
    require(_is_finite(value), field, value, "a finite number")


def require_odd(field: str, value: int) -> None:
    """Raise ValueError unless `value` is odd."""
    require(value % 2 == 1, field, value, "an odd number")


@cache
def bounds_of(settings_type: type) -> dict[str, dict[str, float]]:
    """Bounds of the fields of a dataclass that have any: ``gt``, ``ge``, ``lt`` and ``le`` by field."""
    hints = get_type_hints(settings_type, include_extras=True)
    bounds_by_field = {name: dict(_bounds_in(hint)) for name, hint in hints.items()}
    return {name: bounds for name, bounds in bounds_by_field.items() if bounds}


def _bounds_in(hint: Any) -> Iterator[tuple[str, float]]:
    if isinstance(hint, Gt | Ge | Lt | Le | Interval):
        named = ((name, getattr(hint, name, None)) for name in ("gt", "ge", "lt", "le"))
        yield from ((name, bound) for name, bound in named if bound is not None)
    for part in get_args(hint):
        yield from _bounds_in(part)


def in_words(bounds: Mapping[str, float]) -> str:
    """The numbers within bounds."""
    shown = {name: f"{bound:.15g}" for name, bound in bounds.items()}
    match shown:
        case {"ge": least, "le": most}:
            return f"a number from {least} to {most}"
        case {"ge": least, "lt": end}:
            return f"a number from {least} to below {end}"
        case {"gt": start, "lt": end}:
            return f"a number between {start} and {end}"
    words = {"gt": "above", "ge": "not below", "lt": "below", "le": "not above"}
    return f"a number {' and '.join(f'{words[name]} {bound}' for name, bound in shown.items())}"


def _is_within(value: object, bounds: Mapping[str, float]) -> bool:
    if not isinstance(value, Real):
        return False
    number: Any = value  # a Real has no type that floats are compared with
    above = number > bounds.get("gt", -math.inf) and number >= bounds.get("ge", -math.inf)
    return bool(above and number < bounds.get("lt", math.inf) and number <= bounds.get("le", math.inf))


def require_storable(value: object) -> None:
    """Check what a TOML or JSON file holds: numbers and nests that every other program can read too.

    Raises
    ------
    ValueError
        If a whole number needs more than 64 bits, a text contains a null character, or lists and tables nest deeper
        than `MOST_LEVELS`.
    """
    level: list[object] = [value]
    for _ in range(MOST_LEVELS):
        for item in level:
            _require_plain(item)
        level = [part for item in level for part in _parts(item)]
    if level:
        raise ValueError(f"lists and tables more than {MOST_LEVELS} deep, expected fewer levels")


def _require_plain(value: object) -> None:
    if isinstance(value, int) and value not in _WHOLE:
        raise ValueError(f"a whole number of {value.bit_length()} bits, expected at most 64 bits")
    if isinstance(value, str) and "\0" in value:
        raise ValueError(f"{value!r}, expected a text without null characters")


def _parts(value: object) -> Iterable[object]:
    if isinstance(value, Mapping):
        return [*value.keys(), *value.values()]
    return value if isinstance(value, list | tuple) else ()


def _is_finite(value: object) -> bool:
    bounds = {"gt": -math.inf, "lt": math.inf}  # unlike math.isfinite, without an error for whole numbers of any size
    return _is_within(value, bounds)


_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
"""Types of problems with keys that models and dataclasses do not have."""


def likeliest_problem(problems: "Sequence[ErrorDetails]") -> "ErrorDetails":
    """The first problem, or instead of a missing key an unknown one of the same section: it may be a misspelling."""
    first = problems[0]
    if first["type"] != "missing":
        return first
    unknown = (error for error in problems if error["type"] in _UNKNOWN and error["loc"][:-1] == first["loc"][:-1])
    return next(unknown, first)


def in_one_line(problems: "Sequence[ErrorDetails]") -> str:
    """The likeliest problem: where, and what was expected."""
    problem = likeliest_problem(problems)
    return f"{'.'.join(map(str, problem['loc']))}: {problem['msg'].lower()}"
