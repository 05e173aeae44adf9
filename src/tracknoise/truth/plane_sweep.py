"""Depth of points of an image from other images of known poses: a plane sweep around each point.

A patch around a point at the inverse depth r is seen in another view, a frame or an image of a second camera, where the
poses say. The right r is the one at which the patch looks alike in views of many baselines:

1. The views are sorted into rungs of doubling baseline. On the lowest rung all inverse depths are tried, in images of
   half the size; on each further rung those around the best few, in steps of less than a pixel there. The score of an
   inverse depth is the mean correlation in the better half of the views: a point is often hidden on one side.
2. In the views of the rungs on which the patch is found, Gauss-Newton steps fit a small plane, r and its slope along
   both axes of the image. A view counts by its own distance from the median of all.

Errors are mostly no noise: a patch is not flat, or lies on two surfaces. With r_h the inverse depth that half a patch
alone gives (left, right, upper, lower), and r_g that of one side of the views (earlier or later frames or the second
camera, near or far), the variance is that of the mean of the r_g, plus

    c^2 max_h (r_h - r)^2 + c^2 v / sum g^2    (sweep.spread)

The last term is the noise of the point's own patch, which all views have in common: v is the variance of the
differences of gray values, g their derivative. Both c are 0.7: then errors in simulated recordings are as large as
stated (`benchmarks.validity.swept_depth`).

3. A patch on two surfaces is found at the depth of one of them, whichever the point is on. So smaller patches around
   the point are looked for at other depths: where one is alike there, and clearly less at the depth of the point, the
   point is at a depth edge.

A point has no inverse depth if its patch is found in fewer than two views, is found at two depths as well, or has too
little parallax. So there is none without texture, and none where a single camera does not change its position. At a
depth edge it has none either, as beside the edge of a depth map.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.patch_samples import offsets, sampled
from tracknoise.truth.sweep_views import Cameras, SweepViews
from tracknoise.truth.visibility import SequenceGeometry

Floats = NDArray[np.float64]

LARGEST_PX, LARGEST_SHARE = 64.0, 0.2
"""Parallax of the nearest points that are looked for, in the view of the shortest baseline, px; and at least this share
of the image's width where that is one of the second camera, whose baseline is not the shorter the nearer a scene is."""

LEAST_SIGMAS, LEAST_PARALLAX_PX = 2.0, 0.5
"""An inverse depth is known where it exceeds so many of its standard deviations, and moves the point so far."""
HALF_SHARE, NOISE_SHARE = 0.7, 0.7
"""The numbers c of (sweep.spread), of halves and of noise."""
STEEPEST = 2.0
"""Slope of surfaces against the image plane, metres per metre: the standard deviation of a prior of the fit."""

_FEWEST_VIEWS = 2
"""In which a patch is found."""
_NEGLIGIBLE, _OF_PAIR = 0.02, 0.25
"""Baselines below this share of the longest say nothing; and none below this share of that to a second camera, in whose
images all inverse depths can be tried: what is found with much shorter ones is too vague for a step to it."""
_MOST_PLANES, _CANDIDATES, _AT_ONCE = 96, 3, 100
_COARSE, _FINE = offsets(7), offsets(11)
_STEPS_PX = 0.75 * np.arange(-3, 4)
"""Around an inverse depth, in the view of a rung that shows the most parallax."""
_POSSIBLE, _ALIKE = 0.3, 0.5
"""Least correlation of a candidate on the lowest rung, and of patches that are alike."""
_UNIQUE, _APART_PX = 0.9, 2.0
"""A rival is so far away, and its scores add up to such a share of the best."""
_EDGE_PX, _EDGE_STEPS = 16.0, np.linspace(0.02, 2.2, 49)
"""Patches beside a point are looked for where it has about this parallax, at these multiples of its inverse depth."""
_SAME_PX, _ELSEWHERE, _LESS = 1.0, 0.8, 0.7
"""A depth as near as this is that of the point. Another needs such a correlation, and what is missing to 1 has to be
less than such a share of what is missing at the depth of the point."""
_ITERATIONS, _NEAR_PX = 4, 1.5
"""Frames that want a larger step than this take no part in it."""
_LEAST_SPREAD_PX, _LEAST_VARIANCE = 0.02, 0.01
_SMOOTH = 0.2
"""Weight of the prior, relative to the differences of gray values."""
_FARTHEST, _STEP, _RIDGE, _TINY = 1e-4, 1e-3, 1e-9, 1e-300

