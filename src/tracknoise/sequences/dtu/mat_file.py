"""Arrays in MATLAB files of version 4 to 7.2, read without trusting a single byte of them.

Every size is compared with the bytes that are there before anything is allocated or read. A damaged file is therefore
an error, and can neither end the process nor make it wait.
"""

import math
import struct
import zlib
from collections.abc import Container, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_TEXT_BYTES, _HEADER_BYTES = 124, 128
_MAX_BYTES = 1 << 29
"""Largest array that is read, bytes: more than ten times the largest scan of the data set."""
_START_BYTES = 4096
"""Enough of a compressed array for its name, bytes."""
_MAX_DIMENSIONS = 32
_COMPRESSED, _MATRIX, _INT8, _INT32, _UINT32 = 15, 14, 1, 5, 6
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_OLD_TYPES = ("f8", "f4", "i4", "i2", "u2", "u1")
_NAMED, _NUMERIC = range(1, 16), range(6, 16)
"""Classes of arrays: objects and function handles, which come after, have no name where others have one."""
_COMPLEX = 0x800


class MatFileError(ValueError):
    """A MATLAB file is damaged."""


class UnsupportedMatFileError(ValueError):
    """A MATLAB file is of version 7.3, which is another format."""


class _NotNumeric:
    """Stands for a variable that is no array of real numbers."""


Variable = NDArray[np.generic] | _NotNumeric
NOT_NUMERIC = _NotNumeric()


def parse_mat(content: bytes, names: Container[str]) -> dict[str, Variable]:
    """Read those variables of a MATLAB file that it has.

    Parameters
    ----------
    content
        All of the file.
    names
        Which variables. Others are skipped.

    Returns
    -------
    dict
        Arrays by name, with the shape and the numeric type that they have in the file; `NOT_NUMERIC` for a variable
        that is no array of real numbers.

    Raises
    ------
    MatFileError
        If the file is damaged, or not a MATLAB file.
    UnsupportedMatFileError
        If it is of version 7.3.
    """
    if 0 in content[:4]:
        return {name: value for name, value in _old_variables(content, names) if name in names}
    order = _byte_order(content)
    found = {}
    for kind, data in _elements(memoryview(content)[_HEADER_BYTES:], order):
        named = _variable(kind, data, order, names)
        if named:
            found[named[0]] = named[1]
    return found


