"""Whether the second camera of a recording is where it is said to be, by points that both cameras see.

Residuals are distances from epipolar lines, and differences along them between the parallax that is seen and that of
the depth of a point, where a depth map or the poses tell it (`tracknoise.geometry.stereo_pair`):

    across,    parallax - atan2(|t x r| q, 1 - q t . r)    (rig.residual)

q is the inverse distance of the point. Residuals are angles, times the pixels of the second camera for a unit of angle.
Turns of the second camera, a factor of t and a delay of its images, in frames, are fitted to both together.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import chain

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.geometry.depth import sample
from tracknoise.geometry.pose import invert
from tracknoise.geometry.stereo_pair import PairRays, StereoPair, unit_rays
from tracknoise.sequences.second_camera import pair_of, second_image
from tracknoise.sequences.sequence import SecondCamera, Sequence, camera_at, second_of
from tracknoise.sequences.stereo import StereoDepth
from tracknoise.text import significant
from tracknoise.trackers.matching import RATIO, mutual_nearest
from tracknoise.truth.plane_sweep import PlaneSweep
from tracknoise.truth.sweep_views import Cameras
from tracknoise.truth.visibility import SequenceGeometry
from tracknoise.truth_faults.check_report import Item, Severity, Values

Array = NDArray[np.float64]

TOPIC = "second camera"
_FRAMES, _FEATURES, _RATIO = 8, 600, 0.8
_SWEPT_POINTS = 60
"""Points of a frame whose depth is asked of the poses."""
_FEWEST_POINTS, _FEWEST_FRAMES = 40, 3
_LARGEST_SIGMA = 0.1
"""A depth by the poses counts with a smaller relative standard deviation."""
_MOST_PX, _MOST_GAIN = 1.0, 0.5
"""A median residual above this is too large. A mistake has to lower it to this part."""
_SIGMAS, _ALIKE = 4.0, 0.9
"""Faults are clear from so many standard deviations on. One that explains this part of another is alike."""
_LEAST_TURN_PX, _LEAST_SCALE, _LEAST_DELAY_PX = 1.0, 0.02, 0.3
"""Sizes of faults that count: what a turn and a delay move, and a relative error of the baseline."""
_LEAST_MOVES_PX = 0.1
"""Moves from image to image that show a delay."""
_ROUNDS, _LEAST_PX = 3, 0.2
_PRIOR = np.array([0.1, 0.1, 0.1, 1.0, 5.0])
"""Sizes of faults that are no surprise, which decide only what the images do not."""


class _Fault(StrEnum):
    """Faults of a rig that are fitted."""

    turn = "turn"
    scale = "scale"
    delay = "delay"


_PLACES = {_Fault.turn: slice(0, 3), _Fault.scale: slice(3, 4), _Fault.delay: slice(4, 5)}


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """Points that both cameras see: (n,), (n, 2) and (n, 3) each."""

    frame: NDArray[np.intp]
    first_uv: Array
    second_uv: Array
    moves: Array  # of the point in the second camera until its next image, px; NaN where unknown
    inverse_m: Array  # inverse depths along z of the first camera; NaN where unknown

    def chosen(self, rows: NDArray[np.bool_]) -> "_Points":
        """Some of the points."""
        return _Points(*(getattr(self, name)[rows] for name in self.__slots__))

    @property
    def moves_px(self) -> float:
        """Median length of the moves, px; 0 where none is known."""
        length = np.linalg.norm(self.moves, axis=1)
        return float(np.nanmedian(length)) if np.isfinite(length).any() else 0.0


class _Sights:
    """Points in both cameras of a rig. Their rays are computed once: with a distortion these take most of the time."""

    def __init__(self, rig: StereoPair, points: _Points) -> None:
        self.rig, self.points = rig, points
        self._moves = np.nan_to_num(points.moves)
        self._second: dict[float, Array] = {}

    @cached_property
    def per_angle(self) -> Array:
        """(n,): pixels of the second camera for a unit of angle."""
        return self.rig.px_per_angle(self.points.second_uv)

    @cached_property
    def _first(self) -> Array:
        return unit_rays(self.rig.first, self.points.first_uv)

    def rays(self, undone: StereoPair, delay: float) -> PairRays:
        """Those of a rig with the same cameras, whose second one took its images this many frames later."""
        if delay not in self._second:
            kept = list(self._second.items())[-1:]  # beside the one that a derivative by the delay needs
            own = unit_rays(self.rig.second, self.points.second_uv - delay * self._moves)
            self._second = dict([*kept, (delay, own)])
        return undone.of_rays(self._first, self._second[delay])


def _residuals_px(seen: _Sights, fault: Array) -> tuple[Array, Array, Array]:
    """(rig.residual), px, with a fault undone: across and along, NaN without a depth; and the parallax.

    This is negative where a point is behind the cameras.
    """
    moved = seen.rig.first_from_second.copy()
    moved[:3, :3] = moved[:3, :3] @ Rotation.from_rotvec(fault[:3]).as_matrix()
    moved[:3, 3] *= np.exp(fault[3])
    undone = replace(seen.rig, first_from_second=moved)
    rays = seen.rays(undone, float(fault[4]))
    expected = undone.parallax(rays, seen.points.inverse_m * rays.unit[:, 2])
    return seen.per_angle * rays.across, seen.per_angle * (rays.parallax - expected), seen.per_angle * rays.parallax


def _misfit_px(seen: _Sights, fault: Array = np.zeros(5)) -> float:  # noqa: B008
    """Median distance of points from where they can be, px: in front of both cameras, at their depth if known."""
    across, along, parallax = _residuals_px(seen, fault)
    return float(np.nanmedian(np.hypot(across, np.where(np.isnan(along), np.minimum(parallax, 0.0), along))))


def second_camera(sequence: Sequence) -> Item | None:
    """The topic second camera of a sequence; None where it has none. Images that cannot be read are a finding."""
    second = second_of(sequence)
    if second is None:
        return None
    pair = _Pair(sequence, second)
    try:
        points = pair.points()
    except DataError as error:
        return Item(TOPIC, pair.severity, f"{error}.")
    if len(points.frame) < _FEWEST_POINTS or len(np.unique(points.frame)) < _FEWEST_FRAMES:
        text = "The second camera cannot be checked: too few points are seen by both."
        return Item(TOPIC, Severity.unknown, text, {"n_points": len(points.frame)})
    seen = _Sights(pair.rig, points)
    fitted, given_px = _Fitted.of(seen), _misfit_px(seen)
    undone = [(_misfit_px(_Sights(one, points)), name) for name, one in pair.mistakes()]
    least_px = min(undone)[0]
    if given_px > _MOST_PX and least_px <= min(_MOST_GAIN * given_px, fitted.left_px / _ALIKE):
        names = [name for px, name in undone if px <= least_px / _ALIKE]
        return _of_mistake(pair, names, given_px, least_px)
    return _of_faults(pair, fitted, points, given_px)


class _Pair:
    """The images of both cameras of a sequence, and points in them."""

    def __init__(self, sequence: Sequence, second: SecondCamera) -> None:
        self.sequence, self.second = sequence, second
        self.rig = pair_of(sequence, second)
        self._geometry = SequenceGeometry(sequence)
        self._sift = cv2.SIFT_create(_FEATURES)  # type: ignore[attr-defined]
        # of depth from the pair: with these both cameras agree whatever is wrong
        self.has_maps = not is_of_pair(sequence) and self._geometry.depth(self._frames[0]) is not None

    @property
    def severity(self) -> Severity:
        """Of a mistake: where depths are those of maps, nothing depends on the second camera."""
        return Severity.caveat if self.has_maps else Severity.fatal

    @property
    def scaled_by(self) -> str:
        """What the distance between the cameras is compared with."""
        return "depths" if self.has_maps else "poses"

    @property
    def is_rectified(self) -> bool:
        """Whether the rig is said to be a rectified pair."""
        turned = Rotation.from_matrix(self.second.first_from_second[:3, :3]).magnitude()
        cameras = (self.sequence.camera, self.second.camera)
        return bool(turned < 1e-6) and not any(any(getattr(camera, "distortion", ())) for camera in cameras)

    @cached_property
    def _frames(self) -> list[int]:
        last = len(self.sequence) - 1
        return [*map(int, np.unique(np.linspace(min(2, last), max(last - 2, 0), _FRAMES).astype(int)))]

    def points(self) -> _Points:
        """Points in some frames."""
        parts = [part for index in self._frames if (part := self._of_frame(index)) is not None]
        if not parts:
            empty = np.empty((0, 2))
            return _Points(np.empty(0, np.intp), empty, empty, empty, np.empty(0))
        return _Points(*(np.concatenate([getattr(part, name) for part in parts]) for name in _Points.__slots__))

    def mistakes(self) -> Iterator[tuple[str, StereoPair]]:
        """What may be wrong with the rig, and the rig without it."""
        given, back = self.rig, invert(self.rig.first_from_second)
        opposite, turned_back = given.first_from_second.copy(), given.first_from_second.copy()
        opposite[:3, 3] *= -1.0
        turned_back[:3, :3] = turned_back[:3, :3].T
        yield "the images of both cameras are swapped", StereoPair(given.second, given.first, back)
        yield "the transformation between the cameras is inverted", replace(given, first_from_second=back)
        yield "the baseline has the wrong sign", replace(given, first_from_second=opposite)
        yield "the rotation between the cameras is inverted", replace(given, first_from_second=turned_back)

    def _of_frame(self, index: int) -> _Points | None:
        image, other = self.sequence.image(index), second_image(self.second, index, self.sequence.source)
        if other is None:
            return None
        first_uv, second_uv = self._matched(image, other)
        if not len(first_uv):
            return None
        frame = np.full(len(first_uv), index, np.intp)
        return _Points(
            frame, first_uv, second_uv, self._moves(index, other, second_uv), self._inverse_m(index, first_uv)
        )

    def _matched(self, image: NDArray[np.uint8], other: NDArray[np.uint8]) -> tuple[Array, Array]:
        """(n, 2) each: positions of the same points in two images, each other's nearest by descriptors."""
        (keys, first), (others, second) = (self._sift.detectAndCompute(one, None) for one in (image, other))
        if first is None or second is None or min(len(first), len(second)) < 2:
            return np.empty((0, 2)), np.empty((0, 2))
        matches = mutual_nearest(first, second)
        clear = matches.chosen(matches.quality[RATIO] < _RATIO)
        uv, others_uv = (np.array([key.pt for key in of], np.float64) for of in (keys, others))
        return uv[clear.query_rows], others_uv[clear.train_rows]

    def _moves(self, index: int, image: NDArray[np.uint8], uv: Array) -> Array:
        """(n, 2): by how much points move until the next image of the second camera, px; NaN where unknown."""
        unknown = np.full(uv.shape, np.nan)
        after = second_image(self.second, index + 1, self.sequence.source) if index + 1 < len(self.sequence) else None
        if after is None:
            return unknown
        moved, is_found, _ = cv2.calcOpticalFlowPyrLK(image, after, uv.astype(np.float32), None)  # type: ignore[call-overload]
        return np.where(is_found == 1, moved - uv, np.nan)

    def _inverse_m(self, index: int, uv: Array) -> Array:
        """(n,): inverse depths, 1/m, by a depth map, or by the poses of some points; NaN where unknown."""
        depth, inverse = self._geometry.depth(index) if self.has_maps else None, np.full(len(uv), np.nan)
        if depth is not None:
            read = sample(depth, uv, camera_at(self.sequence, index))
            return np.where(read.valid, 1.0 / read.depth_m, np.nan)
        if self.has_maps or not self._geometry.has_pose(index):
            return inverse
        chosen = np.unique(np.linspace(0, len(uv) - 1, _SWEPT_POINTS).astype(int))
        swept = self._sweep.found(index, uv[chosen])
        usable = swept.sigma < _LARGEST_SIGMA * swept.inverse_depth
        inverse[chosen[usable]] = swept.inverse_depth[usable]
        return inverse

    @cached_property
    def _sweep(self) -> PlaneSweep:
        return PlaneSweep(self._geometry, Cameras.first)


