"""Columns of every table, their types, and the enumerations in them.

A missing number is null, never 0, -1 or NaN. Columns that identify the origin of a row hold the names from the
settings.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar

import polars as pl
import polars.selectors as cs

from tracknoise.exceptions import SchemaError
from tracknoise.inference.track_noise import NAMES
from tracknoise.tables.enumerations import (
    Aspect,
    Axis,
    EdgeSide,
    FittedMeasure,
    FittedTo,
    FloorSource,
    InputKind,
    Occlusion,
    Population,
    Product,
    Surrounding,
    TrimAmong,
    Trimming,
    TruthQuantity,
    Verdict,
    Weighting,
)


class TruthStatus(IntEnum):
    """Whether the true position of an observation is known and visible.

    The true position of `valid`, `occluded` and `out_of_image` observations is known; that of the others is not.
    behind_camera: the point is behind the camera, or so far from its axis that the lens has no image of it. no_pose:
    the frame has no pose, or the track began in one that has none.
    """

    valid = 0
    no_depth = 1
    edge = 2
    occluded = 3
    out_of_image = 4
    behind_camera = 5
    no_pose = 6


class TrackEnd(IntEnum):
    """Why a track ended.

    lost: the tracker did not find the feature. outlier: it was rejected as inconsistent with the others. displaced:
    it moved farther in one step than the tracker allows. masked: it moved into the border margin or onto another
    feature, or became older than the tracker allows. sequence_end: it was alive in the last frame, so that its lifetime
    is censored.
    """

    lost = 0
    outlier = 1
    displaced = 2
    masked = 3
    sequence_end = 4


Table = TypeVar("Table", pl.DataFrame, pl.LazyFrame)
Schema = Mapping[str, pl.DataType | type[pl.DataType]]

TRUTH = pl.Enum([status.name for status in TruthStatus])
END = pl.Enum([end.name for end in TrackEnd])
POPULATION = pl.Enum(Population)
AXIS = pl.Enum(Axis)
TRIMMING = pl.Enum(Trimming)
AMONG = pl.Enum(TrimAmong)
WEIGHTING = pl.Enum(Weighting)
VERDICT = pl.Enum(Verdict)
ASPECT = pl.Enum(Aspect)
FITTED_MEASURE = pl.Enum(FittedMeasure)

INPUT_KIND = pl.Enum(InputKind)
FLOOR_SOURCE = pl.Enum(FloorSource)
PRODUCT = pl.Enum(Product)
FITTED_TO = pl.Enum(FittedTo)
TRUTH_QUANTITY = pl.Enum(TruthQuantity)
EDGE_SIDE = pl.Enum(EdgeSide)
SURROUNDING = pl.Enum(Surrounding)
OCCLUSION = pl.Enum(Occlusion)

CAUSES = tuple(end.name for end in TrackEnd if end is not TrackEnd.sequence_end)
"""Ends that are not censored: the causes that compete to end a track."""
FAILURES = (TrackEnd.lost.name, TrackEnd.outlier.name)
"""Causes that are failures of the tracker. The others follow from the rules of tracking."""
BY_CAUSE: Schema = {f"n_{cause}": pl.Int64 for cause in CAUSES}
"""Columns that count ended tracks by cause."""

VIEW: Schema = {"lighting": pl.String, "rotation": pl.Int16, "direction": pl.String, "camera": pl.String}
"""View of a scene: lighting, rotation of the images in degrees, direction of play, and camera of a rig."""
SEQUENCE: Schema = {"dataset": pl.String, "scene": pl.String, **VIEW}
CONDITION: Schema = {**VIEW, "tracker": pl.String, "speed": pl.Int32}
POOLED: Schema = {"dataset": pl.String, **CONDITION}
ORIGIN: Schema = {**SEQUENCE, "tracker": pl.String, "speed": pl.Int32}

QUALITY_PREFIX = "quality_"
"""Prefix of the columns with what trackers report about single observations."""
QUALITY_NAME = "[a-z][a-z0-9_]*"
"""Regular expression of what follows `QUALITY_PREFIX`."""


def covariances(quality: Iterable[str]) -> Iterator[tuple[str, str, str]]:
    """Covariances among names of quality: three names ``<name>_uu``, ``<name>_uv`` and ``<name>_vv``, px^2."""
    names = set(quality)
    for name in sorted(key.removesuffix("_uu") for key in names if key.endswith("_uu")):
        entries = (f"{name}_uu", f"{name}_uv", f"{name}_vv")
        if names.issuperset(entries):
            yield entries


@dataclass(frozen=True, slots=True)
class OpenSchema(Mapping[str, pl.DataType | type[pl.DataType]]):
    """Columns that every table of a kind has, and rules for further columns at its end.

    The mapping contains the columns that every table has. After them, a table has either all columns of a group, in
    their order, or none. Any number of columns follow whose names match `pattern`, in alphabetical order.

    Parameters
    ----------
    columns
        Columns that every table has.
    groups
        Columns that a table has all together or not at all.
    pattern, dtype
        Regular expression of the names of further columns, and their type.
    """

    columns: Schema
    groups: tuple[Schema, ...]
    pattern: str
    dtype: type[pl.DataType]

    def __getitem__(self, name: str) -> pl.DataType | type[pl.DataType]:
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)


TRUE_COVARIANCE: Schema = {"cov_true_uu": pl.Float64, "cov_true_uv": pl.Float64, "cov_true_vv": pl.Float64}

LEVERAGE: Schema = {"leverage_uu": pl.Float64, "leverage_uv": pl.Float64, "leverage_vv": pl.Float64}

EPIPOLAR: Schema = {"epipolar_px": pl.Float64, "epipolar_variance": pl.Float64}
SECOND_TRUTH: Schema = {"u_second_px": pl.Float64, "v_second_px": pl.Float64}
PAIR: Schema = dict.fromkeys(
    ("first_du_px", "first_dv_px", "across_px", "along_px", "pair_depth_m", "first_depth_m"), pl.Float64
)
_OBSERVED: Schema = {
    **ORIGIN,
    **dict.fromkeys(("track", "frame", "age"), pl.UInt32),
    **dict.fromkeys(("u_px", "v_px", "u_true_px", "v_true_px"), pl.Float64),
    "truth": TRUTH,
    "du_px": pl.Float64,
    "dv_px": pl.Float64,
    "kept": pl.Boolean,
}
OBSERVATIONS = OpenSchema(
    _OBSERVED, (TRUE_COVARIANCE, LEVERAGE, EPIPOLAR, SECOND_TRUTH, PAIR), QUALITY_PREFIX + QUALITY_NAME, pl.Float32
)
"""One row per feature and frame in which its tracker found it; age counts frames of the nominal sequence.

