"""How much of the errors the truth could explain at most, whatever is wrong with it and whether or not it is found.

- Constant faults: all parameters of the audit together, with no bias of the trackers beside them. A fault that cannot
  be separated from another one, or from a bias, is in the bound. One that moves no true position adds nothing to it.
- Depths that are wrong by chance, each by itself. Such an error moves a true position along the epipolar line only.

The first is of errors in units of the robust scale of their tracker and age, in which those beyond three scales do not
count: the share 1 - sum min(d^2, 9) / sum min(d0^2, 9) for residuals d of a robust linear regression of the
errors d0 on the derivatives of true positions. It is of the errors that it was fitted to, and so an upper bound.
(truth.faults)

For the second, with the derivative g of a true position by the logarithm of its depth Z, and variances of errors along
and across g, without those beyond three scales, in cells of like g,

    along - across = a + s^2 (g Z^m)^2    (truth.depths)

is fitted to the cells of each tracker and age. A tracker whose noise is larger along the motion of the image has it in
a. The share is that of sum s^2 (g Z^m)^2 in the sum of both variances. How errors of depths grow with depth is not
known: as those of a scan, by a part of the depth, or as those of stereo (m = -1, 0, 1). The one that bounds least
counts. Where g Z^m hardly differs, as of stereo where the camera moves evenly to the side, a is unknown, and all of
along - across counts. Where depth maps of different frames were compared (`tracknoise.truth_faults.depth_repeats`), s
is also known from them at each depth, whatever the trackers do: no bound, but the share of what the maps do not repeat.

The same fault moves the true positions of one tracker farther than those of another, which follows other points. With
the median q of the squares of derivatives of true positions by a number c of the faults, relative to that of all
trackers at the same age, tracker i is moved

    m_i = max over c of q_ic / min over j of q_jc                                             (truth.moved)

times as much, in px^2, as the tracker that c moves least.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.inference.robust_fits import LEAST_PX, scales, summed
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.truth_faults.audit_fit import MEDIAN_TO_CORE, Gain, gain, jackknife_half_width, losses
from tracknoise.truth_faults.audit_samples import AuditSamples, numbered
from tracknoise.truth_faults.corrected_positions import predict
from tracknoise.truth_faults.fault_parameters import COUNT, Parameter, furthest
from tracknoise.truth_faults.pose_errors import CUT

NAMED_FAULTS, EVERY_FAULT, DEPTHS, DEPTH_MAPS = "named_faults", "every_fault", "depths", "depth_maps"
"""Names of the shares in the family `at_most` of an audit."""
MOVED = "moved"
"""Name of (truth.moved) there."""
_STILL_PX = 1e-3
"""A number whose largest change moves a true position less than this says nothing."""
_ROUNDS = 8
_POWERS = (-1, 0, 1)
"""m of (truth.depths)."""
_SAME = 0.01
"""Squares of derivatives are alike if their variance is less than this part of their mean square."""
_CELLS, _LEAST_IN_CELL = 5, 12
"""Cells of each tracker and age by the derivative by depth, at most, and fewest errors of one."""


@dataclass(frozen=True, slots=True)
class Explained:
    """Shares of the errors that the truth could explain.

    Attributes
    ----------
    faults
        By all constant faults together.
    depths
        By random errors of single depths; None where there are too few errors of like derivatives.
    depth_maps
        By errors of depths that their maps do not repeat; None where that is unknown.
    """

    faults: Gain
    depths: Gain | None
    depth_maps: Gain | None


def explained(samples: AuditSamples, parameters: Sequence[Parameter]) -> Explained:
    """How much the truth could explain of the errors of some observations.

    Parameters
    ----------
    samples
        The observations, of one tracker.
    parameters
        Those that can be fitted.
    """
    error = samples.observed - samples.stated
    scale = scales(samples.group, error)
    stated = predict(samples, np.zeros(COUNT))
    by_depth = stated.by([Parameter.depth_scale])[:, :, 0]
    return Explained(
        _by_faults(samples, error, scale, stated.by(parameters), 1.0 / furthest(parameters) ** 2),
        _by_depths(samples, error, by_depth),
        _by_depth_maps(samples, error, by_depth),
    )


def _by_faults(
    samples: AuditSamples,
    error: NDArray[np.float64],
    scale: NDArray[np.float64],
    design: NDArray[np.float64],
    ridge: NDArray[np.float64],
) -> Gain:
    """(truth.faults)."""
    residual, theta = error, np.zeros(len(ridge))
    for _ in range(_ROUNDS):
        information, score = summed(design, residual, scale, ridge)
        theta = theta + np.linalg.solve(information, score - ridge * theta)
        residual = error - design @ theta
    share = gain(losses(samples, residual, scale), losses(samples, error, scale))
    return Gain(max(share.value, 0.0), share.low, max(share.high, 0.0))


def _by_depths(samples: AuditSamples, error: NDArray[np.float64], by_depth: NDArray[np.float64]) -> Gain | None:
    """(truth.depths), with its interval; 0 where depths move nothing, None where errors are too few to tell."""
    length = np.hypot(*by_depth.T)
    if not np.any(length > 0.0):
        return Gain(0.0, 0.0, 0.0)
    rows = [_Rows.of(samples, error, by_depth, length * samples.depth**power) for power in _POWERS]
    by_excess, *laws = _share_of(rows[0], _excess), *(_share_of(of_law, _fitted_share) for of_law in rows)
    if by_excess is None:
        return None
    return max((by_excess if law is None else law for law in laws), key=lambda law: law.high)


def _by_depth_maps(samples: AuditSamples, error: NDArray[np.float64], by_depth: NDArray[np.float64]) -> Gain | None:
    """The share of what depth maps do not repeat, with its interval; None where that is unknown."""
    if samples.depth_sd is None:
        return None
    length = np.hypot(*by_depth.T)
    return _share_of(_Rows.of(samples, error, by_depth, length, samples.depth_sd * length), _repeated_share)


def _share_of(rows: "_Rows", share: Callable[["_Rows", NDArray[np.bool_]], float | None]) -> Gain | None:
    """A share with the interval of the jackknife over clusters, between 0 and 1; None where it is not determined."""
    value = share(rows, np.ones(len(rows.cluster), np.bool_))
    without = [share(rows, rows.cluster != cluster) for cluster in np.unique(rows.cluster)]
    if value is None or any(left_out is None for left_out in without):
        return None
    half = jackknife_half_width(np.array(without, dtype=np.float64))
    return Gain(min(max(value, 0.0), 1.0), value - half, min(max(value + half, 0.0), 1.0))


def moved(samples: AuditSamples, parameters: Sequence[Parameter]) -> dict[int, float | None]:
    """How much more faults move the true positions of each tracker than those of another: (truth.moved).

    Parameters
    ----------
    samples
        Of several trackers.
    parameters
        Those that can be fitted.

    Returns
    -------
    dict of float
        At least 1, by place of the tracker; None where a fault does not move another one at all. Empty where trackers
        share no age up to `REFERENCE_AGE`.
    """
    moves = np.sum(np.square(predict(samples, np.zeros(COUNT)).by(parameters)), axis=1) * furthest(parameters) ** 2
    used = np.flatnonzero(np.isfinite(moves).all(axis=1) & (samples.age <= REFERENCE_AGE))
    trackers, place = np.unique(samples.tracker, return_inverse=True)
    ages, age = np.unique(samples.age[used], return_inverse=True)
    counts = np.bincount(place[used] * len(ages) + age, minlength=len(trackers) * len(ages))
    shared = np.flatnonzero((counts.reshape(len(trackers), len(ages)) >= _LEAST_IN_CELL).all(axis=0))
    if not len(shared):
        return {}
    parts = [used[age == index] for index in shared]
    typical = [np.median(moves[part], axis=0) for part in parts]
    moving = np.min(typical, axis=0) > _STILL_PX**2
    rows = np.concatenate(parts)
    relative = np.concatenate(
        [moves[part] / np.where(moving, typical_move, 1.0) for part, typical_move in zip(parts, typical, strict=True)]
    )
    squares = np.stack([np.median(relative[place[rows] == index], axis=0) for index in range(len(trackers))])[:, moving]
    least = squares.min(axis=0, initial=np.inf)
    ratio = np.divide(squares, least, out=np.full_like(squares, np.inf), where=least > 0.0).max(axis=1, initial=1.0)
    return {
        int(tracker): float(value) if value < np.inf else None for tracker, value in zip(trackers, ratio, strict=True)
    }


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Squared errors along and across (2, n), px^2; groups, cells and clusters (n,).

    moved, repeated (n,): what errors of depths make of them, up to a factor, and by depth maps, px^2.
    """

    squares: NDArray[np.float64]
    moved: NDArray[np.float64]
    repeated: NDArray[np.float64]
    group: NDArray[np.intp]
    cell: NDArray[np.intp]
    cluster: NDArray[np.intp]

    @classmethod
    def of(
        cls,
        samples: AuditSamples,
        error: NDArray[np.float64],
        by_depth: NDArray[np.float64],
        size: NDArray[np.float64],
        repeated: NDArray[np.float64] | None = None,
    ) -> "_Rows":
        """Of samples whose errors of depth are of like size where `size` is; of known ones only."""
        length = np.hypot(*by_depth.T)
        repeat = size if repeated is None else repeated
        used = np.flatnonzero((length > 0.0) & np.isfinite(error).all(axis=1) & np.isfinite(size) & np.isfinite(repeat))
        along = by_depth[used] / length[used, None]
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        squares = np.stack([np.sum(error[used] * axis, axis=1) ** 2 for axis in (along, across)])
        group, cell = _cells(samples.group[used], size[used])
        return cls(squares, size[used] ** 2, repeat[used] ** 2, group, cell, samples.cluster[used])