def is_of_pair(sequence: Sequence) -> bool:
    """Whether depths of a sequence are those of its pair of cameras."""
    shown: object = sequence
    while shown is not None and not isinstance(shown, StereoDepth):
        shown = getattr(shown, "sequence", None)
    return shown is not None


@dataclass(frozen=True, slots=True, eq=False)
class _Fitted:
    """Faults of a rig, of which each explains what those before it leave."""

    faults: Mapping[_Fault, tuple[_Fault, ...]]  # each with those that explain as much
    value: Array  # (5,): turn, rad; logarithm of the factor of the baseline; delay, frames
    sigma: Array  # (5,): by the jackknife over frames
    left_px: float  # median residual with them undone

    @classmethod
    def of(cls, seen: _Sights) -> "_Fitted":
        """Add the fault that explains most, as long as one is clear that is not alike to those before."""
        possible = [_Fault.turn]
        possible += [_Fault.scale] if np.isfinite(seen.points.inverse_m).sum() >= _FEWEST_POINTS else []
        possible += [_Fault.delay] if seen.points.moves_px > _LEAST_MOVES_PX else []
        scale_px = max(_fit(seen, possible)[1], _LEAST_PX)
        faults: dict[_Fault, tuple[_Fault, ...]] = {}
        now = cls(faults, np.zeros(5), np.zeros(5), _misfit_px(seen))
        cost = _cost(seen, now.value, scale_px)
        while rest := [fault for fault in possible if fault not in {*faults, *chain.from_iterable(faults.values())}]:
            tried = {fault: _fit(seen, [*faults, fault], scale_px)[0] for fault in rest}
            gains = {fault: cost - _cost(seen, value, scale_px) for fault, value in tried.items()}
            best = max(rest, key=lambda fault: gains[fault])
            if not _is_large(best, tried[best], seen):
                break
            sigma, places = _jackknife(seen, [*faults, best], tried[best], scale_px), _PLACES[best]
            if not (np.abs(tried[best][places]) > _SIGMAS * sigma[places]).any():
                break
            faults[best] = tuple(one for one in rest if one is not best and gains[one] >= _ALIKE * gains[best])
            now = cls(faults, tried[best], sigma, _misfit_px(seen, tried[best]))
            cost -= gains[best]
        return now


