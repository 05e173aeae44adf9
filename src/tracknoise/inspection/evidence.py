"""What the topics about images share: image motion, poses and intrinsics of one sequence."""

from collections.abc import Sequence as ListOf
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.inspection.flow import measure_flow, windows
from tracknoise.inspection.hypotheses import Hypothesis
from tracknoise.inspection.one_camera import seen_by_one_camera
from tracknoise.inspection.pairs import Flow, Pair
from tracknoise.inspection.residuals import median_residual_px
from tracknoise.sequences.sequence import Sequence, z_depth_from

LEAST_MOTION_PX = 0.5
"""Pairs of images with less motion say nothing about poses."""
MOST_PAIRS = 60
"""Hypotheses are compared on at most this many pairs."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Image motion of a sequence with its poses and intrinsics.

    Attributes
    ----------
    flow
        Measured from the images.
    poses
        (n, 4, 4) float64, NaN for frames without a pose.
    camera
        Intrinsics of the images.
    has_depth
        Whether most pairs have depths.
    pairs
        Pairs of frames with image motion and poses, by their first frame; with depths if `has_depth`.
    z_depth_from
        What depths that are along z by construction were computed from; None where their kind is only stated.
    """

    flow: Flow
    poses: NDArray[np.float64]
    camera: CameraModel
    has_depth: bool
    pairs: tuple[Pair, ...]
    z_depth_from: str | None = None

    @classmethod
    def of(
        cls, flow: Flow, poses: NDArray[np.float64], camera: CameraModel, z_depth_from: str | None = None
    ) -> "Evidence":
        """Choose the pairs that can be compared with poses."""
        known: NDArray[np.bool_] = np.isfinite(poses.sum(axis=(1, 2)))
        every = {(pair.first, pair.second): pair for pair in (*flow.steps, *flow.wide)}
        moving = [
            pair
            for _, pair in sorted(every.items())
            if pair.motion_px >= LEAST_MOTION_PX and known[pair.first] and known[pair.second]
        ]
        with_depth = [pair for pair in moving if pair.has_depth]
        has_depth = bool(with_depth) and 2 * len(with_depth) >= len(moving)
        pairs = tuple(with_depth if has_depth else moving)
        return cls(flow, poses, camera, has_depth, pairs, z_depth_from if has_depth else None)

    @classmethod
    def measured(cls, sequence: Sequence) -> "Evidence":
        """Measure the image motion of a sequence; as its first camera would have seen it, if the camera changes.

        Raises
        ------
        DataError
            If an image or depth cannot be read.
        """
        flow = measure_flow(sequence, windows(len(sequence)))
        seen = seen_by_one_camera(flow, sequence)
        return cls.of(seen, sequence.world_from_camera, sequence.camera, z_depth_from(sequence))


def thinned(pairs: ListOf[Pair]) -> list[Pair]:
    """At most `MOST_PAIRS` of some pairs, spread evenly."""
    if len(pairs) <= MOST_PAIRS:
        return list(pairs)
    return [pairs[place] for place in np.linspace(0, len(pairs) - 1, MOST_PAIRS).astype(int)]


def residual_px(evidence: Evidence, pair: Pair, assumed: Hypothesis) -> float:
    """Median distance of the points of a pair from their prediction, px; NaN where a pose is missing."""
    return median_residual_px(pair, evidence.poses, evidence.camera, assumed, has_depth=evidence.has_depth)
