"""Poses that fit tracks: an adjustment of all poses of a sequence, and of the depth of each track.

A track is born at the pixel x_b of frame b, with the depth Z at its birth. Its position in frame t is predicted from
both poses and the depth. With right perturbations T exp(xi) of the poses and log Z + delta of the depth, an observation
has the residual

    r(i, t) = x(i, t) - pi(T_t^-1 T_b Z(i) ray(i)) = J_t xi_t + J_b xi_b + g delta_i + noise           (truth.refined)

where J_b = -J_t Ad(T_t^-1 T_b): only the motion of one camera against the other moves an image.

- Noise: the residuals of one kind of track and one age have a robust scale of their own, and the weights of Student's
  distribution. Errors of depths and poses that the fit cannot remove are noise too.
- Depths: log Z has the prior of the stated depth, or none.
- Stated poses: relative poses of successive frames have a loose prior, so that frames without tracks stay as stated.

Depths are eliminated. What is left is a banded system of the poses, as tracks end, solved by Cholesky factors.
"""

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.spatial.transform import Rotation

from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.projection import cross_matrices
from tracknoise.inference.robust_fits import scales, squared, weights
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.row_poses import RowPoses
from tracknoise.sequences.sequence import Sequence
from tracknoise.truth.uncertainty import AnchoredPoints, ObservedCameras

Array = NDArray[np.float64]
Integers = NDArray[np.intp]

PRIOR_ROTATION_RAD = np.deg2rad(0.5)
"""Standard deviation of the stated rotation from frame to frame, about each axis. A stated translation has that which
moves points of the median depth as far."""
_STEPS, _STEPS_FROM_BEST = 8, 3
_CONVERGED_PX = 1e-3
_LARGEST_STEP = 0.5
"""Largest change of the logarithm of a depth in a step."""
_GAUGE = 1e-6
_HYPOTHESES = 24
_TOGETHER = 1 << 16
"""Rows that are treated together."""
_TWIST = 6
_ESTABLISHED, _OF_A_KIND = 3.0, 1.0 / 3.0
_BLOCK = 0.15
"""Side of the blocks of points that are in the same half, as a part of their median depth."""


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceTracks:
    """Tracks of a sequence. Rows of observations are sorted by track and frame, and leave births out.

    Attributes
    ----------
    birth : (m,) intp
        First frame of each track, ascending.
    birth_uv : (m, 2) float64
        Its position there, px.
    depth_m, depth_sigma : (m,) float64
        Its stated depth there, metres, NaN where there is none; and its relative standard deviation.
    kind : (m,) intp
        Number of the tracker.
    track, frame : (n,) intp
        Of each observation.
    uv : (n, 2) float64
        Its position, px.
    """

    birth: Integers
    birth_uv: Array
    depth_m: Array
    depth_sigma: Array
    kind: Integers
    track: Integers
    frame: Integers
    uv: Array

    def chosen(self, tracks: NDArray[np.bool_]) -> "ReferenceTracks":
        """Some of the tracks, (m,) bool."""
        number = np.cumsum(tracks) - 1
        rows = tracks[self.track]
        births = {name: getattr(self, name)[tracks] for name in ("birth", "birth_uv", "depth_m", "depth_sigma", "kind")}
        return ReferenceTracks(**births, track=number[self.track[rows]], frame=self.frame[rows], uv=self.uv[rows])


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """What is adjusted."""

    poses: Array  # (n, 4, 4): world_from_camera of each frame
    depth_m: Array  # (m,): of each track at its birth, metres


@dataclass(frozen=True, slots=True, eq=False)
class Fault:
    """How large a fault is: its size, its standard deviation, and its size by the tracks of each kind."""

    size: float
    deviation: float
    of_kinds: tuple[float, ...]
    explained: float  # what it takes off the weighted squares of residuals
    in_residuals: Array  # (n, 2): what one unit leaves in residuals, px
    in_positions: Array  # (n, 2): and in positions of points with stated depths

    @property
    def is_established(self) -> bool:
        """Whether it is clearly not 0, and tracks of each kind find much of it."""
        clear = abs(self.size) >= _ESTABLISHED * self.deviation > 0.0
        return clear and all(one / self.size > _OF_A_KIND for one in self.of_kinds)