def _residuals(seen: _Sights, fault: Array) -> Array:
    """Both residuals of all points; 0 of pixels without a ray, and of points at the epipole."""
    across, along, _ = _residuals_px(seen, fault)
    return np.asarray(np.nan_to_num(np.concatenate([across, along[np.isfinite(seen.points.inverse_m)]])))


def _cost(seen: _Sights, fault: Array, scale_px: float) -> float:
    return float(np.log1p((_residuals(seen, fault) / scale_px) ** 2).sum())


def _fit(
    seen: _Sights,
    faults: Iterable[_Fault],
    scale_px: float | None = None,
    start: Array = np.zeros(5),  # noqa: B008
) -> tuple[Array, float]:
    """Some faults, (5,), that fit best, and the median residual; its own scale is found where none is given, px."""
    free = np.concatenate([np.arange(5)[_PLACES[fault]] for fault in faults])
    value, left_px = start, _misfit_px(seen)

    def residuals(part: Array) -> Array:
        return np.concatenate([_residuals(seen, _placed(free, part)), part])

    for _ in range(1 if scale_px else _ROUNDS):
        used_px = scale_px or max(left_px, _LEAST_PX)
        found = least_squares(residuals, value[free] / _PRIOR[free], loss="cauchy", f_scale=used_px)
        value = _placed(free, found.x)
        left_px = _misfit_px(seen, value)
    return value, left_px


