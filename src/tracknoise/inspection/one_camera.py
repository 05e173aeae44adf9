"""Image motion of a camera whose intrinsics change, as one camera would have seen it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.inspection.pairs import FEWEST_POINTS, Flow, Pair
from tracknoise.sequences.sequence import Sequence, camera_at


def seen_by_one_camera(flow: Flow, sequence: Sequence) -> Flow:
    """Positions of points where the camera of the first frame would have seen them; unchanged if that is the camera.

    Rays and depths stay as they are. Points without a position in that camera are left out.

    Parameters
    ----------
    flow
        Image motion of the sequence.
    sequence
        With the camera of each frame.
    """
    frames = {frame for pair in (*flow.steps, *flow.wide) for frame in (pair.first, pair.second)}
    cameras = {frame: camera_at(sequence, frame) for frame in frames}
    if all(camera == sequence.camera for camera in cameras.values()):
        return flow
    steps, wide = (
        (_moved(pair, cameras[pair.first], cameras[pair.second], sequence.camera) for pair in pairs)
        for pairs in (flow.steps, flow.wide)
    )
    return Flow(tuple(filter(_has_points, steps)), tuple(filter(_has_points, wide)))


def _moved(pair: Pair, first: CameraModel, second: CameraModel, to: CameraModel) -> Pair:
    uv_first, uv_second = _seen(pair.uv_first, first, to), _seen(pair.uv_second, second, to)
    known = np.flatnonzero(np.isfinite(uv_first).all(axis=1) & np.isfinite(uv_second).all(axis=1))
    return replace(
        pair,
        uv_first=uv_first[known],
        uv_second=uv_second[known],
        depth_first_m=pair.depth_first_m[known],
        depth_second_m=pair.depth_second_m[known],
    )


def _has_points(pair: Pair) -> bool:
    return len(pair.uv_first) >= FEWEST_POINTS


def _seen(uv: NDArray[np.float64], by: CameraModel, to: CameraModel) -> NDArray[np.float64]:
    """(n, 2) float64, px: positions of the rays through pixels of one camera in another."""
    return uv if by == to else to.project(by.bearings(uv))
