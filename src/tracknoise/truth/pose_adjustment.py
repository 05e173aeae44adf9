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

Sums are made of some tracks after the others, in the order of their births, so that derivatives and weights of few
observations are held at a time.
"""

from collections.abc import Callable, Iterator, Mapping
from collections.abc import Sequence as Items
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.spatial.transform import Rotation

from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.projection import cross_matrices
from tracknoise.inference.robust_fits import scales_of_groups, squared, weights
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.row_poses import RowPoses
from tracknoise.sequences.sequence import Sequence
from tracknoise.truth.uncertainty import AnchoredPoints, ObservedCameras

Array = NDArray[np.float64]
Integers = NDArray[np.signedinteger[Any]]

PRIOR_ROTATION_RAD = np.deg2rad(0.5)
"""Standard deviation of the stated rotation from frame to frame, about each axis. A stated translation has that which
moves points of the median depth as far."""
_STEPS, _STEPS_FROM_BEST = 8, 3
_CONVERGED_PX = 1e-3
_LARGEST_STEP = 0.5
"""Largest change of the logarithm of a depth in a step."""
_GAUGE = 1e-6
_HYPOTHESES = 24
_TOGETHER = 1 << 14
"""Rows that are treated together, but for those of tracks that are born in one frame, which always are."""
_KEPT = 1 << 17
"""Rows whose derivatives are kept between passes: all of those of a short recording."""
_TWIST = 6
_ESTABLISHED, _OF_A_KIND = 3.0, 1.0 / 3.0
_BLOCK = 0.15
"""Side of the blocks of points that are in the same half, as a part of their median depth."""


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceTracks:
    """Tracks of a sequence. Rows of observations are sorted by track and frame, and leave births out.

    Attributes
    ----------
    birth : (m,) integers
        First frame of each track, ascending.
    birth_uv : (m, 2) float64
        Its position there, px.
    depth_m, depth_sigma : (m,) float64
        Its stated depth there, metres, NaN where there is none; and its relative standard deviation.
    kind : (m,) integers
        Number of the tracker.
    track, frame : (n,) integers
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
        number = np.cumsum(tracks, dtype=self.track.dtype) - 1
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
    # (n, 2) float32: what one unit leaves in positions of points with stated depths, and in residuals of others, px
    left: NDArray[np.float32]

    @property
    def is_established(self) -> bool:
        """Whether it is clearly not 0, and tracks of each kind find much of it."""
        clear = abs(self.size) >= _ESTABLISHED * self.deviation > 0.0
        return clear and all(size / self.size > _OF_A_KIND for size in self.of_kinds)


class _Chunk:
    """Tracks that are born in successive frames, and their observations.

    Their pairs of a frame of birth and a later frame are sorted by both.
    """

    def __init__(self, tracks: ReferenceTracks, numbers: range) -> None:
        first, last = np.searchsorted(tracks.track, (numbers.start, numbers.stop)).tolist()
        self.tracks, self.rows = slice(numbers.start, numbers.stop), slice(first, last)
        born, frame = tracks.birth[tracks.track[self.rows]], tracks.frame[self.rows]
        frames = int(frame.max(initial=0)) + 1
        key, of_row = np.unique(born.astype(np.intp) * frames + frame, return_inverse=True)
        self.birth, self.frame = np.divmod(key, frames)
        self.of_row = of_row.astype(np.int32)
        self.order = np.argsort(self.of_row, kind="stable").astype(np.int32)  # of the rows
        self.starts = np.searchsorted(self.of_row[self.order], np.arange(len(key) + 1))

    def numbers(self, tracks: ReferenceTracks) -> Integers:
        """(n,): the track of each observation, from the first of the chunk."""
        return np.asarray(tracks.track[self.rows] - self.tracks.start)

    def births(self, tracks: ReferenceTracks) -> Iterator[tuple[int, slice, slice, slice]]:
        """Of each frame of birth: the frame, and its rows, tracks and pairs, from the first of the chunk."""
        births = np.unique(self.birth)
        first = np.append(np.searchsorted(tracks.birth[self.tracks], births), self.tracks.stop - self.tracks.start)
        rows = np.searchsorted(tracks.track[self.rows], first + self.tracks.start)
        pairs = np.append(np.searchsorted(self.birth, births), len(self.birth))
        for place, birth in enumerate(births.tolist()):
            yield birth, *(slice(int(ends[place]), int(ends[place + 1])) for ends in (rows, first, pairs))


