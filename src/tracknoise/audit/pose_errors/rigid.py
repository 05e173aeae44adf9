"""The rigid share: how much of the errors is a motion of the camera that the stated poses do not have.

One small pose error per frame is fitted to half of the tracks (`tracknoise.audit.pose_errors.rigid_fit`) and predicts
the errors of the other half. With the error e of a track and the prediction p from the other half,

    share = sum(e p) / sum(e e)    (rigid.share)

is the rigid share of the second moment. The noise of the fit is not in it, as the halves are independent: for a tracker
whose errors have nothing in common the share is 0 on average. What is left after the correction, sum((e - p)^2),
includes the noise of the fit.

What is rigid need not be an error of the poses. A clock offset, a rolling shutter or a wrong focal length move all
features in a way that is partly a motion of the camera, and so may a tracker. Therefore the pose errors are also fitted
to all other trackers that saw images: what these predict is not due to the tracker alone.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.audit.pose_errors.motions import adjoints
from tracknoise.audit.pose_errors.pose_growth import pose_growth
from tracknoise.audit.pose_errors.rigid_fit import Normal, normal_equations, predicted, robust_weights
from tracknoise.audit.pose_errors.rigid_rows import RigidRows, TrackPoints, rigid_rows
from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.statistics.blocks import BLOCKS
from tracknoise.statistics.definitions import STEPS
from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import FittedTo
from tracknoise.tables.schema import EPIPOLAR, POSE_GROWTH, RIGID, SEQUENCE, check, empty

MOST_ROWS = 1_000_000
"""Most observations of a sequence that are used."""
MOST_IN_FRAME = 400
"""Most observations of a tracker that are used, per frame on average."""


_SUMS = ("n", "error_uu", "error_vv", "left_uu", "left_vv", "rigid_uu", "rigid_vv")
_KEYS = [name for name in RIGID if name not in _SUMS]


@dataclass(frozen=True, slots=True, eq=False)
class _Tracker:
    """What one tracker says about the poses.

    Attributes
    ----------
    condition
        Row of the conditions.
    is_witness
        Whether its positions come from images.
    rows
        Its observations.
    halves
        Normal equations of the first and the second half of its tracks.
    """

    condition: int
    is_witness: bool
    rows: RigidRows
    halves: tuple[Normal, Normal]

    @classmethod
    def of(cls, condition: int, rows: RigidRows, axes: NDArray[np.float64], *, is_witness: bool) -> "_Tracker":
        """Weigh the equations of a tracker, with all of its tracks, and add up those of each half."""
        equations = rows.chosen(rows.again >= 0)
        weight = robust_weights(equations, axes)
        halves = [
            normal_equations(equations.chosen(held), weight[held], axes) for held in (~equations.half, equations.half)
        ]
        return cls(condition, is_witness, rows, (halves[0], halves[1]))


def rigid_tables(
    sequence: PreparedSequence, geometry: FrameGeometry, *, witnesses: Collection[str]
) -> dict[str, pl.DataFrame]:
    """The tables `RIGID` and `POSE_GROWTH` of one sequence, at the lowest speed, by their names.

    Parameters
    ----------
    sequence
        Of one sequence. All of its visible observations count, whether or not trimming kept their tracks.
    geometry
        Stated poses and cameras of its frames.
    witnesses
        Names of the trackers whose positions come from images. Others say nothing about the poses.

    Returns
    -------
    dict of polars.DataFrame
        ``rigid`` and ``pose_growth``. Without rows where points are fitted to whole tracks, or no depth is known.
    """
    unit_m = _unit_m(sequence)
    if unit_m is None:
        return {"rigid": empty(RIGID), "pose_growth": empty(POSE_GROWTH)}
    conditions = sequence.seen.conditions
    speed = int(conditions["speed"].min())  # type: ignore[arg-type]
    scaled = geometry.in_units_of(unit_m)
    poses = scaled.world_from_camera[::speed]
    axes = _axes(poses)
    points = TrackPoints.of(sequence, scaled, unit_m)
    slowest = np.flatnonzero(conditions["speed"].to_numpy() == speed).tolist()
    most = min(MOST_IN_FRAME * len(poses), MOST_ROWS // len(slowest))
    trackers = [
        _Tracker.of(
            row,
            rigid_rows(sequence, row, scaled, points, most=most),
            axes,
            is_witness=conditions["tracker"][row] in witnesses,
        )
        for row in slowest
    ]
    parts = [_shares(sequence, tracker, trackers, axes) for tracker in trackers]
    rigid = pl.concat([empty(RIGID), *parts]).sort(_KEYS)
    halves = [_solved([one.halves[half] for one in trackers if one.is_witness], axes) for half in (0, 1)]
    grown = pose_growth(conditions.select(*SEQUENCE).head(1), poses, halves, unit_m=unit_m, speed=speed)
    return {"rigid": check(rigid, RIGID, "rigid"), "pose_growth": grown}


def _unit_m(sequence: PreparedSequence) -> float | None:
    """Median depth of the tracks, metres; None where none is known, or points are fitted to whole tracks."""
    depth_m = sequence.tracks["depth_m"].drop_nulls().to_numpy()
    known = depth_m[depth_m > 0.0]
    if not len(known) or set(EPIPOLAR) <= set(sequence.observations.columns):
        return None
    return float(np.median(known))


def _axes(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ad of each pose, (frames, 6, 6); of no motion where there is no pose."""
    known = np.isfinite(poses).all(axis=(1, 2), keepdims=True)
    return adjoints(np.where(known, poses, np.eye(4)))


