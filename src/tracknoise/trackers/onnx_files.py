"""Networks in ONNX files of the user, opened on the processor."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from tracknoise.exceptions import DataError, TrackerError, first_line, missing_extra


def session_of(path: Path, what: str) -> Any:
    """Session of onnxruntime with a network, opened once for each version of its file."""
    status = path.stat()
    return _opened(path, what, status.st_size, status.st_mtime_ns)


def described(values: Sequence[Any]) -> str:
    """Inputs or outputs of a session in a few words: names, types and shapes."""
    return ", ".join(f"{one.name} {one.type} {list(one.shape)}" for one in values)


def run_network(
    path: Path, session: Any, outputs: Sequence[str], inputs: Mapping[str, Any], *, on: str, expected: str
) -> list[Any]:
    """Outputs of a network, by their names."""
    try:
        found: list[Any] = session.run([*outputs], {**inputs})
    except Exception as error:  # of its own types, which depend on the build
        raise TrackerError(f"{path}: the network fails on {on} ({first_line(error)}), expected {expected}") from error
    return found


@lru_cache(maxsize=8)
def _opened(path: Path, what: str, size: int, mtime_ns: int) -> Any:
    try:
        import onnxruntime
    except ImportError as error:
        raise missing_extra(f"{path}: {what}", "learned") from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # so that results do not depend on their number
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # of its own types, which depend on the build
        raise DataError(path, f"cannot be opened ({first_line(error)})", what) from error