def _placed(free: NDArray[np.intp], part: Array) -> Array:
    value = np.zeros(5)
    value[free] = part * _PRIOR[free]
    return value


def _jackknife(seen: _Sights, faults: list[_Fault], value: Array, scale_px: float) -> Array:
    frames = np.unique(seen.points.frame)
    parts = (_Sights(seen.rig, seen.points.chosen(seen.points.frame != one)) for one in frames)
    without = np.array([_fit(part, faults, scale_px, value)[0] for part in parts])
    return np.asarray(np.sqrt((len(frames) - 1) / len(frames) * np.sum((without - value) ** 2, axis=0)))


def _is_large(fault: _Fault, value: Array, seen: _Sights) -> bool:
    """Whether a fault counts by its size."""
    length = float(np.linalg.norm(value[_PLACES[fault]]))
    if fault is _Fault.turn:
        return length * float(np.nanmedian(seen.per_angle)) > _LEAST_TURN_PX
    return length > _LEAST_SCALE if fault is _Fault.scale else length * seen.points.moves_px > _LEAST_DELAY_PX


def _of_mistake(pair: _Pair, names: list[str], given_px: float, undone_px: float) -> Item:
    text = (
        f"It looks as if {names[0]}. Points that both cameras see are {significant(given_px, 3)} px from where the rig "
        f"allows them, and {significant(undone_px, 2)} px if that is corrected."
    )
    if len(names) > 1:
        text += f" This recording cannot distinguish it from: {'; or '.join(names[1:3])}."
    values: Values = {"mistake": names[0], "given_px": given_px, "undone_px": undone_px}
    return Item(TOPIC, pair.severity, text, values)


