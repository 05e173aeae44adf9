"""The true points that tracks observe."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.statistics.prepared import PreparedSequence


def true_points(sequence: PreparedSequence, geometry: FrameGeometry, born: NDArray[np.intp]) -> NDArray[np.float64]:
    """Points of tracks in the world, (tracks, 3) float64, metres; NaN where the depth is unknown.

    Parameters
    ----------
    sequence
        Their observations, and the depths of the tracks.
    geometry
        Poses and cameras of its frames.
    born
        (tracks,) rows of their first observations.
    """
    true_uv = sequence.observations.select("u_true_px", "v_true_px").to_numpy()[born]
    depth_m = sequence.tracks["depth_m"].to_numpy()[sequence.track_row[born]]
    return geometry.unproject(sequence.seen.frame[born], true_uv, depth_m)
