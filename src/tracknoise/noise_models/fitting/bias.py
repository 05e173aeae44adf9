"""The mean error, and whether a correction by it is warranted.

Two forms are tried: a mean by age, and an error along the motion of the image, e = beta f, with the motion f of the
true position since the frame before. Each is fitted to all scenes but one, in turn. The share of the second moment of
the errors of the scene that was left out, that it removes, is

    sum(2 b' e - b' b) / sum(e' e)    (bias.reduction)

Scenes of one group are left out together if there are enough groups. However few scenes there are, whole scenes are
left out: tracks of a scene share its mean error, so that they would agree on it anyway. A correction is warranted if
this share is at least `LEAST_REDUCTION`, its interval does not reach 0, the mean is more than twice what the errors of
the truth may cause, and no faults of the truth that an audit found explain it.
"""

from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.audit_cover import audited_mean
from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.findings.sampling.jackknife import student_interval
from tracknoise.findings.sampling.units import by_number, units_of
from tracknoise.noise_models.fitting.independent import group_numbers
from tracknoise.noise_models.model import Bias, BiasKind, Interval
from tracknoise.statistics.truth.floor import truth_floor
from tracknoise.tables.enumerations import Axis, FloorSource, Product

Array = NDArray[np.float64]

LEAST_REDUCTION = 0.01
_BEYOND_FLOOR = 2.0
_LEAST = 50
_COLUMNS = ("n", "sum_u", "sum_v", "along", "motion", "squares")


@dataclass(frozen=True, slots=True, eq=False)
class _Form:
    """One form of the mean error: how large it is (px), and its reduction."""

    bias: Bias
    size_px: float
    reduction: Interval


def fit_bias(
    sums: pl.DataFrame,
    floors: pl.DataFrame,
    *,
    groups: SceneGroups,
    level: float,
    audit_curves: pl.DataFrame | None = None,
) -> Bias:
    """The correction that is warranted, or why none is.

    Parameters
    ----------
    sums
        Schema `NOISE_SUMS`, of one tracker and speed.
    floors
        Schema `FLOORS`, of the same.
    groups
        Of scenes that are not independent of each other.
    level
        Of the interval of the reduction.
    audit_curves
        Table `AUDIT_CURVES` of the run; None where it has not been audited yet.
    """
    errors = sums.filter(pl.col("product") == Product.error).with_columns(squares=pl.col("uu") + pl.col("vv"))
    units = units_of(errors, points=["age"], columns=_COLUMNS)
    every = by_number(group_numbers(errors.unique("scene").sort("scene"), groups), units.sums)
    own = every[every[..., -1].sum(axis=1) > 0.0]
    if len(own) < 2:
        return Bias(kind=BiasKind.REFUSED, why="there is only one scene, so that none can be left out")
    ages = units.points["age"].to_numpy()
    best = max((_by_age(own, ages, level), _along(own, level)), key=lambda form: form.reduction.value)
    if reason := _objection(best, floors, int(ages.max())) or _audited(sums, audit_curves, int(ages.max())):
        return Bias(kind=BiasKind.REFUSED, why=reason, reduction=best.reduction)
    return best.bias


def _by_age(own: Array, ages: NDArray[np.int64], level: float) -> _Form:
    total = own.sum(axis=0)
    rest = total - own
    mean = _mean(rest)
    removed = (2.0 * mean * own[..., 1:3]).sum(axis=(1, 2)) - (own[..., 0] * np.square(mean).sum(axis=2)).sum(axis=1)
    known = total[:, 0] >= _LEAST
    every = _mean(total)
    size = float(np.sqrt(np.average(np.square(every).sum(axis=1), weights=total[:, 0])))
    reduction = _reduction(removed, own, level)
    bias = Bias(
        kind=BiasKind.BY_AGE,
        why="the mean error depends on the age of the track, and scenes that were left out agree",
        ages=tuple(ages[known].tolist()),
        mean_px=tuple((float(u), float(v)) for u, v in every[known]),
        reduction=reduction,
    )
    return _Form(bias, size, reduction)


def _mean(sums: Array) -> Array:
    """Mean error (..., ages, 2); 0 where there are fewer than `_LEAST` errors."""
    n = sums[..., :1]
    return np.where(n >= _LEAST, sums[..., 1:3] / np.maximum(n, 1.0), 0.0)


def _along(own: Array, level: float) -> _Form:
    along, motion = own[..., 3].sum(axis=1), own[..., 4].sum(axis=1)
    slope = (along.sum() - along) / np.maximum(motion.sum() - motion, 1e-300)
    reduction = _reduction(2.0 * slope * along - slope**2 * motion, own, level)
    every = float(along.sum() / max(motion.sum(), 1e-300))
    bias = Bias(
        kind=BiasKind.ALONG_MOTION,
        why="the mean error is along the motion of the image, and scenes that were left out agree",
        per_motion=every,
        reduction=reduction,
    )
    return _Form(bias, abs(every) * float(np.sqrt(motion.sum() / own[..., 0].sum())), reduction)


def _reduction(removed: Array, own: Array, level: float) -> Interval:
    """(bias.reduction) of all units together, with its interval over them."""
    squares = own[..., -1].sum(axis=1)
    value = removed.sum() / squares.sum()
    left = np.maximum(squares.sum() - squares, 1e-300)
    low, high = student_interval(value, (removed.sum() - removed) / left, level=level, sizes=squares)
    bounds = [None if np.isnan(bound) else float(bound) for bound in (low, high)]
    return Interval(value=float(value), low=bounds[0], high=bounds[1])


def _objection(form: _Form, floors: pl.DataFrame, last_age: int) -> str | None:
    """Why a correction is not warranted; None if it is."""
    if form.reduction.value < LEAST_REDUCTION:
        return f"it would change the second moment of new scenes by less than {100 * LEAST_REDUCTION:g} %"
    if form.reduction.low is None or form.reduction.low <= 0.0:
        return "scenes that were left out do not agree on it"
    floor = _mean_floor(floors, last_age)
    if floor is None:
        return "the errors of the truth are unknown"
    if form.size_px <= _BEYOND_FLOOR * floor:
        return "errors of the truth may cause the mean error"
    return None


def _audited(sums: pl.DataFrame, audit_curves: pl.DataFrame | None, last_age: int) -> str | None:
    """Why a correction is not warranted where an audit found faults of the truth; None if it is."""
    cover = None if audit_curves is None else audited_mean(audit_curves, sums["tracker"][0], last_age)
    covered = cover is not None and cover.is_covered
    return "faults of the truth that the audit found explain the mean error" if covered else None


def _mean_floor(floors: pl.DataFrame, last_age: int) -> float | None:
    """Largest standard deviation of the mean error that the truth may cause, px; None if it is unknown."""
    of_all = truth_floor(floors).filter(
        pl.col("source") == FloorSource.all, pl.col("axis") == Axis.age, pl.col("at").is_between(1, last_age)
    )
    length = (pl.col("mean_u_px").pow(2) + pl.col("mean_v_px").pow(2)).sqrt()
    found = of_all.select(length.max()).item()
    return None if found is None or of_all["mean_u_px"].null_count() else float(found)