def _of_faults(pair: _Pair, fitted: _Fitted, points: _Points, given_px: float) -> Item:
    longer = float(np.expm1(-fitted.value[3]))  # than it is, relative to what it is
    degrees, of_turn = (float(np.degrees(np.linalg.norm(part[:3]))) for part in (fitted.value, fitted.sigma))
    delay, of_delay = float(fitted.value[4]), float(fitted.sigma[4])
    values: Values = {
        "given_px": given_px,
        "left_px": fitted.left_px,
        "turn_deg": degrees,
        "baseline_off": longer,
        "delay_frames": delay,
    }
    length = f"{abs(longer):.1%} too {'long' if longer > 0.0 else 'short'}"
    when = f"{significant(abs(delay), 2)} ± {of_delay:.1g} frames {'after' if delay > 0.0 else 'before'}"
    says = {
        _Fault.turn: f"the second camera is turned by {significant(degrees, 2)} ± {of_turn:.1g} degrees",
        _Fault.scale: f"the distance between the cameras is {length}, or {pair.scaled_by} are not in metres",
        _Fault.delay: f"images of the second camera were taken {when} those of the first",
    }
    kinds = {
        _Fault.turn: "a turn of the second camera",
        _Fault.scale: "another distance between the cameras",
        _Fault.delay: "other times of its images",
    }
    if fitted.faults:
        text = f"It looks as if {', and '.join(says[fault] for fault in fitted.faults)}."
        text += f" The median residual falls from {significant(given_px, 3)} to {significant(fitted.left_px, 2)} px."
        alike = [kinds[other] for others in fitted.faults.values() for other in others]
        text += f" This recording cannot distinguish it from: {'; or '.join(alike)}." if alike else ""
        text += _NOT_RECTIFIED if _Fault.turn in fitted.faults and pair.is_rectified else ""
        severity = Severity.caveat if [*fitted.faults] == [_Fault.scale] else pair.severity
        return Item(TOPIC, severity, text, values)
    median = f"points are {significant(given_px, 2)} px from where the rig allows them (median)"
    if given_px > _MOST_PX:
        reason = _NOT_RECTIFIED if pair.is_rectified else " Its intrinsics or its distortion are probably wrong."
        return Item(TOPIC, pair.severity, f"The second camera does not fit: {median}.{reason}", values)
    text = f"Both cameras agree: {median}."
    if np.isfinite(points.inverse_m).sum() < _FEWEST_POINTS:
        text += " The distance between the cameras could not be checked: too few depths are known from the poses."
    return Item(TOPIC, Severity.ok, text, values)


_NOT_RECTIFIED = " The images are probably not rectified, as they are said to be."
