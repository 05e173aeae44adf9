"""What an estimator that assumes one noise makes of another, by exact linear algebra on windows of frames.

The windows have tracks of static points. The first pose is known, and so is the scale: the newest position does not
move along the line from the first one to it. All other coordinates of poses, and all points, are unknown.

Each track is whitened by the covariance that the estimator assumes, and its 3-D point is eliminated. With G for what is
left of the derivatives by poses, C for the true covariance after whitening, and sums over tracks,

    claimed = (sum G' G)^-1,  actual = claimed (sum G' C G) claimed    (benchmark.covariances)
    NEES / dof = trace(claimed^-1 actual) / dof                        (benchmark.nees)

The normalised estimation error squared is 1 if the estimator is as certain as it should be, and larger if it is
overconfident. Innovations are the residuals of a track after its point was fitted with the true poses.

Points are also fitted to tracks by least squares with a covariance of all observations, to first order. With F the
derivatives of the positions by the point, e the errors and C their assumed covariance, the point errs by

    dX = P F' C^-1 e,  and its claimed covariance is  P = (F' C^-1 F)^-1    (point_fit)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import gammaincinv

from tracknoise.estimators.model import Landmark, Purpose
from tracknoise.geometry.cameras import Camera, CameraModel
from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.projection import cross_matrices, image_derivatives
from tracknoise.inference.track_noise import COMPONENTS, Reference, Seen, TrackNoise

CAMERA = Camera(640, 480, 460.0, 460.0, 319.5, 239.5)
"""The camera of simulated windows."""
_VIEW_PX = (560.0, 400.0)
_DEPTHS_M = (2.0, 10.0)
_LEAST_LENGTH = 3


class Motion(StrEnum):
    """How the camera moves through a simulated window."""

    SIDEWAYS = "sideways"
    """0.06 m per frame along x, without rotation."""
    FORWARD = "forward"
    """0.10 m per frame along z, and 0.01 rad per frame about y."""


@dataclass(frozen=True, slots=True, eq=False)
class PointTracks:
    """Tracks that have the same number n of observations."""

    frames: NDArray[np.int64]  # (tracks, n) integers: frames of the window, increasing
    points: NDArray[np.float64]  # (tracks, 3) float64: points in the world, metres
    # (tracks,) bool: whether a track begins with its first observation of the window. Others began before it. By
    # default all do.
    born: NDArray[np.bool_] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LinearTracks:
    """Tracks that have the same number n of observations, with derivatives of the images."""

    frames: NDArray[np.int64]  # (tracks, n) integers: as those of `PointTracks`
    by_pose: NDArray[np.float64]  # (tracks, 2 n, p) float64: by the p unknown coordinates of poses
    by_point: NDArray[np.float64]  # (tracks, 2 n, 3) float64: px per metre
    magnification: NDArray[np.float64]  # (tracks, n) float64: Z_0 / Z_k
    rays: NDArray[np.float64]  # (tracks, 3) float64: from the first camera that sees a point to the point, metres
    born: NDArray[np.bool_]  # (tracks,) bool: as that of `PointTracks`
    # (tracks, 2 n, p) and (tracks, 2 n, 3): derivatives of the same in a second camera, where there is one
    beside: "tuple[NDArray[np.float64], NDArray[np.float64]] | None" = None

    @property
    def of_both(self) -> "LinearTracks":
        """The tracks in both cameras: first the 2 n rows of the first one, then those of the second."""
        assert self.beside is not None, "it has a second camera"
        by_pose, by_point = (
            np.concatenate(both, axis=1) for both in zip((self.by_pose, self.by_point), self.beside, strict=True)
        )
        return replace(self, by_pose=by_pose, by_point=by_point, beside=None)


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """A second camera."""

    camera: CameraModel
    first_from_second: NDArray[np.float64]  # (4, 4) float64, metres: its pose in the frame of the first camera


@dataclass(frozen=True, slots=True, eq=False)
class Gauge:
    """What an estimator of a window takes as known, and which coordinates of poses it has to find.

    A pose is moved as in `tracknoise.geometry.projection.image_derivatives`. The p = 6 frames - 7 coordinates are the
    six of each pose but the first; the newest position has two, across the line from the first position to it.
    """

    across: NDArray[np.float64]  # (3, 2) float64: orthonormal directions, along which the newest position is moved

    @classmethod
    def of(cls, positions: NDArray[np.float64]) -> "Gauge":
        """Of a camera at positions (frames, 3), metres, of which the first and the last differ."""
        line = positions[-1:] - positions[:1]
        return cls(np.linalg.svd(line)[2][1:].T)

    def free(self, by_pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., p) float64: derivatives by the coordinates to be found, from those by all, (..., 6 frames)."""
        return np.concatenate([by_pose[..., 6:-3], by_pose[..., -3:] @ self.across], axis=-1)


