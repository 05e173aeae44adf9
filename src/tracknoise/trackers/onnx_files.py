"""Networks in ONNX files of the user, run on the processor, in a process of its own with limits of time and memory.

A network is a program: it can loop for years, or fill the memory, already while it is opened. Its tensors may lie in
files beside its own, which the library opens by itself; they are found here, so that a run notes them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, TrackerError, first_line, missing_extra
from tracknoise.foreign_files import MIB, is_regular_file, read_bytes
from tracknoise.opened_files import note_stated
from tracknoise.parsing_child import LostError, call_in_child, limits_of

_MOST_OUTPUT_BYTES = 512 * MIB
_IT = "it"

Versions = tuple[tuple[str, int, int], ...]
"""Name, size and time of the last change, nanoseconds, of each file of a network."""


@dataclass(frozen=True, slots=True)
class Port:
    """An input or an output of a network."""

    name: str
    type: str  # such as tensor(float)
    shape: tuple[int | str | None, ...]


@dataclass(frozen=True, slots=True)
class Network:
    """A network that can be run."""

    path: Path
    versions: Versions
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]

    def run(
        self, outputs: Sequence[str], inputs: Mapping[str, NDArray[Any]], *, work: int, on: str, expected: str
    ) -> list[NDArray[Any]]:
        """Some outputs, which are arrays of numbers.

        Parameters
        ----------
        outputs
            Their names.
        inputs
            Arrays by name.
        work
            Bytes of a file that would take as long to parse: it determines how much time and memory the network has.
        on, expected
            What it is run on, and what it should give, for errors.

        Raises
        ------
        TrackerError
            If it fails, takes too long, needs too much memory, or gives anything else.
        """
        size = work + sum(size for _, size, _ in self.versions)
        try:
            return call_in_child(
                _outputs, str(self.path), self.versions, [*outputs], {**inputs}, on, expected, size=size, who=_IT
            )
        except LostError as error:
            cpu_s, memory = limits_of(size)
            within = f"{expected} within {cpu_s} s of processor time and {memory / 2**30:.1f} GiB"
            raise TrackerError(f"{self.path}: the network fails on {on} ({error}), expected {within}") from error


def require_file(path: Path, what: str) -> None:
    """Check that there is a file of a network, and let a run count it, and those of its tensors."""
    content = read_bytes(path, what)
    for name in dict.fromkeys(_external_names(content)):
        note_stated(path.parent / name)


def open_network(path: Path, what: str) -> Network:
    """A network, opened once for each version of its files.

    Raises
    ------
    DataError
        If it cannot be opened, naming `what` was expected.
    SettingsError
        If the package that runs networks is not installed.
    """
    status = path.stat()
    names = [path.name, *_external_of(path, status.st_size, status.st_mtime_ns)]
    states = [(name, (path.parent / name).stat()) for name in names if is_regular_file(path.parent / name)]
    return _opened(path, tuple((name, state.st_size, state.st_mtime_ns) for name, state in states), what)


def described(values: Sequence[Port]) -> str:
    """Inputs or outputs of a network in a few words: names, types and shapes."""
    return ", ".join(f"{port.name} {port.type} {list(port.shape)}" for port in values)


@lru_cache(maxsize=8)
def _opened(path: Path, versions: Versions, what: str) -> Network:
    if find_spec("onnxruntime") is None:
        raise missing_extra(f"{path}: {what}", "learned")
    size = sum(size for _, size, _ in versions)
    try:
        inputs, outputs = call_in_child(_ports, str(path), versions, size=size, who=_IT)
    except LostError as error:
        raise DataError(path, f"cannot be opened ({error})", what) from error
    return Network(path, versions, inputs, outputs)


def _ports(path: str, versions: Versions) -> tuple[tuple[Port, ...], tuple[Port, ...]]:
    """Inputs and outputs of a network, in the process that runs it."""
    session = _session(path, versions)
    inputs, outputs = (
        tuple(Port(port.name, port.type, tuple(port.shape)) for port in ports)
        for ports in (session.get_inputs(), session.get_outputs())
    )
    return inputs, outputs


def _outputs(
    path: str, versions: Versions, outputs: list[str], inputs: dict[str, NDArray[Any]], on: str, expected: str
) -> list[NDArray[Any]]:
    """Outputs of a network, in the process that runs it."""
    try:
        values = _session(path, versions).run(outputs, inputs)
    except Exception as error:  # of its own types, which depend on the build
        raise TrackerError(f"{path}: the network fails on {on} ({first_line(error)}), expected {expected}") from error
    for name, value in zip(outputs, values, strict=True):
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
            what = f"{value.dtype} values" if isinstance(value, np.ndarray) else type(value).__name__
            raise TrackerError(f"{path}: the network returned {name} of {what}, expected an array of numbers")
    size = sum(value.nbytes for value in values)
    if size > _MOST_OUTPUT_BYTES:
        shapes = ", ".join(f"{name} {value.shape}" for name, value in zip(outputs, values, strict=True))
        most = f"{expected} of at most {_MOST_OUTPUT_BYTES} bytes"
        raise TrackerError(f"{path}: the network returned {shapes}, {size} bytes, on {on}, expected {most}")
    arrays: list[NDArray[Any]] = values
    return arrays


@lru_cache(maxsize=8)
def _session(path: str, versions: Versions) -> Any:
    """The session of the library with the network."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # so that results do not depend on their number
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])