def _chunks(tracks: ReferenceTracks) -> tuple[_Chunk, ...]:
    """All tracks in the order of their births, those of one frame together."""
    births, first = np.unique(tracks.birth, return_index=True)
    rows = np.searchsorted(tracks.track, first)
    ends, start = [0], 0
    for place in range(1, len(births)):
        if rows[place] - start >= _TOGETHER:
            ends.append(int(first[place]))
            start = rows[place]
    ends.append(len(tracks.birth))
    return tuple(_Chunk(tracks, range(*span)) for span in pairwise(ends) if span[0] < span[1])


@dataclass(frozen=True, slots=True, eq=False)
class _Linear:
    """Derivatives of the residuals of a chunk: (n, 2, 6) by the pose now, (n, 2) by depth.

    `carried`, (pairs, 6, 6): twists of the pose at birth as such of the pose now, with the other sign.
    """

    by_pose: Array
    by_depth: Array
    carried: Array

    def between(self, chunk: _Chunk, twist: Array) -> Array:
        """(n, 6): twists of the pose now that do what twists (frames, 6) of both poses do."""
        moved = twist[chunk.frame] - np.einsum("pij,pj->pi", self.carried, twist[chunk.birth])
        return np.asarray(moved[chunk.of_row])


Weights = Callable[[_Chunk], Array]
"""Weights of the observations of a chunk, (n,), 1/px^2."""


