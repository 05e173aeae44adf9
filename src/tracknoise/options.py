"""Options of a plug-in: the fields of its settings dataclass, checked strictly, and the paths among them."""

import inspect
import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, asdict, fields, is_dataclass
from functools import cache
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Annotated, Any, NewType, TypeVar, get_args, get_type_hints

from tracknoise.checks import MOST_LEVELS, bounds_of, in_words, likeliest_problem, require_storable
from tracknoise.exceptions import did_you_mean

if TYPE_CHECKING:
    from pydantic import TypeAdapter
    from pydantic_core import ErrorDetails

T = TypeVar("T")

_OUT_OF_BOUNDS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")

PathTemplate = NewType("PathTemplate", str)
"""Type of an option that is a path with placeholders, such as ``tracks/{scene}.csv``: see `SequenceId.expand`."""

_FROM_DATA = object()
DataPath = Annotated[Path, _FROM_DATA]
"""Type of an option that is a path relative to the folder of the data, and not to that of the experiment file."""


def validated(settings_type: type[T], options: Mapping[str, object], given: Mapping[str, object]) -> T:
    """Make settings from options, types checked.

    Options are what a TOML or JSON file can hold: nested settings are mappings, members of enumerations their names,
    tuples lists, paths strings. Types must fit as they are: "12" is not a number.

    Parameters
    ----------
    settings_type
        A dataclass.
    options
        Values of its fields, by name.
    given
        Values of fields that are not options.

    Raises
    ------
    ValueError
        If an option is unknown or missing, or has a wrong type or value; the message, one line, names it.
    """
    from pydantic import ValidationError

    for name in given.keys() & options.keys():
        raise ValueError(f"{name}: unknown setting{_known(settings_type, (name,), given)}")
    try:
        written = json.dumps({**options, **given}, default=_plain)
        require_storable(json.loads(written))
    except RecursionError as error:
        raise ValueError(f"lists and tables more than {MOST_LEVELS} deep, expected fewer levels") from error
    except TypeError as error:
        raise ValueError(f"{error}, expected what a TOML file can hold") from error
    kind: Any = settings_type  # which can be hashed, unlike what mypy takes it for
    try:
        settings: T = _adapter(kind).validate_json(written, strict=True)
    except ValidationError as error:
        raise ValueError(_explain(settings_type, likeliest_problem(error.errors()), given)) from error
    return settings


def defaults_as_toml(settings_type: type, hidden: frozenset[str]) -> str:
    """The fields of settings with their defaults as TOML, those without a value as comments.

    Parameters
    ----------
    settings_type
        A dataclass.
    hidden
        Fields that are not options.
    """
    import tomlkit

    comments, defaults = [], {}
    for field in fields(settings_type):
        value = field.default if field.default_factory is MISSING else field.default_factory()
        if value is MISSING or value is None:
            comments.append(f"# {field.name} = ... ({'required' if value is MISSING else 'optional'})\n")
        else:
            defaults[field.name] = value
    shown = [comment for comment in comments if comment.split()[1] not in hidden]
    return ("".join(shown) + tomlkit.dumps(as_toml_values(defaults))).rstrip()


def options_schemas(
    settings_types: Mapping[str, type], hidden: frozenset[str]
) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """JSON Schemas of the options of several settings: types, bounds, defaults and what docstrings say.

    Parameters
    ----------
    settings_types
        Dataclasses by name. The sections *Parameters* or *Attributes* of their docstrings describe the fields.
    hidden
        Fields that are not options.

    Returns
    -------
    schemas
        By the same names: references to definitions.
    definitions
        What belongs into ``$defs`` of the document.
    """
    from pydantic import TypeAdapter
    from pydantic.json_schema import GenerateJsonSchema

    class Described(GenerateJsonSchema):
        def dataclass_schema(self, schema: Any) -> dict[str, Any]:
            made, kind = super().dataclass_schema(schema), schema["cls"]
            summary, documented = _documented(kind)
            made["description"] = summary
            for name, described in made["properties"].items():
                if name in documented:
                    described["description"] = documented[name]
            if kind in settings_types.values():
                for name in hidden:
                    made["properties"].pop(name, None)
                made["required"] = [name for name in made.get("required", ()) if name not in hidden]
            return made

    adapters = [(name, "validation", _adapter(kind)) for name, kind in settings_types.items()]
    schemas, document = TypeAdapter.json_schemas(adapters, schema_generator=Described)  # type: ignore[arg-type]
    return {name: schema for (name, _), schema in schemas.items()}, document["$defs"]


def _documented(settings_type: type) -> tuple[str, dict[str, str]]:
    """First sentence of the docstring of a dataclass, and what it and those of its bases say of each field."""
    summary = (inspect.getdoc(settings_type) or "").partition("\n\n")[0]
    texts: dict[str, str] = {}
    for documented in reversed(settings_type.__mro__):
        rest = inspect.cleandoc(documented.__doc__ or "").partition("\n\n")[2]
        for names, text in re.findall(r"^(\w+(?:, \w+)*)\n((?:(?:[ ]{4}.*)?\n?)+)", rest + "\n", re.MULTILINE):
            texts |= dict.fromkeys(names.split(", "), _in_one_line(text))
    return _in_one_line(summary), {name: text for name, text in texts.items() if text}


