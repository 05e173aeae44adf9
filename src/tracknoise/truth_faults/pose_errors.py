"""The rigid share: how much of the errors is a motion of the camera that the stated poses do not have.

Small rigid motions (rho, phi) are vectors of six numbers, in the axes of different frames.

Observations
------------

The stated pose T_f of frame f differs from the real one, T_f exp(xi_f), by a small motion xi_f of the camera. With
eta_f = Ad(T_f) xi_f, the same motion in the axes of the world, a track that begins in frame i at the point X has in
frame j, beside the error of its tracker, to first order the error

    e = J (eta_i - eta_j),  J = d pi_j(X) / dX [I, -[X]x]    (rigid)

Nothing changes if all eta change by the same motion: where the world is does not matter.

A track of many frames begins again every `REACH` steps, at its observed position and stated depth, so that no equation
is between distant frames. What its tracker did before that is subtracted, and its noise there is added.

Fit of pose errors
------------------

The fit is by robust least squares. The equations (rigid) of one pair of frames add up to the 6 x 6 matrix S = sum w J'J
and the vector g = sum w J'e. The normal equations of all frames are a Laplacian with these matrices as weights, whose
band is as wide as the distance of the frames. A weak prior, `PRIOR`, fixes the motion that all frames share, and any
that the tracks do not determine.

Weights are those of a Cauchy distribution, whose scale is the median residual at the same number of steps. Each half of
the tracks is fitted alone, with weights from its own residuals: weights from all tracks would make the halves alike.

Growth with the distance of frames
----------------------------------

Two halves of the tracks give two independent fits of the pose errors. The product of their relative errors of frames i
and j = i + k,

    D(i, j) = Ad(T_j^-1) (eta_i - eta_j),  mean over i of D_one D_other    (pose.growth)

has no contribution from the noise of the fits. Whatever else moves all features as a motion of the camera does is in
it: a clock offset, a rolling shutter, or what the trackers have in common.

Rigid share
-----------

The pose errors that are fitted to half of the tracks predict the errors of the other half. With the error e of a track
and the prediction p from the other half,

    share = sum(e p) / sum(e e)    (rigid.share)

is the rigid share of the second moment. The noise of the fit is not in it, as the halves are independent: for a tracker
whose errors have nothing in common the share is 0 on average. What is left after the correction, sum((e - p)^2),
includes the noise of the fit.

A few lost tracks, or frames whose pose errors the tracks hardly determine, can decide second moments. With e and p in
units of the robust scale of the errors at the same number of steps, the errors of at most three scales have

    share = sum(e p) / sum(e e),  |e| <= 3, p shortened to a length of 3    (pose.share)

Few tracks make the predictions of a frame noisy, but not their products with the errors of the other half. Frames with
too few, whose pose error is unknown, take no part; how large their errors are is kept.

What is rigid need not be an error of the poses. A clock offset, a rolling shutter or a wrong focal length move all
features in a way that is partly a motion of the camera, and so may a tracker. Therefore the pose errors are also fitted
to all other trackers that saw images: what these predict is not due to the tracker alone.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, fields
from functools import reduce
from operator import add
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import special
from scipy.linalg import solveh_banded

from tracknoise.geometry.pose import first_visits, invert
from tracknoise.geometry.projection import FrameGeometry, cross_matrices
from tracknoise.inference.bootstrap import scattered
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.robust_fits import scales
from tracknoise.inference.units import BLOCKS
from tracknoise.statistics.definitions import STEPS
from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import FittedTo
from tracknoise.tables.schema import EPIPOLAR, POSE_GROWTH, RIGID, SEQUENCE, check, empty


def adjoints(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ad(T): a small motion in the axes of the source of T, in the axes of its target.

    With T = (R, t), Ad(T) (rho, phi) = (R rho + t x R phi, R phi). Shapes: poses (n, 4, 4); returns (n, 6, 6).
    """
    rotation, position = poses[:, :3, :3], poses[:, :3, 3]
    matrices = np.zeros((len(poses), 6, 6))
    matrices[:, :3, :3] = matrices[:, 3:, 3:] = rotation
    matrices[:, :3, 3:] = np.cross(position[:, :, None], rotation, axis=1)
    return matrices


REACH = 16
"""Most steps of the tracker between the two frames of an equation."""


