"""The XML of OpenCV's FileStorage, as the same keys and values that its YAML has."""

from pathlib import Path
from typing import Any

from tracknoise.exceptions import DataError
from tracknoise.foreign.xml_file import Element, read_xml

_ROOT = "opencv_storage"
_MOST_VALUES = 100_000


def read_opencv_xml(path: Path) -> dict[str, Any]:
    """Keys and values of such a file: numbers, texts, lists of numbers, and matrices as rows, columns and data.

    Raises
    ------
    DataError
        If it cannot be read, or is other XML.
    """
    root = read_xml(path)
    if root.tag != _ROOT:
        raise DataError(path, f"XML of <{root.tag}>", f"<{_ROOT}>, as OpenCV writes it")
    return {child.tag: _value(child) for child in root}


def _value(element: Element) -> Any:
    """A matrix's parts by name; otherwise one word, or a list of several."""
    if len(element):
        return {child.tag: _words(child) for child in element}
    words = _words(element)
    return words[0] if len(words) == 1 else words


def _words(element: Element) -> list[float | int | str]:
    return [_word(word) for word in (element.text or "").split()[:_MOST_VALUES]]


def _word(word: str) -> float | int | str:
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word