Where the accuracy of the truth is known and not exact, the table also has `TRUE_COVARIANCE`: the covariance of the
error of the true position, px^2. Where the truth is triangulated, it has `LEVERAGE`, the covariance of the true
position for white noise of 1 px in the observations, no unit, and `EPIPOLAR`: the signed distance from the epipolar
line, px, and the variance of this distance for the same noise, px^2. Where a tracker reports the quality of its
observations, it has one column ``quality_<name>`` for each of them. `SECOND_TRUTH` is the true position by a second
truth, if the experiment has one. Trackers of a second camera have `PAIR`: the error of the position in the first
camera at the same time, the signed distance from its epipolar line and the error along that, px, and the depth along z
of the first camera by both positions, and the true one, metres. All of these are null where they are unknown.
"""


def of_second_camera(observations: pl.DataFrame) -> list[str]:
    """Names of the trackers whose positions in a table of observations are those in the images of a second camera."""
    if not set(PAIR) <= set(observations.columns):
        return []
    return observations.filter(pl.col("across_px").is_not_null())["tracker"].unique().sort().to_list()


def of_first_camera(observations: pl.DataFrame) -> pl.DataFrame:
    """Observations of the trackers whose positions are those in the images of the sequence itself."""
    return observations.filter(~pl.col("tracker").is_in(of_second_camera(observations)))


TRACKS: Schema = {
    **ORIGIN,
    **dict.fromkeys(("track", "first_frame", "lifetime"), pl.UInt32),
    "end": END,
    "response": pl.Float32,
    "depth_m": pl.Float64,
    "gradient_rad": pl.Float32,
    "edge_px": pl.Float32,
    "edge_side": EDGE_SIDE,
    "incidence_deg": pl.Float32,
    "max_error_px": pl.Float64,
    "kept": pl.Boolean,
}
"""One row per track. The lifetime counts frames that its tracker saw, including the first.

gradient_rad is the angle of the dominant image gradient in the first frame of the track, from u towards v. It is an
axis without a sign, and null if no gradient dominates.

edge_px is the distance to the nearest depth edge in the first frame, positive on its near side and negative on its far
side. It is null if there is none within 15 px; edge_side is then `none`. incidence_deg is the angle between the ray and
the normal of the surface there. All three are null where depth is sparse or unknown.
"""

FRAME_COUNTS: Schema = {
    **ORIGIN,
    **dict.fromkeys(("frame", "offered", "matched", "outliers", "new", "alive"), pl.UInt32),
}
"""One row per frame that a tracker saw: F(t-1), the features found again, f1, f2 and F(t)."""

POSES: Schema = {
    **SEQUENCE,
    "frame": pl.UInt32,
    **dict.fromkeys(("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"), pl.Float64),
}
"""One row per frame: world_from_camera as the position of the camera and a unit quaternion with qw >= 0.