@dataclass(frozen=True, slots=True, eq=False)
class _Linearised:
    """Derivatives at a state, chunk by chunk. Those of the first chunks are kept, as far as there is room."""

    adjustment: "PoseAdjustment"
    state: State
    _kept: dict[int, _Linear] = field(default_factory=dict)

    def of(self, chunk: _Chunk) -> _Linear:
        """Of one chunk."""
        first = chunk.rows.start
        if first in self._kept:
            return self._kept[first]
        linear = self.adjustment.linear(self.state, chunk)
        if chunk.rows.stop <= _KEPT:
            self._kept[first] = linear
        return linear


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
        self._row_poses = RowPoses(sequence)
        self._cameras = ObservedCameras.of(sequence, np.arange(len(self._stated)))  # of frames
        self._rays = self._cameras.chosen(tracks.birth).bearings(tracks.birth_uv)
        self._in_frame = None  # of a rolling shutter: pose of the row of birth in the frame of the pose
        if self._row_poses.rows is not None:
            self._in_frame = invert(self._stated)[tracks.birth] @ self._row_poses.at(tracks.birth, tracks.birth_uv)
        stated_m = tracks.depth_m[np.isfinite(tracks.depth_m)]
        self.has_depth = bool(len(stated_m))
        self._chunks = _chunks(tracks)
        self._reach = max((int((chunk.frame - chunk.birth).max(initial=1)) for chunk in self._chunks), default=1)
        self._depth_prior = np.where(np.isfinite(tracks.depth_m), tracks.depth_sigma, np.inf)
        self._start = State(self._stated.copy(), self._depths(tracks.depth_m))
        self._logs = np.log(self._start.depth_m)
        self._far_m = float(np.median(self._start.depth_m)) if len(tracks.birth) else 1.0

    def chosen(self, tracks: NDArray[np.bool_]) -> "PoseAdjustment":
        """The adjustment by some of the tracks, (m,) bool, with the same prior."""
        part = copy(self)
        part._choose(tracks)
        part._logs, part._start = self._logs[tracks], State(self._start.poses, self._start.depth_m[tracks])
        return part

    def with_depths(self, depth_m: Array) -> "PoseAdjustment":
        """The adjustment with other stated depths (m,), metres, NaN where there are none."""
        part, has_depth = copy(self), np.isfinite(depth_m)
        part.tracks = replace(self.tracks, depth_m=depth_m)
        part._start = State(self._start.poses, np.where(has_depth, depth_m, self._start.depth_m))
        part._logs = np.log(part._start.depth_m)
        part._depth_prior = np.where(has_depth, self._depth_prior, np.inf)
        return part

    def with_cameras(self, sequence: Sequence) -> "PoseAdjustment":
        """The adjustment with the cameras of another sequence of the same frames."""
        part = copy(self)
        part._cameras = ObservedCameras.of(sequence, np.arange(len(self._stated)))
        part._rays = part._cameras.chosen(self.tracks.birth).bearings(self.tracks.birth_uv)
        return part

    def _choose(self, tracks: NDArray[np.bool_]) -> None:
        """Leave out the other tracks, but for what their depths are at the start."""
        self.tracks = self.tracks.chosen(tracks)
        self._chunks = _chunks(self.tracks)
        self._rays, self._depth_prior = self._rays[tracks], self._depth_prior[tracks]
        if self._in_frame is not None:
            self._in_frame = self._in_frame[tracks]

    def residuals(self, poses: Array, depth_m: Array) -> Array:
        """(n, 2): observed less predicted positions, px, by poses (frames, 4, 4) and depths (m,) at births."""
        state, residual = State(poses, depth_m), np.empty_like(self.tracks.uv)
        for chunk in self._chunks:
            seen, *_ = self._seen(state, self._between(state, chunk), chunk)
            cameras = self._cameras.chosen(self.tracks.frame[chunk.rows])
            residual[chunk.rows] = self.tracks.uv[chunk.rows] - cameras.project(seen)
        return residual

    def blocks(self) -> Iterator[slice]:
        """Rows that are treated together, so that memory grows little with their number."""
        return (chunk.rows for chunk in self._chunks)

    def anchored_points(self, poses: Array, depth_m: Array, rows: Integers | slice) -> AnchoredPoints:
        """The points of some observations in the world of these poses."""
        track = self.tracks.track[rows]
        anchor = self.tracks.birth[track]
        points = transform(poses[anchor], self._rays[track] * depth_m[track, None])
        return AnchoredPoints(anchor.astype(np.intp), self.tracks.frame[rows].astype(np.intp), points)

    def epipolar_distances(self, poses: Array, rows: NDArray[np.bool_]) -> Array:
        """Distances of observations from the epipolar lines of their first positions, (n,), in focal lengths."""
        track, frame = self.tracks.track[rows], self.tracks.frame[rows]
        relative = invert(poses[frame]) @ poses[self.tracks.birth[track]]
        turned = (relative[:, :3, :3] @ self._rays[track][:, :, None])[:, :, 0]
        lines = np.cross(relative[:, :3, 3], turned)
        seen = self._cameras.chosen(frame).bearings(self.tracks.uv[rows])
        with np.errstate(divide="ignore", invalid="ignore"):  # of frames at one place
            return np.asarray(np.abs(np.sum(lines * seen, axis=1)) / np.hypot(lines[:, 0], lines[:, 1]))

    def parallax_px(self) -> float:
        """Median parallax of the tracks by the stated poses, px; infinite where depths are known without it."""
        if self.has_depth:
            return np.inf
        far = 1e6 * self._start.depth_m
        near = self.residuals(self._stated, self._start.depth_m)
        moved = np.linalg.norm(near - self.residuals(self._stated, far), axis=1)
        most = np.zeros(len(self.tracks.birth))
        np.maximum.at(most, self.tracks.track, np.nan_to_num(moved))
        return float(np.median(most))

    def best(self, start: "State | None" = None) -> "State":
        """The state that fits all tracks, from another one that is near."""
        return self._fitted(start or self._start, _STEPS)

    def _fitted(self, state: State, steps: int) -> State:
        """The state after so many steps, or fewer where they no longer change residuals."""
        residual = self.residuals(state.poses, state.depth_m)
        for _ in range(steps):
            linear = _Linearised(self, state)
            state = self._moved(state, *self._step(state, linear, residual, self._weights(residual)))
            before, residual = residual, self.residuals(state.poses, state.depth_m)
            before -= residual
            if np.nanmedian(np.abs(before, out=before)) < _CONVERGED_PX:
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
        near = State(state.poses, state.depth_m[tracks])
        return self.chosen(tracks)._fitted(near, _STEPS_FROM_BEST).poses

    def faults(self, state: "State", moved: Mapping[str, NDArray[np.floating]]) -> dict[str, "Fault"]:
        """How much of each fault by itself the residuals hold that no poses and depths of tracks absorb.

        With the displacements m (n, 2) of observations by one unit of it, what is left m~ of them in residuals r, and
        the weights W of these, it is (m' W m~)^-1 m~' W r. Its variance is that of sums over blocks of space.
        """
        linear, block = _Linearised(self, state), self._blocks(state)
        residual = self.residuals(state.poses, state.depth_m)
        weight = self._weights(residual)
        return {name: self._fault(linear, residual, weight, block, displaced) for name, displaced in moved.items()}

    def _fault(
        self, linear: _Linearised, residual: Array, weight: Weights, block: Integers, moved: NDArray[np.floating]
    ) -> "Fault":
        """What small displacements of true positions (n, 2), px, leave; NaN stays.

        Poses and depths absorb a part of them in residuals. Positions of tracks with stated depths have the poses, and
        no depths that absorb anything.
        """
        tracks, left = self.tracks, np.empty(moved.shape, np.float32)
        is_free = ~np.isfinite(tracks.depth_m)

        def of_known(chunk: _Chunk) -> Array:
            return np.where(np.isfinite(moved[chunk.rows]).all(axis=1), weight(chunk), 0.0)

        start = State(self._stated, self._start.depth_m)  # where the priors are 0
        twist, stretch = self._step(start, linear, moved, of_known)
        size = int(block.max(initial=0)) + 1
        of_blocks, of_kinds = np.zeros((2, size)), np.zeros((2, int(tracks.kind.max(initial=0)) + 1))
        for chunk in self._chunks:
            rows, derivatives = chunk.rows, linear.of(chunk)
            track, unit = tracks.track[rows], moved[rows].astype(np.float64)
            turned = np.einsum("nij,nj->ni", derivatives.by_pose, derivatives.between(chunk, twist))
            by_poses = unit - turned
            by_both = by_poses - derivatives.by_depth * stretch[track, None]
            left[rows] = np.where(is_free[track, None], by_both, by_poses)
            chunk_weight = of_known(chunk)
            curvature, slope, square = (
                np.nan_to_num(chunk_weight * np.sum(first * second, axis=1))
                for first, second in ((unit, by_both), (by_both, residual[rows]), (by_both, by_both))
            )
            of_blocks += [np.bincount(block[track], values, size) for values in (slope, curvature)]
            of_kinds += [np.bincount(tracks.kind[track], values, of_kinds.shape[1]) for values in (slope, square)]
        slopes, curvatures = of_blocks.sum(axis=1).tolist()
        if not curvatures > 0.0:
            return Fault(0.0, np.inf, (), 0.0, left)
        fault_size = slopes / curvatures
        deviation = float(np.sqrt(np.sum((of_blocks[0] - fault_size * of_blocks[1]) ** 2)) / curvatures)
        kinds = of_kinds[0] / np.maximum(of_kinds[1], 1e-300) * (of_kinds[1].sum() / curvatures)
        return Fault(fault_size, deviation, tuple(kinds.tolist()), fault_size * slopes, left)

    def by_log_depth(self, state: "State") -> NDArray[np.float32]:
        """(n, 2): displacements of predicted positions with the logarithms of the depths at birth, px."""
        displaced = np.empty(self.tracks.uv.shape, np.float32)
        for chunk in self._chunks:
            displaced[chunk.rows] = self.linear(state, chunk).by_depth
        return displaced

    def _weights(self, residual: Array) -> Weights:
        """Of observations, by the scales of all residuals (n, 2); 0 where one is unknown."""
        scale = scales_of_groups(self._group(slice(None)), residual)
        return partial(self._weighted, scale, residual)

    def _weighted(self, scale_of_group: Array, residual: Array, chunk: _Chunk) -> Array:
        scale = scale_of_group[self._group(chunk.rows)]
        return np.asarray(weights(squared(residual[chunk.rows], scale)) / scale**2)

    def _group(self, rows: slice) -> Integers:
        """Number of the kind and age of some observations."""
        tracks = self.tracks
        track = tracks.track[rows]
        return np.asarray(tracks.kind[track] * (self._reach + 1) + tracks.frame[rows] - tracks.birth[track], np.int32)

    def _between(self, state: State, chunk: _Chunk) -> Array:
        """(pairs, 4, 4): pose at birth in the pose now."""
        return invert(state.poses[chunk.frame]) @ state.poses[chunk.birth]

    def _seen(self, state: State, between: Array, chunk: _Chunk) -> tuple[Array, Array, Array, Array | None]:
        """Of a chunk: points in the camera and in the frame of the pose that see them, and origins of the rays.

        Of a rolling shutter also the frame of the pose in the camera.
        """
        track, pair = self.tracks.track[chunk.rows], chunk.of_row
        at_birth, origin = self._rays[track] * state.depth_m[track, None], between[pair, :3, 3]
        if self._in_frame is None:
            points = transform(between[pair], at_birth)
            return points, points, origin, None
        in_frame, frame = self._in_frame[track], self.tracks.frame[chunk.rows]
        origin = transform(between[pair], in_frame[:, :3, 3])
        points = transform(between[pair], transform(in_frame, at_birth))
        in_row = invert(self._row_poses.at(frame, self.tracks.uv[chunk.rows])) @ self._stated[frame]
        return transform(in_row, points), points, origin, in_row

    def linear(self, state: State, chunk: _Chunk) -> _Linear:
        """Derivatives of the residuals of a chunk; 0 where one is unknown."""
        between = self._between(state, chunk)
        seen, points, origin, in_row = self._seen(state, between, chunk)
        by_point = self._cameras.chosen(self.tracks.frame[chunk.rows]).jacobians(seen)
        if in_row is not None:
            by_point = by_point @ in_row[:, :3, :3]
        by_pose = np.concatenate([-by_point, np.cross(by_point, points[:, None])], axis=2)
        by_depth = np.einsum("nij,nj->ni", by_point, points - origin)
        unknown = ~np.isfinite(by_pose).all(axis=(1, 2))
        by_pose[unknown], by_depth[unknown] = 0.0, 0.0
        return _Linear(by_pose, by_depth, _adjoint(between))

    def _step(
        self, state: State, linear: _Linearised, residual: NDArray[np.floating], weight: Weights
    ) -> tuple[Array, Array]:
        """Twists (frames, 6) and changes of log depths (m,) that fit residuals (n, 2), and priors from a state."""
        tracks, n_frames = self.tracks, len(state.poses)
        prior = np.where(np.isfinite(self._depth_prior), 1.0 / self._depth_prior**2, 0.0)
        curvature, slope = prior, -prior * (np.log(state.depth_m) - self._logs)
        system = _Banded(n_frames, min(self._reach, n_frames - 1) + 1)
        self._add_prior(state, system)
        for chunk in self._chunks:
            derivatives, chunk_weight, number = linear.of(chunk), weight(chunk), chunk.numbers(tracks)
            weighted, chunk_residual = derivatives.by_depth * chunk_weight[:, None], np.nan_to_num(residual[chunk.rows])
            of_depth = curvature[chunk.tracks], slope[chunk.tracks]
            for sums, column in zip(of_depth, (derivatives.by_depth, chunk_residual), strict=True):
                sums += np.bincount(number, np.sum(weighted * column, axis=1), len(sums))
            of_depth[0][of_depth[0] <= 0.0] = 1.0
            self._add_chunk(system, chunk, derivatives, chunk_residual, chunk_weight, of_depth)
        twist = system.solved()
        for chunk in self._chunks:
            derivatives = linear.of(chunk)
            turned = np.einsum("nij,nj->ni", derivatives.by_pose, derivatives.between(chunk, twist))
            along = weight(chunk) * np.sum(derivatives.by_depth * turned, axis=1)
            own_slope = slope[chunk.tracks]
            own_slope -= np.bincount(chunk.numbers(tracks), along, len(own_slope))
        return twist, slope / curvature

    def _add_chunk(
        self, system: "_Banded", chunk: _Chunk, linear: _Linear, residual: Array, weight: Array, of_depth: Items[Array]
    ) -> None:
        """Add the information of observations, less that of the depths: `of_depth`, curvature and slope of each."""
        columns = np.concatenate([linear.by_pose, residual[:, :, None]], axis=2) * np.sqrt(weight)[:, None, None]
        columns = columns[chunk.order].reshape(-1, _TWIST + 1)
        sums = np.empty((len(chunk.birth), _TWIST, _TWIST + 1))
        for place, (start, end) in enumerate(pairwise((2 * chunk.starts).tolist())):
            sums[place] = columns[start:end, :_TWIST].T @ columns[start:end]
        now, aside = sums[:, :, :_TWIST], -np.swapaxes(linear.carried, 1, 2) @ sums
        by_both = np.einsum("nij,ni->nj", linear.by_pose, linear.by_depth * weight[:, None])
        number, frame, root = chunk.numbers(self.tracks), self.tracks.frame[chunk.rows], np.sqrt(of_depth[0])
        for birth, rows, born, pairs in chunk.births(self.tracks):
            age, carried, square = chunk.frame[pairs] - birth, linear.carried[pairs], system.opened(birth)
            square[age, :, age, :] += now[pairs]
            square[0, :, age, :] += aside[pairs, :, :_TWIST]
            square[0, :, 0, :] -= np.tensordot(aside[pairs, :, :_TWIST], carried, axes=((0, 2), (0, 1)))
            joint = np.zeros((born.stop - born.start, int(age[-1]) + 1, _TWIST))
            joint[number[rows] - born.start, frame[rows] - birth] = by_both[rows]
            joint[:, 0] = -np.tensordot(joint[:, age], carried, axes=2)
            wide = joint.shape[1]
            scaled = joint.reshape(len(joint), -1) / root[born, None]
            square[:wide, :, :wide] -= (scaled.T @ scaled).reshape(wide, _TWIST, wide, _TWIST)
            system.right[birth + age] += sums[pairs, :, _TWIST]
            system.right[birth] += aside[pairs, :, _TWIST].sum(axis=0)
            system.right[birth : birth + wide] -= (scaled.T @ (of_depth[1][born] / root[born])).reshape(-1, _TWIST)

    def _add_prior(self, state: State, system: "_Banded") -> None:
        """Add the stated relative poses of successive frames with a pose."""
        precision = np.repeat([1.0 / (PRIOR_ROTATION_RAD * self._far_m) ** 2, 1.0 / PRIOR_ROTATION_RAD**2], 3)
        all_frames, frames = np.arange(len(self._posed)), np.flatnonzero(self._posed)
        before, after = frames[:-1], frames[1:]
        near = after - before < system.width
        before, after = before[near], after[near]
        stated, now = (invert(poses[before]) @ poses[after] for poses in (self._stated, state.poses))
        miss, moved = -_logarithm(invert(stated) @ now), -_adjoint(invert(now))
        weighted = np.swapaxes(moved, 1, 2) * precision
        system.add(all_frames, all_frames, np.diag(np.full(_TWIST, _GAUGE * precision.min())))
        system.add(all_frames[~self._posed], all_frames[~self._posed], np.eye(_TWIST))
        system.add(frames[:1], frames[:1], np.diag(1e6 * precision))
        system.add(before, before, weighted @ moved)
        system.add(after, after, np.diag(precision))
        system.add(before, after, weighted)
        system.right[before] += np.einsum("nij,nj->ni", weighted, miss)
        system.right[after] += precision * miss

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
        if self.has_depth:
            given_m = stated_m[~unknown]
            tried = np.geomspace(0.3 * given_m.min(), 3.0 * given_m.max(), _HYPOTHESES)
        else:
            tried = unit * np.geomspace(2.0, 2000.0, _HYPOTHESES)
        part = copy(self)
        part._choose(unknown)
        count = len(part.tracks.birth)
        costs = np.empty((len(tried), count))
        for place, depth_m in enumerate(tried):
            length = np.linalg.norm(part.residuals(self._stated, np.full(count, depth_m)), axis=1)
            costs[place] = np.bincount(part.tracks.track, np.nan_to_num(np.minimum(length, 20.0), nan=20.0), count)
        filled_m = stated_m.copy()
        filled_m[unknown] = tried[np.argmin(costs, axis=0)]
        return filled_m