def _solved(normals: Sequence[Normal], axes: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Pose errors from all of these equations, (frames, 6); None without any."""
    return reduce(add, normals).solve(axes) if normals else None


def _shares(
    sequence: PreparedSequence, tracker: _Tracker, trackers: Sequence[_Tracker], axes: NDArray[np.float64]
) -> pl.DataFrame:
    """Rows of `RIGID` of one tracker. Of what others predict, frames count whose pose errors they know.

    Where a tracker does not know its own, no pose error is taken off: the share is that of all of its errors.
    """
    others = [other for other in trackers if other.is_witness and other is not tracker]
    by_own = np.nan_to_num(_cross_predicted(tracker.rows, [tracker], axes))
    tables = [
        _summed(sequence, tracker, by_own, FittedTo.own, len(axes)),
        _summed(sequence, tracker, _cross_predicted(tracker.rows, others, axes), FittedTo.others, len(axes)),
    ]
    return pl.concat([empty(RIGID), *tables])


def _cross_predicted(rows: RigidRows, sources: Sequence[_Tracker], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Errors of the rows as the other half of the tracks of some trackers predicts them, (n, 2), px; NaN if unknown."""
    found = np.full_like(rows.error_px, np.nan)
    for half in (0, 1):
        eta = _solved([source.halves[1 - half] for source in sources], axes)
        held = rows.half == half
        if eta is not None:
            found[held] = predicted(eta, rows.jacobian[held], rows.zero[held], rows.frame[held])
    return found


def _summed(
    sequence: PreparedSequence, tracker: _Tracker, prediction: NDArray[np.float64], name: FittedTo, n_frames: int
) -> pl.DataFrame:
    """Sums of squares and products by block of frames and distance from where errors are zero; of what is predicted."""
    rows = tracker.rows
    steps = np.abs(rows.frame - rows.zero)
    chosen = np.isin(steps, STEPS) & np.isfinite(prediction).all(axis=1)
    error, fitted, block = rows.error_px[chosen], prediction[chosen], rows.frame[chosen] * BLOCKS // n_frames
    (block, step), group = number_combinations([block, steps[chosen]])
    products = {"error": error * error, "left": np.square(error - fitted), "rigid": error * fitted}
    sums = {
        f"{product}_{2 * axis}": np.bincount(group, values[:, place], len(block))
        for product, values in products.items()
        for place, axis in enumerate("uv")
    }
    labels = sequence.seen.conditions[[tracker.condition] * len(block)]
    n = pl.Series("n", np.bincount(group, minlength=len(block)))
    counted = labels.with_columns(
        pl.lit(name).alias("fitted_to"), n, block=pl.Series(block), age=pl.Series(step) * pl.col("speed"), **sums
    )
    return counted.select(pl.col(name).cast(kind) for name, kind in RIGID.items())