class _Pairs:
    """The pairs of a frame of birth and a later frame that have observations, sorted by both."""

    def __init__(self, tracks: ReferenceTracks) -> None:
        frames = int(tracks.frame.max(initial=0)) + 1
        key, self.of_row = np.unique(tracks.birth[tracks.track] * frames + tracks.frame, return_inverse=True)
        self.birth, self.frame = np.divmod(key, frames)
        self.order = np.argsort(self.of_row, kind="stable")  # of the rows
        self.starts = np.searchsorted(self.of_row[self.order], np.arange(len(key) + 1))

    def blocks(self) -> Iterator[range]:
        """Pairs that are treated together: those of about as many rows."""
        steps = np.arange(0, len(self.order) + _TOGETHER, _TOGETHER)
        ends = np.unique(np.minimum(np.searchsorted(self.starts, steps), len(self.birth)))
        return (range(*each) for each in pairwise(ends.tolist()))


@dataclass(frozen=True, slots=True, eq=False)
class _Linear:
    """Residuals (n, 2) of observations and their derivatives: (n, 2, 6) by the pose now, (n, 2) by depth.

    `carried`, (pairs, 6, 6): twists of the pose at birth as such of the pose now, with the other sign.
    """

    residual: Array
    by_pose: Array
    by_depth: Array
    carried: Array

    def between(self, pairs: _Pairs, twist: Array) -> Array:
        """(pairs, 6): twists of the pose now that do what twists (frames, 6) of both poses do."""
        return np.asarray(twist[pairs.frame] - np.einsum("pij,pj->pi", self.carried, twist[pairs.birth]))

    def moved(self, tracks: ReferenceTracks, pairs: _Pairs, twist: Array, stretch: Array) -> Array:
        """Residuals after twists (frames, 6) of poses and changes (m,) of log depths."""
        turned = np.einsum("nij,nj->ni", self.by_pose, self.between(pairs, twist)[pairs.of_row])
        return np.asarray(self.residual - turned - self.by_depth * stretch[tracks.track, None])


