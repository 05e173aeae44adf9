"""The document of a noise model: JSON with a published schema, checked when it is read."""

import json
from pathlib import Path
from typing import TypeVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import MIB, read_text

FORMAT = "tracknoise.noise/1"
_KEY = "format"
STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)
"""What a class of documents sets as its ``__pydantic_config__``: unknown keys are refused."""
_Model = TypeVar("_Model")


def _adapter(kind: type[_Model]) -> TypeAdapter[_Model]:
    return TypeAdapter(kind)


def written(kind: type[_Model], model: _Model) -> str:
    """The document of a model, JSON."""
    fields = _adapter(kind).dump_python(model, mode="json")
    return json.dumps({_KEY: FORMAT, **fields}, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def document_schema(kind: type[_Model]) -> str:
    """JSON Schema of the document, as text."""
    schema = _adapter(kind).json_schema()
    schema["properties"] = {_KEY: {"const": FORMAT, "title": "Format"}, **schema["properties"]}
    schema["required"] = [_KEY, *schema["required"]]
    return json.dumps(schema, indent=2) + "\n"


def read_document(kind: type[_Model], path: Path) -> _Model:
    """Read a document.

    Raises
    ------
    DataError
        If it cannot be read, or is not such a document.
    """
    fields = _fields(path, read_text(path, "a noise model", most=16 * MIB))
    try:
        return _adapter(kind).validate_python(fields)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"])) or "document"
        message = first["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
        raise DataError(path, f"{key}: found {_shown(first['input'])}", message) from error


def _fields(path: Path, text: str) -> dict[str, object]:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:  # thousands of brackets
        raise DataError(path, f"is not JSON ({error})", "a noise model, as `tracknoise noise fit` writes it") from error
    if not isinstance(document, dict) or document.get(_KEY) != FORMAT:
        found = document.get(_KEY) if isinstance(document, dict) else None
        raise DataError(path, f"format is {found!r}", f"{FORMAT!r}")
    return {name: value for name, value in document.items() if name != _KEY}


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:80]}..."
