"""The topic clock: whether poses and images are of the same moment.

The offset is that of the rotation rates that images and poses show. The axes of the camera may show different offsets,
by more than their noise explains. An offset of all axes together then depends on how the camera happened to turn. Axes
that show an offset have offsets d_a and variances v_a. The variance b between axes is that of DerSimonian and Laird.
The offset is then the mean of d_a with weights 1 / (v_a + b), and its variance one over their sum (axes).

Source: R. DerSimonian, N. Laird, Controlled Clinical Trials 7 (1986).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.pose import interpolate_poses
from tracknoise.truth_faults.check_report import Item, Severity, Values
from tracknoise.truth_faults.image_evidence import FEWEST_POINTS, Evidence, Pair, focal_px, relative_pose

_ITERATIONS, _CONVERGED_RAD = 12, 1e-8
_STEP_M = 1e-6
_TUKEY = 4.685
_SMALLEST = 1e-3
"""Lengths of epipolar lines below this count less: the direction of the point is almost that of the motion."""


def image_rotation(
    pair: Pair, camera: CameraModel, translation_m: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """(3,) float64: rotation vector of second_from_first in radians; NaN where it cannot be estimated.

    Shapes: translation_m (3,).
    """
    rotation = _from_depth(pair, camera, translation_m) if pair.has_depth else _from_directions(pair, camera)
    return rotation if np.isfinite(rotation).all() else np.full(3, np.nan)


def _from_depth(pair: Pair, camera: CameraModel, translation_m: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Rotation that, with the translation or any, moves the points of the first frame onto those of the second."""
    valid = np.isfinite(pair.depth_first_m)
    points, observed = camera.unproject(pair.uv_first[valid], pair.depth_first_m[valid]), pair.uv_second[valid]
    rotation = Rotation.identity()
    shift = np.zeros(3) if translation_m is None else translation_m
    for _ in range(_ITERATIONS):
        turned = rotation.apply(points)
        residual = observed - camera.project(turned + shift)
        usable = np.isfinite(residual).all(axis=1)
        if usable.sum() < FEWEST_POINTS:
            return np.full(3, np.nan)
        by_point = _by_point(camera, (turned + shift)[usable])
        jacobian = _by_rotation(by_point, turned[usable])
        if translation_m is None:
            jacobian = np.concatenate([jacobian, by_point], axis=-1)
        step = _weighted_step(jacobian, residual[usable])
        rotation = Rotation.from_rotvec(step[:3]) * rotation
        shift = shift if translation_m is not None else shift + step[3:]
        if np.linalg.norm(step[:3]) < _CONVERGED_RAD:
            break
    return np.asarray(rotation.as_rotvec(), dtype=np.float64)


def _by_point(camera: CameraModel, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2, 3) float64: derivative of pixels with respect to the points, px/m."""
    size = _STEP_M * points[:, 2:]
    moved = [points + sign * size * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    pixels = camera.project(np.concatenate(moved)).reshape(3, 2, len(points), 2)  # all at once is quicker
    return np.stack([(above - below) / (2 * size) for above, below in pixels], axis=-1)


def _by_rotation(by_point: NDArray[np.float64], turned: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2, 3) float64: derivative of pixels with respect to a small rotation of the points, px/rad."""
    x, y, z = turned.T
    still = np.zeros_like(x)
    moved = ((still, -z, y), (z, still, -x), (-y, x, still))  # axes times points: `numpy.cross` takes far longer
    return np.stack([np.einsum("nij,nj->ni", by_point, np.stack(by_axis, axis=-1)) for by_axis in moved], axis=-1)


