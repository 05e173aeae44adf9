"""What a recording holds, in a few numbers per sequence."""

from dataclasses import dataclass

import numpy as np

from tracknoise.inspection.depths import depth_share, sampled_depths
from tracknoise.sequences.sequence import Sequence


@dataclass(frozen=True, slots=True)
class Overview:
    """Numbers of one sequence.

    Attributes
    ----------
    n_frames, n_poses
        Images, and how many of them have a pose.
    width_px, height_px
        Size of the images.
    rate_hz
        From the median interval of the timestamps; None without timestamps.
    depth_share
        Share of pixels with depth, from some frames; None without depth maps.
    """

    n_frames: int
    n_poses: int
    width_px: int
    height_px: int
    rate_hz: float | None
    depth_share: float | None


def overview(sequence: Sequence) -> Overview:
    """Numbers of a sequence. Depth maps of some frames are read, and no image.

    Raises
    ------
    DataError
        If poses, timestamps or a depth map cannot be read.
    """
    maps = sampled_depths(sequence)
    return Overview(
        n_frames=len(sequence),
        n_poses=int(np.isfinite(sequence.world_from_camera).all(axis=(1, 2)).sum()),
        width_px=sequence.camera.width,
        height_px=sequence.camera.height,
        rate_hz=_rate_hz(sequence),
        depth_share=depth_share(maps) if maps else None,
    )


def _rate_hz(sequence: Sequence) -> float | None:
    times = sequence.timestamps_s
    if times is None or len(times) < 2:
        return None
    return 1.0 / float(np.median(np.diff(times)))
