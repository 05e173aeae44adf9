"""Poses that fit tracks: an adjustment of all poses of a sequence, and of the depth of each track.

A track is born at the pixel x_b of frame b, with the depth Z at its birth. Its position in frame t is predicted from
both poses and the depth. With right perturbations T exp(xi) of the poses and log Z + delta of the depth, an observation
has the residual

    r(i, t) = x(i, t) - pi(T_t^-1 T_b Z(i) ray(i)) = J_t xi_t + J_b xi_b + g delta_i + noise           (truth.refined)

- Noise: the residuals of one kind of track and one age have a robust scale of their own, and the weights of Student's
  distribution. Errors of depths and poses that the fit cannot remove are noise too.
- Depths: log Z has the prior of the stated depth, or none.
- Stated poses: relative poses of successive frames have a loose prior, so that frames without tracks stay as stated.

Depths are eliminated. What is left is a banded system of the poses, as tracks end, solved by Cholesky factors.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

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
_TWIST = 6
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
class _Linear:
    """Residuals (n, 2) of observations and their derivatives: (n, 2, 6) by poses at birth and now, (n, 2) by depth."""

    residual: Array
    by_birth: Array
    by_pose: Array
    by_depth: Array

    def moved(self, tracks: ReferenceTracks, twist: Array, stretch: Array) -> Array:
        """Residuals after twists (frames, 6) of poses and changes (m,) of log depths."""
        born = tracks.birth[tracks.track]
        return np.asarray(
            self.residual
            - np.einsum("nij,nj->ni", self.by_birth, twist[born])
            - np.einsum("nij,nj->ni", self.by_pose, twist[tracks.frame])
            - self.by_depth * stretch[tracks.track, None]
        )


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
        start = State(self._stated.copy(), tracks.depth_m.copy())
        self._start = start if self._has_depth and np.isfinite(tracks.depth_m).all() else self._with_depths(start)
        self._depth_prior = np.where(np.isfinite(tracks.depth_m), tracks.depth_sigma, np.inf)
        self._logs = np.log(self._start.depth_m)

    def residuals(self, poses: Array, depth_m: Array) -> Array:
        """(n, 2): observed less predicted positions, px, by poses (frames, 4, 4) and depths (m,) at births."""
        return self._linear(State(poses, depth_m)).residual

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
        far = State(self._stated, 1e6 * self._start.depth_m)
        near = self._linear(State(self._stated, self._start.depth_m)).residual
        moved = np.linalg.norm(near - self._linear(far).residual, axis=1)
        most = np.zeros(len(self.tracks.birth))
        np.maximum.at(most, self.tracks.track, np.nan_to_num(moved))
        return float(np.median(most))

    def best(self) -> "State":
        """The state that fits all tracks."""
        state = self._start
        every = np.ones(len(self.tracks.birth), np.bool_)
        for _ in range(_STEPS):
            linear = self._linear(state)
            twist, stretch = self._step(state, linear, self._weights(linear.residual), every)
            state = self._moved(state, twist, stretch)
            change = np.abs(linear.moved(self.tracks, twist, stretch) - linear.residual)
            if np.nanmedian(change) < _CONVERGED_PX:
                break
        return state

    def half(self, state: "State") -> NDArray[np.bool_]:
        """(m,) bool: half of the tracks, drawn by blocks of space, so that all tracks of a point are in the same half.

        Errors of tracks of one point are not independent: both kinds may have it, and tracks that end begin again.
        """
        points = transform(state.poses[self.tracks.birth], self._rays * state.depth_m[:, None])
        blocks = np.floor(points / (_BLOCK * np.median(state.depth_m)))
        block = np.unique(blocks, axis=0, return_inverse=True)[1].reshape(-1)
        return np.asarray((np.random.default_rng(0).permutation(int(block.max(initial=0)) + 1) % 2 == 0)[block])

    def of(self, state: "State", tracks: NDArray[np.bool_]) -> Array:
        """Poses (n, 4, 4) by some of the tracks, (m,) bool, near the state that fits all."""
        linear = self._linear(state)
        residual = linear.residual
        for _ in range(_STEPS_FROM_BEST):
            twist, stretch = self._step(state, linear, self._weights(residual), tracks)
            residual = linear.moved(self.tracks, twist, stretch)
        return self._moved(state, twist, stretch).poses

    def left_of(self, state: "State", moved: Array) -> tuple[Array, Array]:
        """What small displacements of true positions leave in residuals, and in positions by stated depths.

        Shapes: moved (n, 2), px; NaN stays. Poses and depths absorb a part of them in residuals (n, 2). Positions
        (n, 2) of other tracks have the poses, and no depths that absorb anything.
        """
        linear = self._linear(state)
        known = np.isfinite(moved[:, :1]) & np.isfinite(moved[:, 1:])
        weight = np.where(known[:, 0], self._weights(linear.residual), 0.0)
        changed = replace(linear, residual=np.where(known, moved, 0.0))
        start = State(self._stated, self._start.depth_m)  # where the priors are 0
        twist, stretch = self._step(start, changed, weight, np.ones(len(self.tracks.birth), np.bool_))
        by_both, by_poses = (changed.moved(self.tracks, twist, one) for one in (stretch, np.zeros_like(stretch)))
        return np.where(known, by_both, np.nan), np.where(known, by_poses, np.nan)

    def _weights(self, residual: Array) -> Array:
        """(n,) float64, 1/px^2: of observations; 0 where one is unknown."""
        scale = scales(self._group, residual)
        return np.asarray(weights(squared(residual, scale)) / scale**2)

    def _linear(self, state: State) -> _Linear:
        tracks = self.tracks
        at_birth = (self._rays * state.depth_m[:, None])[tracks.track]
        if self._in_frame is not None:
            at_birth = transform(self._in_frame, at_birth)
        here_from_birth = invert(state.poses[tracks.frame]) @ state.poses[tracks.birth[tracks.track]]
        points = transform(here_from_birth, at_birth)
        seen, turn = points, here_from_birth[:, :3, :3]
        if self._in_row is not None:
            row = invert(self._in_row)
            seen = transform(row, points)
        by_point = self._cameras.jacobians(seen)
        if self._in_row is not None:
            by_point = by_point @ row[:, :3, :3]
        at_start = by_point @ turn
        centre = at_birth if self._in_frame is None else at_birth - self._in_frame[:, :3, 3]
        linear = _Linear(
            residual=tracks.uv - self._cameras.project(seen),
            by_birth=np.concatenate([at_start, -at_start @ cross_matrices(at_birth)], axis=2),
            by_pose=np.concatenate([-by_point, by_point @ cross_matrices(points)], axis=2),
            by_depth=np.einsum("nij,nj->ni", at_start, centre),
        )
        known = np.isfinite(linear.residual).all(axis=1) & np.isfinite(by_point).all(axis=(1, 2))
        values = {name: getattr(linear, name) for name in _Linear.__slots__}
        for name, value in values.items():
            value[~known] = np.nan if name == "residual" else 0.0
        return _Linear(**values)

    def _step(self, state: State, linear: _Linear, weight: Array, chosen: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Twists (frames, 6) and changes of log depths (m,) that fit the chosen tracks."""
        tracks, n_frames = self.tracks, len(state.poses)
        weight = np.where(chosen[tracks.track], weight, 0.0)
        residual = np.nan_to_num(linear.residual)
        weighted = linear.by_depth * weight[:, None]
        prior = np.where(np.isfinite(self._depth_prior), 1.0 / self._depth_prior**2, 0.0)
        count = len(tracks.birth)
        curvature = np.bincount(tracks.track, np.sum(weighted * linear.by_depth, axis=1), count) + prior
        slope = np.bincount(tracks.track, np.sum(weighted * residual, axis=1), count)
        slope = slope - prior * (np.log(state.depth_m) - self._logs)
        curvature = np.where(curvature > 0.0, curvature, 1.0)
        by_birth = np.einsum("nij,ni->nj", linear.by_birth, weighted)
        by_pose = np.einsum("nij,ni->nj", linear.by_pose, weighted)
        width = min(self._reach, n_frames - 1) + 1
        blocks, right = np.zeros((n_frames, width, _TWIST, _TWIST)), np.zeros((n_frames, _TWIST))
        self._add_prior(state, blocks, right)
        columns = np.concatenate([linear.by_birth, linear.by_pose, residual[:, :, None]], axis=2)
        columns *= np.sqrt(weight)[:, None, None]
        for rows, first, last in self._births():
            if not len(rows):
                continue
            self._add_born(columns, rows, blocks, right)
            own = np.arange(first, last)
            span = min(width, n_frames - int(tracks.birth[first]))
            joint = np.zeros((len(own), span, _TWIST))
            own_row = tracks.track[rows] - first
            np.add.at(joint[:, 0], own_row, by_birth[rows])
            age = tracks.frame[rows] - tracks.birth[first]
            joint[own_row, age] += by_pose[rows]
            flat = joint.reshape(len(own), -1)
            scaled = flat / curvature[own, None]
            _add_square(blocks, int(tracks.birth[first]), -(flat.T @ scaled).reshape(span, _TWIST, span, _TWIST))
            right[tracks.birth[first] : tracks.birth[first] + span] -= (scaled.T @ slope[own]).reshape(span, _TWIST)
        twist = _solved(blocks, right)
        born = tracks.birth[tracks.track]
        along = np.sum(by_birth * twist[born] + by_pose * twist[tracks.frame], axis=1)
        stretch = (slope - np.bincount(tracks.track, along, count)) / curvature
        return twist, np.clip(stretch, -_LARGEST_STEP, _LARGEST_STEP)

    def _births(self) -> Iterator[tuple[NDArray[np.intp], int, int]]:
        """Rows of the observations of the tracks that are born in each frame, and the range of these tracks."""
        tracks = self.tracks
        starts = np.flatnonzero(np.diff(tracks.birth, prepend=-1))
        ends = np.append(starts[1:], len(tracks.birth))
        places = np.searchsorted(tracks.track, np.append(starts, len(tracks.birth)))
        for first, last, begin, end in zip(starts, ends, places[:-1], places[1:], strict=True):
            yield np.arange(begin, end), int(first), int(last)

    def _add_born(self, columns: Array, rows: Integers, blocks: Array, right: Array) -> None:
        """Add the information of observations, without that of the depths, of tracks that are born in one frame."""
        frame = self.tracks.frame[rows]
        order = rows[np.argsort(frame, kind="stable")]
        frame = self.tracks.frame[order]
        starts = np.flatnonzero(np.diff(frame, prepend=-1))
        born = int(self.tracks.birth[self.tracks.track[rows[0]]])
        for start, end in zip(starts, np.append(starts[1:], len(order)), strict=True):
            part = columns[order[start:end]].reshape(-1, 2 * _TWIST + 1)
            now, product = int(frame[start]), part.T @ part
            blocks[born, 0] += product[:6, :6]
            blocks[now, 0] += product[6:12, 6:12]
            blocks[born, now - born] += product[:6, 6:12]
            right[born] += product[:6, 12]
            right[now] += product[6:12, 12]

    def _add_prior(self, state: State, blocks: Array, right: Array) -> None:
        """Add the stated relative poses of successive frames with a pose."""
        far_m = float(np.median(self._start.depth_m)) if len(self._start.depth_m) else 1.0
        precision = np.repeat([1.0 / (PRIOR_ROTATION_RAD * far_m) ** 2, 1.0 / PRIOR_ROTATION_RAD**2], 3)
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
        return State(poses, state.depth_m * np.exp(stretch))

    def _with_depths(self, state: State) -> State:
        """With the depth of tracks that have none: the best of many along the ray, by the stated poses."""
        unknown = ~np.isfinite(state.depth_m)
        rows = unknown[self.tracks.track]
        moved_m = np.linalg.norm(np.diff(self._stated[self._posed, :3, 3], axis=0), axis=1)
        unit = max(float(np.median(moved_m)) if len(moved_m) else 0.0, 1e-6)
        if self._has_depth:
            known = state.depth_m[~unknown]
            tried = np.geomspace(0.3 * known.min(), 3.0 * known.max(), _HYPOTHESES)
        else:
            tried = unit * np.geomspace(2.0, 2000.0, _HYPOTHESES)
        costs = np.full((len(tried), len(unknown)), np.inf)
        for place, depth_m in enumerate(tried):
            one = replace(state, depth_m=np.where(unknown, depth_m, state.depth_m))
            length = np.linalg.norm(self._linear(one).residual, axis=1)
            cost = np.bincount(
                self.tracks.track[rows], np.nan_to_num(np.minimum(length, 20.0), nan=20.0)[rows], len(unknown)
            )
            costs[place] = cost
        best = tried[np.argmin(costs, axis=0)]
        return State(state.poses, np.where(unknown, best, state.depth_m))


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


def _add_square(blocks: Array, first: int, square: Array) -> None:
    """Add (k, 6, k, 6), symmetric, at a frame."""
    span = len(square)
    frames = np.arange(span)
    for apart in range(span):
        near = frames[: span - apart]
        blocks[first + near, apart] += square[near, :, near + apart, :]


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