def _weighted_step(jacobian: NDArray[np.float64], residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3 or 6,) float64: least squares with Tukey's weights, whose scale is the median residual."""
    length = np.linalg.norm(residual, axis=1)
    ratio = length / (_TUKEY * max(1.4826 * float(np.median(length)), 1e-3))
    root = np.where(ratio < 1.0, 1.0 - ratio**2, 0.0)[:, None]
    rows = (jacobian * root[..., None]).reshape(-1, jacobian.shape[-1])
    return np.asarray(np.linalg.lstsq(rows, (residual * root).ravel(), rcond=1e-9)[0], dtype=np.float64)


def _from_directions(pair: Pair, camera: CameraModel) -> NDArray[np.float64]:
    """Rotation for which, with the best direction of translation, points lie on their epipolar lines."""
    first, second = (_unit(camera.bearings(uv)) for uv in (pair.uv_first, pair.uv_second))
    usable = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    first, second = first[usable], second[usable]
    if len(first) < FEWEST_POINTS:
        return np.full(3, np.nan)

    def distances(motion: NDArray[np.float64]) -> NDArray[np.float64]:
        a, b, c = motion[3:] / np.linalg.norm(motion[3:])
        x, y, z = Rotation.from_rotvec(motion[:3]).apply(first).T
        lines = np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1)  # `numpy.cross` takes far longer
        length = np.sqrt((lines**2).sum(axis=1) + _SMALLEST**2)
        return np.asarray((lines * second).sum(axis=1) / length, dtype=np.float64)

    scale = 0.5 / camera.width
    fits = [
        least_squares(distances, np.concatenate([np.zeros(3), axis]), loss="soft_l1", f_scale=scale)
        for axis in np.eye(3)
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    return np.asarray(best.x[:3], dtype=np.float64)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    unit: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit


MOST_FRAMES = 3.5
"""Offsets up to this many frames are looked for."""

_GRID_FRAMES = 0.1
_FEWEST_STEPS, _FEWEST_IN_RUN, _FEWEST_SHARE = 8, 5, 0.5
_BLOCKS = 10
_SCALE_LIMITS = 0.7, 1.4
"""Rates may differ by a factor for each axis, such as that of a wrong focal length."""
_REFINED_FRAMES, _AT_BOUND_FRAMES = 0.5, 0.01
"""An offset is refined within the first of its start. Nearer than the second to that bound, it is no minimum."""
_MOST_REFINEMENTS = 4
_AXES = slice(None), slice(0, 1), slice(1, 2), slice(2, 3)
"""All axes of the camera, and each."""
_FEWEST_REFINED = 4
"""Steps of a refinement; one less than those of a run, because the jackknife leaves out at least one."""


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """Rotation rates between consecutive frames.

    Attributes
    ----------
    steps
        (n,) float64, increasing: first frame of each step.
    by_image, by_poses
        (n, 3) float64, radians per frame, in the axes of the camera; NaN where unknown.
    """

    steps: NDArray[np.float64]
    by_image: NDArray[np.float64]
    by_poses: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """How many frames later than it says a pose belongs.

    Attributes
    ----------
    frames, sd_frames
        Offset, and its standard deviation by a jackknife over stretches of the recording, and by (axes) where the axes
        of the camera differ. The pose at the time of frame i plus the offset fits image i. The standard deviation is
        infinite where no minimum of the differences is found from the best offset of the grid, with all steps or
        without some. Then the offset is not known.
    unexplained
        Median difference of the rates at this offset, relative to the median variation of the image's rate.
    rate_change
        Median change of the rate of the poses from step to step, radians per frame.
    """

    frames: float
    sd_frames: float
    unexplained: float
    rate_change: float


def estimate_offset(rates: Rates) -> ClockOffset | None:
    """Offset at which the rates agree best; None where there are too few steps."""
    runs = _runs(rates)
    if sum(len(run.steps) for run in runs) < _FEWEST_STEPS:
        return None
    splines = [CubicSpline(run.steps, run.by_poses, extrapolate=False) for run in runs]
    observed = np.concatenate([run.by_image for run in runs])

    def predicted(offset: float) -> NDArray[np.float64]:
        return np.concatenate([spline(run.steps + offset) for spline, run in zip(splines, runs, strict=True)])

    grid = np.arange(-MOST_FRAMES, MOST_FRAMES + _GRID_FRAMES / 2, _GRID_FRAMES)
    start = float(grid[int(np.nanargmin([_unexplained(predicted(offset), observed) for offset in grid]))])
    of_all, *of_axes = (_jackknifed(_Refinement(predicted, observed, start, axes)) for axes in _AXES)
    offset, sd = _of_axes(of_all, [estimate for estimate in of_axes if estimate.sd <= MOST_SD_FRAMES])
    offset = offset if np.isfinite(offset) else start
    changes = np.concatenate([np.linalg.norm(np.diff(run.by_poses, axis=0), axis=1) for run in runs])
    return ClockOffset(offset, sd, _unexplained(predicted(offset), observed), float(np.median(changes)))


@dataclass(frozen=True, slots=True)
class _Estimate:
    """An offset and its standard deviation by the jackknife over blocks, frames; infinite where it is not known."""

    offset: float
    sd: float


def _jackknifed(refined: "_Refinement") -> _Estimate:
    """Offset from all steps, and how it varies as blocks of steps are left out."""
    all_steps = np.arange(len(refined.observed))
    offsets = [refined(all_steps)]
    for block in np.array_split(all_steps, _BLOCKS):
        if not np.isfinite(offsets[-1]):  # no further search would make it known
            break
        offsets.append(refined(np.setdiff1d(all_steps, block)))
    is_known = bool(np.isfinite(offsets).all())
    return _Estimate(offsets[0], float(np.sqrt((_BLOCKS - 1) * np.var(offsets[1:]))) if is_known else np.inf)


def _of_axes(of_all: _Estimate, axes: Sequence[_Estimate]) -> tuple[float, float]:
    """Offset and standard deviation by (axes), from the estimates of single axes; of all axes where these agree."""
    if not np.isfinite(of_all.sd) or len(axes) < 2:
        return of_all.offset, of_all.sd
    offsets, variances = np.array([axis.offset for axis in axes]), np.array([max(axis.sd, 1e-6) ** 2 for axis in axes])
    weights = 1 / variances
    excess = weights @ (offsets - np.average(offsets, weights=weights)) ** 2 - (len(axes) - 1)
    if excess <= 0:
        return of_all.offset, of_all.sd
    weights = 1 / (variances + excess / (weights.sum() - (weights**2).sum() / weights.sum()))
    return float(np.average(offsets, weights=weights)), float(max(weights.sum() ** -0.5, of_all.sd))


def _runs(rates: Rates) -> list[Rates]:
    """Stretches of steps that follow each other and have both rates."""
    usable = np.isfinite(rates.by_image).all(axis=1) & np.isfinite(rates.by_poses).all(axis=1)
    places = np.flatnonzero(usable)
    cuts = np.flatnonzero(np.diff(rates.steps[places]) != 1) + 1
    parts = [part for part in np.split(places, cuts) if len(part) >= _FEWEST_IN_RUN]
    return [Rates(rates.steps[part], rates.by_image[part], rates.by_poses[part]) for part in parts]


def _unexplained(predicted: NDArray[np.float64], observed: NDArray[np.float64]) -> float:
    """Median difference of two rates after a factor per axis, relative to the median variation; NaN for few values."""
    is_known = np.isfinite(predicted).all(axis=1)
    if is_known.sum() < max(_FEWEST_IN_RUN, _FEWEST_SHARE * len(observed)):
        return np.nan
    left = observed[is_known] - _factors(predicted[is_known], observed[is_known]) * predicted[is_known]
    variation = observed[is_known] - np.median(observed[is_known], axis=0)
    return float(np.mean(_cut_length(left))) / max(float(np.mean(_cut_length(variation))), 1e-12)


def _cut_length(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) float64: lengths, cut at three times their median."""
    length = np.linalg.norm(vectors, axis=1)
    return np.asarray(np.minimum(length, 3.0 * np.median(length)), dtype=np.float64)


def _factors(predicted: NDArray[np.float64], observed: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) float64: factor per axis that fits best, within `_SCALE_LIMITS`."""
    products, squares = (predicted * observed).sum(axis=0), (predicted**2).sum(axis=0)
    factors: NDArray[np.float64] = np.clip(products / np.maximum(squares, 1e-30), *_SCALE_LIMITS)
    return factors


@dataclass(frozen=True, slots=True, eq=False)
class _Refinement:
    """Robust least squares from a start, for some axes; the same steps are used at every offset around a start."""

    predicted: Callable[[float], NDArray[np.float64]]
    observed: NDArray[np.float64]
    start: float
    axes: slice

    def __call__(self, chosen: NDArray[np.intp]) -> float:
        """Offset from some of the steps, frames; NaN where there are few of them, or no minimum is found.

        A search that ends at its bound is started again from there. All searches of a jackknife that end at the same
        bound agree without having found anything.
        """
        start = self.start
        for _ in range(_MOST_REFINEMENTS):
            offset = self._around(start, chosen)
            if not abs(offset - start) >= _REFINED_FRAMES - _AT_BOUND_FRAMES:  # also of NaN
                return offset
            start = offset
        return np.nan

    def _around(self, start: float, chosen: NDArray[np.intp]) -> float:
        """Best offset within `_REFINED_FRAMES` of a start, frames; NaN for few steps."""
        ends = [self.predicted(start + sign * _REFINED_FRAMES) for sign in (-1.0, 1.0)]
        finite: NDArray[np.bool_] = np.isfinite(np.concatenate(ends, axis=1).sum(axis=1))
        steps = chosen[finite[chosen]]
        if len(steps) < _FEWEST_REFINED:
            return np.nan
        observed = self.observed[steps]
        factors = _factors(self.predicted(start)[steps], observed)
        at_start = observed - factors * self.predicted(start)[steps]
        scale = max(1.4826 * float(np.median(np.abs(at_start[:, self.axes]))), 1e-9)

        def left(moved: NDArray[np.float64]) -> NDArray[np.float64]:
            at_offset = self.predicted(start + float(moved[0]) - 1.0)[steps]
            apart = (observed - _factors(at_offset, observed) * at_offset)[:, self.axes]
            return np.asarray(apart.ravel() / scale, dtype=np.float64)

        limits = 1.0 - _REFINED_FRAMES, 1.0 + _REFINED_FRAMES  # around 1, because differences are relative
        fit = least_squares(left, [1.0], bounds=limits, loss="soft_l1", diff_step=[1e-3])
        return start + float(fit.x[0]) - 1.0


MOST_SD_FRAMES = 0.25
"""Offsets with a larger standard deviation are not known."""
LEAST_FRAMES, SURE_SD = 0.1, 3.0
"""Offsets smaller than this, or than this many standard deviations, are no offsets."""
LEAST_EFFECT_PX = 0.1
"""Offsets that move points by less than this from frame to frame are no caveat."""
_MOST_UNEXPLAINED = 0.8
_PASSES, _NEIGHBOURS_FRAMES = 3, 1.5
_LEAST_RATE_PX = 0.3
"""Rotation per frame, as image motion, below which a clock cannot be seen."""


def clock(evidence: Evidence, timestamps_s: NDArray[np.float64] | None) -> Item:
    """Offset between the times of poses and images, where the rotation rate changes enough to show it.

    `timestamps_s`: None where unknown.
    """
    offset = measured_offset(evidence)
    if offset is None or offset.sd_frames > MOST_SD_FRAMES or not offset.unexplained <= _MOST_UNEXPLAINED:
        text = "The rotation rate changes too little to show an offset between the clocks of images and poses."
        return Item("clock", Severity.unknown, text)
    step = None if timestamps_s is None or len(timestamps_s) < 2 else float(np.median(np.diff(timestamps_s)))
    values: Values = {
        "offset_frames": offset.frames,
        "sd_frames": offset.sd_frames,
        "offset_s": None if step is None else offset.frames * step,
        "sd_s": None if step is None else offset.sd_frames * step,
    }
    size = _size(offset, step)
    effect_px = abs(offset.frames) * offset.rate_change * focal_px(evidence.camera)
    if abs(offset.frames) < max(LEAST_FRAMES, SURE_SD * offset.sd_frames):
        return Item("clock", Severity.ok, f"Clocks of images and poses agree: the offset is {size}.", values)
    when = "later" if offset.frames > 0 else "earlier"
    text = f"Poses and images differ in time: the pose that fits an image is {size} {when} than the image."
    if effect_px < LEAST_EFFECT_PX:
        little = f"From frame to frame this moves points by less than {LEAST_EFFECT_PX:g} px."
        return Item("clock", Severity.ok, f"{text} {little}", values)
    return Item("clock", Severity.caveat, text, values)


def measured_offset(evidence: Evidence) -> ClockOffset | None:
    """Offset of the poses; None where there is next to no rotation, or too little of the recording.

    Rotation and translation are estimated together first. Then the translation is that of the poses at the offset found
    so far, because a small translation and a small rotation look much alike.
    """
    rates = _rates(evidence, None)
    offset = None if rates is None else estimate_offset(rates)
    for _ in range(_PASSES if evidence.has_depth else 0):
        if offset is not None and (again := _rates(evidence, offset.frames)) is not None:
            offset = estimate_offset(again)
    return offset


def _rates(evidence: Evidence, offset_frames: float | None) -> Rates | None:
    """Rotation rates by images and by poses; by images with the translation of poses at an offset, if one is given."""
    steps = evidence.flow.steps
    by_poses = np.array([_pose_rotation(relative_pose(evidence.poses, pair)) for pair in steps]).reshape(-1, 3)
    turned = np.linalg.norm(by_poses[np.isfinite(by_poses).all(axis=1)], axis=1)
    if not len(turned) or np.percentile(turned, 90) * focal_px(evidence.camera) < _LEAST_RATE_PX:
        return None
    translations = _translations(evidence, offset_frames)
    by_image = [image_rotation(pair, evidence.camera, shift) for pair, shift in zip(steps, translations, strict=True)]
    return Rates(np.array([pair.first for pair in steps], dtype=np.float64), np.array(by_image), by_poses)


def _translations(evidence: Evidence, offset_frames: float | None) -> list[NDArray[np.float64] | None]:
    """Translation of second_from_first of each step at an offset, metres; None where it is unknown."""
    steps = evidence.flow.steps
    if offset_frames is None:
        return [None] * len(steps)
    frames = np.arange(len(evidence.poses), dtype=np.float64)
    offset_poses = interpolate_poses(frames, evidence.poses, frames + offset_frames, max_gap_s=_NEIGHBOURS_FRAMES)
    moved = [relative_pose(offset_poses, pair)[:3, 3] for pair in steps]
    return [translation if np.isfinite(translation).all() else None for translation in moved]


def _pose_rotation(relative: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) float64: rotation vector, radians; NaN without a pose."""
    if not np.isfinite(relative).all():
        return np.full(3, np.nan)
    return np.asarray(Rotation.from_matrix(relative[:3, :3]).as_rotvec(), dtype=np.float64)


def _size(offset: ClockOffset, step_s: float | None) -> str:
    """The offset without its sign, with its standard deviation."""
    frames = f"{abs(offset.frames):.2f} ± {max(offset.sd_frames, 0.01):.2f} frames"
    return frames if step_s is None else f"{frames} ({1000 * abs(offset.frames) * step_s:.1f} ms)"
