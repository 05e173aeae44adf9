"""PDF files that depend on what they show alone.

The library that draws them lists fonts and other resources in random order, and numbers objects accordingly. Here the
entries of every dictionary of resources are sorted, and objects are numbered in the order in which they are first
referred to.
"""

import re
from collections.abc import Iterator, Mapping

_OBJECT = re.compile(rb"(\d+) 0 obj\n")
_LENGTH = re.compile(rb"/Length (\d+)")
_REFERENCE = re.compile(rb"\b(\d+) 0 R\b")
_RESOURCES = re.compile(rb"(?:^ +/[a-zA-Z]+\d+ \d+ 0 R\n){2,}", re.MULTILINE)
_STREAM, _END = b"\nstream\n", b"\nendobj\n"


def canonical_pdf(content: bytes) -> bytes:
    """Write the objects of a PDF file in an order that depends on their content alone.

    Parameters
    ----------
    content
        A file as ``vl_convert.svg_to_pdf`` returns it: uncompressed objects, one table of references.

    Returns
    -------
    bytes
        A file that shows the same.
    """
    head, body, trailer = _parts(content)
    objects = {number: (_in_order(described), stream) for number, described, stream in _objects(body)}
    numbers = _numbers(trailer, objects)
    written, places = head, []
    for old, new in numbers.items():
        described, stream = objects[old]
        places.append(len(written))
        written += b"%d 0 obj\n" % new + _renumbered(described, numbers) + stream + _END + b"\n"
    table = b"".join(b"%010d 00000 n \n" % place for place in places)
    start = len(written)
    written += b"xref\n0 %d\n0000000000 65535 f \n" % (len(places) + 1) + table
    written += b"trailer\n" + _sized(_renumbered(trailer, numbers), len(places) + 1)
    return written + b"startxref\n%d\n%%%%EOF" % start


def _parts(content: bytes) -> tuple[bytes, bytes, bytes]:
    """The head, the objects and the dictionary of the trailer."""
    start = int(content[content.rindex(b"startxref\n") :].split()[1])
    first = _OBJECT.search(content)
    assert first is not None
    trailer = content[content.index(b"trailer\n", start) + len(b"trailer\n") : content.rindex(b"startxref\n")]
    return content[: first.start()], content[first.start() : start], trailer


def _objects(body: bytes) -> Iterator[tuple[int, bytes, bytes]]:
    """Number, dictionary and stream of each object. The stream is empty where there is none."""
    place = 0
    while found := _OBJECT.search(body, place):
        end = body.index(_END, found.end())
        divider = body.find(_STREAM, found.end(), end)
        if divider < 0:
            yield int(found[1]), body[found.end() : end], b""
        else:
            described = body[found.end() : divider]
            length = _LENGTH.search(described)
            assert length is not None
            end = body.index(_END, divider + len(_STREAM) + int(length[1]))
            yield int(found[1]), described, body[divider:end]
        place = end + len(_END)


def _in_order(described: bytes) -> bytes:
    def in_order(found: re.Match[bytes]) -> bytes:
        lines = sorted(found[0].splitlines(keepends=True), key=_natural)
        return b"".join(lines)

    return _RESOURCES.sub(in_order, described)


def _natural(line: bytes) -> tuple[int, bytes]:
    return len(line.split()[0]), line


def _numbers(trailer: bytes, objects: Mapping[int, tuple[bytes, bytes]]) -> dict[int, int]:
    """New numbers by old ones, from 1, in the order in which objects are first referred to."""
    numbers: dict[int, int] = {}
    ahead = _referred(trailer)
    while ahead:
        number = ahead.pop(0)
        if number not in numbers:
            numbers[number] = len(numbers) + 1
            ahead += _referred(objects[number][0])
    return numbers


def _referred(described: bytes) -> list[int]:
    return [int(number) for number in _REFERENCE.findall(described)]


def _renumbered(described: bytes, numbers: Mapping[int, int]) -> bytes:
    return _REFERENCE.sub(lambda found: b"%d 0 R" % numbers[int(found[1])], described)


def _sized(trailer: bytes, size: int) -> bytes:
    return re.sub(rb"/Size \d+", b"/Size %d" % size, trailer)