All of them are null in a frame without a pose.
"""

MOMENTS: Schema = {
    **ORIGIN,
    "population": POPULATION,
    "trimming": TRIMMING,
    "axis": AXIS,
    "at": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(
        (
            *("mean_u", "mean_v"),
            *("m_uu", "m_uv", "m_vv"),
            *("m_uuu", "m_uuv", "m_uvv", "m_vvv"),
            *("m_uuuu", "m_uuuv", "m_uuvv", "m_uvvv", "m_vvvv"),
            *("mean_abs_u", "mean_abs_v", "m_abs_uu", "m_abs_vv"),
        ),
        pl.Float64,
    ),
}
"""Moments of du, dv at one age, or in one frame: means (px), central power sums (px^p, not divided by n) to order 4."""

BLOCKS: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "population": POPULATION,
    "trimming": TRIMMING,
    "axis": AXIS,
    "at": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(("mean_u", "mean_v", "m_uu", "m_uv", "m_vv", "mean_abs_u", "mean_abs_v"), pl.Float64),
}
"""Moments as in `MOMENTS`, by blocks of tracks that began at similar times."""

ASPECTS: Schema = {"aspect": ASPECT, "at_least": pl.UInt32, **MOMENTS}
"""Moments of visible errors along (u) and across (v) a direction, or of long-lived tracks.

The direction is the dominant gradient in the first frame of the feature (aspect `gradient`) or the image motion (aspect
`motion`). The aspect `long_lived` has the errors, in u and v, of tracks that were seen at age `at_least` (frames) or
later. `at_least` is null for the other aspects.
"""

ASPECT_BLOCKS: Schema = {"aspect": ASPECT, "at_least": pl.UInt32, **BLOCKS}
"""Moments as in `ASPECTS`, and of changes (aspect `change`, see `INCREMENTS`), by blocks of tracks."""

SCALES: Schema = {
    **ORIGIN,
    "population": POPULATION,
    "trimming": TRIMMING,
    "axis": AXIS,
    "at": pl.UInt32,
    "n": pl.Int64,
    "core_u_px": pl.Float64,
    "core_v_px": pl.Float64,
    "beyond_u": pl.Int64,
    "beyond_v": pl.Int64,
}
"""Robust scale of the errors of a scene at one age, or in one frame.

core is 1.4826 times the median absolute error: the sigma of the Gaussian that has this median. beyond counts the errors
that are larger than three cores. Those of an axis are null where there are too few errors, or more than half of them
are exactly 0 (`tracknoise.statistics.scales`).
"""

SCALE_BLOCKS: Schema = {**SCALES, "block": pl.UInt8}
"""Robust scales as in `SCALES`, by blocks of tracks that began at similar times."""

ENDS: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "lifetime": pl.UInt32,
    "n_ended": pl.Int64,
    "n_censored": pl.Int64,
    **BY_CAUSE,
}
"""Number of tracks of a block that ended or were censored, by lifetime in frames that their tracker saw.

n_ended is the sum of the counts by cause.
"""

INCREMENTS: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "trimming": TRIMMING,
    "lag": pl.UInt32,
    "age": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(("mean_u", "mean_v", "m_uu", "m_uv", "m_vv"), pl.Float64),
    **dict.fromkeys(("lagged_uu", "lagged_vv", "squares_uu", "squares_vv"), pl.Float64),
}
"""Changes of visible errors from one frame that the tracker saw to the next.

Rows of lag 0 hold the means and central sums of all blocks together (block is null), by the age at which changes end.
Rows of lag l >= 1 hold sums over all ages together (age is null), over the n pairs of changes that are l steps apart:
lagged is the sum of their products, squares half the sum of their squares. If the truth is a scan, these rows exist
too, because a change does not depend on where the error is zero.
"""

PAIR_SUMS: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "cell": pl.UInt8,
    **dict.fromkeys(("n", "n_short", "n_near", "n_later"), pl.Int64),
    **dict.fromkeys(("sum_along", "sum_log", "sum_log_depth"), pl.Float64),
    **{f"{name}_{axis}": pl.Float64 for name in ("first", "second", "both") for axis in "uv"},
    **dict.fromkeys(("across_counts", "along_counts", "log_counts"), pl.List(pl.UInt32)),
}
"""Sums of what positions in two cameras say together, by cells of depth (`tracknoise.statistics.pair_sums`).