def _cells(group: NDArray[np.intp], length: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Groups without gaps, and cells of each group by how far depths move positions, alike in number.

    A group with few errors has fewer cells: without its ages, whose errors are the largest, shares would be too small.
    """
    place = numbered(group)
    order = np.lexsort((length, place))
    start = np.searchsorted(place[order], np.arange(place.max(initial=0) + 2))
    rank = np.empty(len(order), np.intp)
    rank[order] = np.arange(len(order)) - start[place[order]]
    sizes = np.diff(start)
    cells = np.clip(sizes // _LEAST_IN_CELL, 1, _CELLS)
    return place, place * _CELLS + (rank * cells[place]) // sizes[place]


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """Cells with enough errors: their groups and counts (cells,), and variances along and across (cells, 2)."""

    members: list[NDArray[np.intp]]
    group: NDArray[np.intp]
    count: NDArray[np.intp]
    variance: NDArray[np.float64]

    @classmethod
    def of(cls, rows: _Rows, used: NDArray[np.bool_]) -> "_Cells":
        """Of some rows, whose numbers are `members`."""
        chosen = np.flatnonzero(used)
        order = chosen[np.argsort(rows.cell[chosen], kind="stable")]
        names, first, counts = np.unique(rows.cell[order], return_index=True, return_counts=True)
        full = counts >= _LEAST_IN_CELL
        members = [order[start : start + count] for start, count in zip(first[full], counts[full], strict=True)]
        variance = [_variances(rows.squares[:, places], rows.moved[places]) for places in members]
        return cls(members, names[full] // _CELLS, counts[full], np.array(variance).reshape(-1, 2))

    def share(self, part: NDArray[np.float64]) -> float:
        """Share of the variances that a part (cells,) of them is, in units of the mean variance of each group.

        Of errors that are none it is nearly 0.
        """
        weight = self.count / self.typical
        return float(np.sum(weight * part)) / float(np.sum(weight * self.total))

    @property
    def total(self) -> NDArray[np.float64]:
        """Both variances of each cell together, (cells,), px^2."""
        return np.asarray(np.maximum(self.variance.sum(axis=1), 2.0 * LEAST_PX**2))

    @property
    def typical(self) -> NDArray[np.float64]:
        """Mean of both variances together in the group of each cell, (cells,), which no cell decides, px^2."""
        means = np.bincount(self.group, self.count * self.total) / np.maximum(np.bincount(self.group, self.count), 1)
        return np.asarray(means[self.group])


def _variances(squares: NDArray[np.float64], moved: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means (2,) of squares along and across (2, n), without those beyond three robust standard deviations of the cell.

    One along is no outlier either if it is none beside what errors of depth make at its place.
    """
    limit = (CUT * MEDIAN_TO_CORE) ** 2
    inside = squares <= limit * np.median(squares, axis=1, keepdims=True)
    of_depth = squares[0] / moved
    inside[0] |= of_depth <= limit * np.median(of_depth)
    return np.asarray((inside * squares).sum(axis=1) / np.maximum(inside.sum(axis=1), 1))


def _fitted_share(rows: _Rows, used: NDArray[np.bool_]) -> float | None:
    """Share that random errors of depths explain, of some rows; None where cells are too few, or too much alike."""
    cells = _Cells.of(rows, used)
    if not cells.members:
        return None
    x = np.array([np.mean(rows.moved[places]) for places in cells.members])
    weight = cells.count / np.maximum(cells.typical, 1e-12) ** 2
    slope = _slope(cells.group, weight, x, cells.variance[:, 0] - cells.variance[:, 1])
    return None if slope is None else cells.share(slope * x)


def _excess(rows: _Rows, used: NDArray[np.bool_]) -> float | None:
    """Share of what is larger along than across, of some rows; None where cells are too few."""
    cells = _Cells.of(rows, used)
    return cells.share(cells.variance[:, 0] - cells.variance[:, 1]) if cells.members else None


def _repeated_share(rows: _Rows, used: NDArray[np.bool_]) -> float | None:
    """The same of errors that depth maps do not repeat, which are at most the variance along."""
    cells = _Cells.of(rows, used)
    if not cells.members:
        return None
    medians = np.array([np.median(rows.repeated[places]) for places in cells.members])
    return cells.share(np.minimum(medians, cells.variance[:, 0]))


def _slope(
    group: NDArray[np.intp], weight: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> float | None:
    """Slope of y over x within groups, by weighted least squares; None where x hardly differs."""
    sums = np.maximum(np.bincount(group, weight), 1e-300)
    left, right = (values - (np.bincount(group, weight * values) / sums)[group] for values in (x, y))
    square = float(np.sum(weight * left * left))
    return float(np.sum(weight * left * right)) / square if square > _SAME * np.sum(weight * x * x) else None
