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
from tracknoise.foreign_files import read_bytes
from tracknoise.trackers.onnx_files import described, run_network, session_of

_WHAT = "an ONNX network of keypoints"


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
        descriptors, covariances = (None if one is None else one[rows] for one in (self.descriptors, self.covariances))
        return NetworkKeypoints(self.uv[rows], self.score[rows], descriptors, covariances)

    def at_least(self, score: float) -> "NetworkKeypoints":
        """Those with this score or a higher one."""
        return self.chosen(slice(int(np.count_nonzero(self.score >= score))))


def require_network(path: Path) -> None:
    """Check that a network can be used."""
    read_bytes(
        path, f"{_WHAT}, such as SuperPoint, DISK or ALIKED exported for LightGlue"
    )  # a run counts it among its files
    _open(path)


def find_keypoints(image: NDArray[np.uint8], path: Path, units: NetworkUnits) -> NetworkKeypoints:
    """Run a network on an image (height, width), which is stretched to the size of its input, if it has one."""
    network = _open(path)
    size = network.input_size or image.shape[::-1]
    shown = image if size == image.shape[::-1] else cv2.resize(image, size, interpolation=cv2.INTER_LINEAR)
    planes = np.repeat((shown.astype(np.float32) / 255)[None, None], network.channels, axis=1)
    found = run_network(
        path,
        network.session,
        [*network.outputs.values()],
        {network.input_name: planes},
        on=f"images of {size[0]} x {size[1]} px",
        expected="keypoints",
    )
    return _strongest_first(path, dict(zip(network.outputs, found, strict=True)), size, image.shape[::-1], units)


@dataclass(frozen=True, slots=True, eq=False)
class _Network:
    """An open network: its input, and its names of keypoints, scores, descriptors and covariances, as it has them."""

    session: Any
    input_name: str
    channels: int
    input_size: tuple[int, int] | None
    outputs: Mapping[str, str]


def _open(path: Path) -> _Network:
    session = session_of(path, _WHAT)
    inputs, names = session.get_inputs(), [output.name for output in session.get_outputs()]
    shapes = [list(one.shape) for one in inputs]
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
    height, width = shapes[0][2:]
    known = (width, height) if isinstance(width, int) and isinstance(height, int) else None
    return _Network(session, inputs[0].name, shapes[0][1], known, outputs)


def _strongest_first(
    path: Path, found: Mapping[str, Any], size: tuple[int, int], image: tuple[int, int], units: NetworkUnits
) -> NetworkKeypoints:
    """What a network returned, in pixels of the image."""
    uv = np.asarray(found["keypoints"], dtype=np.float64).reshape(-1, 2)
    score = np.asarray(found.get("scores", np.ones(len(uv))), dtype=np.float32).reshape(-1)
    descriptors = None
    if "descriptors" in found:
        descriptors = np.asarray(found["descriptors"], dtype=np.float32)
        descriptors = descriptors.reshape(-1, descriptors.shape[-1])
    matrices = np.asarray(found["covariances"], dtype=np.float64) if "covariances" in found else None
    lengths = {len(score), len(uv if descriptors is None else descriptors)}
    if lengths != {len(uv)} or (matrices is not None and matrices.shape[-3:] != (len(uv), 2, 2)):
        shapes = ", ".join(f"{name} {np.shape(one)}" for name, one in found.items())
        raise TrackerError(f"{path}: the network returned {shapes}, expected one element per keypoint")
    scale = np.array(image) / np.array(size)
    if units is NetworkUnits.minus_one_to_one:
        uv = (uv + 1) / 2 * (np.array(size) - 1)
    uv = (uv + 0.5) * scale - 0.5
    covariances = None
    if matrices is not None:
        stretch = scale * (np.array(size) - 1) / 2 if units is NetworkUnits.minus_one_to_one else scale
        entries = (matrices * np.outer(stretch, stretch)).reshape(-1, 4)
        covariances = entries[:, [0, 1, 3]].astype(np.float32)
    inside = np.all((uv >= 0) & (uv <= np.array(image) - 1), axis=1) & np.isfinite(score)
    rows = np.flatnonzero(inside)[np.argsort(-score[inside], kind="stable")]
    return NetworkKeypoints(uv, score, descriptors, covariances).chosen(rows)
