"""Matches that a network finds between the keypoints of two images, from an ONNX file of your own, on the processor."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, TrackerError
from tracknoise.text import counted
from tracknoise.trackers.matching import Matches
from tracknoise.trackers.onnx_files import Network, described, open_network, require_file

_WHAT = "an ONNX network of matches"
_INPUTS = ("kpts0", "kpts1", "desc0", "desc1")
_OUTPUTS = ("matches0", "mscores0")
_WORK_PER_PAIR = 4
"""As `Network.run` has it: a network compares each keypoint of one image with each of the other."""
_OF_IMAGES = ("image0", "images")
"""Inputs of pipelines, which find keypoints and match them in one network."""

Keypoints = tuple[NDArray[np.float64], NDArray[np.float32]]
"""Positions (n, 2), px, and descriptors (n, d) of the keypoints of an image."""


def require_matcher(path: Path) -> None:
    """Check that a network of matches can be used."""
    require_file(path, f"{_WHAT}, such as LightGlue exported for the network of keypoints")
    _open(path)


def network_matches(
    path: Path, before: Keypoints, after: Keypoints, size: tuple[int, int], least_score: float
) -> Matches:
    """Pairs of keypoints of two images that a network matches.

    Its positions are relative to the centre of the image, in units of half of the longer side, as LightGlue has them.
    No keypoint is in two pairs: where the network has several with the same keypoint, the one with the highest score
    stays, if it is that of the other keypoint too.

    `path`: the file: see `require_matcher`; `before`, `after`: keypoints of both images: of m and of n; `size`: (width,
    height) of both images, px; `least_score`: pairs with a lower score are left out. Returns pairs with
    their scores (``match_score``).
    """
    network = _open(path)
    inputs: dict[str, NDArray[np.float32]] = {}
    for number, (uv, descriptors) in enumerate((before, after)):
        centred = (uv - np.array(size) / 2) / (max(size) / 2)
        inputs[f"kpts{number}"] = centred.astype(np.float32)[None]
        inputs[f"desc{number}"] = descriptors[None]
    counts = len(before[0]), len(after[0])
    pairs, score = np.empty((0, 2), dtype=np.intp), np.empty(0, dtype=np.float32)
    if all(counts):
        _require_length(network, after[1].shape[1])
        on = f"{counted(counts[0], 'keypoint')} and {counts[1]}"
        work = _WORK_PER_PAIR * counts[0] * counts[1]
        pairs, score = _pairs(path, network.run(_OUTPUTS, inputs, work=work, on=on, expected="matches"), counts)
    kept = np.flatnonzero((score >= least_score) & _is_best(pairs[:, 0], score) & _is_best(pairs[:, 1], score))
    kept = kept[np.argsort(pairs[kept, 0])]
    return Matches(pairs[kept, 0], pairs[kept, 1], {"match_score": score[kept]})


def _open(path: Path) -> Network:
    network = open_network(path, _WHAT)
    inputs, outputs = network.inputs, network.outputs
    names = {port.name for port in inputs}
    expected = f"inputs {', '.join(_INPUTS)} of floats, and outputs {' and '.join(_OUTPUTS)}"
    if names & {*_OF_IMAGES}:
        found = f"a pipeline from images to matches (inputs {described(inputs)})"
        raise DataError(path, found, f"the network of matches by itself: {expected}")
    if names != {*_INPUTS} or any(port.type != "tensor(float)" for port in inputs):
        raise DataError(path, f"inputs {described(inputs)}", expected)
    if not {*_OUTPUTS} <= {port.name for port in outputs}:
        raise DataError(path, f"outputs {described(outputs)}", expected)
    return network


def _require_length(network: Network, length: int) -> None:
    """Raise TrackerError unless descriptors have the length that the network states, if it states one."""
    for port in network.inputs:
        stated = port.shape[-1] if port.name.startswith("desc") and port.shape else None
        if isinstance(stated, int) and stated != length:
            raise TrackerError(f"{network.path}: descriptors of {length} numbers, expected {stated} for {port.name}")


def _pairs(path: Path, outputs: list[Any], counts: tuple[int, int]) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Pairs of rows (k, 2) and their scores (k,), once both are known to fit to the keypoints."""
    rows, score = (np.asarray(output) for output in outputs)
    place = f"{path}: the network returned"
    if rows.dtype.kind not in "iu" or score.dtype.kind != "f":
        raise TrackerError(f"{place} matches0 {rows.dtype} and mscores0 {score.dtype}, expected int64 and float32")
    if rows.shape == score.shape == (1, counts[0]):
        matched = np.flatnonzero(rows[0] != -1)
        rows, score = np.column_stack([matched, rows[0, matched]]), score[0, matched]
    if rows.shape != (*rows.shape[:1], 2) or score.shape != rows.shape[:1]:
        shapes = f"matches0 {rows.shape} and mscores0 {score.shape}"
        raise TrackerError(f"{place} {shapes}, expected (k, 2) and (k,), or (1, {counts[0]}) of both")
    outside = np.any((rows < 0) | (rows >= counts), axis=1)
    for first, second in rows[outside][:1].tolist():
        raise TrackerError(f"{place} matches0 ({first}, {second}), expected rows below {counts[0]} and {counts[1]}")
    for value in score[~np.isfinite(score)][:1].tolist():
        raise TrackerError(f"{place} mscores0 {value}, expected finite scores")
    return rows.astype(np.intp), score.astype(np.float32)


def _is_best(rows: NDArray[np.intp], score: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether each pair (k,) has the highest score of those with the same row, the first of equal ones."""
    order = np.argsort(-score, kind="stable")
    _, first = np.unique(rows[order], return_index=True)
    best = np.zeros(len(rows), dtype=np.bool_)
    best[order[first]] = True
    return best