Of the n observations of a cell, n_short have short errors, n_near a depth near the true one, and n_later are of n_short
and older than 0 frames. first, second and both are sums of products of errors of these in the first camera, in the
second, and of one with the other, px^2. sum_along is of the short ones, px; sum_log is of the logarithms of depths by
both cameras over true ones. The lists are histograms of |across_px|, |along_px| and these logarithms in units of .001.
"""

PAIR_TRACKS: Schema = {
    **ORIGIN,
    "track": pl.UInt32,
    "stands_for": pl.Float32,
    "age": pl.UInt32,
    **dict.fromkeys(("first_du_px", "first_dv_px", "du_px", "dv_px"), pl.Float32),
}
"""Errors in both cameras of the tracks of `NOISE_TRACKS` of trackers of a second camera."""

RIG: Schema = {
    **SEQUENCE,
    **dict.fromkeys(("width", "height"), pl.Int32),
    **dict.fromkeys(("fx_px", "fy_px", "cx_px", "cy_px"), pl.Float64),
    **dict.fromkeys(("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"), pl.Float64),
}
"""The second camera of a sequence, without its distortion, and its pose in the frame of the first: one row."""

FITTED_NOISE: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "measure": FITTED_MEASURE,
    "trimming": TRIMMING,
    "length_low": pl.UInt32,
    "length_high": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(("squares_u", "freedom_u", "squares_v", "freedom_v", "squares", "freedom"), pl.Float64),
}
"""Sums for the noise of tracks with triangulated truth, by blocks of tracks and by length of the track.

squares are sums of squared errors (px^2), freedom their degrees of freedom: 2 N - 3 for a track of N observations. For
the measure `epipolar`, squares is the sum of squared distances over their variances for noise of 1 px, and freedom
their number. The table has no rows for other kinds of truth.
"""

_WINDOW_SUMS: Schema = {
    "trimming": TRIMMING,
    "window": pl.UInt32,
    "n": pl.Int64,
    "n_depth": pl.Int64,
    **dict.fromkeys(("squares_u", "freedom_u", "squares_v", "freedom_v", "squares_z"), pl.Float64),
    "residual_counts": pl.List(pl.UInt32),
    "z_counts": pl.List(pl.UInt32),
}

WINDOW_NOISE: Schema = {**ORIGIN, **_WINDOW_SUMS}
"""Windows of the first N observations of tracks, after a fit of their points (`tracknoise.statistics.windows`).

window is N, n the number of windows, n_depth that of windows that show the depth of their point. squares are sums of
squared residuals (px^2), freedom their degrees of freedom, squares_z the sum of z^2 (px^2). The lists are histograms of
the root mean square residual of each window, and of |z|, in the bins of `tracknoise.statistics.histograms`
(px).
"""

WINDOW_BLOCKS: Schema = {**ORIGIN, "block": pl.UInt8, **_WINDOW_SUMS}
"""The same by blocks of tracks, at the slowest speed."""

NOISE_SUMS: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "product": PRODUCT,
    "age": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(("uu", "uv", "vv"), pl.Float64),
    **dict.fromkeys(NAMES, pl.Float64),
    **dict.fromkeys(("sum_u", "sum_v", "along", "motion"), pl.Float64),
}
"""Sums of products of errors, and of what multiplies the covariance of each component in their expectation.

See `tracknoise.statistics.noise_sums`. uu, uv, vv and motion are in px^2, walk in frames, drift in frames^2.
first and white have no unit. sum_u and sum_v are sums of the errors (px), along that of the errors along the motion of
the image since the frame before, times this motion, and motion that of its square. These four are of the product
`error`. Errors beyond the limit of `NOISE_OUTLIERS` are left out. block is that of the track at the slowest speed, 0 at
others.
"""

NOISE_OUTLIERS: Schema = {
    **ORIGIN,
    "n_tracks": pl.Int64,
    "n": pl.Int64,
    "n_outliers": pl.Int64,
    "limit_px": pl.Float64,
}
"""Errors at the ages of `NOISE_SUMS`, and how many of these are larger than `limit_px` in length."""

CHANGE_TERMS = ("squares", "white_before", *(name for name in NAMES if name not in ("first", "white")))
"""Sums over changes of errors, besides their count: changes have nothing of A, and W has the factor 1 at their end."""

NOISE_COVARIATES: Schema = {
    **ORIGIN,
    "covariate": pl.String,
    "before": pl.Int16,
    "now": pl.Int16,
    "n": pl.Int64,
    **dict.fromkeys(CHANGE_TERMS, pl.Float64),
}
"""Sums over changes of errors by what was known at run time at both of their ends
(`tracknoise.statistics.noise_sums`).

