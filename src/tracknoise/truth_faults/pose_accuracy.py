"""Errors of stated poses with intervals, and the accuracy of poses for the settings of an experiment.

The law by which the error of the relative pose of two frames grows is fitted to (pose.growth) of all scenes. Pose
errors that are independent from frame to frame have relative errors of the same size at every distance. Those of a
random walk grow with its root. Of each coordinate of the rotation and of the translation, at k frames,

    mean square = 2 white^2 + walk^2 k    (pose.law)

is fitted by least squares with weights 1/k and no negative part. A turn and a move to the side look alike where depth
varies little: tracks may then show a large rotation beside a negative square of the translation. What they show well is
the motion of the image. With the mean squares r and t of rotations and translations by (pose.law), and with what one
degree and one metre make of the errors without outliers,

    px^2 by degrees r + px^2 by metres t = what pose errors explain of the second moment    (pose.image)

is fitted too, all in px^2, with weights that are much larger. All parts are then made so small that
the sum is at no distance larger than the second moment of the errors.
"""

from collections.abc import Iterable, Mapping
from itertools import chain, combinations
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimated, units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, pooled
from tracknoise.statistics.definitions import POOLED, REFERENCE_AGE
from tracknoise.statistics.grouping import Tables, by_condition
from tracknoise.tables.findings_schema import ESTIMATE_COLUMNS, INTERVAL_COLUMNS
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import ESTIMATED_OF_N, OF_CONDITION, OF_VIEW, Rows, RunTable, Value, one_number
from tracknoise.tables.schema import FITTED_TO, POSE_GROWTH, RIGID, VIEW, check, empty
from tracknoise.tables.schema import POOLED as CONDITIONS


def _shared_motion() -> Rows:
    values = [
        Value("shared_motion", "share", carried=ESTIMATED_OF_N),
        Value("shared_motion_moment", "second_px2", {"against": "measured"}),
        Value("shared_motion_moment", "left_px2", {"against": "left"}),
    ]
    keys = {**OF_CONDITION, "part": "fitted_to", "at": "age", "coordinate": "coordinate"}
    return Rows("shared motion", keys, values)


RIGID_SHARE = RunTable(
    "rigid_share",
    {
        **CONDITIONS,
        "fitted_to": FITTED_TO,
        "age": pl.Int64,
        "coordinate": pl.String,
        "n": pl.Int64,
        "second_px2": pl.Float64,
        "left_px2": pl.Float64,
        "share": pl.Float64,
        **INTERVAL_COLUMNS,
    },
    _shared_motion(),
    title="share of errors that pose errors explain",
    quantities={
        "shared_motion": Quantity("share", "Share of the second moment that one small pose error per frame explains."),
        "shared_motion_moment": Quantity("px^2", "Second moment before and after a correction of the poses."),
    },
    without_truth=True,
)
"""Share of the second moment of the errors that one small pose error per frame explains, by age.

The pose errors are fitted to other tracks: to the other half of the tracks of the same tracker (`own`), or of all other
trackers (`others`), where n counts only errors for which these know it. second_px2 is the second moment about zero of n
errors, left_px2 what a correction of the poses leaves of it. share does not contain the noise of the fit, which
left_px2 does. coordinate is u, v or both.
"""

POSE_SHARE = RunTable(
    "pose_share",
    {
        **CONDITIONS,
        "fitted_to": FITTED_TO,
        "n": pl.Int64,
        "share": pl.Float64,
        **INTERVAL_COLUMNS,
    },
    one_number("pose share", "pose_share", "share", {**OF_CONDITION, "part": "fitted_to"}, ESTIMATED_OF_N),
    title="share of errors without outliers that pose errors explain",
    quantities={
        "pose_share": Quantity(
            "share", "Share of the squared errors up to the reference age, without outliers, that pose errors explain."
        ),
    },
    without_truth=True,
)
"""The same share of both coordinates and of all steps up to the reference age together, without outliers: (pose.share).

n counts errors, outliers too. low and high hold whatever the share is of errors for which nothing is predicted.
"""

POSE_LAW = RunTable(
    "pose_law",
    {
        "dataset": pl.String,
        **VIEW,
        "motion": pl.String,
        "law": pl.String,
        "unit": pl.String,
        "n": pl.Int64,
        **ESTIMATE_COLUMNS,
    },
    one_number(
        "pose errors",
        "pose_error",
        "value",
        {"dataset": "dataset", **OF_VIEW, "part": "motion", "of": "law"},
        ESTIMATED_OF_N | {"unit": "unit"},
    ),
    title="growth of pose errors",
    quantities={"pose_error": Quantity(None, "Growth law of the errors of the stated poses.")},
    without_truth=True,
)
"""Growth law of the errors of the stated poses, fitted to `POSE_GROWTH`: one row per motion and part of the law.

motion is `rotation` or `translation`. The part `white` is the standard deviation of one coordinate of a single pose,
`random walk` that of its change from one frame to the next. Both are what the tracks see as a motion of the camera,
whatever its cause.
"""