def _in_one_line(text: str) -> str:
    return " ".join(text.split()).replace("``", "`")


def as_toml_values(settings: Mapping[str, object]) -> dict[str, Any]:
    """Settings as a TOML file can hold them. A setting that is None is left out, in nested settings too."""
    plain: dict[str, Any] = json.loads(json.dumps(settings, default=_plain), object_pairs_hook=_present)
    return plain


def change_paths(
    settings_type: type, options: Mapping[str, object], change: Callable[[Path | PathTemplate], str]
) -> dict[str, object]:
    """Return options with every path replaced. Paths are found from the types of the fields.

    Parameters
    ----------
    settings_type
        A dataclass, whose paths are of the type `Path` or `PathTemplate`, alone or in unions, lists and nested
        settings.
    options
        Values of its fields, as a file has them. Unknown names and wrong types are left as they are.
    change
        Called for each path, except those of the type `DataPath`, which stay as they are.
    """
    changed = _changed(settings_type, options, change, str)
    assert isinstance(changed, dict)
    return changed


def find_paths(
    settings_type: type, options: Mapping[str, object], root: Path | None = None
) -> list[Path | PathTemplate]:
    """The paths among options, in order: see `change_paths`. Those of the type `DataPath` start from `root`."""
    paths: list[Path | PathTemplate] = []

    def note(path: Path | PathTemplate) -> str:
        paths.append(path)
        return str(path)

    _changed(settings_type, options, note, lambda path: note((root or Path()) / path))
    return paths


def _changed(
    hint: Any, value: object, change: Callable[[Path | PathTemplate], str], from_data: Callable[[Path], str]
) -> object:
    parts = list(parts_of(hint))
    if isinstance(value, list | tuple):
        return [_changed(hint, item, change, from_data) for item in value]
    if isinstance(value, Mapping):
        nested = _settings_in(hint)
        hints = {} if nested is None else get_type_hints(nested, include_extras=True)
        return {name: _changed(hints.get(name), item, change, from_data) for name, item in value.items()}
    if isinstance(value, str | Path) and _FROM_DATA in parts:
        return from_data(Path(value))
    if isinstance(value, str | Path) and PathTemplate in parts:
        return change(PathTemplate(str(value)))
    if isinstance(value, str | Path) and Path in parts:
        return change(Path(value))
    return value


def parts_of(hint: Any) -> Iterator[Any]:
    """A type and all types that it is made of."""
    yield hint
    for part in get_args(hint):
        yield from parts_of(part)


@cache
def _adapter(settings_type: type[T]) -> "TypeAdapter[T]":
    from pydantic import TypeAdapter

    _refuse_unknown(settings_type)
    return TypeAdapter(settings_type)


def _refuse_unknown(settings_type: type) -> None:
    """Make pydantic refuse unknown keys in a dataclass and in all dataclasses that are its fields."""
    from pydantic import ConfigDict, with_config

    with_config(ConfigDict(extra="forbid"))(settings_type)
    for nested in _nested(settings_type).values():
        _refuse_unknown(nested)


def _nested(settings_type: type) -> dict[str, type]:
    """Fields that are settings themselves, or may be."""
    kinds = ((name, _settings_in(hint)) for name, hint in get_type_hints(settings_type).items())
    return {name: kind for name, kind in kinds if kind is not None}


def _settings_in(hint: Any) -> type | None:
    return next((part for part in parts_of(hint) if isinstance(part, type) and is_dataclass(part)), None)


def _plain(value: object) -> object:
    """A path or nested settings, as a TOML file holds them."""
    if isinstance(value, PurePath):
        return str(value)
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    raise TypeError(f"found {value!r}")


def _present(settings: list[tuple[str, Any]]) -> dict[str, Any]:
    return {name: value for name, value in settings if value is not None}


def _explain(settings_type: type, error: "ErrorDetails", given: Mapping[str, object]) -> str:
    place = ".".join(str(part) for part in error["loc"])
    if error["type"] == "unexpected_keyword_argument":
        return f"{place}: unknown setting{_known(settings_type, error['loc'], given)}"
    if error["type"] == "value_error":
        return f"{place}{'.' if place else ''}{error['ctx']['error']}"
    if error["type"] == "missing":
        return f"{place}: missing, expected a value"
    if error["type"] in _OUT_OF_BOUNDS and (bounds := _bounds_at(settings_type, error["loc"])):
        return f"{place} is {error['input']!r}, expected {in_words(bounds)}"
    return f"{place or 'settings'}: {error['msg'].replace('Input should be', 'expected')}, found {error['input']!r}"


def _bounds_at(settings_type: type, location: tuple[Any, ...]) -> dict[str, float]:
    """Bounds of a field of settings, or of settings in them; none if they are stated in another way."""
    names = [part for part in location if isinstance(part, str)]
    for part in names[:-1]:
        settings_type = _nested(settings_type).get(part, settings_type)
    return bounds_of(settings_type).get(names[-1], {})


def _known(settings_type: type, location: tuple[Any, ...], given: Mapping[str, object]) -> str:
    """The known names beside an unknown one, and the likeliest."""
    for part in location[:-1]:
        settings_type = _nested(settings_type).get(part, settings_type)
    names = sorted(field.name for field in fields(settings_type) if field.name not in given)
    return f"{did_you_mean(str(location[-1]), names)}; known: {', '.join(names) or 'none'}"