before and now are classes of the covariate. squares is the sum of half the squared length of the changes (px^2).
white_before and n multiply W at the first and the second end in its expectation, the others their own component.
"""

NOISE_TRACKS: Schema = {
    **ORIGIN,
    "track": pl.UInt32,
    "block": pl.UInt8,
    "stands_for": pl.Float32,
    "kept": pl.Boolean,
    "age": pl.UInt32,
    **dict.fromkeys(("du_px", "dv_px", "magnification"), pl.Float32),
    **dict.fromkeys(("across_u", "across_v", "other_u", "other_v", "depth_u", "depth_v"), pl.Float32),
}
"""First observations of some tracks at the slowest speed (`tracknoise.statistics.windows`).

stands_for is the number of tracks that each of them represents. magnification is Z_0 / Z_k. The other columns are
derivatives of the true position, px: by motions of the point in two directions across its first ray, and along this ray
(depth), each by the length of the ray.
"""

NOISE_PAIRS: Schema = {
    **ORIGIN,
    **dict.fromkeys(("first", "second"), pl.String),
    **dict.fromkeys(("first_before", "first_now", "second_before", "second_now"), pl.Int16),
    "n": pl.Int64,
    **dict.fromkeys(CHANGE_TERMS, pl.Float64),
}
"""The same sums by two covariates together, in classes of an octave (`tracknoise.statistics.noise_sums`)."""

TRACK_ERRORS = OpenSchema(
    {
        **ORIGIN,
        "track": pl.UInt32,
        "block": pl.UInt8,
        "age": pl.UInt32,
        **dict.fromkeys(("du_px", "dv_px", "magnification", "motion_px"), pl.Float32),
    },
    (),
    QUALITY_PREFIX + QUALITY_NAME,
    pl.Float32,
)
"""Errors of some tracks of every condition, about their first positions (`tracknoise.statistics.noise_sums`).

magnification is Z_0 / Z_k, and motion_px the motion of the true position since the observation before (null at birth).
Further columns ``quality_<name>`` are those of the observations.
"""

FLOORS: Schema = {
    **ORIGIN,
    "source": FLOOR_SOURCE,
    "axis": AXIS,
    "at": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(("sum_uu", "sum_uv", "sum_vv", "own_uu", "own_vv", "shared_u", "shared_v"), pl.Float64),
}
"""Errors of the true positions of visible observations, by what causes them, and by age or frame.

sum is the sum of the covariances of the n true positions (px^2). own is n^2 times the variance of their mean error, as
far as it is independent from scene to scene; shared is the sum of displacements by an error that all scenes share, px
(`tracknoise.measurement.floors`). Sources whose size is unknown have no rows. Exact sources have zeros.
"""

BETWEEN_TRACKERS: Schema = {
    **ORIGIN,
    "other": pl.String,
    "block": pl.UInt8,
    "age": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(("mean_u", "mean_v", "m_uu", "m_uv", "m_vv"), pl.Float64),
}
"""Differences of the positions of two trackers that track the same corners: `tracker` minus `other`.

Both positions are counted from the first frame, in which both trackers found the same corner. The truth is not used.
Means (px) and central sums (px^2, not divided by n), by the age of both tracks, and by blocks of tracks that began at
similar times.
"""

RIGID: Schema = {
    **ORIGIN,
    "fitted_to": FITTED_TO,
    "block": pl.UInt8,
    "age": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(("error_uu", "error_vv", "left_uu", "left_vv", "rigid_uu", "rigid_vv"), pl.Float64),
    **dict.fromkeys(("cut_error", "cut_rigid", "cut_unknown"), pl.Float64),
}
"""What one small pose error per frame explains of the errors of tracks to which it was not fitted; sums, px^2.

error are squares of the visible errors, left squares of what a correction leaves of them, rigid products of the errors
with the predicted ones. Their expectation is that of the squared error that is due to poses: the noise of the fit does
not add to them, and is part of left. age counts frames from where the error is zero: the first frame of the track, or
the key frame of a scan. Only a sample of the tracks counts, at the lowest speed. Blocks are of frames, from the first
to the last, as what is common to a frame is a single sample, however many tracks it has.

cut_error and cut_rigid are sums of the same squares and products over both coordinates, without outliers, and without
unit: in units of the robust scale of the errors at this age (`tracknoise.truth_faults.pose_errors.cut_products`).
cut_unknown are such squares of errors for which nothing is predicted, which are in no other column.
"""

POSE_GROWTH: Schema = {
    **SEQUENCE,
    "lag": pl.UInt32,
    "n": pl.Int64,
    "rotation_deg": pl.Float64,
    "translation_m": pl.Float64,
    **dict.fromkeys(("rotation_xx_deg2", "rotation_yy_deg2", "rotation_zz_deg2"), pl.Float64),
    **dict.fromkeys(("translation_xx_m2", "translation_yy_m2", "translation_zz_m2"), pl.Float64),
    **dict.fromkeys(("rigid_px2", "error_px2", "px2_per_degree", "px2_per_metre"), pl.Float64),
}
"""Error of the relative pose of two frames, measured by the tracks, by their distance in frames.