class PoseAdjustment:
    """The poses of a sequence by its tracks.

    Parameters
    ----------
    sequence
        With stated poses, which are the start and the prior.
    tracks
        Reference tracks of it, in frames with a pose.
    """

    def __init__(self, sequence: Sequence, tracks: ReferenceTracks) -> None:
        self.tracks = tracks
        self._stated = sequence.world_from_camera
        self._posed = has_pose(self._stated)
        rows = RowPoses(sequence)
        born = tracks.birth[tracks.track]
        self._cameras = ObservedCameras.of(sequence, tracks.frame)
        self._rays = ObservedCameras.of(sequence, tracks.birth).bearings(tracks.birth_uv)
        self._in_frame = self._in_row = None  # of a rolling shutter: pose of the row in the frame of the pose
        if rows.rows is not None:
            stated = invert(self._stated)
            self._in_frame = (stated[tracks.birth] @ rows.at(tracks.birth, tracks.birth_uv))[tracks.track]
            self._in_row = stated[tracks.frame] @ rows.at(tracks.frame, tracks.uv)
        self._reach = int(max(1, (tracks.frame - born).max(initial=1)))
        known = tracks.depth_m[np.isfinite(tracks.depth_m)]
        self._has_depth = bool(len(known))
        self._group = tracks.kind[tracks.track] * (self._reach + 1) + tracks.frame - born
        self._pairs = _Pairs(tracks)
        self._depth_prior = np.where(np.isfinite(tracks.depth_m), tracks.depth_sigma, np.inf)
        self._start = State(self._stated.copy(), self._depths(tracks.depth_m))
        self._logs = np.log(self._start.depth_m)
        self._far_m = float(np.median(self._start.depth_m)) if len(tracks.birth) else 1.0

    def chosen(self, tracks: NDArray[np.bool_]) -> "PoseAdjustment":
        """The adjustment by some of the tracks, (m,) bool, with the same prior."""
        part, rows = copy(self), np.flatnonzero(tracks[self.tracks.track])
        part._choose(tracks, rows)
        part._logs, part._start = self._logs[tracks], State(self._start.poses, self._start.depth_m[tracks])
        return part

    def with_depths(self, depth_m: Array) -> "PoseAdjustment":
        """The adjustment with other stated depths (m,), metres, NaN where there are none."""
        part, known = copy(self), np.isfinite(depth_m)
        part.tracks = replace(self.tracks, depth_m=depth_m)
        part._start = State(self._start.poses, np.where(known, depth_m, self._start.depth_m))
        part._logs = np.log(part._start.depth_m)
        part._depth_prior = np.where(known, self._depth_prior, np.inf)
        return part

    def _choose(self, tracks: NDArray[np.bool_], rows: Integers) -> None:
        """Leave out the other tracks, but for what their depths are at the start."""
        self.tracks = self.tracks.chosen(tracks)
        self._cameras, self._group, self._pairs = self._cameras.chosen(rows), self._group[rows], _Pairs(self.tracks)
        self._rays, self._depth_prior = self._rays[tracks], self._depth_prior[tracks]
        if self._in_frame is not None and self._in_row is not None:
            self._in_frame, self._in_row = self._in_frame[rows], self._in_row[rows]

    def residuals(self, poses: Array, depth_m: Array) -> Array:
        """(n, 2): observed less predicted positions, px, by poses (frames, 4, 4) and depths (m,) at births."""
        state, found = State(poses, depth_m), np.empty_like(self.tracks.uv)
        between = self._between(state)
        for rows in self.blocks():
            seen, *_ = self._seen(state, between, rows)
            found[rows] = self.tracks.uv[rows] - self._cameras.chosen(rows).project(seen)
        return found

    def blocks(self) -> Iterator[Integers]:
        """Rows that are treated together, so that memory grows little with their number."""
        count = len(self.tracks.frame)
        return (np.arange(start, min(start + _TOGETHER, count)) for start in range(0, count, _TOGETHER))

    def anchored_points(self, poses: Array, depth_m: Array, rows: Integers) -> AnchoredPoints:
        """The points of some observations in the world of these poses."""
        track = self.tracks.track[rows]
        anchor = self.tracks.birth[track]
        points = transform(poses[anchor], self._rays[track] * depth_m[track, None])
        return AnchoredPoints(anchor, self.tracks.frame[rows], points)

    def parallax_px(self) -> float:
        """Median parallax of the tracks by the stated poses, px; infinite where depths are known without it."""
        if self._has_depth:
            return np.inf
        far = 1e6 * self._start.depth_m
        near = self.residuals(self._stated, self._start.depth_m)
        moved = np.linalg.norm(near - self.residuals(self._stated, far), axis=1)
        most = np.zeros(len(self.tracks.birth))
        np.maximum.at(most, self.tracks.track, np.nan_to_num(moved))
        return float(np.median(most))

    def best(self, start: "State | None" = None) -> "State":
        """The state that fits all tracks, from another one that is near."""
        state = start or self._start
        for _ in range(_STEPS):
            linear = self._linear(state)
            twist, stretch = self._step(state, linear, self._weights(linear.residual))
            state = self._moved(state, twist, stretch)
            change = np.abs(linear.moved(self.tracks, self._pairs, twist, stretch) - linear.residual)
            if np.nanmedian(change) < _CONVERGED_PX:
                break
        return state

    def half(self, state: "State") -> NDArray[np.bool_]:
        """(m,) bool: half of the tracks, drawn by blocks of space, so that all tracks of a point are in the same half.

        Errors of tracks of one point are not independent: both kinds may have it, and tracks that end begin again.
        """
        block = self._blocks(state)
        drawn = np.random.default_rng(0).permutation(np.arange(int(block.max(initial=0)) + 1))
        return np.asarray(drawn[block] % 2 == 0)

    def _blocks(self, state: "State") -> Integers:
        """(m,): number of the block of space of each track."""
        points = transform(state.poses[self.tracks.birth], self._rays * state.depth_m[:, None])
        blocks = np.floor(points / (_BLOCK * np.median(state.depth_m)))
        return np.asarray(np.unique(blocks, axis=0, return_inverse=True)[1].reshape(-1))

    def of(self, state: "State", tracks: NDArray[np.bool_]) -> Array:
        """Poses (n, 4, 4) by some of the tracks, (m,) bool, near the state that fits all."""
        part, near = self.chosen(tracks), State(state.poses, state.depth_m[tracks])
        linear = part._linear(near)
        residual = linear.residual
        for _ in range(_STEPS_FROM_BEST):
            twist, stretch = part._step(near, linear, part._weights(residual))
            residual = linear.moved(part.tracks, part._pairs, twist, stretch)
        return part._moved(near, twist, stretch).poses

    def faults(self, state: "State", moved: Mapping[str, Array]) -> dict[str, "Fault"]:
        """How much of each fault by itself the residuals hold that no poses and depths of tracks absorb.

        With the displacements m (n, 2) of observations by one unit of it, what is left m~ of them in residuals r, and
        the weights W of these, it is (m' W m~)^-1 m~' W r. Its variance is that of sums over blocks of space.
        """
        linear, block = self._linear(state), self._blocks(state)[self.tracks.track]
        weight = self._weights(linear.residual)
        return {name: self._fault(linear, weight, block, one) for name, one in moved.items()}

    def _fault(self, linear: _Linear, weight: Array, block: Integers, moved: Array) -> "Fault":
        left, in_positions = self._left_of(linear, weight, moved)
        weight = np.where(np.isfinite(left[:, 0]), weight, 0.0)
        curvature = np.nan_to_num(weight * np.sum(moved * left, axis=1))
        slope = np.nan_to_num(weight * np.sum(left * linear.residual, axis=1))
        if not curvature.sum() > 0.0:
            return Fault(0.0, np.inf, (), 0.0, left, in_positions)
        size = float(slope.sum() / curvature.sum())
        blocks = np.bincount(block, slope - size * curvature)
        kind, square = self.tracks.kind[self.tracks.track], np.nan_to_num(weight * np.sum(left * left, axis=1))
        of_kinds = np.bincount(kind, slope) / np.maximum(np.bincount(kind, square), 1e-300)
        of_kinds *= square.sum() / curvature.sum()
        deviation = float(np.sqrt(np.sum(blocks**2)) / curvature.sum())
        explained = size * float(slope.sum())
        return Fault(size, deviation, tuple(of_kinds.tolist()), explained, left, in_positions)

    def _left_of(self, linear: _Linear, weight: Array, moved: Array) -> tuple[Array, Array]:
        """What small displacements of true positions leave in residuals, and in positions by stated depths.

        Shapes: moved (n, 2), px; NaN stays. Poses and depths absorb a part of them in residuals (n, 2). Positions
        (n, 2) of other tracks have the poses, and no depths that absorb anything.
        """
        known = np.isfinite(moved[:, :1]) & np.isfinite(moved[:, 1:])
        changed = replace(linear, residual=np.where(known, moved, 0.0))
        start = State(self._stated, self._start.depth_m)  # where the priors are 0
        twist, stretch = self._step(start, changed, np.where(known[:, 0], weight, 0.0))
        by_both, by_poses = (
            changed.moved(self.tracks, self._pairs, twist, one) for one in (stretch, np.zeros_like(stretch))
        )
        return np.where(known, by_both, np.nan), np.where(known, by_poses, np.nan)

    def by_log_depth(self, state: "State") -> Array:
        """(n, 2): displacements of predicted positions with the logarithms of the depths at birth, px."""
        return self._linear(state).by_depth

    def _weights(self, residual: Array) -> Array:
        """(n,) float64, 1/px^2: of observations; 0 where one is unknown."""
        scale = scales(self._group, residual)
        return np.asarray(weights(squared(residual, scale)) / scale**2)

    def _between(self, state: State) -> Array:
        """(pairs, 4, 4): pose at birth in the pose now."""
        return invert(state.poses[self._pairs.frame]) @ state.poses[self._pairs.birth]

    def _seen(self, state: State, between: Array, rows: Integers) -> tuple[Array, Array, Array]:
        """Of some rows: points in the camera and in the frame of the pose that see them, and origins of the rays."""
        track, pair = self.tracks.track[rows], self._pairs.of_row[rows]
        at_birth, origin = self._rays[track] * state.depth_m[track, None], between[pair, :3, 3]
        if self._in_frame is not None:
            at_birth = transform(self._in_frame[rows], at_birth)
            origin = transform(between[pair], self._in_frame[rows, :3, 3])
        points = transform(between[pair], at_birth)
        return points if self._in_row is None else transform(invert(self._in_row[rows]), points), points, origin

    def _linear(self, state: State) -> _Linear:
        between, count = self._between(state), len(self.tracks.frame)
        residual, by_pose, by_depth = (np.empty((count, *shape)) for shape in ((2,), (2, _TWIST), (2,)))
        for rows in self.blocks():
            seen, points, origin = self._seen(state, between, rows)
            cameras = self._cameras.chosen(rows)
            by_point = cameras.jacobians(seen)
            if self._in_row is not None:
                by_point = by_point @ invert(self._in_row[rows])[:, :3, :3]
            residual[rows] = self.tracks.uv[rows] - cameras.project(seen)
            by_pose[rows] = np.concatenate([-by_point, np.cross(by_point, points[:, None])], axis=2)
            by_depth[rows] = np.einsum("nij,nj->ni", by_point, points - origin)
        unknown = ~(np.isfinite(residual).all(axis=1) & np.isfinite(by_pose).all(axis=(1, 2)))
        residual[unknown], by_pose[unknown], by_depth[unknown] = np.nan, 0.0, 0.0
        return _Linear(residual, by_pose, by_depth, _adjoint(between))

    def _step(self, state: State, linear: _Linear, weight: Array) -> tuple[Array, Array]:
        """Twists (frames, 6) and changes of log depths (m,) that fit the tracks."""
        tracks, pairs, n_frames = self.tracks, self._pairs, len(state.poses)
        residual = np.nan_to_num(linear.residual)
        weighted = linear.by_depth * weight[:, None]
        prior = np.where(np.isfinite(self._depth_prior), 1.0 / self._depth_prior**2, 0.0)
        count = len(tracks.birth)
        curvature = np.bincount(tracks.track, np.sum(weighted * linear.by_depth, axis=1), count) + prior
        slope = np.bincount(tracks.track, np.sum(weighted * residual, axis=1), count)
        slope = slope - prior * (np.log(state.depth_m) - self._logs)
        curvature = np.where(curvature > 0.0, curvature, 1.0)
        by_pose = np.einsum("nij,ni->nj", linear.by_pose, weighted)
        width = min(self._reach, n_frames - 1) + 1
        blocks, right = np.zeros((n_frames, width, _TWIST, _TWIST)), np.zeros((n_frames, _TWIST))
        self._add_prior(state, blocks, right)
        self._add_observed(linear, residual, weight, blocks, right)
        squares = _Squares(blocks)
        for rows, first, last, some in self._births():
            birth, age = int(tracks.birth[first]), pairs.frame[some] - int(tracks.birth[first])
            joint = np.zeros((last - first, int(age[-1]) + 1, _TWIST))
            joint[tracks.track[rows] - first, tracks.frame[rows] - birth] = by_pose[rows]
            joint[:, 0] = -np.tensordot(joint[:, age], linear.carried[some], axes=2)
            scaled = joint.reshape(last - first, -1) / np.sqrt(curvature[first:last, None])
            squares.subtract(birth, scaled.T @ scaled)
            along = scaled.T @ (slope[first:last] / np.sqrt(curvature[first:last]))
            right[birth : birth + joint.shape[1]] -= along.reshape(-1, _TWIST)
        squares.finish()
        twist = _solved(blocks, right)
        along = np.sum(by_pose * linear.between(pairs, twist)[pairs.of_row], axis=1)
        stretch = (slope - np.bincount(tracks.track, along, count)) / curvature
        return twist, stretch

    def _births(self) -> Iterator[tuple[slice, int, int, slice]]:
        """Of the tracks that are born in each frame: rows of observations, the range of the tracks, and the pairs."""
        tracks, pairs = self.tracks, self._pairs
        births = np.unique(pairs.birth)
        first, last = (np.searchsorted(tracks.birth, births, side=side) for side in ("left", "right"))
        rows = np.searchsorted(tracks.track, np.append(first, len(tracks.birth)))
        some = np.append(np.searchsorted(pairs.birth, births), len(pairs.birth))
        for place in range(len(births)):
            of_birth = (slice(int(ends[place]), int(ends[place + 1])) for ends in (rows, some))
            yield next(of_birth), int(first[place]), int(last[place]), next(of_birth)

    def _add_observed(self, linear: _Linear, residual: Array, weight: Array, blocks: Array, right: Array) -> None:
        """Add the information of observations, without that of the depths."""
        pairs = self._pairs
        sums, root = np.empty((len(pairs.birth), _TWIST, _TWIST + 1)), np.sqrt(weight)[:, None, None]
        for some in pairs.blocks():
            ends = pairs.starts[some.start : some.stop + 1]
            rows = pairs.order[ends[0] : ends[-1]]
            columns = np.concatenate([linear.by_pose[rows], residual[rows, :, None]], axis=2) * root[rows]
            columns = columns.reshape(-1, _TWIST + 1)
            for place, (start, end) in zip(some, pairwise((2 * (ends - ends[0])).tolist()), strict=True):
                sums[place] = columns[start:end, :_TWIST].T @ columns[start:end]
        now, back = sums[:, :, :_TWIST], -np.swapaxes(linear.carried, 1, 2)
        np.add.at(blocks, (pairs.frame, 0), now)
        np.add.at(blocks, (pairs.birth, 0), -back @ now @ linear.carried)
        blocks[pairs.birth, pairs.frame - pairs.birth] += back @ now
        np.add.at(right, pairs.frame, sums[:, :, _TWIST])
        np.add.at(right, pairs.birth, (back @ sums[:, :, _TWIST:])[:, :, 0])

    def _add_prior(self, state: State, blocks: Array, right: Array) -> None:
        """Add the stated relative poses of successive frames with a pose."""
        precision = np.repeat([1.0 / (PRIOR_ROTATION_RAD * self._far_m) ** 2, 1.0 / PRIOR_ROTATION_RAD**2], 3)
        frames = np.flatnonzero(self._posed)
        before, after = frames[:-1], frames[1:]
        near = after - before < blocks.shape[1]
        before, after = before[near], after[near]
        stated, now = (invert(poses[before]) @ poses[after] for poses in (self._stated, state.poses))
        miss, moved = -_logarithm(invert(stated) @ now), -_adjoint(invert(now))
        weighted = np.swapaxes(moved, 1, 2) * precision
        blocks[:, 0] += np.diag(np.full(_TWIST, _GAUGE * precision.min()))
        blocks[~self._posed, 0] += np.eye(_TWIST)
        if len(frames):
            blocks[frames[0], 0] += np.diag(1e6 * precision)
        np.add.at(blocks, (before, 0), weighted @ moved)
        np.add.at(blocks, (after, 0), np.diag(precision))
        np.add.at(blocks, (before, after - before), weighted)
        np.add.at(right, before, np.einsum("nij,nj->ni", weighted, miss))
        np.add.at(right, after, precision * miss)

    def _moved(self, state: State, twist: Array, stretch: Array) -> State:
        poses = state.poses.copy()
        poses[self._posed] = poses[self._posed] @ exponential(twist[self._posed])
        return State(poses, state.depth_m * np.exp(np.clip(stretch, -_LARGEST_STEP, _LARGEST_STEP)))

    def _depths(self, stated_m: Array) -> Array:
        """Depths (m,), with the best of many along the ray, by the stated poses, of tracks that have none."""
        unknown = ~np.isfinite(stated_m)
        if not unknown.any():
            return stated_m.copy()
        moved_m = np.linalg.norm(np.diff(self._stated[self._posed, :3, 3], axis=0), axis=1)
        unit = max(float(np.median(moved_m)) if len(moved_m) else 0.0, 1e-6)
        if self._has_depth:
            known = stated_m[~unknown]
            tried = np.geomspace(0.3 * known.min(), 3.0 * known.max(), _HYPOTHESES)
        else:
            tried = unit * np.geomspace(2.0, 2000.0, _HYPOTHESES)
        part = copy(self)
        part._choose(unknown, np.flatnonzero(unknown[self.tracks.track]))
        count = len(part.tracks.birth)
        costs = np.empty((len(tried), count))
        for place, depth_m in enumerate(tried):
            length = np.linalg.norm(part.residuals(self._stated, np.full(count, depth_m)), axis=1)
            costs[place] = np.bincount(part.tracks.track, np.nan_to_num(np.minimum(length, 20.0), nan=20.0), count)
        found = stated_m.copy()
        found[unknown] = tried[np.argmin(costs, axis=0)]
        return found


