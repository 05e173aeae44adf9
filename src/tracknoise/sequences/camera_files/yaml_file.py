"""YAML files from unknown sources: of bounded size, depth and number of values, without objects."""

import re
from pathlib import Path
from typing import Any

import yaml

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text
from tracknoise.foreign.parsing import damage_reported

_MOST_BYTES = 1 << 18
_MOST_LEVELS, _MOST_VALUES = 16, 20_000
_OPENCV_HEADER = "%YAML:"
_TAB = re.compile(r"(?<=\S)[ ]*\t[ \t]*")
"""White space with a tab behind something: YAML allows it, and the parser does not. Indentation must have no tabs."""
_EXPECTED = "a YAML file of keys and values"


class _Loader(yaml.SafeLoader):
    """Plain values, and OpenCV's matrices as the mapping of their rows, columns and data."""


def _opencv_matrix(loader: yaml.SafeLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    return loader.construct_mapping(node, deep=True)


_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _opencv_matrix)


def read_yaml(path: Path) -> dict[str, Any]:
    """Read the first document of a YAML file, or of one that OpenCV's FileStorage wrote.

    Parameters
    ----------
    path
        The file, of at most 256 KiB; lists and mappings may nest 16 deep and have 20 000 values, aliases resolved.

    Returns
    -------
    dict
        The document's keys and values: plain lists, mappings, numbers and texts.

    Raises
    ------
    DataError
        If the file is missing, unreadable, no YAML, or its document is no mapping; the message names the line.
    """
    return parse_yaml(path, read_text(path, _EXPECTED, most=_MOST_BYTES))


def parse_yaml(path: Path, text: str) -> dict[str, Any]:
    """Parse the text of a YAML file: see `read_yaml`."""
    with damage_reported(path, "no YAML", _EXPECTED, with_reason=True):
        try:
            document = _first_document(_TAB.sub(" ", _without_opencv_header(text)))
        except yaml.MarkedYAMLError as error:
            line = 1 if error.problem_mark is None else error.problem_mark.line + 1
            raise DataError(f"{path}:{line}", f"no YAML ({error.problem})", _EXPECTED) from error
    if not isinstance(document, dict):
        raise DataError(path, "YAML without keys", _EXPECTED)
    return {str(key): value for key, value in document.items()}


def _without_opencv_header(text: str) -> str:
    """OpenCV's first line is not YAML: it has a colon in place of a space. It is left empty, so that lines keep."""
    return text.partition("\n")[2].join(("\n", "")) if text.startswith(_OPENCV_HEADER) else text


def _first_document(text: str) -> object:
    _require_bounded(text)
    loader = _Loader(text)
    try:
        document: object = loader.get_data()
    finally:
        loader.dispose()
    return document


def _require_bounded(text: str) -> None:
    """Count values, those behind an alias each time, before any is made: few lines of aliases stand for billions."""
    values, sizes = 0, dict[str, int]()
    opened: list[tuple[str | None, int]] = []
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.DocumentEndEvent):
            return
        if isinstance(event, yaml.AliasEvent):
            values += sizes.get(event.anchor or "", _MOST_VALUES)
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = opened.pop()
            sizes |= {anchor: values - before} if anchor else {}
        elif isinstance(event, yaml.NodeEvent):
            values += 1
            if isinstance(event, yaml.CollectionStartEvent):
                opened.append((event.anchor, values - 1))
        if values > _MOST_VALUES or len(opened) > _MOST_LEVELS:
            raise ValueError(f"more than {_MOST_VALUES} values or {_MOST_LEVELS} levels")