The squares are means over n pairs of frames, about the axes of the camera in the later frame, without the noise of the
fit: they are products of two independent fits, and may be negative by chance. rotation_deg and translation_m are roots
of the mean over the three axes. They are null where the squares of this sequence do not show, at 95 %, that the mean is
positive: the error is then too small, or the sequence too short.

The rest is of errors without outliers, this far from where they are zero, of trackers that saw images, px^2 of both
coordinates together: rigid_px2 is what pose errors explain of their second moment error_px2. px2_per_degree and
px2_per_metre are what a relative pose error of one degree about each axis makes, and one of one metre along each. Null
where nothing is known.
"""
POINT_TRACKING: Schema = {
    **ORIGIN,
    "raster": pl.String,
    "n_points": pl.Int64,
    **dict.fromkeys(("delta_avg", "delta_avg_reported", "average_jaccard", "occlusion_accuracy"), pl.Float64),
    "expected_feature_age": pl.Float64,
    **{f"{name}_{px}": pl.Float64 for name in ("delta", "delta_reported", "jaccard") for px in (1, 2, 4, 8, 16)},
}
"""Metrics of TAP-Vid and expected feature age of one sequence: two rows per tracker and speed.

raster says whether distances are px of images scaled to 256 x 256 (``256x256``), as TAP-Vid defines them, or px of the
images themselves (``image``). n_points counts the tracks with a known point. A metric is null where no frame can be
evaluated. delta counts all positions, and is null where the tracker states none of points that it predicts to be
occluded; delta_reported counts those that it reports as visible.
"""

TRUTH_DIFFERENCES: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "quantity": TRUTH_QUANTITY,
    "trimming": TRIMMING,
    "age": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(("u", "v", "uu", "uv", "vv"), pl.Float64),
}
"""Sums over the observations that two truths know: of a quantity (px) and of its products about zero (px^2).

By age and block of tracks, at the lowest speed. Observations are visible by the first truth. The table has no rows
unless the experiment has a second truth.
"""

POSE_DIFFERENCES: Schema = {
    **SEQUENCE,
    "block": pl.UInt8,
    "lag": pl.UInt32,
    "n": pl.Int64,
    "rotation_rad2": pl.Float64,
    "translation_m2": pl.Float64,
}
"""Sums over pairs of frames that are `lag` frames apart: squared difference of the relative poses of two truths.

rotation_rad2 and translation_m2 are per axis: one third of the squared length. Blocks are stretches of the sequence.
The table has no rows unless the experiment has a second truth.
"""

SAMPLES: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "age_low": pl.UInt32,
    "age_high": pl.UInt32,
    "track": pl.UInt32,
    "at": pl.UInt32,
    "du_px": pl.Float64,
    "dv_px": pl.Float64,
    "kept": pl.Boolean,
}
"""Single visible errors, at most one per track and band of ages, for statistics that moments do not give."""

PLACE_SUMS: Schema = {"n": pl.Int64, **dict.fromkeys(("sum_u", "sum_v", "sum_uu", "sum_uv", "sum_vv"), pl.Float64)}
"""Number of errors, and sums of du, dv (px) and of their products (px^2)."""
_PLACE: Schema = {**ORIGIN, "block": pl.UInt8, "axis": AXIS, "at": pl.UInt32}

SURROUNDINGS: Schema = {
    **_PLACE,
    "surrounding": SURROUNDING,
    "low": pl.Float64,
    "high": pl.Float64,
    "occlusion": OCCLUSION,
    **PLACE_SUMS,
    "n_directed": pl.Int64,
    **dict.fromkeys(("sum_along", "sum_across", "sum_along_2", "sum_across_2"), pl.Float64),
}
"""Sums of untrimmed errors at a few ages, by what surrounds a feature in its first frame, and by its parallax.

low and high bound a class of the property: depth (m), edge (signed distance, px), incidence (degrees) or parallax
(px). Both are null in the class of features without an edge in reach. The last sums are of the n_directed errors whose
true position has moved since the frame before: along and across this motion. occlusion divides each class; `now` is not
visible.
"""

RATIOS: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "quantity": pl.String,
    "trimming": TRIMMING,
    "axis": AXIS,
    "at": pl.UInt32,
    "n": pl.Float64,
    "sum": pl.Float64,
}
"""Sums of the quantities `tracknoise.tables.quantities.RATIOS`, whose value is sum / n, by block, trimming and age."""

COVARIANCE_FRAMES = ("image", "own", "motion")
"""Axes in which the shape of covariances is looked at: of the image, of each covariance, along the motion."""

COVARIANCE_SUMS: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "covariance": pl.String,
    "trimming": TRIMMING,
    "axis": AXIS,
    "at": pl.UInt32,
    "n": pl.Float64,
    **dict.fromkeys(("inside_50", "inside_90", "inside_95", "inside_99"), pl.Float64),
    **dict.fromkeys(("squares", "log_det", "px2", "impossible"), pl.Float64),
    **{f"{frame}_{name}": pl.Float64 for frame in COVARIANCE_FRAMES for name in ("total", "along", "turned")},
    **dict.fromkeys(("elongation", "fourth", "n_large", "large_px", "n_small", "small_px"), pl.Float64),
}
"""Sums of visible errors for which a tracker predicted a covariance, by block, trimming and age.