def exponential(twist: Array) -> Array:
    """(n, 4, 4): rigid transforms of twists (n, 6), translation first, with the translation as it is."""
    transforms = np.tile(np.eye(4), (len(twist), 1, 1))
    transforms[:, :3, :3] = Rotation.from_rotvec(twist[:, 3:]).as_matrix()
    transforms[:, :3, 3] = twist[:, :3]
    return transforms


def _logarithm(poses: Array) -> Array:
    """(n, 6): the inverse of `exponential`."""
    return np.concatenate([poses[:, :3, 3], Rotation.from_matrix(poses[:, :3, :3]).as_rotvec()], axis=1)


def _adjoint(poses: Array) -> Array:
    """(n, 6, 6): twists of the source frame in the target frame."""
    adjoint = np.zeros((len(poses), _TWIST, _TWIST))
    adjoint[:, :3, :3] = adjoint[:, 3:, 3:] = poses[:, :3, :3]
    adjoint[:, :3, 3:] = cross_matrices(poses[:, :3, 3]) @ poses[:, :3, :3]
    return adjoint


class _Banded:
    """The banded system of the poses. What belongs to tracks is added in the order of their births."""

    def __init__(self, n_frames: int, width: int) -> None:
        self.width = width  # frames that are linked with each, itself among them
        self.right = np.zeros((n_frames, _TWIST))
        self._lower = np.zeros((n_frames * _TWIST, width * _TWIST))  # its columns, each from the diagonal on
        self._open = np.zeros((width, _TWIST, width, _TWIST))  # of a frame and those after it
        self._frame = 0

    def add(self, frame: Integers, other: Integers, block: Array) -> None:
        """Add blocks (n, 6, 6), or one, at different frames (n,) and later or the same ones."""
        row, column = np.divmod(np.arange(_TWIST * _TWIST), _TWIST)
        below = _TWIST * (other - frame)[:, None] + column - row
        at, place = np.nonzero(below >= 0)
        values = np.broadcast_to(block, (len(frame), _TWIST, _TWIST)).reshape(len(frame), len(row))
        self._lower[_TWIST * frame[at] + row[place], below[at, place]] += values[at, place]

    def opened(self, frame: int) -> Array:
        """(width, 6, width, 6): what is added at a frame and those after it, of which the upper part counts.

        A frame before that of an earlier call is closed.
        """
        while self._frame < frame:
            self._close()
        return self._open

    def solved(self) -> Array:
        """Twists (frames, 6). Nothing can be added afterwards."""
        self.opened(len(self.right))
        twists = solveh_banded(self._lower.T, self.right.ravel(), overwrite_ab=True, lower=True)
        return np.asarray(twists.reshape(-1, _TWIST))

    def _close(self) -> None:
        for row, values in enumerate(self._open[0].reshape(_TWIST, -1)):
            self._lower[_TWIST * self._frame + row, : len(values) - row] += values[row:]
        self._open[:-1, :, :-1] = self._open[1:, :, 1:]
        self._open[-1], self._open[:, :, -1] = 0.0, 0.0
        self._frame += 1