def _byte_order(content: bytes) -> str:
    """``<`` or ``>``, from the header of a file of version 5 to 7.2."""
    mark = content[_TEXT_BYTES + 2 : _HEADER_BYTES]
    if mark not in (b"IM", b"MI"):
        raise MatFileError("no header")
    order = "<" if mark == b"IM" else ">"
    major = struct.unpack_from(f"{order}H", content, _TEXT_BYTES)[0] >> 8
    if major == 2:
        raise UnsupportedMatFileError
    if major != 1:
        raise MatFileError("an unknown version")
    return order


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Type and data of each element. Padding to whole 8 bytes follows all but compressed elements."""
    at = 0
    while at < len(data):
        kind, content, size = _element(data[at:], order)
        yield kind, content
        at += size


def _element(data: memoryview, order: str) -> tuple[int, memoryview, int]:
    """Type, data, and size with tag and padding of the first element."""
    if len(data) < 8:
        raise MatFileError("half of a tag")
    kind, size = struct.unpack_from(f"{order}II", data)
    if kind >> 16:  # a small element: type, size and data in 8 bytes
        kind, size, start, whole = kind & 0xFFFF, kind >> 16, 4, 8
        limit = 4
    else:
        start, limit = 8, len(data) - 8
        whole = 8 + size + (0 if kind == _COMPRESSED else -size % 8)
    if size > limit:
        raise MatFileError("an element that is longer than what contains it")
    return kind, data[start : start + size], whole


@dataclass(frozen=True, slots=True)
class _Matrix:
    """The header of an array, and where its numbers start."""

    name: str
    shape: tuple[int, ...]
    numeric: bool
    start: int


def _variable(kind: int, data: memoryview, order: str, names: Container[str]) -> tuple[str, Variable] | None:
    """Name and value of a variable; None if it is not one of `names`."""
    if kind not in (_COMPRESSED, _MATRIX):
        return None
    start = _inflated(data, _START_BYTES, order) if kind == _COMPRESSED else data
    if _class(start, order) not in _NAMED or _matrix(start, order).name not in names:
        return None
    whole = _inflated(data, _MAX_BYTES, order, checked=True) if kind == _COMPRESSED else data
    matrix = _matrix(whole, order)
    return matrix.name, _numbers(whole, matrix, order) if matrix.numeric else NOT_NUMERIC


def _inflated(data: memoryview, most: int, order: str, *, checked: bool = False) -> memoryview:
    """The first bytes of a compressed array, without its tag; with `checked`, all bytes, which must be undamaged."""
    stream = zlib.decompressobj()
    try:
        tag = stream.decompress(data, 8)
        if len(tag) < 8:
            raise MatFileError("half of a tag")
        kind, size = struct.unpack(f"{order}II", tag)
        plain = stream.decompress(stream.unconsumed_tail, min(size, most) + 1)
    except zlib.error as error:
        raise MatFileError(str(error)) from error
    if kind != _MATRIX:
        raise MatFileError("compressed data that are not an array")
    if checked and (not stream.eof or len(plain) != size):
        raise MatFileError("compressed data that are damaged, cut off, or too large")
    return memoryview(plain)


def _flags(data: memoryview, order: str) -> tuple[int, int]:
    """Flags of an array, and where its sizes start."""
    kind, flags, size = _element(data, order)
    if kind != _UINT32 or len(flags) != 8:
        raise MatFileError("an array without flags")
    return struct.unpack_from(f"{order}I", flags)[0], size


def _class(data: memoryview, order: str) -> int:
    return _flags(data, order)[0] & 0xFF


def _matrix(data: memoryview, order: str) -> _Matrix:
    flags, at = _flags(data, order)
    kind, sizes, size = _element(data[at:], order)
    at += size
    if kind != _INT32 or len(sizes) % 4 or not 2 <= len(sizes) // 4 <= _MAX_DIMENSIONS:
        raise MatFileError("an array without sizes")
    shape = tuple(np.frombuffer(sizes, f"{order}i4").tolist())
    kind, name, size = _element(data[at:], order)
    if kind != _INT8:
        raise MatFileError("an array without a name")
    numeric = flags & 0xFF in _NUMERIC and not flags & _COMPLEX
    return _Matrix(bytes(name).decode("latin-1"), shape, numeric, at + size)


def _numbers(data: memoryview, matrix: _Matrix, order: str) -> NDArray[np.generic]:
    kind, numbers, _ = _element(data[matrix.start :], order)
    return _array(numbers, _TYPES.get(kind), order, matrix.shape)


def _array(numbers: memoryview, kind: str | None, order: str, shape: tuple[int, ...]) -> NDArray[np.generic]:
    """An array from its numbers, which MATLAB orders by columns."""
    if kind is None or min(shape) < 0 or len(numbers) != math.prod(shape) * int(kind[1]):
        raise MatFileError("an array whose numbers are not as many as its sizes say")
    try:
        return np.frombuffer(numbers, f"{order}{kind}").reshape(shape, order="F")
    except ValueError as error:  # no numbers, but sizes beyond what an array can have
        raise MatFileError(str(error)) from error


def _old_variables(content: bytes, names: Container[str]) -> Iterator[tuple[str, Variable]]:
    """Variables of a file of version 4: a header of five numbers, the name and the numbers, one after another."""
    data, at = memoryview(content), 0
    order = "<" if len(content) >= 4 and struct.unpack_from("<I", content)[0] < 5000 else ">"
    while at < len(data):
        if len(data) - at < 20:
            raise MatFileError("half of a header")
        kind, rows, columns, imaginary, letters = struct.unpack_from(f"{order}5I", data, at)
        thousands, rest = divmod(kind, 1000)
        code, form = rest // 10 % 10, rest % 10
        if thousands != (order == ">") or rest >= 100 or code >= len(_OLD_TYPES) or form > 2 or imaginary > 1:
            raise MatFileError("an unknown type of array")
        at += 20
        size = rows * columns * int(_OLD_TYPES[code][1])
        if letters > len(data) - at or size * (1 + imaginary) > len(data) - at - letters:
            raise MatFileError("an array that is longer than the file")
        name = bytes(data[at : at + letters]).rstrip(b"\0").decode("latin-1")
        numbers = data[at + letters : at + letters + size]
        at += letters + size * (1 + imaginary)
        if name in names:
            real = form == 0 and not imaginary
            yield name, _array(numbers, _OLD_TYPES[code], order, (rows, columns)) if real else NOT_NUMERIC