at is null for all ages together. covariance is the name in its columns ``quality_<name>_uu``. inside_50 to inside_99
count errors in the regions of these levels, %. squares are of the Mahalanobis distance, log_det of the determinant
(px^4), px2 of the length of the error. impossible counts covariances that are not positive definite, which no other
number holds. Of errors whitened by their covariance, total sums the squared length, along the square along the first
axis of a frame minus that across, and turned the same in axes turned by 45 degrees. Those of own axes count by the
elongation of the covariance, (l1 - l2) / (l1 + l2) of its eigenvalues, which elongation sums. fourth sums the fourth
power of the Mahalanobis distance. large_px sums the length of the n_large errors whose mean predicted variance exceeds
the geometric mean of the scene, small_px that of those below it.
"""

IMAGE_MAP: Schema = {
    **_PLACE,
    "column": pl.UInt8,
    "row": pl.UInt8,
    "n": pl.Int32,
    **dict.fromkeys(("sum_u", "sum_v", "sum_uu", "sum_uv", "sum_vv"), pl.Float32),
}
"""Sums of visible, untrimmed errors at a few ages by cell of the image, from its left and its top."""

IMAGE_SPEEDS: Schema = {
    **_PLACE,
    "low": pl.Float64,
    "high": pl.Float64,
    "n": pl.Int64,
    **dict.fromkeys(("sum_along", "sum_across", "sum_along_2", "sum_across_2"), pl.Float64),
}
"""Sums of visible, untrimmed errors along and across the image motion, by its speed (px per frame, low to high)."""

PATCHES: Schema = {
    **ORIGIN,
    "at": pl.UInt32,
    "n_each": pl.UInt8,
    "track": pl.List(pl.UInt32),
    "frame": pl.List(pl.UInt32),
    "anchor_frame": pl.List(pl.UInt32),
    "du_px": pl.List(pl.Float64),
    "dv_px": pl.List(pl.Float64),
    "sheet": pl.Binary,
    "strip": pl.Binary,
}
"""Pictures of the tracks with the largest, middle and smallest errors at an age, or in a frame of a run with a scan.

The lists have the n_each worst tracks, the worst first, then n_each around the median and n_each best ones. A track was
seen in `frame`, where its error is du, dv; its error is zero in anchor_frame. sheet is a WebP image with a row of two
patches for each track: in the anchor frame and in `frame`, each centred on the pixel nearest to the observed position.
strip is a WebP image with patches of the worst track side by side, from its anchor frame on. Patches are squares of
`tracknoise.tables.defaults.PATCH_PX`.
"""

FILM: Schema = {"frame": pl.UInt32, "image": pl.Binary}
"""Images of the first frames of a sequence, small, as JPEG files; as WebP files in earlier runs."""

INPUTS: Schema = {
    "kind": INPUT_KIND,
    "in_data": pl.Boolean,
    "path": pl.Binary,
    "always": pl.Boolean,
    "size": pl.Int64,
    "mtime_ns": pl.Int64,
    "content": pl.String,
}
"""What a sequence was measured from, a row for each file and folder.

in_data: path is relative to the folder of the data. path: the bytes of a file name. always: whether the content is
compared even if size (bytes) and time of modification are the same. size: -1 of what has none; of ``frames``, their
number. content: a checksum of the content, or of the names in a folder; empty if it was not read.
"""

REFERENCES: Schema = {
    "kind": pl.UInt8,
    "track": pl.UInt32,
    "frame": pl.UInt32,
    "u_px": pl.Float64,
    "v_px": pl.Float64,
    "sha256": pl.String,
}
"""Reference tracks of a sequence, a row for each observation.

