"""Anchors: the world point that a feature is taken to be, fixed at its first frame."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.depth import sample
from tracknoise.sequences.sequence import Surface
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.frames import Frames

Anchored = tuple[NDArray[np.float64], NDArray[np.int8]]


class Anchor(Protocol):
    """A way to find the depth of features at their first frame."""

    def depths(self, index: int, uv: NDArray[np.float64]) -> Anchored:
        """Depths of features in the frame in which they were first seen.

        Parameters
        ----------
        index
            Frame.
        uv
            (n, 2) float64, px.

        Returns
        -------
        depth_m : (n,) float64
            Metres along z; arbitrary but finite where the status is not valid.
        status : (n,) int8
            `TruthStatus`: valid, no_depth or edge.
        """
        ...


class BirthDepth:
    """Depth of the first frame, read between pixels: (truth.birth)."""

    __slots__ = ("_frames",)

    def __init__(self, frames: Frames) -> None:
        self._frames = frames

    def depths(self, index: int, uv: NDArray[np.float64]) -> Anchored:
        """Depth between pixels: see `Anchor.depths`. Next to a depth discontinuity the status is edge."""
        depth = self._frames.depth(index)
        if depth is None:
            return np.ones(len(uv)), np.full(len(uv), TruthStatus.no_depth, np.int8)
        read = sample(depth, uv)
        status = np.full(len(uv), TruthStatus.no_depth, np.int8)
        status[read.edge] = TruthStatus.edge
        status[read.valid] = TruthStatus.valid
        return read.depth_m, status


class RayCast:
    """The exact surface point under the feature, in a simulated world: (truth.raycast)."""

    __slots__ = ("_frames", "_surface")

    def __init__(self, frames: Frames, surface: Surface) -> None:
        self._frames = frames
        self._surface = surface

    def depths(self, index: int, uv: NDArray[np.float64]) -> Anchored:
        """Exact depth: see `Anchor.depths`. A ray that hits nothing has none."""
        depth_m, hit = cast_depth(self._frames, self._surface, index, uv)
        return depth_m, np.where(hit, TruthStatus.valid, TruthStatus.no_depth).astype(np.int8)


def cast_depth(
    frames: Frames, surface: Surface, index: int, uv: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Depth of the exact surface under pixels.

    Only the depth of the point that was hit is used: the ray itself is known better than the caster computes it.

    Returns
    -------
    depth_m : (n,) float64
        Metres along z; 1 where nothing is hit.
    hit : (n,) bool
    """
    points_world, hit = surface.cast(index, uv)
    depth_m = frames.to_camera(index, np.where(hit[:, None], points_world, 0.0))[:, 2]
    return np.where(hit, depth_m, 1.0), hit


def fix(frames: Frames, anchor: Anchor, index: int, uv: NDArray[np.float64]) -> Anchored:
    """World points of features: X_w = world_from_camera pi^-1(x, Z).

    Parameters
    ----------
    frames
        The sequence.
    anchor
        Where Z comes from.
    index
        Frame.
    uv
        (n, 2) float64, px.

    Returns
    -------
    points_world : (n, 3) float64
        Metres; NaN where the status is not valid.
    status : (n,) int8
        `TruthStatus`: valid, no_depth or edge.
    """
    depth_m, status = anchor.depths(index, uv)
    points_world = frames.to_world(index, frames.camera.unproject(uv, depth_m))
    points_world[status != TruthStatus.valid] = np.nan
    return points_world, status
