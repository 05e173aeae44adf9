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

from tracknoise.audit.motions import adjoints
from tracknoise.geometry.pose import invert
from tracknoise.statistics.definitions import STEPS
from tracknoise.tables.schema import POSE_GROWTH, check, empty

_SQUARES = [name for name in POSE_GROWTH if name.endswith(("_m2", "_deg2"))]


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
        products = (relative[0] * relative[1])[:, [3, 4, 5, 0, 1, 2]] * units**2
        known = products[np.isfinite(products).all(axis=1)]
        if len(known):
            rows.append([step * speed, len(known), *known.mean(axis=0)])
    table = pl.DataFrame(rows, schema=["lag", "n", *_SQUARES], orient="row")
    named = labels.join(table, how="cross").with_columns(
        rotation_deg=_root(_SQUARES[:3]), translation_m=_root(_SQUARES[3:])
    )
    typed = named.select(pl.col(name).cast(kind) for name, kind in POSE_GROWTH.items())
    return check(typed, POSE_GROWTH, "pose growth")


def _root(squares: Sequence[str]) -> pl.Expr:
    mean = pl.mean_horizontal(squares)
    return pl.when(mean >= 0.0).then(mean.sqrt())