kind: number of the tracker. sha256: of the images, of the settings of the trackers, and of the other columns; the same
in all rows.
"""


def layout_of(schema: Schema, names: Iterable[str]) -> Schema:
    """Columns, in order, that a table with these column names must have: `schema`, unless it is open."""
    if not isinstance(schema, OpenSchema):
        return schema
    present = set(names)
    group = {name: kind for group in schema.groups if present & group.keys() for name, kind in group.items()}
    more = sorted(name for name in present if re.fullmatch(schema.pattern, name))
    return {**schema.columns, **group, **dict.fromkeys(more, schema.dtype)}


def check(table: pl.DataFrame, schema: Schema, name: str) -> pl.DataFrame:
    """Return `table` unchanged if it has exactly the columns of `schema`, in order and type.

    An `OpenSchema` allows more columns, by its rules.

    Parameters
    ----------
    table
        The table.
    schema
        Column names and types, in order.
    name
        Name of the table in the error.

    Raises
    ------
    SchemaError
        Naming the first column that differs, or what is no table.
    """
    require_table(table, name)
    columns = list(zip(table.columns, table.dtypes, strict=True))  # quicker than its schema
    schema = layout_of(schema, table.columns)
    expected = [(column, kind() if isinstance(kind, type) else kind) for column, kind in schema.items()]
    for position, pair in enumerate(expected):
        actual = columns[position] if position < len(columns) else None
        if actual != pair:
            shown = f"{actual[0]}: {actual[1]}" if actual else "nothing"
            raise SchemaError(f"{name}: column {position} is {shown}, expected {pair[0]}: {pair[1]}")
    if len(columns) > len(expected):
        raise SchemaError(f"{name}: unexpected column {columns[len(expected)][0]!r}")
    return table


def require_table(found: object, name: str) -> pl.DataFrame:
    """What was found, if it is a table. Raises SchemaError, naming it, otherwise."""
    if not isinstance(found, pl.DataFrame):
        raise SchemaError(f"{name}: found {type(found).__name__}, expected a table (polars.DataFrame)")
    return found


def storable(table: Table) -> Table:
    """A table in which numbers that are not finite are null: what is infinite relative to something is unknown."""
    finite = pl.element().is_finite()
    single = cs.float()
    lists = [
        name for name, kind in table.collect_schema().items() if isinstance(kind, pl.List) and kind.inner.is_float()
    ]
    return table.with_columns(
        pl.when(single.is_finite()).then(single),
        *(pl.col(name).list.eval(pl.when(finite).then(pl.element())) for name in lists),
    )


def check_stored(table: pl.DataFrame, schema: Schema, name: str) -> pl.DataFrame:
    """As `check`, of a table that was read: every number in it is finite or null too.

    Raises
    ------
    SchemaError
        Naming the first column that differs, or that holds another number.
    """
    for column in check(table, schema, name).iter_columns():
        values = column.explode() if isinstance(column.dtype, pl.List) else column
        if values.dtype.is_float() and not values.is_finite().all():  # which leaves out null
            value = values.filter(~values.is_finite())[0]
            raise SchemaError(f"{name}: column {column.name} holds {value}, expected finite numbers or null")
    return table


_LATER_COLUMNS = ("near_px",)
"""Last columns of tables that earlier versions did not write."""


def of_this_version(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """A table of an earlier version, whose enumerations lack later categories, or whose names are strings.

    Enumerations are extended only if those of `schema` have all of their categories. Last columns that are not in it
    are null.
    """
    stored = table.schema  # made anew whenever it is asked for
    kinds = dict(schema).items()
    changed = [pl.col(name).cast(kind) for name, kind in kinds if name in stored and _continues(kind, stored[name])]
    changed += [pl.lit(None, kind).alias(name) for name, kind in kinds if name in _LATER_COLUMNS and name not in stored]
    return table.with_columns(changed) if changed else table


def _continues(new: object, old: object) -> bool:
    """Whether an enumeration has all categories of another and more, or categories replace strings."""
    if isinstance(new, pl.Categorical):
        return old == pl.String
    if isinstance(new, pl.List) and isinstance(old, pl.List):
        return _continues(new.inner, old.inner)
    if not (isinstance(new, pl.Enum) and isinstance(old, pl.Enum)) or new == old:  # as in almost every table
        return False
    return set(old.categories) < set(new.categories)


def joined(tables: Iterable[pl.DataFrame], schema: Schema) -> pl.DataFrame:
    """One table of several that have the columns of `schema`; a column that only some of them have is null elsewhere.

    Parameters
    ----------
    tables
        Any number.
    schema
        Column names and types, in order.
    """
    together = pl.concat([empty(schema), *tables], how="diagonal")
    return together.select(list(layout_of(schema, together.columns)))


def empty(schema: Schema) -> pl.DataFrame:
    """A table with the columns of `schema` and no rows."""
    return pl.DataFrame(schema=dict(schema))


def typed(table: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """The columns of `schema` of a table, in its order and of its types: what `check` would find right."""
    return table.select_seq(pl.col(name).cast(kind) for name, kind in schema.items())