@lru_cache(maxsize=8)
def _external_of(path: Path, size: int, mtime_ns: int) -> tuple[str, ...]:
    """Names of the files of tensors of a version of a file."""
    return tuple(dict.fromkeys(_external_names(read_bytes(path, "an ONNX network"))))


_MODEL, _GRAPH, _NODE, _ATTRIBUTE, _SPARSE, _FUNCTION, _TENSOR, _ENTRY = range(8)
_MESSAGES: Mapping[int, Mapping[int, int]] = {
    _MODEL: {7: _GRAPH, 25: _FUNCTION},
    _GRAPH: {1: _NODE, 5: _TENSOR, 15: _SPARSE},
    _FUNCTION: {7: _NODE, 11: _ATTRIBUTE},
    _NODE: {5: _ATTRIBUTE},
    _ATTRIBUTE: {5: _TENSOR, 6: _GRAPH, 10: _TENSOR, 11: _GRAPH, 22: _SPARSE, 23: _SPARSE},
    _SPARSE: {1: _TENSOR, 2: _TENSOR},
    _TENSOR: {13: _ENTRY},
}
"""Messages of ``onnx.proto`` (of ONNX 1.17) that hold tensors: the kind of the message in each of their fields."""
_VARINT, _FIXED_64, _BYTES, _FIXED_32 = 0, 1, 2, 5
_KEY, _VALUE = 1, 2


def _external_names(content: bytes) -> Iterator[str]:
    """Files of tensors that a network names, from its folder; as far as it can be read: the library says what is wrong.

    Only the lengths of fields are looked at, and the fields that lead to a tensor.
    """
    left = [(memoryview(content), _MODEL)]
    while left:
        message, kind = left.pop()
        if kind == _ENTRY:
            entry = dict(_fields(message))
            if entry.get(_KEY, b"") == b"location":
                yield bytes(entry.get(_VALUE, b"")).decode(errors="surrogateescape")
            continue
        left += [(inner, _MESSAGES[kind][number]) for number, inner in _fields(message) if number in _MESSAGES[kind]]


def _fields(message: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Number and content of each field that has a length, up to the first that is damaged."""
    offset = 0
    while offset < len(message):
        key, offset = _number(message, offset)
        kind = key & 7
        if kind == _BYTES:
            length, offset = _number(message, offset)
            if offset + length > len(message):
                return
            yield key >> 3, message[offset : offset + length]
            offset += length
        elif kind == _VARINT:
            _, offset = _number(message, offset)
        elif kind in (_FIXED_64, _FIXED_32):
            offset += 8 if kind == _FIXED_64 else 4
        else:
            return


def _number(message: memoryview, offset: int) -> tuple[int, int]:
    """A number of seven bits a byte, and where it ends."""
    number = shift = 0
    while offset < len(message):
        byte = message[offset]
        number |= (byte & 127) << shift
        offset, shift = offset + 1, shift + 7
        if byte < 128:
            break
    return number, offset
