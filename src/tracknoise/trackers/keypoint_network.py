"""Keypoints that a network finds, from an ONNX file of your own, on the processor."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, TrackerError
from tracknoise.foreign_files import MOST_PIXELS
from tracknoise.text import counted
from tracknoise.trackers.features import are_symmetric
from tracknoise.trackers.onnx_files import Network, described, open_network, require_file
from tracknoise.trackers.tracker import are_impossible

_WHAT = "an ONNX network of keypoints"
_WORK_PER_PIXEL = 128
"""As `Network.run` has it."""
_SHOWN = 4


class NetworkUnits(StrEnum):
    """What positions of a network are.

    pixels: of its input, whose first pixel has the centre (0, 0). minus-one-to-one: from the centre of the first pixel
    of its input to that of the last.
    """

    pixels = "pixels"
    minus_one_to_one = "minus-one-to-one"


@dataclass(frozen=True, slots=True, eq=False)
class NetworkKeypoints:
    """What a network found in an image, strongest first."""

    uv: NDArray[np.float64]  # (n, 2): positions in the image, px
    score: NDArray[np.float32]  # (n,): by the network; 1 where it gives none
    descriptors: NDArray[np.float32] | None  # (n, d): none if the network has none
    # (n, 3): Of the positions, px^2: uu, uv and vv. None if the network predicts none.
    covariances: NDArray[np.float32] | None

    def chosen(self, rows: NDArray[np.intp] | slice) -> "NetworkKeypoints":
        """Some of them."""
        descriptors, covariances = (
            None if values is None else values[rows] for values in (self.descriptors, self.covariances)
        )
        return NetworkKeypoints(self.uv[rows], self.score[rows], descriptors, covariances)

    def at_least(self, score: float) -> "NetworkKeypoints":
        """Those with this score or a higher one."""
        return self.chosen(slice(int(np.count_nonzero(self.score >= score))))


def require_network(path: Path) -> None:
    """Check that a network can be used."""
    require_file(path, f"{_WHAT}, such as SuperPoint, DISK or ALIKED exported for LightGlue")
    _open(path)


def find_keypoints(image: NDArray[np.uint8], path: Path, units: NetworkUnits) -> NetworkKeypoints:
    """Run a network on an image (height, width), which is stretched to the size of its input, if it has one."""
    opened = _open(path)
    size = opened.input_size or image.shape[::-1]
    shown = image if size == image.shape[::-1] else cv2.resize(image, size, interpolation=cv2.INTER_LINEAR)
    planes = np.repeat((shown.astype(np.float32) / 255)[None, None], opened.channels, axis=1)
    outputs = opened.network.run(
        [*opened.outputs.values()],
        {opened.network.inputs[0].name: planes},
        work=_WORK_PER_PIXEL * size[0] * size[1],
        on=f"images of {size[0]} x {size[1]} px",
        expected="keypoints",
    )
    return _strongest_first(path, dict(zip(opened.outputs, outputs, strict=True)), size, image.shape[::-1], units)


@dataclass(frozen=True, slots=True, eq=False)
class _Keypoints:
    """A network of keypoints: its input, and its names of what it finds: keypoints and others, as it has them."""

    network: Network
    channels: int
    input_size: tuple[int, int] | None
    outputs: Mapping[str, str]


def _open(path: Path) -> _Keypoints:
    network = open_network(path, _WHAT)
    inputs, names = network.inputs, [output.name for output in network.outputs]
    shapes = [port.shape for port in inputs]
    if len(inputs) != 1 or len(shapes[0]) != 4 or inputs[0].type != "tensor(float)" or shapes[0][1] not in (1, 3):
        raise DataError(
            path, f"inputs {described(inputs)}", "one input of floats with the shape (1, 1 or 3, height, width)"
        )
    parts = (
        (part, name) for part in ("keypoints", "scores", "descriptors", "covariances") for name in names if part in name
    )
    outputs = dict(parts)
    if "keypoints" not in outputs:
        raise DataError(path, f"outputs {', '.join(names)}", "one whose name contains keypoints")
    _, channels, height, width = shapes[0]
    size = (width, height) if isinstance(width, int) and isinstance(height, int) else None
    if size is not None and not (min(size) > 0 and size[0] * size[1] <= MOST_PIXELS):
        raise DataError(path, f"an input of {size[0]} x {size[1]} px", f"at least one pixel, at most {MOST_PIXELS}")
    return _Keypoints(network, 1 if channels == 1 else 3, size, outputs)


def _strongest_first(
    path: Path,
    outputs: Mapping[str, NDArray[Any]],
    size: tuple[int, int],
    image: tuple[int, int],
    units: NetworkUnits,
) -> NetworkKeypoints:
    """What a network returned, in pixels of the image."""
    arrays = {name: array.astype(np.float64) for name, array in outputs.items()}
    inner = {"keypoints": (2,), "descriptors": (None,), "covariances": (2, 2)}
    n = arrays["keypoints"].size // 2
    rows_of = {name: _rows(array, n, inner.get(name, ())) for name, array in arrays.items()}
    if any(array is None for array in rows_of.values()):
        shapes = ", ".join(f"{name} {array.shape}" for name, array in outputs.items())
        raise TrackerError(f"{path}: the network returned {shapes}, expected one element per keypoint: {_SHAPES}")
    uv, score, descriptors, matrices = (
        rows_of.get(name) for name in ("keypoints", "scores", "descriptors", "covariances")
    )
    assert uv is not None, "it is among the outputs"
    score = np.ones(n) if score is None else score
    scale = np.array(image) / np.array(size)
    if units is NetworkUnits.minus_one_to_one:
        uv = (uv + 1) / 2 * (np.array(size) - 1)
    uv = (uv + 0.5) * scale - 0.5
    inside = np.all((uv >= 0) & (uv <= np.array(image) - 1), axis=1) & np.isfinite(score)
    rows = np.flatnonzero(inside)[np.argsort(-score[inside], kind="stable")]
    covariances = None
    if matrices is not None:
        stretch = scale * (np.array(size) - 1) / 2 if units is NetworkUnits.minus_one_to_one else scale
        covariances = _entries(path, matrices[rows] * np.outer(stretch, stretch))
    return NetworkKeypoints(
        uv[rows],
        score[rows].astype(np.float32),
        None if descriptors is None else _finite_descriptors(path, descriptors[rows]),
        covariances,
    )


_SHAPES = "keypoints (n, 2), scores (n,), descriptors (n, d), covariances (n, 2, 2), of one image"


def _rows(array: NDArray[np.float64], n: int, inner: tuple[int | None, ...]) -> NDArray[np.float64] | None:
    """An array with a row for each of n keypoints, without leading axes of length 1; None if it is none.

    `inner`: shape of a row, where None is any length but 0. Scores may have a last axis of length 1.
    """
    if not inner and array.ndim > 1 and array.shape[-1] == 1 and n != 1:
        array = array[..., 0]
    outer = array.ndim - 1 - len(inner)
    if outer < 0 or any(length != 1 for length in array.shape[:outer]):
        return None
    rows = array.reshape(array.shape[outer:])
    shape: tuple[int, ...] = rows.shape[1:]
    lengths = [actual if wanted is None else wanted for actual, wanted in zip(shape, inner, strict=True)]
    return rows if rows.shape == (n, *lengths) and all(lengths) else None


def _finite_descriptors(path: Path, descriptors: NDArray[np.float64]) -> NDArray[np.float32]:
    narrowed: NDArray[np.float32]
    with np.errstate(over="ignore"):  # of what is refused
        narrowed = descriptors.astype(np.float32)
    _require(path, ~np.isfinite(narrowed).all(axis=1), "descriptors", descriptors, "finite numbers")
    return narrowed


def _entries(path: Path, matrices: NDArray[np.float64]) -> NDArray[np.float32]:
    """uu, uv and vv of covariances (n, 2, 2), NaN where they are not known."""
    narrowed: NDArray[np.float32]
    with np.errstate(over="ignore"):  # of what is refused
        narrowed = matrices.astype(np.float32)
    _require(
        path, np.isinf(narrowed).any(axis=(1, 2)), "covariances", matrices, "finite numbers; NaN where it is unknown"
    )
    _require(path, ~are_symmetric(matrices), "covariances", matrices, "symmetric matrices")
    impossible = are_impossible(matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1])
    _require(path, impossible, "covariances", matrices, "no negative eigenvalue")
    return narrowed.reshape(-1, 4)[:, [0, 1, 3]]


def _require(path: Path, wrong: Any, what: str, values: NDArray[np.float64], expected: str) -> None:
    """Raise TrackerError if a row is wrong, naming the first. `wrong`: (n,) bool."""
    for row in np.flatnonzero(wrong)[:1]:
        shown = np.array2string(values[row].ravel()[:_SHOWN], precision=4, separator=", ", max_line_width=1000)
        count = counted(int(np.count_nonzero(wrong)), "keypoint")
        raise TrackerError(f"{path}: the network returned {what} {shown} of {count}, expected {expected}")