@dataclass(frozen=True, slots=True, eq=False)
class RigidRows:
    """Visible observations of one tracker, without those whose error is zero by construction.

    Attributes
    ----------
    zero, frame : (n,) int64
        Where the error is zero, and where the observation is: numbers of the frames that the tracker saw, from 0.
    again : (n,) int64
        Where the track began, or began again, for the equation of the fit; -1 where there is no equation.
    half : (n,) bool
        Half of the tracks that it belongs to. All tracks that begin at one pixel of a frame are in one half.
    jacobian : (n, 2, 6) float64
        J of (rigid): px per unit of length, px per rad.
    error_px, again_px : (n, 2) float64
        Observed minus true position, since `zero` and since `again`.
    """

    zero: NDArray[np.int64]
    frame: NDArray[np.int64]
    again: NDArray[np.int64]
    half: NDArray[np.bool_]
    jacobian: NDArray[np.float64]
    error_px: NDArray[np.float64]
    again_px: NDArray[np.float64]

    def chosen(self, which: NDArray[np.bool_ | np.intp]) -> "RigidRows":
        """Some of the rows, (n,) bool or places."""
        return RigidRows(**{item.name: getattr(self, item.name)[which] for item in fields(self)})


@dataclass(frozen=True, slots=True, eq=False)
class TrackPoints:
    """Where the tracks of a sequence began.

    Attributes
    ----------
    world : (tracks, 3) float64
        True point; NaN where unknown.
    hashed : (tracks,) uint64
        A pseudo-random number of the first frame and of the pixel there.
    """

    world: NDArray[np.float64]
    hashed: NDArray[np.uint64]

    @classmethod
    def of(cls, sequence: PreparedSequence, geometry: FrameGeometry, unit_m: float) -> "TrackPoints":
        """Those of one sequence, whose geometry is in units of `unit_m`, metres."""
        return cls(_points_world(sequence, geometry, unit_m), _hashes(sequence))


def rigid_rows(
    sequence: PreparedSequence, condition: int, geometry: FrameGeometry, points: TrackPoints, *, most: int
) -> RigidRows:
    """The rows of one condition of a sequence."""
    mine = sequence.seen.visible & (sequence.seen.condition == condition)
    has_point: NDArray[np.bool_] = np.isfinite(points.world[:, 0])
    usable = mine & has_point[sequence.track_row]
    share = min(1.0, most / max(int(np.count_nonzero(usable)), 1))
    used = (points.hashed >> np.uint64(11)) * 2.0**-53 < share
    rows = sequence.ordered_where(usable & used[sequence.track_row])
    return _with_equations(sequence, geometry, rows, points)


def _points_world(sequence: PreparedSequence, geometry: FrameGeometry, unit_m: float) -> NDArray[np.float64]:
    """True point of each track, from its true position and depth in its first frame, (tracks, 3); NaN where unknown."""
    seen = sequence.seen
    true_uv = sequence.observations.select("u_true_px", "v_true_px").to_numpy()
    depth = sequence.tracks["depth_m"].to_numpy() / unit_m
    born = np.flatnonzero((seen.age == 0) & np.isfinite(true_uv).all(axis=1) & np.isfinite(depth[sequence.track_row]))
    track = sequence.track_row[born]
    points = np.full((len(depth), 3), np.nan)
    points[track] = geometry.unproject(seen.frame[born], true_uv[born], depth[track])
    return points


def _hashes(sequence: PreparedSequence) -> NDArray[np.uint64]:
    """A pseudo-random number of the frame and the pixel in which each track began, (tracks,)."""
    born = np.flatnonzero(sequence.seen.age == 0)
    uv = sequence.observations.select("u_px", "v_px").to_numpy()[born]
    hashed = np.zeros(sequence.tracks.height, np.uint64)
    hashed[sequence.track_row[born]] = hashed_pixels(sequence.seen.frame[born], uv)
    return hashed


