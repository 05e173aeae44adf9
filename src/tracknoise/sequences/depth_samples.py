"""Some of the depth maps of a sequence, and how much of them lies beside a step of depth."""

from collections.abc import Mapping

import numpy as np

from tracknoise.geometry.depth import DepthMap, interpolate
from tracknoise.sequences.sequence import Sequence, camera_at

MOST_EDGES = 0.5
"""Larger shares of pixels beside an edge are due to noise: edges of surfaces alone made at most .11 of the samples."""
_FRAMES = 8
_EDGES_EVERY_PX = 4


def edge_share(sequence: Sequence, maps: Mapping[int, DepthMap]) -> float:
    """Share of pixels with depth in dense maps of frames that lie on an edge; 0 of sparse maps, and without maps."""
    if any(depth.radius_px is not None for depth in maps.values()):
        return 0.0
    sampled = []
    for index, depth in maps.items():
        rows, columns = (np.arange(0, side, _EDGES_EVERY_PX) for side in depth.depth_m.shape)
        uv = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(float)
        sampled.append(interpolate(depth, uv, camera_at(sequence, index)))
    edge, valid = (sum(int(getattr(of_map, name).sum()) for of_map in sampled) for name in ("edge", "valid"))
    return edge / max(edge + valid, 1)


def sampled_depths(sequence: Sequence, n_frames: int | None = None) -> dict[int, DepthMap]:
    """Depth maps of some of the first frames, by default of all, spread evenly; none where there is no depth."""
    last = (len(sequence) if n_frames is None else n_frames) - 1
    chosen = np.unique(np.linspace(0, last, _FRAMES).astype(int)).tolist()
    return {index: depth for index in chosen if (depth := sequence.depth(index)) is not None}
