"""STL meshes, binary and text."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_bytes
from tracknoise.foreign.parsing import damage_reported
from tracknoise.printable import counted
from tracknoise.simulation.sdf.library import Library
from tracknoise.simulation.sdf.part import Part
from tracknoise.simulation.sdf.remarks import Remarks

_HEADER_BYTES = 84
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def read_stl(path: Path, library: Library, remarks: Remarks) -> list[Part]:
    """Triangles of an STL file, which has no textures.

    Parameters
    ----------
    path
        The file.
    library
        Not used.
    remarks
        Collects what cannot be read.
    """
    try:
        corners = _corners(path, read_bytes(path, "an STL file"))
    except DataError as error:
        remarks.add(path, f"damaged STL file ({error.found}); it is left out")
        return []
    if not len(corners):
        remarks.add(path, "STL file without triangles")
    return [Part(corners, None)]


def _corners(path: Path, content: bytes) -> NDArray[np.float64]:
    """(t, 3, 3) float64: a binary file is one whose length fits its count of facets."""
    count = int.from_bytes(content[_HEADER_BYTES - 4 : _HEADER_BYTES], "little")
    if len(content) == _HEADER_BYTES + count * _FACET.itemsize:
        facets = np.frombuffer(content, _FACET, offset=_HEADER_BYTES)
        return facets["corners"].astype(np.float64)
    return _text_corners(path, content.decode(errors="replace"))


def _text_corners(path: Path, text: str) -> NDArray[np.float64]:
    """(t, 3, 3) float64: the numbers of all lines that begin with ``vertex``."""
    lines = (line.split() for line in text.lower().splitlines())
    with damage_reported(path, "a vertex that is not three numbers", "an STL file"):
        vertices = [[float(x), float(y), float(z)] for key, x, y, z in filter(_is_vertex, lines)]
    if len(vertices) % 3:
        raise DataError(path, counted(len(vertices), "vertex", "vertices"), "three for each triangle")
    return np.array(vertices, np.float64).reshape(-1, 3, 3)


def _is_vertex(words: list[str]) -> bool:
    return words[:1] == ["vertex"]
