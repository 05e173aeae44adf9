"""How the error of the relative pose of two frames grows with their distance, as the tracks measure it.

Two halves of the tracks give two independent fits of the pose errors. The product of their relative errors of frames i
and j = i + k,

    D(i, j) = Ad(T_j^-1) (eta_i - eta_j),  mean over i of D_one D_other    (pose.growth)

has no contribution from the noise of the fits. Whatever else moves all features as a motion of the camera does is in
it: a clock offset, a rolling shutter, or what the trackers have in common.
"""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import special

from tracknoise.audit.pose_errors.motions import adjoints
from tracknoise.geometry.pose import invert
from tracknoise.statistics.definitions import STEPS
from tracknoise.tables.defaults import LEVEL
from tracknoise.tables.schema import POSE_GROWTH, SEQUENCE, check, empty

_NUMBERS = {name: kind for name, kind in POSE_GROWTH.items() if name not in SEQUENCE}
_ROTATION_FIRST = [3, 4, 5, 0, 1, 2]
_MOST_BLOCKS, _FEWEST_BLOCKS = 16, 4


def pose_growth(
    labels: pl.DataFrame,
    poses: NDArray[np.float64],
    halves: Sequence[NDArray[np.float64] | None],
    *,
    unit_m: float,
    speed: int,
) -> pl.DataFrame:
    """The table `POSE_GROWTH` of one sequence, at lags of `STEPS`.

    Parameters
    ----------
    labels
        One row: the names of the sequence.
    poses
        (frames, 4, 4) float64: stated poses of the frames that the trackers saw, in units of `unit_m`.
    halves
        Pose errors (frames, 6) from each half of the tracks, in the axes of the world; NaN where unknown. None where no
        tracker saw images: the table then has no rows.
    unit_m
        Unit of length, metres.
    speed
        Frames of the sequence from one pose to the next.

    Returns
    -------
    polars.DataFrame
        Sorted by lag; only lags that two known poses have.
    """
    one, other = halves
    if one is None or other is None:
        return empty(POSE_GROWTH)
    in_camera = adjoints(invert(poses))
    units = np.repeat([np.rad2deg(1.0), unit_m], 3)
    rows = []
    for step in STEPS:
        relative = [np.einsum("nij,nj->ni", in_camera[step:], eta[:-step] - eta[step:]) for eta in (one, other)]
        products = (relative[0] * relative[1])[:, _ROTATION_FIRST] * units**2
        known = products[np.isfinite(products).all(axis=1)]
        if len(known):
            roots = [_established_root(known[:, axes], step) for axes in (slice(0, 3), slice(3, 6))]
            rows.append([step * speed, len(known), *roots, *known.mean(axis=0)])
    table = pl.DataFrame(rows, schema=_NUMBERS, orient="row")
    named = labels.join(table, how="cross").select(list(POSE_GROWTH))
    return check(named, POSE_GROWTH, "pose growth")


def _established_root(squares: NDArray[np.float64], step: int) -> float | None:
    """Root of the mean of squares (n, 3) of successive frames; None where they do not show that it is positive.

    Squares of pairs of frames that overlap are alike. Blocks of successive squares, at least as long as the pairs, are
    therefore the sample of Student's test.
    """
    count = min(_MOST_BLOCKS, len(squares) // step)
    if count < _FEWEST_BLOCKS:
        return None
    means = np.array([block.mean() for block in np.array_split(squares, count)])
    error = float(means.std(ddof=1)) / np.sqrt(count)
    bound = float(special.stdtrit(count - 1, 0.5 + LEVEL / 2))
    mean = float(squares.mean())
    return float(np.sqrt(mean)) if mean > bound * error and mean > 0.0 else None