def hashed_pixels(frame: NDArray[np.integer[Any]], uv: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Pseudo-random numbers (n,) of frames (n,) and of the pixels at positions (n, 2)."""
    mixed = np.zeros(len(frame), np.uint64)
    for column in np.column_stack([frame, np.rint(uv)]).astype(np.int64).astype(np.uint64).T:
        mixed = scattered(mixed ^ column)
    return mixed


def half_of(hashed: NDArray[np.uint64]) -> NDArray[np.bool_]:
    """Half of the tracks that each belongs to, (n,), by their hashed numbers."""
    return (hashed & np.uint64(1)).astype(bool)


def _with_equations(
    sequence: PreparedSequence,
    geometry: FrameGeometry,
    rows: NDArray[np.intp],
    points: TrackPoints,
) -> RigidRows:
    """Equations of the rows of observations, which are sorted by track and frame."""
    seen, track = sequence.seen, sequence.track_row[rows]
    frame, errors = seen.frame[rows], seen.error_px[rows]
    first = sequence.tracks["first_frame"].to_numpy().astype(np.int64)[track]
    zero = first if sequence.key_frame is None else np.full(len(rows), sequence.key_frame)
    again, before = _beginnings(track, frame, zero, seen.speed[rows])
    place = points.world[track]
    jacobian = by_motion(geometry, frame, place)
    moved = np.zeros_like(errors)
    late = np.flatnonzero(before >= 0)
    shift = _displacement(sequence, geometry, rows[before[late]], points.world)
    moved[late] = np.einsum("nij,nj->ni", jacobian[late, :, :3], shift)
    speed = seen.speed[rows]
    equations = RigidRows(
        zero=zero // speed,
        frame=frame // speed,
        again=np.where(again < 0, -1, again // speed),
        half=half_of(points.hashed[track]),
        jacobian=jacobian,
        error_px=errors,
        again_px=errors - moved,
    )
    return equations.chosen((frame != zero) & np.isfinite(equations.jacobian).all(axis=(1, 2)))


def by_motion(
    geometry: FrameGeometry, frame: NDArray[np.int64], points_world: NDArray[np.float64]
) -> NDArray[np.float64]:
    """J of (rigid) of world points (n, 3) in frames (n,), (n, 2, 6)."""
    by_point = geometry.jacobian(frame, points_world)
    return np.concatenate([by_point, by_point @ cross_matrices(-points_world)], axis=2)


def _beginnings(
    track: NDArray[np.intp], frame: NDArray[np.int64], zero: NDArray[np.int64], speed: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Frame in which the track of each row began again, -1 if it was not seen there; and the row there, else -1."""
    place_of_track = np.cumsum(np.diff(track, prepend=track[:1]) != 0)  # ascending, as rows are sorted by track
    steps = np.maximum(np.abs(frame - zero) // speed - 1, 0) // REACH * REACH
    again = zero + np.sign(frame - zero) * steps * speed
    wide = frame.max(initial=0) + 1
    numbers, wanted = place_of_track * wide + frame, place_of_track * wide + again
    place = np.minimum(np.searchsorted(numbers, wanted), max(len(numbers) - 1, 0))
    is_seen = numbers[place] == wanted
    return np.where(is_seen | (steps == 0), again, -1), np.where(is_seen & (steps > 0), place, -1)


def _displacement(
    sequence: PreparedSequence, geometry: FrameGeometry, rows: NDArray[np.intp], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """From the true points of observations to those at their observed positions and true depths, world, (n, 3)."""
    frame = sequence.seen.frame[rows]
    depth = geometry.to_camera(frame, points[sequence.track_row[rows]])[:, 2]
    observed, true = (
        sequence.observations.select(names).to_numpy()[rows] for names in (("u_px", "v_px"), ("u_true_px", "v_true_px"))
    )
    return geometry.unproject(frame, observed, depth) - geometry.unproject(frame, true, depth)


PRIOR = 1.0
"""Standard deviation of a pose error before any track is seen: rad, and units of length."""
FEWEST = 8
"""Fewest tracks in a frame that determine its pose error, which has six numbers. Products are added up over frames."""
_ROUNDS = 6
_TAIL = 2.4
"""Residual, in units of the scale, at which the weight of an observation is halved."""
_LEAST_SCALE_PX = 0.01
_WIDTH = 6 * (REACH + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Normal:
    """Normal equations, which add up.

    Attributes
    ----------
    band : (6 (`REACH` + 1), 6 frames) float64
        Lower part of the matrix, as `scipy.linalg.solveh_banded` takes it.
    right : (frames, 6) float64
        Right side.
    count : (frames,) int64
        Tracks that were seen in a frame, those that began there only if they were seen in the next one too.
    """

    band: NDArray[np.float64]
    right: NDArray[np.float64]
    count: NDArray[np.int64]

    def __add__(self, other: "Normal") -> "Normal":
        return Normal(self.band + other.band, self.right + other.right, self.count + other.count)

    def solve(self, axes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pose errors eta, (frames, 6); NaN of frames with too few tracks. Shapes: axes (frames, 6, 6).

        All are NaN where numbers are so unlike, as of poses a million metres apart, that rounding decides.
        """
        band = self.band.copy()
        band[0] += 1.0 / PRIOR**2
        try:
            xi = solveh_banded(band, self.right.ravel(), lower=True, check_finite=False).reshape(-1, 6)
        except np.linalg.LinAlgError:
            return np.full((len(self.count), 6), np.nan)
        xi[self.count < FEWEST] = np.nan
        return np.asarray(np.einsum("nij,nj->ni", axes, xi))


def normal_equations(rows: RigidRows, weight: NDArray[np.float64], axes: NDArray[np.float64]) -> Normal:
    """Normal equations of weighted rows, (n,), for the pose errors xi in the axes of their cameras."""
    n_frames = len(axes)
    codes, pair = np.unique(rows.again * n_frames + rows.frame, return_inverse=True)
    start, end = np.divmod(codes, n_frames)
    squares, right = _sums(rows, weight, pair, len(codes))
    band, total = np.zeros((_WIDTH, 6 * n_frames)), np.zeros((n_frames, 6))
    for first, second, sign in ((start, start, 1.0), (end, end, 1.0), (end, start, -1.0)):
        _add_blocks(band, first, second, sign * np.swapaxes(axes[first], 1, 2) @ squares @ axes[second])
    for frame, sign in ((start, 1.0), (end, -1.0)):
        np.add.at(total, frame, sign * np.einsum("nji,nj->ni", axes[frame], right))
    begun = rows.again[np.abs(rows.frame - rows.again) == 1]
    count = np.bincount(begun, minlength=n_frames) + np.bincount(rows.frame, minlength=n_frames)
    return Normal(band, total, count)


def _sums(
    rows: RigidRows, weight: NDArray[np.float64], pair: NDArray[np.intp], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """S and g of each pair of frames, (pairs, 6, 6) and (pairs, 6)."""
    columns = np.ascontiguousarray(np.transpose(rows.jacobian, (2, 1, 0)))  # (6, 2, n)
    weighted = columns * weight
    squares, right = np.empty((count, 6, 6)), np.empty((count, 6))
    for row in range(6):
        right[:, row] = np.bincount(pair, (weighted[row] * rows.again_px.T).sum(axis=0), count)
        for column in range(row + 1):
            products = (weighted[row] * columns[column]).sum(axis=0)
            squares[:, row, column] = squares[:, column, row] = np.bincount(pair, products, count)
    return squares, right


def _add_blocks(
    band: NDArray[np.float64], first: NDArray[np.int64], second: NDArray[np.int64], blocks: NDArray[np.float64]
) -> None:
    """Add blocks (n, 6, 6), with frames (n,) of their rows and columns, to the lower part of a symmetric matrix."""
    late = (first >= second)[:, None, None]
    row, column = 6 * np.maximum(first, second), 6 * np.minimum(first, second)
    placed = np.where(late, blocks, np.swapaxes(blocks, 1, 2))
    for down in range(6):
        for across in range(6):
            below = row + down - column - across
            lower = below >= 0
            np.add.at(band, (below[lower], column[lower] + across), placed[lower, down, across])


def predicted(
    eta: NDArray[np.float64], jacobian: NDArray[np.float64], start: NDArray[np.int64], end: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Errors (n, 2) by (rigid), px; NaN where the pose error of one of the two frames is not known."""
    error: NDArray[np.float64] = np.einsum("nij,nj->ni", jacobian, eta[start] - eta[end])
    return error


def robust_weights(rows: RigidRows, axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weight of each equation, (n,), 1/px^2."""
    lag = np.abs(rows.frame - rows.again)
    weight = _weights(rows.again_px, lag)
    for _ in range(_ROUNDS):
        eta = normal_equations(rows, weight, axes).solve(axes)
        error_px = np.nan_to_num(predicted(eta, rows.jacobian, rows.again, rows.frame))
        weight = _weights(rows.again_px - error_px, lag)
    return weight


def _weights(residual_px: NDArray[np.float64], lag: NDArray[np.int64]) -> NDArray[np.float64]:
    """Weights of a Cauchy distribution with the scale of each lag."""
    size = np.hypot(*residual_px.T)
    scale = np.full(REACH + 1, _LEAST_SCALE_PX)
    for step in np.unique(lag):
        scale[step] = max(float(np.median(size[lag == step])) / _MEDIAN_SIZE, _LEAST_SCALE_PX)
    return np.asarray(1.0 / (scale[lag] ** 2 + (size / _TAIL) ** 2))


_MEDIAN_SIZE = 1.1774
"""Median length of a vector whose two components are standard Gaussian."""


_IMAGE = ("rigid_px2", "error_px2", "px2_per_degree", "px2_per_metre")
_NUMBERS = {name: kind for name, kind in POSE_GROWTH.items() if name not in {*SEQUENCE, *_IMAGE}}
_ROTATION_FIRST = [3, 4, 5, 0, 1, 2]
_MOST_BLOCKS, _FEWEST_BLOCKS = 16, 4


def pose_growth(
    labels: pl.DataFrame,
    poses: NDArray[np.float64],
    halves: Sequence[NDArray[np.float64] | None],
    moved: pl.DataFrame,
    *,
    unit_m: float,
    speed: int,
) -> pl.DataFrame:
    """The table `POSE_GROWTH` of one sequence, at lags of `STEPS`.

    Shapes: poses (frames, 4, 4). Returns: sorted by lag; only lags that two known poses have. `halves`: NaN where
    unknown. None where no tracker saw images: the table then has no rows. `moved`: columns of `image_motion`.
    """
    first, second = halves
    if first is None or second is None:
        return empty(POSE_GROWTH)
    in_camera = adjoints(invert(poses))
    units = np.repeat([np.rad2deg(1.0), unit_m], 3)
    rows = []
    for step in STEPS:
        relative = [np.einsum("nij,nj->ni", in_camera[step:], eta[:-step] - eta[step:]) for eta in (first, second)]
        products = (relative[0] * relative[1])[:, _ROTATION_FIRST] * units**2
        finite = products[np.isfinite(products).all(axis=1)]
        if len(finite):
            roots = [_established_root(finite[:, axes], step) for axes in (slice(0, 3), slice(3, 6))]
            rows.append([step * speed, len(finite), *roots, *finite.mean(axis=0)])
    table = pl.DataFrame(rows, schema=_NUMBERS, orient="row").join(moved, on="lag", how="left")
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


def image_motion(
    trackers: Sequence["PoseWitness"], rigid: pl.DataFrame, axes: NDArray[np.float64], *, unit_m: float, speed: int
) -> pl.DataFrame:
    """What pose errors make of the errors of trackers that saw images, by lag: means of those in (pose.share), px^2.

    rigid_px2 and error_px2 by their own halves. px2_per_degree and px2_per_metre of a relative pose error of one degree
    about each axis, and of one metre along each, as in (truth.floor).
    """
    parts = [_image_sums(tracker, rigid, axes, unit_m) for tracker in trackers if tracker.is_witness]
    sums = pl.concat(
        [pl.DataFrame(schema={"lag": pl.Int64, "n": pl.Int64, **dict.fromkeys(_IMAGE, pl.Float64)}), *parts]
    )
    means = sums.group_by("lag").agg(pl.col(name).sum() / pl.col("n").sum() for name in _IMAGE)
    return means.select((pl.col("lag") * speed).cast(POSE_GROWTH["lag"]), *_IMAGE)


def _image_sums(tracker: "PoseWitness", rigid: pl.DataFrame, axes: NDArray[np.float64], unit_m: float) -> pl.DataFrame:
    """Counts and sums of one tracker by steps, of steps at which table `RIGID` knows its share."""
    step = np.abs(tracker.rows.frame - tracker.rows.zero)
    inside = np.hypot(*tracker.rows.error_px.T) <= CUT * scales(step.astype(np.intp), tracker.rows.error_px)
    squares = np.column_stack([np.sum(tracker.rows.error_px**2, axis=1), _squared_motion(tracker.rows, axes, unit_m)])
    sums = [np.bincount(step[inside], column[inside]).astype(np.float64) for column in squares.T]  # whole if empty
    names = dict(zip(_IMAGE[1:], sums, strict=True))
    table = pl.DataFrame({"lag": np.arange(len(sums[0])), "n": np.bincount(step[inside]), **names})
    fitted_to_own = rigid.join(tracker.labels, on=["tracker", "speed"], how="semi").filter(fitted_to=FittedTo.own)
    by_step = fitted_to_own.group_by(lag=(pl.col("age") // pl.col("speed")).cast(pl.Int64))
    shares = by_step.agg(share=pl.col("cut_rigid").sum() / pl.col("cut_error").sum()).filter(
        pl.col("share").is_finite()
    )
    with_shares = table.join(shares, on="lag").filter(pl.col("n") > 0)
    return with_shares.select("lag", "n", *_IMAGE[1:], rigid_px2=pl.col("share") * pl.col("error_px2")).select(
        "lag", "n", *_IMAGE
    )


def _squared_motion(rows: RigidRows, axes: NDArray[np.float64], unit_m: float) -> NDArray[np.float64]:
    """(n, 2): px^2 of one degree about each axis of the camera, and of one metre along each."""
    at_frame, at_zero = (np.einsum("nij,njk->nik", rows.jacobian, axes[frame]) for frame in (rows.frame, rows.zero))
    turned = 0.5 * (at_frame[:, :, 3:] ** 2 + at_zero[:, :, 3:] ** 2)
    squares = np.deg2rad(1.0) ** 2 * turned, at_frame[:, :, :3] ** 2 / unit_m**2
    return np.stack([square.sum(axis=(1, 2)) for square in squares], axis=1)


MOST_ROWS = 1_000_000
"""Most observations of a sequence that are used."""
MOST_IN_FRAME = 400
"""Most observations of a tracker that are used, per frame on average."""


CUT = 3.0
"""Errors that count in (pose.share), and predictions, are at most this long, in units of the robust scale."""


def cut_products(
    error: NDArray[np.float64], prediction: NDArray[np.float64], step: NDArray[np.integer[Any]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Squares of errors, and their products with predictions, (n,) each, without unit, whose sums give (pose.share).

    Parameters
    ----------
    error, prediction : (n, 2)
        Of one tracker, px.
    step : (n,)
        Steps since the error was zero.
    """
    scale = scales(step.astype(np.intp), error)[:, None]
    e, p = error / scale, prediction / scale
    p = p * np.minimum(1.0, CUT / np.maximum(np.hypot(*p.T), CUT))[:, None]
    counts = np.hypot(*e.T) <= CUT
    return counts * np.sum(e * e, axis=1), counts * np.sum(e * p, axis=1)


_CUT = ("cut_error", "cut_rigid", "cut_unknown")
_SUMS = ("n", "error_uu", "error_vv", "left_uu", "left_vv", "rigid_uu", "rigid_vv", *_CUT)
_KEYS = [name for name in RIGID if name not in _SUMS]


@dataclass(frozen=True, slots=True, eq=False)
class PoseWitness:
    """What one tracker says about the poses.

    Attributes
    ----------
    labels
        One row with the columns of `tracknoise.tables.schema.ORIGIN`.
    is_witness
        Whether its positions come from images.
    rows
        Its observations.
    halves
        Normal equations of the first and the second half of its tracks.
    """

    labels: pl.DataFrame
    is_witness: bool
    rows: RigidRows
    halves: tuple[Normal, Normal]

    @classmethod
    def of(
        cls, labels: pl.DataFrame, rows: RigidRows, axes: NDArray[np.float64], *, is_witness: bool = True
    ) -> "PoseWitness":
        """Weigh and add up the equations of each half of a tracker's tracks."""
        first, second = (_half(rows.chosen((rows.again >= 0) & (rows.half == half)), axes) for half in (False, True))
        return cls(labels, is_witness, rows, (first, second))


def _half(equations: RigidRows, axes: NDArray[np.float64]) -> Normal:
    return normal_equations(equations, robust_weights(equations, axes), axes)


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
    axes = axes_of(poses)
    points = TrackPoints.of(sequence, scaled, unit_m)
    slowest = np.flatnonzero(conditions["speed"].to_numpy() == speed).tolist()
    most = min(MOST_IN_FRAME * len(poses), MOST_ROWS // len(slowest))
    trackers = [
        PoseWitness.of(
            conditions[[row]],
            rigid_rows(sequence, row, scaled, points, most=most),
            axes,
            is_witness=conditions["tracker"][row] in witnesses,
        )
        for row in slowest
    ]
    parts = [rigid_sums(tracker, trackers, axes, steps=STEPS) for tracker in trackers]
    rigid = pl.concat([empty(RIGID), *parts]).sort(_KEYS)
    halves = [_solved([witness.halves[half] for witness in trackers if witness.is_witness], axes) for half in (0, 1)]
    moved = image_motion(trackers, rigid, axes, unit_m=unit_m, speed=speed)
    labels = conditions.select(*SEQUENCE).head(1)
    grown = pose_growth(labels, poses, halves, moved, unit_m=unit_m, speed=speed)
    return {"rigid": check(rigid, RIGID, "rigid"), "pose_growth": grown}


def _unit_m(sequence: PreparedSequence) -> float | None:
    """Median depth of the tracks, metres; None where none is known, or points are fitted to whole tracks."""
    depth_m = sequence.tracks["depth_m"].drop_nulls().to_numpy()
    positive = depth_m[depth_m > 0.0]
    if not len(positive) or set(EPIPOLAR) <= set(sequence.observations.columns):
        return None
    return float(np.median(positive))


def axes_of(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ad of each pose, (frames, 6, 6); of no motion where there is no pose."""
    has_pose = np.isfinite(poses).all(axis=(1, 2), keepdims=True)
    return adjoints(np.where(has_pose, poses, np.eye(4)))


def _solved(normals: Sequence[Normal], axes: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Pose errors from all of these equations, (frames, 6); None without any."""
    return reduce(add, normals).solve(axes) if normals else None


def rigid_sums(
    tracker: PoseWitness, trackers: Sequence[PoseWitness], axes: NDArray[np.float64], *, steps: Iterable[int]
) -> pl.DataFrame:
    """Rows of `RIGID` of one tracker at some steps; none of what is not predicted anywhere."""
    witnesses = [witness for witness in trackers if witness.is_witness and witness is not tracker]
    by_own = _cross_predicted(tracker.rows, [tracker], axes)
    by_others = _cross_predicted(tracker.rows, witnesses, axes)
    chosen = np.isin(np.abs(tracker.rows.frame - tracker.rows.zero), list(steps))
    block = first_visits(axes) * BLOCKS // len(axes)
    tables = [
        _summed(tracker, by, name, block, chosen) for name, by in ((FittedTo.own, by_own), (FittedTo.others, by_others))
    ]
    return pl.concat([empty(RIGID), *tables])


def _cross_predicted(rows: RigidRows, sources: Sequence[PoseWitness], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Errors of the rows as the other half of the tracks of some trackers predicts them, (n, 2), px; NaN if unknown."""
    predictions = np.full_like(rows.error_px, np.nan)
    for half in (0, 1):
        eta = _solved([source.halves[1 - half] for source in sources], axes)
        held = rows.half == half
        if eta is not None:
            predictions[held] = predicted(eta, rows.jacobian[held], rows.zero[held], rows.frame[held])
    return predictions


def _summed(
    tracker: PoseWitness,
    prediction: NDArray[np.float64],
    name: FittedTo,
    block_of: NDArray[np.intp],
    at_steps: NDArray[np.bool_],
) -> pl.DataFrame:
    """Sums of squares and products by block of frames and distance from where errors are zero; of what is predicted."""
    rows = tracker.rows
    is_known = np.asarray(np.isfinite(prediction).all(axis=1))
    chosen = at_steps if np.any(at_steps & is_known) else np.zeros_like(at_steps)
    error, fitted, is_known = rows.error_px[chosen], prediction[chosen], is_known[chosen]
    steps = np.abs(rows.frame - rows.zero)[chosen]
    (block, step), group = number_combinations([block_of[rows.frame[chosen]], steps])
    cut_error, cut_rigid = cut_products(error, fitted, steps)
    products = {"error": error * error, "left": np.square(error - fitted), "rigid": error * fitted}
    columns = {
        f"{product}_{2 * axis}": values[:, place]
        for product, values in products.items()
        for place, axis in enumerate("uv")
    }
    columns |= {"cut_error": cut_error, "cut_rigid": cut_rigid}
    sums = {name: np.bincount(group[is_known], values[is_known], len(block)) for name, values in columns.items()}
    sums["cut_unknown"] = np.bincount(group[~is_known], cut_error[~is_known], len(block))
    labels = tracker.labels[[0] * len(block)]
    n = pl.Series("n", np.bincount(group[is_known], minlength=len(block)))
    counted = labels.with_columns(
        pl.lit(name).alias("fitted_to"), n, block=pl.Series(block), age=pl.Series(step) * pl.col("speed"), **sums
    )
    return counted.select(pl.col(name).cast(kind) for name, kind in RIGID.items())
