"""Random damage to the bytes of a file, by a seeded generator."""

import re
import struct
import zlib
from collections.abc import Callable, Sequence
from random import Random

LONGEST = 1 << 20
"""Mutated inputs are cut to this many bytes."""
_WHOLE = (0, 1, -1, 2, 7, 8, 127, 128, 255, 256, 32767, 32768, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 10**20)
_NUMBERS = (
    *map(str, _WHOLE),
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e309", "1e-320", "1e-170", "0.0", "-0.0", "1_000", "0x10", "1e400"),
    *("9" * 400, "9" * 5000, "0." + "0" * 400 + "1", "\u0663", "1,5", "--1", ""),
)
_TEXTS = (
    *("\0", "\x1b[31m", "\r", "\n", "\u2028", "\x7f", "\ufeff", "\u202e", "\U0001f600", "e\u0301", "\x85", "\t"),
    *(
        "{scene}",
        "{scene.__class__}",
        "{scene:d}",
        "{0}",
        "{",
        "}",
        "%s",
        "../../../etc/passwd",
        "/dev/zero",
        "/dev/stdin",
    ),
    *(
        "true",
        "null",
        "NaN",
        "[]",
        "{}",
        '""',
        "'",
        '"',
        "#",
        "&amp;",
        "&lol;",
        "<!--",
        "<![CDATA[",
        "model://",
        "a" * 5000,
    ),
)
_BYTES = (
    b"\xff",
    b"\xfe\xff",
    b"\xff\xfe",
    b"\xc0\x80",
    b"\xed\xa0\x80",
    b"\0\0\0\0",
    b"PK\x03\x04",
    b"\x89HDF\r\n\x1a\n",
)
_NESTS = (b"[", b"{", b"(", b"<a>", b'{"a":', b"a.", b"[[", b"<model name='m'>", b"<node>", b"((", b"a={")
_PACKED = [
    *(struct.pack(order + kind, value) for order in "<>" for kind, value in (("I", 2**31), ("I", 2**32 - 1), ("I", 0))),
    *(struct.pack(order + "d", value) for order in "<>" for value in (float("nan"), float("inf"), 1e-320, 1e308)),
    *(struct.pack(order + "f", value) for order in "<>" for value in (float("nan"), float("inf"), 1e-42, 3e38)),
    *(struct.pack("<Q", value) for value in (2**63, 2**64 - 1, 2**40)),
    *(bytes([value]) for value in (0, 1, 0x7F, 0x80, 0xFF)),
]
_NUMBER = re.compile(rb"(?<![\w.])-?\d[\d.]*(?:[eE][-+]?\d+)?")

Mutation = Callable[[bytes, Random, Sequence[bytes]], bytes]


def mutated(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """The content of a file, damaged in one to four ways.

    Parameters
    ----------
    content
        A valid file.
    rng
        Decides everything.
    others
        Valid files of the same kind, of which pieces can be taken.
    """
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 4))):
        content = rng.choice(_MUTATIONS)(content, rng, others)[:LONGEST]
    return content


def with_png_checksums(content: bytes) -> bytes:
    """The same PNG file with the checksum of each chunk made right, so that what is inside reaches the decoder."""
    if not content.startswith(b"\x89PNG\r\n\x1a\n"):
        return content
    fixed, start = bytearray(content), 8
    while start + 12 <= len(fixed):
        end = start + 8 + int.from_bytes(fixed[start : start + 4], "big")
        if end + 4 > len(fixed):
            break
        fixed[end : end + 4] = zlib.crc32(fixed[start + 4 : end]).to_bytes(4, "big")
        start = end + 4
    return bytes(fixed)


def _flip_bit(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    if not content:
        return b"\x01"
    at = rng.randrange(len(content))
    return content[:at] + bytes([content[at] ^ 1 << rng.randrange(8)]) + content[at + 1 :]


def _set_byte(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[:at] + rng.randbytes(1) + content[at + 1 :]


def _set_header_byte(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    at = rng.randrange(min(len(content), 128) + 1)
    return content[:at] + rng.choice(_PACKED) + content[at + 1 :]


def _overwrite(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    at, value = rng.randrange(len(content) + 1), rng.choice(_PACKED)
    return content[:at] + value + content[at + len(value) :]


def _truncate(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def _remove(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    start, stop = _span(content, rng)
    return content[:start] + content[stop:]


def _duplicate(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    start, stop = _span(content, rng)
    return content[:stop] + content[start:stop] * rng.choice((1, 1, 2, 30)) + content[stop:]


def _splice(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    other = rng.choice(others) if others else content
    start, stop = _span(other, rng)
    at, end = _span(content, rng)
    return content[:at] + other[start:stop] + content[end:]


def _swap_lines(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    lines = content.split(b"\n")
    first, second = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[first], lines[second] = lines[second], lines[first]
    return b"\n".join(lines)


def _edit_number(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    matches = list(_NUMBER.finditer(content))
    if not matches:
        return _overwrite(content, rng, others)
    chosen = rng.choice(matches)
    return content[: chosen.start()] + rng.choice(_NUMBERS).encode() + content[chosen.end() :]


def _insert_text(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[:at] + rng.choice((*_BYTES, *(text.encode() for text in _TEXTS))) + content[at:]


def _nest(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[:at] + rng.choice(_NESTS) * rng.choice((10, 100, 900, 20_000)) + content[at:]


def _repeat(content: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """One character or short piece, very often: what makes a quadratic parser slow."""
    at = rng.randrange(len(content) + 1)
    piece = rng.choice(
        (b" ", b"\n", b"\t", b"0", b"1 ", b"/", b".", b"-", b'"', b"#", content[at : at + rng.randrange(1, 6)])
    )
    return content[:at] + piece * rng.choice((100, 5_000, 100_000)) + content[at:]


def _span(content: bytes, rng: Random) -> tuple[int, int]:
    start = rng.randrange(len(content) + 1)
    return start, min(len(content), start + rng.choice((1, 2, 4, 16, 64, 1024)))


_MUTATIONS: tuple[Mutation, ...] = (
    *(_flip_bit, _flip_bit, _set_byte, _set_byte, _set_header_byte, _overwrite, _overwrite, _truncate, _remove),
    *(
        _duplicate,
        _splice,
        _swap_lines,
        _edit_number,
        _edit_number,
        _edit_number,
        _insert_text,
        _insert_text,
        _nest,
        _repeat,
    ),
)
