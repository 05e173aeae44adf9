"""Image motion of a recording, measured from its images alone, with the depth of each point."""

from collections.abc import Iterator
from collections.abc import Sequence as ListOf
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.depth import DepthMap, sample
from tracknoise.inspection.pairs import FEWEST_POINTS, LONG_PX, SHORT_PX, Flow, Pair
from tracknoise.sequences.sequence import Sequence

_MOST_FRAMES, _WINDOW_FRAMES = 240, 30
_CHAIN_EVERY, _CHAIN_STEPS = 3, 30
_POINTS, _MARGIN_PX, _SPACING_PX = 200, 12, 12
_ROUND_TRIP_PX = 0.5
_LEAST_QUALITY = 0.005
_WINDOW = (21, 21)
_LEVELS = 4


@dataclass(slots=True, eq=False)
class _Chain:
    """Points of one frame that are followed from frame to frame."""

    first: int
    uv_first: NDArray[np.float64]
    uv: NDArray[np.float64]
    depth_m: NDArray[np.float64]
    thresholds_px: tuple[float, ...]


def windows(n_frames: int) -> list[range]:
    """Parts of a recording that are read: all of a short one, otherwise stretches spread evenly over it."""
    if n_frames <= _MOST_FRAMES:
        return [range(n_frames)]
    starts = np.linspace(0, n_frames - _WINDOW_FRAMES, _MOST_FRAMES // _WINDOW_FRAMES).astype(int)
    return [range(start, start + _WINDOW_FRAMES) for start in starts.tolist()]


def measure_flow(sequence: Sequence, parts: ListOf[range]) -> Flow:
    """Follow points through parts of a recording with pyramidal Lucas-Kanade, forward and back.

    Parameters
    ----------
    sequence
        The recording; its poses are not used.
    parts
        Consecutive frames each: see `windows`.

    Raises
    ------
    DataError
        If an image or depth cannot be read.
    """
    steps: list[Pair] = []
    wide: list[Pair] = []
    for part in parts:
        for pair in _followed(sequence, part):
            (steps if pair.second == pair.first + 1 else wide).append(pair)
    return Flow(tuple(steps), tuple(wide))


def _followed(sequence: Sequence, part: range) -> Iterator[Pair]:
    """Pairs of one stretch of frames."""
    previous = sequence.image(part[0])
    chains = [_begin(part[0], previous, sequence.depth(part[0]), wide=True)]
    for index in part[1:]:
        image, depth = sequence.image(index), sequence.depth(index)
        _follow(chains, previous, image)
        chains = [chain for chain in chains if len(chain.uv) >= FEWEST_POINTS]
        for chain in chains:
            yield from _emitted(chain, index, depth, is_last=index == part[-1])
        chains = [chain for chain in chains if chain.thresholds_px and index - chain.first < _CHAIN_STEPS]
        chains.append(_begin(index, image, depth, wide=(index - part[0]) % _CHAIN_EVERY == 0))
        previous = image


def _begin(index: int, image: NDArray[np.uint8], depth: DepthMap | None, *, wide: bool) -> _Chain:
    """Corners of one frame, with their depths."""
    margin = np.zeros_like(image)
    margin[_MARGIN_PX:-_MARGIN_PX, _MARGIN_PX:-_MARGIN_PX] = 255
    found = cv2.goodFeaturesToTrack(image, _POINTS, _LEAST_QUALITY, _SPACING_PX, mask=margin)
    uv: NDArray[np.float64] = np.array([] if np.ndim(found) == 0 else found, dtype=np.float64).reshape(-1, 2)
    return _Chain(index, uv, uv, _depths(depth, uv), (SHORT_PX, LONG_PX) if wide else ())


def _follow(chains: ListOf[_Chain], previous: NDArray[np.uint8], image: NDArray[np.uint8]) -> None:
    """Move the points of chains into the next image; drop those that are not found again on the way back.

    All points are tracked together, so that the image pyramids are built once for all chains.
    """
    start = np.concatenate([np.zeros((0, 2)), *(chain.uv for chain in chains)]).astype(np.float32)
    if not len(start):
        return
    there, found = _tracked(previous, image, start)
    back, found_back = _tracked(image, previous, there)
    good = found & found_back & (np.linalg.norm(back - start, axis=1) < _ROUND_TRIP_PX)
    height, width = image.shape
    good &= np.all((there >= 0) & (there <= (width - 1, height - 1)), axis=1)
    ends = np.cumsum([len(chain.uv) for chain in chains])[:-1]
    for chain, kept, uv in zip(chains, np.split(good, ends), np.split(there, ends), strict=True):
        chain.uv_first, chain.uv = chain.uv_first[kept], uv[kept].astype(np.float64)
        chain.depth_m = chain.depth_m[kept]


def _tracked(
    source: NDArray[np.uint8], target: NDArray[np.uint8], uv: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(n, 2) positions of points in another image, and (n,) whether they were found."""
    there, found, _ = cv2.calcOpticalFlowPyrLK(source, target, uv, uv.copy(), winSize=_WINDOW, maxLevel=_LEVELS)
    return np.asarray(there, dtype=np.float32), found[:, 0] == 1


def _emitted(chain: _Chain, index: int, depth: DepthMap | None, *, is_last: bool) -> Iterator[Pair]:
    """The pair of a chain's first frame and this one, where it is consecutive or has reached a baseline."""
    pair = Pair(chain.first, index, chain.uv_first, chain.uv, chain.depth_m, _depths(depth, chain.uv))
    if index == chain.first + 1:
        yield pair
    reached = [least for least in chain.thresholds_px if pair.motion_px >= least]
    ends = is_last or index - chain.first == _CHAIN_STEPS
    if (reached or (chain.thresholds_px and ends)) and index > chain.first + 1:
        yield pair
    chain.thresholds_px = tuple(least for least in chain.thresholds_px if least not in reached)


def _depths(depth: DepthMap | None, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) float64: depth at points, NaN where unknown."""
    if depth is None or not len(uv):
        return np.full(len(uv), np.nan)
    read = sample(depth, uv)
    return np.where(read.valid, read.depth_m, np.nan)