def linear_tracks(
    camera: CameraModel,
    world_from_camera: NDArray[np.float64],
    tracks: PointTracks,
    gauge: Gauge | None = None,
    rig: Rig | None = None,
) -> LinearTracks:
    """Derivatives of the images of tracks at given poses, (frames, 4, 4), and points, also in a second camera.

    The gauge is by default that of these poses.
    """
    count, length = tracks.frames.shape
    rows = tracks.frames.ravel()
    poses = world_from_camera[rows]
    points = np.repeat(tracks.points, length, axis=0)
    known = Gauge.of(world_from_camera[:, :3, 3]) if gauge is None else gauge

    def of_tracks(
        by_pose: NDArray[np.float64], by_point: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        spread = np.zeros((count * length, 2, len(world_from_camera), 6))
        spread[np.arange(count * length), :, rows] = by_pose
        return known.free(spread.reshape(count, 2 * length, -1)), by_point.reshape(count, 2 * length, 3)

    by_pose, by_point = of_tracks(*image_derivatives(camera, poses, points))
    depth = transform(invert(poses), points)[:, 2].reshape(count, length)
    return LinearTracks(
        frames=tracks.frames,
        by_pose=by_pose,
        by_point=by_point,
        magnification=depth[:, :1] / depth,
        rays=tracks.points - world_from_camera[tracks.frames[:, 0], :3, 3],
        born=np.ones(count, dtype=np.bool_) if tracks.born is None else tracks.born,
        beside=None if rig is None else of_tracks(*_derivatives_beside(rig, poses, points)),
    )


def _derivatives_beside(
    rig: Rig, poses: NDArray[np.float64], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Derivatives of images in a second camera by the poses of the first, (n, 2, 6), and by points, (n, 2, 3).

    Where the first camera turns by a about its axes and moves by b, the second at t, turned by S, turns by S' a about
    its own and moves by b + R (a x t).
    """
    by_second, by_point = image_derivatives(rig.camera, poses @ rig.first_from_second, points)
    place = np.tile(rig.first_from_second[:3, 3], (len(poses), 1))
    turned = by_second[..., :3] @ rig.first_from_second[:3, :3].T
    moved = by_second[..., 3:] @ poses[:, :3, :3] @ cross_matrices(place)
    return np.concatenate([turned - moved, by_second[..., 3:]], axis=-1), by_point


def trajectory(motion: Motion, n_frames: int) -> NDArray[np.float64]:
    """(n_frames, 4, 4) float64: world_from_camera of a simulated window, the first one the identity."""
    frame = np.arange(n_frames)
    poses = np.tile(np.eye(4), (n_frames, 1, 1))
    if motion is Motion.SIDEWAYS:
        poses[:, 0, 3] = 0.06 * frame
    else:
        poses[:, 2, 3] = 0.10 * frame
        poses[:, :3, :3] = Rotation.from_rotvec(np.outer(0.01 * frame, (0.0, 1.0, 0.0))).as_matrix()
    return poses


def simulated_tracks(
    world_from_camera: NDArray[np.float64],
    *,
    n_tracks: int = 80,
    lengths: Sequence[int] | NDArray[np.int64] | None = None,
    seed: int = 0,
    camera: Camera = CAMERA,
    sights: NDArray[np.float64] | None = None,
    before: NDArray[np.float64] | None = None,
) -> tuple[PointTracks, ...]:
    """Tracks of points, as long as they are in the image of a camera, grouped by their length.

    Shapes: world_from_camera (frames, 4, 4), sights (n, 3), before (m, 4, 4). With poses `before` the window, tracks
    begin there, too, at one of these sights. Without them, those that began earlier have their first sight in it.
    """
    random = np.random.default_rng(seed)
    drawn = [_track(random, world_from_camera, lengths, camera, sights, before) for _ in range(n_tracks)]
    long_enough = [track for track in drawn if len(track[0]) >= _LEAST_LENGTH]
    groups = sorted({len(frames) for frames, _, _ in long_enough})
    return tuple(_stacked([track for track in long_enough if len(track[0]) == length]) for length in groups)


def _stacked(tracks: Sequence[tuple[NDArray[np.int64], NDArray[np.float64], bool]]) -> PointTracks:
    frames, points, born = zip(*tracks, strict=True)
    return PointTracks(np.stack(frames), np.stack(points), np.array(born))


def _track(
    random: np.random.Generator,
    world_from_camera: NDArray[np.float64],
    lengths: Sequence[int] | NDArray[np.int64] | None,
    camera: Camera,
    sights: NDArray[np.float64] | None,
    before: NDArray[np.float64] | None,
) -> tuple[NDArray[np.int64], NDArray[np.float64], bool]:
    """Frames, point, and whether it begins in the window."""
    n_frames, known = len(world_from_camera), None if before is None else len(before)
    birth, end = (0, n_frames) if lengths is None else _lifespan(random, np.asarray(lengths), n_frames, known)
    poses = world_from_camera if before is None else np.concatenate([before, world_from_camera])
    first = max(birth, 0 if known is None else -known)
    *uv, depth = drawn_sight(random) if sights is None else sights[random.integers(len(sights))]
    seen = camera.unproject(np.asarray(uv), np.array(depth))
    frames = np.arange(first, end)
    of_frames = poses[frames + (known or 0)]
    point = transform(of_frames[0], seen[None])[0]
    images = camera.project(transform(invert(of_frames), np.tile(point, (len(frames), 1))))
    visible = np.logical_and.accumulate(camera.contains(images)) & (frames >= 0)
    return frames[visible], point, birth >= 0


def drawn_sight(random: np.random.Generator) -> tuple[float, float, float]:
    """u, v (px) and depth (m) at first sight: in the middle of the image of `CAMERA`, at 2 to 10 m."""
    u, v = (random.random(2) - 0.5) * _VIEW_PX + (CAMERA.cx, CAMERA.cy)
    return float(u), float(v), random.uniform(*_DEPTHS_M)


def _lifespan(
    random: np.random.Generator, lengths: NDArray[np.int64], n_frames: int, before: int | None
) -> tuple[int, int]:
    """First frame, and end in a window, of a track that is seen in at least `_LEAST_LENGTH` of its frames.

    It is negative if the track begins before the window, in one of so many frames if that is known. As many begin
    in each frame. The number of births with which a track of length T is seen is T + frames - 2 least + 1, from
    least - T to frames - least.
    """
    long_enough = lengths[lengths >= _LEAST_LENGTH] if (lengths >= _LEAST_LENGTH).any() else np.array([_LEAST_LENGTH])
    earliest = _LEAST_LENGTH - long_enough
    earliest = earliest if before is None else np.maximum(earliest, -before)
    births = n_frames - _LEAST_LENGTH + 1 - earliest
    place = int(random.choice(len(long_enough), p=births / births.sum()))
    birth = int(random.integers(earliest[place], n_frames - _LEAST_LENGTH + 1))
    return birth, min(birth + int(long_enough[place]), n_frames)


EXACT = 1e-4
"""Standard deviation of an observation that is taken as true, as a share of that of the others."""
_NEWEST = 5
"""Coordinates of the newest pose: three of its rotation, two of its position."""
_FACTORS = (-4.0, 4.0)
"""Range of the standard deviation that is searched, as logarithm of its ratio to the one for a free landmark."""
_DRAWS = 200
_ROUNDING = 1e-3
"""Error of a NEES that rounding may cause. It is larger where the poses of a window are not determined."""
Covariances = Sequence[NDArray[np.float64]]
"""(tracks, 2 n, 2 n) float64 for each group of tracks, px^2."""
Assumed = Sequence[NDArray[np.float64]]
"""Covariances that an estimator assumes, or variances (tracks, 2 n) where it takes observations as independent."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What an estimator claims about the poses of a window, and what is so."""

    # claimed, actual: (p, p) float64: covariances of the unknown coordinates of poses; radians and metres, those of the
    # newest last
    claimed: NDArray[np.float64]
    actual: NDArray[np.float64]
    innovations: float  # mean square of the whitened innovations; 1 if they look right

    @property
    def nees_all(self) -> float:
        """(benchmark.nees) of all poses."""
        return _nees(self.claimed, self.actual)

    @property
    def nees_newest(self) -> float:
        """(benchmark.nees) of the newest pose, with its own block of the covariance."""
        return _nees(self.claimed[-_NEWEST:, -_NEWEST:], self.actual[-_NEWEST:, -_NEWEST:])

    @property
    def position_m(self) -> float:
        """Root mean square error of the newest position."""
        return float(np.sqrt(np.trace(self.actual[-2:, -2:])))

    @property
    def rotation_rad(self) -> float:
        """Root mean square error of the newest rotation."""
        return float(np.sqrt(np.trace(self.actual[-_NEWEST:-2, -_NEWEST:-2])))


def _nees(claimed: NDArray[np.float64], actual: NDArray[np.float64]) -> float:
    return float(np.trace(np.linalg.solve(claimed, actual)) / len(claimed))


def true_covariances(window: Sequence[LinearTracks], noise: TrackNoise) -> Covariances:
    """Covariances of the errors of all tracks, counted from the true positions.

    A track that began before the window has its first observation there with the noise W of any other one. What it
    carries from before, its point absorbs.
    """
    found = []
    for tracks in window:
        covariance = noise.covariance(tracks.magnification, reference=Reference.FREE)
        covariance[~tracks.born, :2, :2] = noise.white
        found.append(covariance)
    return found


@dataclass(frozen=True, slots=True, eq=False)
class LinearEstimate:
    """What an estimator that assumes a noise makes of the errors of a window."""

    # of each group of tracks: what whitens it, and its whitened derivatives by poses without what the points absorb
    parts: Sequence[tuple[LinearTracks, "_Whitened", NDArray[np.float64]]]
    root: NDArray[np.float64]  # as of `_root_of_claimed`

    @classmethod
    def of(cls, window: Sequence[LinearTracks], assumed: Assumed) -> "LinearEstimate":
        """That of a window."""
        whitened = _whitened(window, assumed)
        pairs = zip(window, whitened, strict=True)
        by_pose = [without(one.whitened(tracks.by_pose), one.span) for tracks, one in pairs]
        return cls(list(zip(window, whitened, by_pose, strict=True)), _root_of_claimed(by_pose))

    def influences(self) -> dict[Purpose, NDArray[np.float64]]:
        """What each purpose is about, as a linear function of the components.

        Its mean square over the claimed one is the sum of the products of the entries of these matrices and of those of
        A, W, Q and D, (4, 2, 2) each: (benchmark.nees), without the noise itself. Walk and drift are per frame of the
        window.
        """
        roots = {Purpose.ALL_POSES: self.root, Purpose.NEWEST_POSE: self.root[:, -_NEWEST:]}
        found = {purpose: np.zeros((len(COMPONENTS), 2, 2)) for purpose in Purpose}
        freedom = sum(rows.shape[0] * (rows.shape[1] - 3) for _, _, rows in self.parts)
        for tracks, one, rows in self.parts:
            unit, shared = one.unwhitened(rows), _shared(tracks)
            for purpose, root in roots.items():
                found[purpose] += _contracted(shared, unit @ root) / root.shape[1]
            free = np.broadcast_to(np.eye(rows.shape[1]), (len(rows), rows.shape[1], rows.shape[1]))
            found[Purpose.INNOVATIONS] += _contracted(shared, one.unwhitened(without(free, one.span))) / freedom
        return found

    def influences_in_common(self, noise: TrackNoise) -> dict[Purpose, NDArray[np.float64]]:
        """What errors that all features of a frame have in common add to the mean squares of `influences`, per feature.

        What is claimed falls with the number of features, and errors in common do not. Two numbers for each purpose: of
        white errors, which are A and W of a noise for one track, and of a walk, which is Q. Innovations at true poses
        do not depend on other features.
        """
        size = len(self.root)
        length = 1 + max(int(tracks.frames.max()) for tracks, _, _ in self.parts)
        summed, features = np.zeros((2, length, 2, size)), np.zeros(length)
        drawn = [_symmetric_root(part) for part in (noise.first, noise.white, noise.walk)]
        for tracks, one, rows in self.parts:
            half = (one.unwhitened(rows) @ self.root).reshape(*tracks.frames.shape, 2, size)
            in_frame = (tracks.frames.ravel() == np.arange(length)[:, None]).astype(np.float64)
            for place, own in enumerate(_by_draw(tracks, half, *drawn)):
                summed[place] += (in_frame @ own.reshape(-1, 2 * size)).reshape(length, 2, size)
            features += in_frame.sum(axis=1)
        each = np.square(summed).sum(axis=(1, 2)) * features.sum() / np.square(features).sum()
        return {
            Purpose.INNOVATIONS: np.zeros(2),
            Purpose.ALL_POSES: each.mean(axis=1),
            Purpose.NEWEST_POSE: each[:, -_NEWEST:].mean(axis=1),
        }


def _root_of_claimed(by_pose: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """An upper triangular root of what is claimed, from derivatives without what the points absorb.

    Squares would lose poses that are hardly known. Its last columns are those of the newest pose over the root of its
    own block.
    """
    size = by_pose[0].shape[2]
    return np.linalg.inv(np.linalg.qr(np.concatenate([rows.reshape(-1, size) for rows in by_pose]), mode="r"))


def _by_draw(
    tracks: LinearTracks,
    half: NDArray[np.float64],
    first: NDArray[np.float64],
    white: NDArray[np.float64],
    walk: NDArray[np.float64],
) -> list[NDArray[np.float64]]:
    """What multiplies the draw of each frame, white and of a walk, from what multiplies errors, (tracks, n, 2, q).

    The others are roots (2, 2) of A, W and Q.
    """
    drawn = white @ half
    drawn[tracks.born, 0] = first @ half[tracks.born, 0]
    carried = tracks.magnification[:, :, None, None] * half
    later = np.cumsum(carried[:, ::-1], axis=1)[:, ::-1] / tracks.magnification[:, :, None, None]
    later[:, 0] = 0.0
    return [drawn, walk @ later]


def _symmetric_root(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)


def _shared(tracks: LinearTracks) -> NDArray[np.float64]:
    """What multiplies each component in the covariances of `true_covariances`, (4, tracks, n, n)."""
    magnification = tracks.magnification
    steps = 1.0 / magnification**2
    steps[:, 0] = 0.0
    age = np.broadcast_to(np.arange(magnification.shape[1], dtype=np.float64), magnification.shape)
    seen = Seen(age, magnification, np.cumsum(steps, axis=1), np.ones(magnification.shape))
    rows, columns = seen.at(slice(None), slice(None), None), seen.at(slice(None), None)
    found = np.stack([np.array(one.shared(rows, columns, Reference.FREE)) for one in COMPONENTS])
    found[:, ~tracks.born, 0, 0] = np.array([one.name == "white" for one in COMPONENTS])[:, None]
    return found


def _contracted(shared: NDArray[np.float64], half: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 2, 2): sums over tracks of each component's share of pairs times `half` half', (tracks, 2 n, q)."""
    count, size, _ = half.shape
    products = (half @ np.swapaxes(half, 1, 2)).reshape(count, size // 2, 2, size // 2, 2)
    sums = shared.reshape(len(shared), -1) @ np.swapaxes(products, 2, 3).reshape(-1, 4)
    return np.asarray(sums.reshape(-1, 2, 2))


def scalar_variances(
    window: Sequence[LinearTracks], sigma: float, *, first: float | None = None, born_only: bool = False
) -> Assumed:
    """One standard deviation for all observations, px, and another for first ones if it is given.

    With `born_only`, this is that of tracks that begin in the window, as where the first direction of a track is a
    state. An estimator that takes the first observation as exact does so with each track of its window.
    """
    variances = []
    for tracks in window:
        variance = np.full(tracks.by_point.shape[:2], sigma**2)
        if first is not None:
            variance[tracks.born | (not born_only), :2] = first**2
        variances.append(variance)
    return variances


def outcome(window: Sequence[LinearTracks], actual: Covariances, assumed: Assumed) -> Outcome:
    """Claimed and actual covariance of the poses of a window, (benchmark.covariances)."""
    return outcomes(window, [actual], assumed)[0]


def outcomes(window: Sequence[LinearTracks], actual: Sequence[Covariances], assumed: Assumed) -> list[Outcome]:
    """The same for several true covariances, of an estimator that assumes one."""
    whitened = _whitened(window, assumed)
    size = window[0].by_pose.shape[2]
    information, middle = np.zeros((size, size)), np.zeros((len(actual), size, size))
    squares, freedom = np.zeros(len(actual)), 0
    for place, (tracks, one) in enumerate(zip(window, whitened, strict=True)):
        by_pose = without(one.whitened(tracks.by_pose), one.span)
        rows = by_pose.reshape(-1, size)
        information += rows.T @ rows
        freedom += by_pose.shape[0] * (by_pose.shape[1] - 3)
        for number, each in enumerate(actual):
            noise = one.innovations(each[place])
            middle[number] += rows.T @ (noise @ by_pose).reshape(-1, size)
            squares[number] += np.trace(noise, axis1=1, axis2=2).sum()
    claimed = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return [
        Outcome(claimed, claimed @ one @ claimed, float(sum_ / freedom))
        for one, sum_ in zip(middle, squares, strict=True)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _Whitened:
    """What an estimator makes of tracks: the inverse root of their covariance, and a basis of F whitened by it."""

    root: NDArray[np.float64]  # (tracks, 2 n, 2 n), or its diagonal (tracks, 2 n) where it has nothing else
    span: NDArray[np.float64]

    @classmethod
    def of(cls, tracks: LinearTracks, assumed: NDArray[np.float64]) -> "_Whitened":
        is_diagonal = assumed.ndim == 2
        root = 1.0 / np.sqrt(assumed) if is_diagonal else np.linalg.inv(np.linalg.cholesky(assumed))
        return cls(root, np.linalg.qr(_times(root, tracks.by_point))[0])

    def whitened(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Errors, or their derivatives, (tracks, 2 n, k)."""
        return _times(self.root, values)

    def unwhitened(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """What multiplies errors where `values` (tracks, 2 n, k) multiply whitened ones."""
        return self.root[:, :, None] * values if self.root.ndim == 2 else np.swapaxes(self.root, 1, 2) @ values

    def innovations(self, true: NDArray[np.float64]) -> NDArray[np.float64]:
        """Covariances of whitened innovations, without what the points absorb."""
        half = without(self.whitened(true), self.span)
        return without(self.whitened(np.swapaxes(half, 1, 2)), self.span)


def _times(root: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    return root[:, :, None] * values if root.ndim == 2 else root @ values


def _whitened(window: Sequence[LinearTracks], assumed: Assumed) -> list[_Whitened]:
    return [_Whitened.of(one, believed) for one, believed in zip(window, assumed, strict=True)]


def determines_poses(window: Sequence[LinearTracks]) -> bool:
    """Whether tracks determine all poses of a window, so that an estimator with the true noise has a NEES of 1."""
    if not window:
        return False
    variances = scalar_variances(window, 1.0)
    white = [one[:, :, None] * np.eye(one.shape[1]) for one in variances]
    try:
        found = outcome(window, white, variances)
        errors = np.array([found.nees_all, found.nees_newest]) - 1.0
    except np.linalg.LinAlgError:
        return False
    return bool((np.abs(errors) < _ROUNDING).all())


def without(values: NDArray[np.float64], span: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns without their parts in the span of orthonormal ones."""
    return np.asarray(values - span @ (np.swapaxes(span, 1, 2) @ values))


def consistent_sigma(
    window: Sequence[LinearTracks],
    noise: TrackNoise,
    *,
    purpose: Purpose,
    landmark: Landmark = Landmark.FREE,
) -> float:
    """The standard deviation of all observations that makes a purpose right, px.

    `landmark`: NaN if no standard deviation does it.
    """
    actual = true_covariances(window, noise)
    free = np.sqrt(_consistency(window, actual, scalar_variances(window, 1.0), purpose))
    if landmark is Landmark.FREE:
        return float(free)
    is_state = landmark is Landmark.STATE
    first = np.sqrt(np.trace(noise.first) / 2.0) if is_state else 0.0

    def excess(log_sigma: float) -> float:
        sigma = float(np.exp(log_sigma))
        assumed = scalar_variances(window, sigma, first=max(first, EXACT * sigma), born_only=is_state)
        return float(np.log(_consistency(window, actual, assumed, purpose)))

    return float(np.exp(_root(excess, float(np.log(free)))))


def _root(excess: Callable[[float], float], start: float) -> float:
    low, high = (start + factor for factor in _FACTORS)
    if excess(low) < 0.0 or excess(high) > 0.0:
        return float("nan")
    return float(brentq(excess, low, high, xtol=1e-6))


def consistencies(
    window: Sequence[LinearTracks], actual: Sequence[Covariances], assumed: Assumed
) -> list[dict[Purpose, float]]:
    """Actual over claimed mean square of what each purpose is about, for each of several true covariances."""
    return [
        {
            Purpose.INNOVATIONS: found.innovations,
            Purpose.ALL_POSES: found.nees_all,
            Purpose.NEWEST_POSE: found.nees_newest,
        }
        for found in outcomes(window, actual, assumed)
    ]


def _consistency(window: Sequence[LinearTracks], actual: Covariances, assumed: Assumed, purpose: Purpose) -> float:
    """Actual over claimed mean square of what a purpose is about."""
    return consistencies(window, [actual], assumed)[0][purpose]


@dataclass(frozen=True, slots=True, eq=False)
class TrackGates:
    """What Gaussian noise makes of the squared innovations of the tracks of a window."""

    window: Sequence[LinearTracks]  # its tracks
    actual: Covariances  # covariances of their errors
    # of chi square with one degree of freedom, 200 for each coordinate of each track
    draws: Sequence[NDArray[np.float64]]

    @classmethod
    def of(cls, window: Sequence[LinearTracks], noise: TrackNoise) -> "TrackGates":
        """Those of a noise."""
        return cls.of_covariances(window, true_covariances(window, noise))

    @classmethod
    def of_covariances(cls, window: Sequence[LinearTracks], actual: Covariances) -> "TrackGates":
        """Those of errors with these covariances."""
        random = np.random.default_rng(0)
        return cls(window, actual, [random.chisquare(1.0, (len(one), _DRAWS, one.shape[1])) for one in actual])

    def factors(
        self, levels: Sequence[float], *, sigma: float, first: float | None = None, born_only: bool = False
    ) -> tuple[float, ...]:
        """What to multiply chi-square gates of a track by, so that they let through shares of `levels` of good tracks.

        A gate is over the innovations of a track, whitened as by `scalar_variances`, with 2 n - 3 degrees of freedom.
        """
        squares = list[tuple[NDArray[np.float64], float]]()
        assumed = scalar_variances(self.window, sigma, first=first, born_only=born_only)
        for one, true, draws in zip(_whitened(self.window, assumed), self.actual, self.draws, strict=True):
            spread = np.linalg.eigvalsh(one.innovations(true))
            found = np.einsum("tdi,ti->td", draws, np.maximum(spread, 0.0)).ravel()
            squares.append((found, (spread.shape[1] - 3) / 2.0))
        ratios = ([found / (2.0 * gammaincinv(half, level)) for found, half in squares] for level in levels)
        return tuple(float(np.quantile(np.concatenate(own), level)) for level, own in zip(levels, ratios, strict=True))


Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FittedPoints:
    """Points of tracks, and what is left of the errors."""

    step: Array  # (tracks, 3): dX
    claimed: Array  # (tracks, 3, 3): P
    residuals: Array  # (tracks, n): e - F dX

    def along(self, directions: Array) -> tuple[Array, Array]:
        """Errors of the points along directions (tracks, 3), and these over their claimed standard deviations."""
        moved = np.einsum("ti,ti->t", directions, self.step)
        variance = np.einsum("ti,tij,tj->t", directions, self.claimed, directions)
        return moved, moved / np.sqrt(variance)


def fit_points(by_point: Array, errors: Array, covariance: Array) -> FittedPoints:
    """Fit points to tracks of equal length, (point_fit).

    Shapes: by_point (tracks, n, 3), errors (tracks, n) px, covariance (tracks, n, n) or (n, n) px^2.
    """
    weighted = np.asarray(np.linalg.solve(covariance, by_point), dtype=np.float64)
    claimed = np.asarray(np.linalg.inv(np.swapaxes(by_point, 1, 2) @ weighted), dtype=np.float64)
    step = np.einsum("tij,tnj,tn->ti", claimed, weighted, errors)
    return FittedPoints(step, claimed, errors - np.einsum("tni,ti->tn", by_point, step))


def of_full_rank(covariances: Array) -> Array:
    """Covariances (tracks, n, n) with a small variance added, so that no observation is exact."""
    size = covariances.shape[1]
    level = np.trace(covariances, axis1=1, axis2=2) / size
    added: Array = covariances + EXACT**2 * level[:, None, None] * np.eye(size)
    return added
