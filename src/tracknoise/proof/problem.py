"""What an estimator is given: a window of frames, tracks in it, and the truth to compare its answer with."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.pose import invert, transform
from tracknoise.noise_models.linear_window import Gauge, PointTracks

ROUNDING_PX = 1e-6
"""Errors below this are 0 but for rounding, as those in the frame that fixes the true position."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackGroup:
    """Tracks of a window that have the same number n of observations.

    Parameters
    ----------
    frames
        (tracks, n) integers: frames of the window, increasing.
    uv
        (tracks, n, 2) float64: observed positions, px.
    points
        (tracks, 3) float64: true points, world, metres.
    born
        (tracks,) bool: whether a track begins with its first observation of the window. Others began before it.
    covariate
        (tracks,) float64: what is known of a track beforehand and may change its noise, as the logarithm of its
        texture.
    """

    frames: NDArray[np.int64]
    uv: NDArray[np.float64]
    points: NDArray[np.float64]
    born: NDArray[np.bool_]
    covariate: NDArray[np.float64]

    @property
    def ages(self) -> NDArray[np.int64]:
        """(tracks, n) integers: frames since the first observation of the window."""
        return self.frames - self.frames[:, :1]


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A window of frames with its tracks, and its truth.

    Parameters
    ----------
    scene
        Name of the scene. Windows of one scene are not independent of each other.
    camera
        The camera.
    world_from_camera
        (frames, 4, 4) float64: the true poses.
    groups
        Tracks, grouped by the number of their observations.
    start
        Frame of its sequence with which it begins.
    """

    scene: str
    camera: CameraModel
    world_from_camera: NDArray[np.float64]
    groups: tuple[TrackGroup, ...]
    start: int = 0

    @property
    def gauge(self) -> Gauge:
        """What an estimator takes as known."""
        return Gauge.of(self.world_from_camera[:, :3, 3])

    @property
    def n_tracks(self) -> int:
        """How many tracks there are."""
        return sum(len(group.points) for group in self.groups)

    def with_uv(self, uv: tuple[NDArray[np.float64], ...]) -> "Problem":
        """The same with other observed positions, one array for each group."""
        return replace(self, groups=tuple(replace(group, uv=own) for group, own in zip(self.groups, uv, strict=True)))


def images(
    camera: CameraModel, world_from_camera: NDArray[np.float64], tracks: TrackGroup | PointTracks
) -> NDArray[np.float64]:
    """(tracks, n, 2) float64, px: where points are seen from poses (frames, 4, 4)."""
    count, length = tracks.frames.shape
    seen = transform(invert(world_from_camera)[tracks.frames.ravel()], np.repeat(tracks.points, length, axis=0))
    return camera.project(seen).reshape(count, length, 2)


def errors_of(problem: Problem) -> tuple[NDArray[np.float64], ...]:
    """(tracks, n, 2) float64, px, for each group: observed minus true positions."""
    return tuple(group.uv - images(problem.camera, problem.world_from_camera, group) for group in problem.groups)


def are_exact(problem: Problem) -> bool:
    """Whether no observation has an error."""
    return all(np.abs(part).max() < ROUNDING_PX for part in errors_of(problem))


def magnification_of(problem: Problem, group: TrackGroup) -> NDArray[np.float64]:
    """(tracks, n) float64: Z_0 / Z_k since the first observation of the window, from the truth."""
    count, length = group.frames.shape
    poses = invert(problem.world_from_camera)[group.frames.ravel()]
    depth = transform(poses, np.repeat(group.points, length, axis=0))[:, 2].reshape(count, length)
    return np.asarray(depth[:, :1] / depth)
