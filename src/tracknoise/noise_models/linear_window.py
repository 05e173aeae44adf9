"""Windows of frames with tracks of static points, as linear algebra sees them.

The first pose is known, and so is the scale: the newest position does not move along the line from the first one to it.
All other coordinates of poses, and all points, are unknown.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.camera import Camera
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.reprojection import image_derivatives

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
    """Tracks that have the same number n of observations.

    Parameters
    ----------
    frames
        (tracks, n) integers: frames of the window, increasing.
    points
        (tracks, 3) float64: points in the world, metres.
    born
        (tracks,) bool: whether a track begins with its first observation of the window. Others began before it. By
        default all do.
    """

    frames: NDArray[np.int64]
    points: NDArray[np.float64]
    born: NDArray[np.bool_] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LinearTracks:
    """Tracks that have the same number n of observations, with derivatives of the images.

    Parameters
    ----------
    by_pose
        (tracks, 2 n, p) float64: by the p unknown coordinates of poses.
    by_point
        (tracks, 2 n, 3) float64: px per metre.
    magnification
        (tracks, n) float64: Z_0 / Z_k.
    rays
        (tracks, 3) float64: from the first camera that sees a point to the point, metres.
    born
        (tracks,) bool: as that of `PointTracks`.
    """

    by_pose: NDArray[np.float64]
    by_point: NDArray[np.float64]
    magnification: NDArray[np.float64]
    rays: NDArray[np.float64]
    born: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Gauge:
    """What an estimator of a window takes as known, and which coordinates of poses it has to find.

    A pose is moved as in `tracknoise.geometry.reprojection.image_derivatives`. The p = 6 frames - 7 coordinates are the
    six of each pose but the first; the newest position has two, across the line from the first position to it.

    Parameters
    ----------
    across
        (3, 2) float64: orthonormal directions, along which the newest position is moved.
    """

    across: NDArray[np.float64]

    @classmethod
    def of(cls, positions: NDArray[np.float64]) -> "Gauge":
        """Of a camera at positions (frames, 3), metres, of which the first and the last differ."""
        line = positions[-1:] - positions[:1]
        return cls(np.linalg.svd(line)[2][1:].T)

    def free(self, by_pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., p) float64: derivatives by the coordinates to be found, from those by all, (..., 6 frames)."""
        return np.concatenate([by_pose[..., 6:-3], by_pose[..., -3:] @ self.across], axis=-1)

    def moved(self, world_from_camera: NDArray[np.float64], coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        """(frames, 4, 4) float64: poses moved by their coordinates (p,)."""
        moves = np.concatenate([np.zeros(6), coordinates[:-2], self.across @ coordinates[-2:]]).reshape(-1, 6)
        poses = world_from_camera.copy()
        poses[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(moves[:, :3]).as_matrix()
        poses[:, :3, 3] += moves[:, 3:]
        return poses

    def between(self, estimated: NDArray[np.float64], true: NDArray[np.float64]) -> NDArray[np.float64]:
        """(p,) float64: coordinates that move true poses (frames, 4, 4) to estimated ones."""
        turned = np.swapaxes(true[:, :3, :3], 1, 2) @ estimated[:, :3, :3]
        moves = np.hstack([Rotation.from_matrix(turned).as_rotvec(), estimated[:, :3, 3] - true[:, :3, 3]])
        return self.free(moves.ravel())


def linear_tracks(
    camera: CameraModel, world_from_camera: NDArray[np.float64], tracks: PointTracks, gauge: Gauge | None = None
) -> LinearTracks:
    """Derivatives of the images of tracks at given poses, (frames, 4, 4), and points.

    The gauge is by default that of these poses.
    """
    count, length = tracks.frames.shape
    rows = tracks.frames.ravel()
    poses = world_from_camera[rows]
    points = np.repeat(tracks.points, length, axis=0)
    by_pose, by_point = image_derivatives(camera, poses, points)
    depth = transform(invert(poses), points)[:, 2].reshape(count, length)
    spread = np.zeros((count * length, 2, len(world_from_camera), 6))
    spread[np.arange(count * length), :, rows] = by_pose
    known = Gauge.of(world_from_camera[:, :3, 3]) if gauge is None else gauge
    return LinearTracks(
        by_pose=known.free(spread.reshape(count, 2 * length, -1)),
        by_point=by_point.reshape(count, 2 * length, 3),
        magnification=depth[:, :1] / depth,
        rays=tracks.points - world_from_camera[tracks.frames[:, 0], :3, 3],
        born=np.ones(count, dtype=np.bool_) if tracks.born is None else tracks.born,
    )


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
) -> tuple[PointTracks, ...]:
    """Tracks of points, as long as they are in the image of a camera, grouped by their length.

    Parameters
    ----------
    world_from_camera
        (frames, 4, 4) float64.
    n_tracks
        How many tracks are drawn. Those with fewer than 3 observations are left out.
    lengths
        Observations of measured tracks, drawn at random. Tracks then begin at any time, in the window or before it,
        equally often in each frame, and only what lies in the window counts: long tracks are seen in more windows. By
        default all tracks begin in the first frame and end when they leave the image.
    seed
        Of the random numbers.
    camera
        The camera.
    sights
        (n, 3) float64: u, v (px) and depth (m) at first sight, drawn at random. By default in the middle of the image
        of `CAMERA`, at 2 to 10 m.
    """
    random = np.random.default_rng(seed)
    drawn = [_track(random, world_from_camera, lengths, camera, sights) for _ in range(n_tracks)]
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
) -> tuple[NDArray[np.int64], NDArray[np.float64], bool]:
    """Frames, point, and whether it begins in the window."""
    n_frames = len(world_from_camera)
    birth, end = (0, n_frames) if lengths is None else _lifespan(random, np.asarray(lengths), n_frames)
    first = max(birth, 0)
    *uv, depth = drawn_sight(random) if sights is None else sights[random.integers(len(sights))]
    seen = camera.unproject(np.asarray(uv), np.array(depth))
    point = transform(world_from_camera[first], seen[None])[0]
    frames = np.arange(first, end)
    images = camera.project(transform(invert(world_from_camera[frames]), np.tile(point, (len(frames), 1))))
    visible = np.logical_and.accumulate(camera.contains(images))
    return frames[visible], point, birth >= 0


def drawn_sight(random: np.random.Generator) -> tuple[float, float, float]:
    """u, v (px) and depth (m) at first sight: in the middle of the image of `CAMERA`, at 2 to 10 m."""
    u, v = (random.random(2) - 0.5) * _VIEW_PX + (CAMERA.cx, CAMERA.cy)
    return float(u), float(v), random.uniform(*_DEPTHS_M)


def _lifespan(random: np.random.Generator, lengths: NDArray[np.int64], n_frames: int) -> tuple[int, int]:
    """First frame, and end in a window, of a track that is seen in at least `_LEAST_LENGTH` of its frames.

    It is negative if the track begins before the window. As many tracks begin in each frame. The number of births with
    which a track of length T is seen is T + frames - 2 least + 1, from least - T to frames - least.
    """
    long_enough = lengths[lengths >= _LEAST_LENGTH] if (lengths >= _LEAST_LENGTH).any() else np.array([_LEAST_LENGTH])
    births = long_enough + n_frames - 2 * _LEAST_LENGTH + 1
    length = int(random.choice(long_enough, p=births / births.sum()))
    birth = int(random.integers(_LEAST_LENGTH - length, n_frames - _LEAST_LENGTH + 1))
    return birth, min(birth + length, n_frames)