_CROSS = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
_AROUND = np.array([(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
_SIDES = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]
_BESIDE = 5.0 * np.array([(x / np.hypot(x, y), y / np.hypot(x, y)) for x, y in _SIDES])
_X, _Y = _FINE.T.astype(np.float64)
_WEIGHT = np.exp(-0.5 * (_X * _X + _Y * _Y) / 3.0**2)
_ONE = np.ones_like(_X)
_HALVES = [_X <= 0, _X >= 0, _Y <= 0, _Y >= 0]
_TOWARDS = np.stack([_ONE, _X, _Y, *_HALVES], axis=1)
_NORMAL = np.stack([_ONE, _X, _Y, _X * _X, _X * _Y, _Y * _Y, *_HALVES], axis=1)
_MATRIX = [0, 1, 2, 1, 3, 4, 2, 4, 5]
"""Where the entries of the matrix of (1, x, y) are among its sums."""


@dataclass(frozen=True, slots=True, eq=False)
class Swept:
    """What was found at n points; NaN where nothing."""

    inverse_depth: Floats  # (n,): 1/m
    sigma: Floats  # (n,): its standard deviation, 1/m
    at_edge: NDArray[np.bool_]  # (n,): nothing, because another depth was found beside the point


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """Rays of pixels, and of those 1 px to the right of them and below: the points origin + direction / r."""

    origin: Floats  # (3, n, 3): metres, world
    direction: Floats  # (3, n, 3): to the depth 1

    @classmethod
    def of(cls, geometry: SequenceGeometry, index: int, uv: Floats) -> "Rays":
        """Rays of pixels (n, 2) of a frame."""
        origins, ends = [], []
        for step in _CROSS:
            seen = uv + step
            bearings = geometry.camera_at(index).bearings(seen)
            origins.append(geometry.to_world(index, seen, np.zeros_like(bearings)))
            ends.append(geometry.to_world(index, seen, bearings))
        return cls(np.stack(origins), np.stack(ends) - np.stack(origins))

    def rows(self, rows: NDArray[np.intp]) -> "Rays":
        """Those of some of the pixels."""
        return Rays(self.origin[:, rows], self.direction[:, rows])

    def points(self, which: int, inverse: Floats) -> Floats:
        """(n, 3): points at inverse depths (n,)."""
        return np.asarray(self.origin[which] + self.direction[which] / inverse[:, None])


@dataclass(frozen=True, slots=True, eq=False)
class Warp:
    """Where patches of a frame are in another view."""

    centre: Floats  # (n, 2): px
    right: Floats  # (n, 2): step for each pixel to the right
    down: Floats  # (n, 2): step for each pixel down

    @classmethod
    def of(cls, views: SweepViews, view: int, rays: Rays, inverse: Floats) -> "Warp":
        """Of patches on planes of constant depth."""
        centre, right, down = (views.project(view, rays.points(which, inverse)) for which in range(3))
        return cls(centre, right - centre, down - centre)

    def positions(self, grid: NDArray[np.float32]) -> NDArray[np.float32]:
        """(n, p, 2): positions of the samples (p, 2) of the patches, px."""
        grid_3 = np.column_stack([np.ones(len(grid), np.float32), grid]).T
        positions = np.empty((len(self.centre), len(grid), 2), np.float32)
        for axis in (0, 1):
            by_step = np.stack([self.centre[:, axis], self.right[:, axis], self.down[:, axis]], axis=1)
            np.matmul(by_step.astype(np.float32), grid_3, out=positions[:, :, axis])
        return positions

    def back(self, moved: Floats) -> Floats:
        """(n, 2): displacements (n, 2) of the other frame in that of the patches, px; NaN where there is none."""
        determinant = self.right[:, 0] * self.down[:, 1] - self.right[:, 1] * self.down[:, 0]
        determinant = np.where(np.abs(determinant) > _STEP, determinant, np.nan)
        u = moved[:, 0] * self.down[:, 1] - moved[:, 1] * self.down[:, 0]
        v = self.right[:, 0] * moved[:, 1] - self.right[:, 1] * moved[:, 0]
        return np.stack([u, v], axis=1) / determinant[:, None]


class PlaneSweep:
    """Inverse depths of points of a sequence.

    Parameters
    ----------
    geometry
        Of the sequence. Its depths are not used.
    cameras
        In whose images points are looked for.
    """

    __slots__ = ("_fewest", "_geometry", "_views")

    def __init__(self, geometry: SequenceGeometry, cameras: Cameras = Cameras.both) -> None:
        self._geometry, self._views = geometry, SweepViews(geometry, cameras)
        self._fewest = 1 if cameras is Cameras.pair else _FEWEST_VIEWS

    def found(self, index: int, uv: Floats) -> Swept:
        """Inverse depths of points (n, 2) of a frame, px, each by itself.

        Raises
        ------
        DataError
            If an image cannot be read.
        """
        rungs = self.rungs(index)
        nothing = np.full(0 if rungs else len(uv), np.nan)
        starts = range(0, len(uv), _AT_ONCE) if rungs else ()
        parts = [self._found(index, uv[start : start + _AT_ONCE], rungs) for start in starts]
        return Swept(
            np.concatenate([nothing, *(part.inverse_depth for part in parts)]),
            np.concatenate([nothing, *(part.sigma for part in parts)]),
            np.concatenate([np.zeros(len(nothing), np.bool_), *(part.at_edge for part in parts)]),
        )

    def rungs(self, index: int) -> list[list[int]]:
        """Views that a frame is compared with, by doubling baseline; none where no camera is elsewhere."""
        baselines = {view: self._views.baseline(index, view) for view in self._views.around(index)}
        most = max(baselines.values(), default=0.0)
        of_pair = self._views.pair_baseline if any(map(self._views.is_second, baselines)) else 0.0
        least = max(_NEGLIGIBLE * most, _OF_PAIR * of_pair)
        used = {view: length for view, length in baselines.items() if length > least}
        rungs: dict[int, list[int]] = {}
        for view, length in sorted(used.items(), key=lambda item: item[1]):
            rungs.setdefault(int(np.log2(length / min(used.values()))), []).append(view)
        return list(rungs.values())

    def _found(self, index: int, uv: Floats, rungs: list[list[int]]) -> Swept:
        rays = Rays.of(self._geometry, index, uv)
        inverse, last = self._searched(index, uv, rays, rungs)
        seen = [(view, number) for number, rung in enumerate(rungs) for view in rung]
        patches = Patches.cut(self._views.level(index, 0), uv)
        inverse, sigma = _Fit(self._views, rays, patches, seen, index).found(inverse, last, self._fewest)
        at_edge = self._at_edge(index, uv, inverse, rungs)
        return Swept(np.where(at_edge, np.nan, inverse), np.where(at_edge, np.nan, sigma), at_edge)

    def _at_edge(self, index: int, uv: Floats, inverse: Floats, rungs: list[list[int]]) -> NDArray[np.bool_]:
        """(n,): whether a patch beside a point is found at another depth than at that of the point."""
        rays, whole = Rays.of(self._geometry, index, uv), self._views.level(index, 0)
        moved = np.stack([inverse * self._slope(rays, rung, inverse) for rung in rungs])
        apart = np.abs(np.log(np.nan_to_num(moved, nan=_TINY) / _EDGE_PX))
        chosen, at_edge = np.argmin(apart, axis=0), np.zeros(len(uv), np.bool_)
        for number, rung in enumerate(rungs):
            rows = np.flatnonzero((chosen == number) & np.isfinite(moved[number]))
            if not len(rows):
                continue
            away_px = moved[number, rows, None] * np.abs(_EDGE_STEPS - 1.0)
            for side in _BESIDE:
                beside = uv[rows] + side
                template = sampled(whole, (beside[:, None] + _COARSE).astype(np.float32))
                tried = inverse[rows, None] * _EDGE_STEPS
                scores = self._scores(
                    Rays.of(self._geometry, index, beside), rung, tried, template, level=0, grid=_COARSE
                )
                at_edge[rows] |= _is_elsewhere(scores, away_px)
        return at_edge

    def _searched(self, index: int, uv: Floats, rays: Rays, rungs: list[list[int]]) -> tuple[Floats, NDArray[np.intp]]:
        """Inverse depth of each point, and the last rung on which it was found, -1 if on none or at two depths."""
        planes = self._planes(index, rungs[0])
        whole, half = (self._views.level(index, level) for level in (0, 1))
        template = sampled(half, (uv[:, None] / 2.0 + _COARSE).astype(np.float32))
        all_planes = np.broadcast_to(planes, (len(uv), len(planes)))
        inverse, score = _peaks(all_planes, self._scores(rays, rungs[0], all_planes, template, level=1, grid=_COARSE))
        template = sampled(whole, (uv[:, None] + _FINE).astype(np.float32))
        alive, total, last = score > _POSSIBLE, np.zeros_like(score), np.full(score.shape, -1)
        for number, rung in enumerate(rungs):
            rows, place = np.nonzero(alive)
            if not len(rows):
                break
            part, middle = rays.rows(rows), inverse[rows, place]
            tried = np.maximum(middle[:, None] + _STEPS_PX / self._slope(part, rung, middle)[:, None], planes[0])
            best, score = _peak(tried, self._scores(part, rung, tried, template[rows], level=0, grid=_FINE))
            good = score > _ALIKE
            inverse[rows[good], place[good]] = np.maximum(best[good], planes[0])
            total[rows[good], place[good]] += score[good]
            last[rows[good], place[good]] = number
            alive[rows[~good], place[~good]] = False
        rows, best_place = np.arange(len(uv)), np.argmax(total, axis=1)
        chosen, last = inverse[rows, best_place], last[rows, best_place]
        slope = self._slope(rays, [frame for rung in rungs for frame in rung], chosen)
        apart = np.abs(inverse - chosen[:, None]) * slope[:, None] > _APART_PX
        rival = np.where(apart, total, 0.0).max(axis=1)
        return chosen, np.where(rival < _UNIQUE * total[rows, best_place], last, -1)

    def _planes(self, index: int, rung: list[int]) -> Floats:
        """Inverse depths that are tried on the lowest rung, 2 px apart in its frame of the most parallax."""
        camera = self._geometry.camera_at(index)
        u, v = np.meshgrid(np.linspace(0, camera.width - 1, 5), np.linspace(0, camera.height - 1, 5))
        rays = Rays.of(self._geometry, index, np.stack([u.ravel(), v.ravel()], axis=1))
        far = np.full(u.size, _STEP / self._views.baseline(index, rung[0]))
        slopes = [self._slope(rays, [frame], far) for frame in rung]
        seen = [float(np.nanmax(slope)) for slope in slopes if np.isfinite(slope).any()]
        first, most = min(seen, default=1.0), max(seen, default=1.0)
        of_pair = LARGEST_SHARE * camera.width if all(map(self._views.is_second, rung)) else 0.0
        largest_px = max(LARGEST_PX, of_pair)
        count = int(np.clip(largest_px / 2.0 * most / first, 16, _MOST_PLANES))
        planes = np.linspace(0.0, largest_px / first, count)
        planes[0] = _FARTHEST * planes[-1]
        return planes

    def _slope(self, rays: Rays, views: list[int], inverse: Floats) -> Floats:
        """(n,): the most that points move in any of the views, px per inverse depth; NaN where none shows them."""
        here, there = rays.points(0, inverse), rays.points(0, inverse * (1.0 + _STEP))
        moved = [self._views.project(view, there) - self._views.project(view, here) for view in views]
        slope = np.fmax.reduce([np.linalg.norm(displacement, axis=1) for displacement in moved]) / (_STEP * inverse)
        return np.where(slope > 0.0, slope, np.nan)

    def _scores(
        self,
        rays: Rays,
        rung: list[int],
        inverse: Floats,
        template: NDArray[np.float32],
        *,
        level: int,
        grid: NDArray[np.float32],
    ) -> Floats:
        """(n, h): mean correlation of patches in the better half of frames, at inverse depths (n, h)."""
        n, h = inverse.shape
        all_rays, flat = rays.rows(np.repeat(np.arange(n), h)), inverse.ravel()
        plain = template - template.mean(axis=1, keepdims=True)
        both = np.stack([plain, np.ones_like(plain)], axis=2)
        length = np.sqrt(np.square(plain).sum(axis=1))[:, None]
        scores = np.empty((len(rung), n, h))
        for number, view in enumerate(rung):
            warp = Warp.of(self._views, view, all_rays, flat)
            warp = Warp(warp.centre / (1.0 + level), warp.right, warp.down)
            values = sampled(self._views.level(view, level), warp.positions(grid)).reshape(n, h, -1)
            alike, total = np.moveaxis(values @ both, 2, 0)
            spread = np.einsum("nhp,nhp->nh", values, values) - np.square(total) / len(grid)
            textured = (length > 0.0) & (spread > _LEAST_VARIANCE * len(grid))
            scores[number] = np.where(
                textured, alike / np.where(textured, length * np.sqrt(np.abs(spread)), 1.0), np.nan
            )
        return _mean_of_better_half(scores)


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """Patches around points, weighted, without their mean, and of length 1: what brightness does is not in them."""

    values: Floats  # (n, p); NaN where a patch is not in the image, or has no texture
    by_u: Floats  # (n, p): derivatives by a displacement, without what a change of brightness explains
    by_v: Floats

    @classmethod
    def cut(cls, image: NDArray[np.float32], uv: Floats) -> "Patches":
        """Those around positions (n, 2) in an image."""
        shown = (sampled(image, (uv[:, None] + _FINE + step).astype(np.float32)) for step in _AROUND)
        middle, right, left, below, above = (patch.astype(np.float64) for patch in shown)
        middle = _without_mean(middle)
        size = np.sqrt(_total(middle * middle))
        size = np.where(size > 0.0, size, np.nan)
        values = middle / size
        by_u, by_v = (
            _without_mean((after - before) / (2.0 * size)) for after, before in ((right, left), (below, above))
        )
        return cls(values, by_u - values * _total(by_u * values), by_v - values * _total(by_v * values))


def _total(values: Floats) -> Floats:
    """(n, 1): weighted sums over patches (n, p)."""
    return np.asarray(values @ _WEIGHT)[:, None]


def _without_mean(values: Floats) -> Floats:
    return np.asarray(values - _total(values) / _WEIGHT.sum())


@dataclass(frozen=True, slots=True, eq=False)
class _Sums:
    """Sums over the patches of n points in f frames; NaN where a patch is not seen."""

    towards: Floats  # (f, n, 7): of derivative times difference, by `_TOWARDS`
    normal: Floats  # (f, n, 10): of squared derivatives, by `_NORMAL`
    slope: Floats  # (f, n): px of the patch per inverse depth
    alike: Floats  # (f, n): correlation

    @property
    def own(self) -> Floats:
        """(f, n): step of the inverse depth that each frame alone wants; NaN where it shows none."""
        return np.asarray(self.towards[:, :, 0] / np.where(self.normal[:, :, 0] > 0.0, self.normal[:, :, 0], np.nan))


class _Fit:
    """The fit of small planes to the patches of points, in the frames in which they are seen."""

    __slots__ = ("_patches", "_pixel", "_rays", "_seen", "_sides", "_views")

    def __init__(
        self,
        views: SweepViews,
        rays: Rays,
        patches: Patches,
        seen: list[tuple[int, int]],
        index: int,
    ) -> None:
        self._views, self._rays, self._patches = views, rays, patches
        self._seen = seen  # views, with the rung of each
        second, before = np.array([(views.is_second(view), views.frame(view) < index) for view, _ in seen]).T
        self._sides = [side[:, None] for side in (second, ~second & before, ~second & ~before)]
        self._pixel = np.linalg.norm(rays.direction[1] - rays.direction[0], axis=1)

    def found(self, inverse: Floats, last: NDArray[np.intp], fewest: int) -> tuple[Floats, Floats]:
        """Inverse depths and their standard deviations, in the views of the rungs up to the `last` of each point."""
        inverse, tilt = np.where(last >= 0, inverse, np.nan), np.zeros((len(inverse), 2))
        for _ in range(_ITERATIONS):
            sums = self._sums(inverse, tilt, last)
            weight = _weights(sums)
            step = self._step(sums, weight, inverse, tilt)
            inverse = np.maximum(inverse + step[:, 0], 0.2 * inverse)
            tilt = tilt + np.nan_to_num(step[:, 1:])
        sums = self._sums(inverse, tilt, last)
        weight = _weights(sums)
        sigma = np.sqrt(
            np.square(self._spread(sums, weight))
            + np.square(_of_halves(sums, weight))
            + np.square(_of_noise(sums, weight))
        )
        slope = np.where(weight > 0.0, sums.slope, 0.0).max(axis=0, initial=0.0)
        valid = (np.count_nonzero(weight, axis=0) >= fewest) & (inverse > LEAST_SIGMAS * sigma)
        valid &= inverse * slope > LEAST_PARALLAX_PX
        return np.where(valid, inverse, np.nan), np.where(valid, sigma, np.nan)

    def _step(self, sums: _Sums, weight: Floats, inverse: Floats, tilt: Floats) -> Floats:
        """(n, 3): Gauss-Newton step of the inverse depth and of its slopes; NaN where nothing is seen."""
        normal = _weighted(weight, sums.normal)[:, _MATRIX].reshape(-1, 3, 3)
        towards = _weighted(weight, sums.towards)[:, :3]
        miss = _weighted(weight, 2.0 * (1.0 - sums.alike)[:, :, None])[:, 0] / np.maximum(weight.sum(axis=0), _TINY)
        prior = _SMOOTH * miss / np.square(STEEPEST * self._pixel * inverse)
        normal[:, [1, 2], [1, 2]] += prior[:, None]
        towards[:, 1:] -= prior[:, None] * tilt
        usable = np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(towards).all(axis=1) & (normal[:, 0, 0] > 0.0)
        size = np.sqrt(np.where(usable[:, None], np.einsum("nii->ni", normal), 1.0))
        size = np.where(size > 0.0, size, 1.0)
        scaled = np.where(usable[:, None, None], normal / size[:, :, None] / size[:, None, :], 0.0)
        step = np.linalg.solve(scaled + _RIDGE * np.eye(3), np.nan_to_num(towards / size)[:, :, None])[:, :, 0] / size
        return np.where(usable[:, None], step, np.nan)

    def _spread(self, sums: _Sums, weight: Floats) -> Floats:
        """(n,): standard deviation of the mean of groups of views: of both cameras, earlier and later, near and far."""
        steps, information = np.nan_to_num(sums.own), weight * np.nan_to_num(sums.normal[:, :, 0])
        total = np.maximum(information.sum(axis=0), _TINY)
        mean = (information * steps).sum(axis=0) / total
        far = sums.slope > _median(np.where(information > 0.0, sums.slope, np.nan))
        parts = [information * side * part for side in self._sides for part in (far, ~far)]
        count = np.sum([part.any(axis=0) for part in parts], axis=0)
        moved = np.stack([(part * (steps - mean)).sum(axis=0) / total for part in parts])
        return np.asarray(np.sqrt(np.square(moved).sum(axis=0) * count / np.maximum(count - 1, 1)))

    def _sums(self, inverse: Floats, tilt: Floats, last: NDArray[np.intp]) -> _Sums:
        shape = len(self._seen), len(inverse)
        sums = _Sums(*(np.full((*shape, *more), np.nan) for more in ((7,), (10,), (), ())))
        for place, (view, rung) in enumerate(self._seen):
            rows = np.flatnonzero((last >= rung) & np.isfinite(inverse))
            rays, here = self._rays.rows(rows), inverse[rows]
            warp = Warp.of(self._views, view, rays, here)
            there = self._views.project(view, rays.points(0, here * (1.0 + _STEP)))
            moved = (there - warp.centre) / (_STEP * here)[:, None]
            back = warp.back(moved)
            tilted = Warp(warp.centre, warp.right + moved * tilt[rows, :1], warp.down + moved * tilt[rows, 1:])
            seen = sampled(self._views.level(view, 0), tilted.positions(_FINE)).astype(np.float64)
            seen = _without_mean(seen)
            size = np.sqrt(_total(seen * seen))
            seen /= np.where(size > 0.0, size, np.nan)
            steep = self._patches.by_u[rows] * back[:, :1] + self._patches.by_v[rows] * back[:, 1:]
            weighted = steep * _WEIGHT
            sums.towards[place, rows] = (weighted * (self._patches.values[rows] - seen)) @ _TOWARDS
            sums.normal[place, rows] = (weighted * steep) @ _NORMAL
            sums.slope[place, rows] = np.linalg.norm(back, axis=1)
            sums.alike[place, rows] = _total(seen * self._patches.values[rows])[:, 0]
        return sums


def _weights(sums: _Sums) -> Floats:
    """(f, n): weights of frames, relative to the sums: by their distance from the median of all; 0 where unlike."""
    steps = sums.own
    good = (sums.alike > _ALIKE) & (np.abs(steps * sums.slope) < _NEAR_PX)
    middle = _weighted_median(np.where(good, steps, 0.0), np.where(good, sums.normal[:, :, 0], 0.0))
    away_px = np.where(good, np.abs(steps - middle) * sums.slope, np.nan)
    scale_px = np.maximum(1.4826 * _median(away_px), _LEAST_SPREAD_PX)
    return np.where(good, 1.0 / (1.0 + np.square(np.nan_to_num(away_px) / (2.0 * scale_px))), 0.0)


def _weighted(weight: Floats, values: Floats) -> Floats:
    """(n, k): sums over frames of values (f, n, k); what is not seen has no weight."""
    return np.asarray(np.einsum("fn,fnk->nk", weight, np.where(weight[:, :, None] > 0.0, values, 0.0)))


def _of_halves(sums: _Sums, weight: Floats) -> Floats:
    """(n,): the term of (sweep.spread) that halves of the patches give; NaN where one has no texture."""
    towards, normal = _weighted(weight, sums.towards), _weighted(weight, sums.normal)
    normal = np.where(normal > 0.0, normal, np.nan)
    differences = towards[:, 3:] / normal[:, 6:] - (towards[:, 0] / normal[:, 0])[:, None]
    return np.asarray(HALF_SHARE * np.abs(differences).max(axis=1))


def _of_noise(sums: _Sums, weight: Floats) -> Floats:
    """(n,): what noise in the patch of the point does, which all frames have in common."""
    used = weight > 0.0
    slope = np.where(used, sums.slope, 0.0)
    texture = _median(np.where(used, sums.normal[:, :, 0] / np.square(sums.slope), np.nan))
    miss = np.where(used, 2.0 * (1.0 - sums.alike), 0.0).sum(axis=0) / np.maximum(used.sum(axis=0), 1) / _WEIGHT.sum()
    valid = (texture > 0.0) & (slope.sum(axis=0) > 0.0)
    px = NOISE_SHARE * np.sqrt(np.maximum(miss, 0.0) / np.where(valid, texture, np.nan))
    return np.asarray(px * slope.sum(axis=0) / np.maximum(np.square(slope).sum(axis=0), _TINY))


def _mean_of_better_half(scores: Floats) -> Floats:
    """Mean over the better half of those of frames (f, ...) that are known; NaN where none is."""
    count = np.isfinite(scores).sum(axis=0)
    ordered = -np.sort(-np.where(np.isfinite(scores), scores, -1.0), axis=0)
    used = np.arange(len(scores)).reshape(-1, *[1] * count.ndim) < (count + 1) // 2
    return np.where(count > 0, np.where(used, ordered, 0.0).sum(axis=0) / np.maximum((count + 1) // 2, 1), np.nan)


def _is_elsewhere(scores: Floats, away_px: Floats) -> NDArray[np.bool_]:
    """(n,): whether scores (n, h) are clearly better at another depth, so many px away, than at that of the point."""
    filled = np.where(np.isfinite(scores), scores, -1.0)
    here = np.where(away_px <= _SAME_PX, filled, -1.0).max(axis=1)
    there = np.where(away_px > _APART_PX, filled, -1.0).max(axis=1)
    return np.asarray((there > _ELSEWHERE) & (1.0 - there < _LESS * (1.0 - here)))


def _peaks(inverse: Floats, scores: Floats) -> tuple[Floats, Floats]:
    """The best few peaks of scores (n, h): inverse depths and scores, (n, k); -1 where there is no more."""
    filled = np.where(np.isfinite(scores), scores, -1.0)
    beside = np.pad(filled, ((0, 0), (1, 1)), constant_values=-1.0)
    peak = np.where((filled >= beside[:, :-2]) & (filled >= beside[:, 2:]), filled, -1.0)
    order = np.argsort(-peak, axis=1)[:, :_CANDIDATES]
    return np.take_along_axis(inverse, order, axis=1).copy(), np.take_along_axis(peak, order, axis=1)


def _peak(inverse: Floats, scores: Floats) -> tuple[Floats, Floats]:
    """The highest of scores (n, h), by a parabola through its neighbours: inverse depth and score, (n,)."""
    filled = np.where(np.isfinite(scores), scores, -1.0)
    rows, top = np.arange(len(filled)), np.argmax(filled, axis=1)
    inner = np.clip(top, 1, filled.shape[1] - 2)
    before, here, after = (filled[rows, inner + step] for step in (-1, 0, 1))
    bend = before - 2.0 * here + after
    shift = np.where((top == inner) & (bend < 0.0), 0.5 * (before - after) / np.where(bend < 0.0, bend, 1.0), 0.0)
    step = inverse[rows, inner + 1] - inverse[rows, inner]
    return inverse[rows, top] + np.clip(shift, -0.5, 0.5) * step, filled[rows, top]


def _weighted_median(values: Floats, weight: Floats) -> Floats:
    order = np.argsort(values, axis=0)
    below = np.cumsum(np.take_along_axis(weight, order, axis=0), axis=0)
    middle = np.argmax(below >= 0.5 * below[-1], axis=0)
    return np.asarray(np.take_along_axis(np.take_along_axis(values, order, axis=0), middle[None], axis=0)[0])


def _median(values: Floats) -> Floats:
    """Medians over the first axis of what is known; 0 where nothing is."""
    count = np.isfinite(values).sum(axis=0)
    ordered = np.sort(values, axis=0)  # what is unknown comes last
    return np.where(count > 0, np.take_along_axis(ordered, np.maximum(count - 1, 0)[None] // 2, axis=0)[0], 0.0)