_SUMS = ["n", "error_uu", "error_vv", "left_uu", "left_vv", "rigid_uu", "rigid_vv"]
_POINT = ["fitted_to", "age"]
_COORDINATES = ("u", "v", "both")


def rigid_share(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Share of the second moment that pose errors explain, by age and coordinate.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `RIGID`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `RIGID_SHARE`, sorted.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(sums, RIGID, "rigid")
    table = condition_table(conditions, RIGID_SHARE, _rigid_share_rows, sampling)
    return check(table.sort([*POOLED, *_POINT, "coordinate"]), RIGID_SHARE, "rigid share")


def _rigid_share_rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per coordinate, source of the pose errors and age of a condition."""
    units = units_of(sums, sums, points=_POINT, columns=_SUMS, groups=draws.groups)
    estimates = pooled(units, draws.weights(units), _shares, method)
    labels = pl.DataFrame({"coordinate": _COORDINATES}).join(units.points, how="cross")
    total = units.sums.sum(axis=0).T
    n = np.tile(total[0], len(_COORDINATES))
    moments = {
        name: pl.Series(_by_coordinate(total[places]).ravel() / np.where(n > 0, n, np.nan))
        for name, places in (("second_px2", slice(1, 3)), ("left_px2", slice(3, 5)))
    }
    rows = estimated(labels, estimates, units, RIGID_SHARE, value="share").with_columns(pl.Series("n", n), **moments)
    return rows.with_columns(pl.col("share", "low", "high").fill_nan(None)).drop_nulls("share")


def scene_shares(rigid: pl.DataFrame) -> dict[str, float]:
    """Cut share that pose errors explain in each scene, of the tracker of which they explain most, where it is known.

    Parameters
    ----------
    rigid
        Schema `RIGID`, of one view and speed.
    """
    near = rigid.filter(pl.col("age") <= REFERENCE_AGE)
    sums = near.group_by("scene", "tracker", "fitted_to").agg(pl.col("cut_error", "cut_rigid").sum())
    shares = sums.filter(pl.col("cut_error") > 0.0).with_columns(share=pl.col("cut_rigid") / pl.col("cut_error"))
    best = shares.group_by("scene", "tracker").agg(pl.col("share").min())
    return dict(best.group_by("scene").agg(pl.col("share").max()).sort("scene").iter_rows())


def _shares(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares in u, in v and in both, (3, points, ...), of the sums of `_SUMS`; NaN where all errors are 0."""
    error, rigid = _by_coordinate(sums[1:3]), _by_coordinate(sums[5:7])
    return np.asarray(rigid / np.where(error > 0.0, error, np.nan))


def _by_coordinate(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums in u, in v and in both, (3, ...), of those in u and v, (2, ...)."""
    return np.concatenate([sums, sums.sum(axis=0, keepdims=True)])


def pose_share(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Share of the errors, without outliers, that pose errors explain: (pose.share), of steps up to `REFERENCE_AGE`.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `RIGID`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `POSE_SHARE`, sorted.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    near = pl.col("age") <= REFERENCE_AGE * pl.col("speed").cast(pl.Int64)
    conditions = {key: part.filter(near) for key, part in by_condition(sums, RIGID, "rigid").items()}
    table = condition_table(conditions, POSE_SHARE, _pose_share_rows, sampling)
    return check(table.sort([*POOLED, "fitted_to"]), POSE_SHARE, "pose share")


def _pose_share_rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per source of the pose errors of a condition."""
    columns = ["n", "cut_error", "cut_rigid", "cut_unknown"]
    units = units_of(sums, sums, points=["fitted_to"], columns=columns, groups=draws.groups)
    estimates = pooled(units, draws.weights(units), _cut_shares, method)
    rows = estimated(units.points, estimates, units, POSE_SHARE, value="share")
    n, error, _, unknown = units.sums.sum(axis=0).T
    part = pl.Series(unknown / np.maximum(error + unknown, 1e-300))
    low, high = pl.col("low") * (1.0 - part), pl.col("high") * (1.0 - part) + part
    counted = rows.with_columns(
        pl.Series("n", n), low=pl.min_horizontal("low", low), high=pl.max_horizontal("high", high)
    )
    return counted.with_columns(pl.col("share", "low", "high").fill_nan(None)).drop_nulls("share")


def _cut_shares(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares (1, points, ...) of the sums of errors, squares and products; NaN where all errors are 0."""
    return np.asarray(sums[2:3] / np.where(sums[1:2] > 0.0, sums[1:2], np.nan))


LARGEST_LAG = 24
"""Largest distance of two frames to which the law is fitted, frames of the nominal sequence."""
_POSE_LAW_KEYS = ["dataset", *VIEW]
_LABELS = pl.DataFrame(
    {
        "motion": ["rotation", "rotation", "translation", "translation"],
        "law": ["white", "random walk", "white", "random walk"],
        "unit": ["deg", "deg per sqrt(frame)", "m", "m per sqrt(frame)"],
    }
)


def pose_law(growth: Iterable[pl.DataFrame], sampling: Sampling = USUAL) -> pl.DataFrame:
    """White and walking part of the pose errors of each dataset and view, with intervals over scenes.

    Parameters
    ----------
    growth
        Tables of all scenes, schema `POSE_GROWTH`.
    sampling
        How scenes are resampled. A part that is 0 has no smooth statistic, so that ``bca`` takes the place of
        ``student``.

    Returns
    -------
    polars.DataFrame
        Schema `POSE_LAW`, sorted. Bounds are null where scenes are too few.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    method = Method(sampling.kind, sampling.level).by_bootstrap()
    tables = [empty(POSE_GROWTH), *(check(table, POSE_GROWTH, "pose growth") for table in growth)]
    near = pl.concat(tables).filter(pl.col("lag") <= LARGEST_LAG).sort(*_POSE_LAW_KEYS, "scene", "lag")
    parts = [empty(POSE_LAW)]
    for key, part in near.partition_by(_POSE_LAW_KEYS, as_dict=True, maintain_order=True).items():
        draws = sampling.draws({str(key[0]): part["scene"].unique()})[str(key[0])]
        names = [
            pl.lit(value, dtype=POSE_LAW[name]).alias(name) for name, value in zip(_POSE_LAW_KEYS, key, strict=True)
        ]
        table = _pose_law_rows(part, draws, method).with_columns(names)
        parts.append(table.select(pl.col(name).cast(dtype) for name, dtype in POSE_LAW.items()))
    return check(pl.concat(parts), POSE_LAW, "pose law")


_LAW_COLUMNS = ("n", "turned", "moved", "n_seen", "rigid", "error", "by_deg", "by_m")


def _pose_law_rows(growth: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per motion and part of the law."""
    image = ["rigid_px2", "error_px2", "px2_per_degree", "px2_per_metre"]
    seen = pl.col("n") * pl.all_horizontal(pl.col(image).is_not_null()).cast(pl.Int64)
    sums = growth.with_columns(
        turned=pl.col("n") * pl.mean_horizontal("^rotation_.._deg2$"),
        moved=pl.col("n") * pl.mean_horizontal("^translation_.._m2$"),
        n_seen=seen,
        **{short: seen * pl.col(name).fill_null(0.0) for short, name in zip(_LAW_COLUMNS[4:], image, strict=True)},
    )
    units = units_of(sums, points=["lag"], columns=_LAW_COLUMNS, groups=draws.groups)
    lag = units.points["lag"].to_numpy().astype(np.float64)
    sizes = units.sums[..., 0].sum(axis=1)[None]
    estimates = pooled(units, draws.weights(units), lambda sums: _fitted(sums, lag), method, sizes=sizes)
    return estimated(_LABELS, estimates, units, POSE_LAW, value="value").with_columns(
        pl.col("low", "high").fill_nan(None), n=pl.lit(int(sums["n"].sum()))
    )


_IMAGE_WEIGHT = 1e6
"""So large that rotations and translations only say how they share what the image shows."""


def _fitted(sums: NDArray[np.float64], lag: NDArray[np.float64]) -> NDArray[np.float64]:
    """White and walking part of rotation and translation, (4, 1, ...), of sums (columns, lags, ...)."""
    count, seen = sums[0], sums[3]
    turned, moved = (total / np.maximum(count, 1.0) for total in sums[1:3])
    rigid, error, *by = (total / np.maximum(seen, 1.0) for total in sums[4:])
    by_deg, by_m = (np.where(seen > 0, px2, 1.0) for px2 in by)
    k = lag.reshape(-1, *[1] * (count.ndim - 1)) * np.ones_like(count)
    nothing = np.zeros_like(k)
    of_deg, of_m = [2.0 * by_deg, k * by_deg], [2.0 * by_m, k * by_m]
    rows = np.stack([[*of_deg, nothing, nothing], [nothing, nothing, *of_m], [*of_deg, *of_m]])  # (3, 4, lags, ...)
    right = np.stack([by_deg * turned, by_m * moved, rigid])
    weight = np.stack([count > 0, count > 0, _IMAGE_WEIGHT * (seen > 0)]) / k
    parts = _non_negative(
        np.einsum("rk...,rik...,rjk...->...ij", weight, rows, rows),
        np.einsum("rk...,rik...,rk...->...i", weight, rows, right),
    )
    claimed = np.einsum("ik...,...i->k...", rows[2], parts)
    room = np.where((seen > 0) & (claimed > 0.0), error / np.where(claimed > 0.0, claimed, 1.0), 1.0)
    least = np.clip(room.min(axis=0), 0.0, 1.0)
    return np.asarray(np.moveaxis(np.sqrt(parts * least[..., None]), -1, 0)[:, None])


def _non_negative(squares: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """What minimises x' S x - 2 x' g without a negative part, (..., n), for S (..., n, n) and g (..., n).

    The minimum is that of some of the parts, the others 0: all choices are tried. Of equal ones the first counts, with
    the fewest parts.
    """
    n = right.shape[-1]
    best, least = np.zeros_like(right), np.zeros(right.shape[:-1])
    for free in chain.from_iterable(combinations(range(n), count) for count in range(1, n + 1)):
        part, of_part = squares[..., np.array(free)[:, None], free], right[..., free]
        size = np.sqrt(np.maximum(np.einsum("...ii->...i", part), 1e-300))
        scaled = part / (size[..., :, None] * size[..., None, :])
        solution = np.einsum("...ij,...j->...i", np.linalg.pinv(scaled, hermitian=True), of_part / size) / size
        loss = -np.sum(solution * of_part, axis=-1)
        better = (solution >= 0.0).all(axis=-1) & (loss < least * (1.0 + _ROUNDING))
        least = np.where(better, loss, least)
        placed = np.zeros_like(best)
        placed[..., free] = solution
        best = np.where(better[..., None], placed, best)
    return best


_ROUNDING = 1e-9
"""Losses that differ by less than this part are equal."""
LEAST_SHARE = 0.05
"""Smallest share of the second moment that pose errors must explain."""
_ACCURACY_KEYS: Mapping[tuple[str, str], str] = MappingProxyType(
    {
        ("rotation", "white"): "rotation_white_deg",
        ("rotation", "random walk"): "rotation_deg_per_sqrt_frame",
        ("translation", "white"): "translation_white_m",
        ("translation", "random walk"): "translation_m_per_sqrt_frame",
    }
)


def accuracy_toml(law: pl.DataFrame, share: pl.DataFrame, step: int = 1) -> str | None:
    """The block ``[truth.accuracy]`` with the pose errors that the tracks show; None where they do not confirm any.

    They are confirmed if at least two trackers have shares of (rigid.share) that were fitted to other trackers, and if
    at most ages each of these shares is at least `LEAST_SHARE` with an interval above 0. A motion that one tracker
    alone sees may be its own.

    Parameters
    ----------
    law
        Table `POSE_LAW`. Its upright, forward view is used.
    share
        Table `RIGID_SHARE`.
    step
        Frames of the recording from one measured frame to the next, see `tracknoise.truth_faults.audit_summary`.

    Returns
    -------
    str or None
        Values with three digits, in the units of `tracknoise.geometry.accuracy.TruthAccuracy`: a random walk over
        frames of the recording, sqrt(step) times as small as that over measured frames.
    """
    upright = law.filter((pl.col("rotation") == 0) & (pl.col("direction") == "forward"))
    rows = upright.unique(["motion", "law"], keep="first", maintain_order=True)
    if not rows["value"].sum() > 0.0 or not _is_confirmed(share):
        return None
    per_frame = {"white": 1.0, "random walk": step**-0.5}
    lines = [
        f"{_ACCURACY_KEYS[motion, law]} = {value * per_frame[law]:.3g}"
        for motion, law, value in rows["motion", "law", "value"].iter_rows()
    ]
    return "\n".join(["[truth.accuracy]", *lines])


def _is_confirmed(share: pl.DataFrame) -> bool:
    of_others = share.filter((pl.col("fitted_to") == "others") & (pl.col("coordinate") == "both"))
    shown = (pl.col("share") >= LEAST_SHARE) & (pl.col("low").fill_null(0.0) > 0.0)
    by_tracker = of_others.group_by("tracker").agg(most=shown.mean() > 0.5)
    return by_tracker.height > 1 and bool(by_tracker["most"].all())