def exponential(twist: Array) -> Array:
    """(n, 4, 4): rigid transforms of twists (n, 6), translation first, with the translation as it is."""
    found = np.tile(np.eye(4), (len(twist), 1, 1))
    found[:, :3, :3] = Rotation.from_rotvec(twist[:, 3:]).as_matrix()
    found[:, :3, 3] = twist[:, :3]
    return found


def _logarithm(poses: Array) -> Array:
    """(n, 6): the inverse of `exponential`."""
    return np.concatenate([poses[:, :3, 3], Rotation.from_matrix(poses[:, :3, :3]).as_rotvec()], axis=1)


def _adjoint(poses: Array) -> Array:
    """(n, 6, 6): twists of the source frame in the target frame."""
    found = np.zeros((len(poses), _TWIST, _TWIST))
    found[:, :3, :3] = found[:, 3:, 3:] = poses[:, :3, :3]
    found[:, :3, 3:] = cross_matrices(poses[:, :3, 3]) @ poses[:, :3, :3]
    return found


class _Squares:
    """Takes symmetric matrices, each about a frame and those after it, from blocks (frames, width, 6, 6)."""

    def __init__(self, blocks: Array) -> None:
        self._blocks, self._frame = blocks, 0
        side = blocks.shape[1] * _TWIST
        self._open = np.zeros((side, side))  # of the frame and those after it

    def subtract(self, first: int, square: Array) -> None:
        """Subtract (6 k, 6 k) at a frame, not before that of an earlier call."""
        while self._frame < first:
            self._close()
        self._open[: len(square), : len(square)] -= square

    def finish(self) -> None:
        """Write what is still open."""
        while self._frame < len(self._blocks):
            self._close()

    def _close(self) -> None:
        of_frame = self._open[:_TWIST].reshape(_TWIST, -1, _TWIST)
        self._blocks[self._frame] += np.swapaxes(of_frame, 0, 1)
        self._open[:-_TWIST, :-_TWIST] = self._open[_TWIST:, _TWIST:]
        self._open[-_TWIST:], self._open[:, -_TWIST:] = 0.0, 0.0
        self._frame += 1


def _solved(blocks: Array, right: Array) -> Array:
    """Twists (frames, 6) of the block-banded system."""
    n_frames, width = blocks.shape[:2]
    banded = np.zeros((width * _TWIST, n_frames * _TWIST))
    row, column = np.divmod(np.arange(_TWIST * _TWIST), _TWIST)
    for apart in range(width):
        frames = np.arange(n_frames - apart)
        for i, j in zip(row, column, strict=True):  # entry (6 t + i, 6 (t + apart) + j) of the upper half
            below = _TWIST * apart + j - i
            if below >= 0:
                banded[below, _TWIST * frames + i] = blocks[frames, apart, i, j]
    return np.asarray(solveh_banded(banded, right.ravel(), lower=True).reshape(n_frames, _TWIST))
