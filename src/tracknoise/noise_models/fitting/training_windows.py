"""Windows of the recordings that a model is fitted to, as linear algebra: their motions, depths and track lengths."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.camera import Camera
from tracknoise.geometry.pose import from_quaternion
from tracknoise.noise_models.linear_benchmark import determines_poses
from tracknoise.noise_models.linear_window import (
    CAMERA,
    LinearTracks,
    Motion,
    linear_tracks,
    simulated_tracks,
    trajectory,
)

_LEAST_MOTION = 0.01
"""Least distance of the first and the last camera of a window, as a share of the median depth."""
_TRACKS, _LEAST_TRACKS = 20, 15
"""Tracks in each frame of a window, and fewest in all of it."""
_MORE = (1, 4, 16)
"""How many times as many tracks are drawn, until they determine the poses of a window."""


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One sequence.

    Parameters
    ----------
    poses
        Schema `POSES`.
    camera
        Schema `CAMERAS`, with at least one row.
    sights
        (n, 3) float64: u, v (px) and depth (m) of points at first sight.
    """

    poses: pl.DataFrame
    camera: pl.DataFrame
    sights: NDArray[np.float64]


def windows(
    recordings: Sequence[Recording], *, speed: int, length: int, lifetimes: NDArray[np.int64]
) -> list[Sequence[LinearTracks]]:
    """Windows of so many frames, one of each recording that is long enough and moves.

    If there is none, a window of sideways and one of forward motion.

    Parameters
    ----------
    recordings
        Where motions and depths are from.
    speed
        Frames of the recording per frame of the window.
    length
        Frames of the window.
    lifetimes
        Lengths of tracks, frames of the window.
    """
    found = [*_measured(recordings, speed, length, lifetimes)]
    if found:
        return found
    poses = [trajectory(motion, length) for motion in Motion]
    return [window for each in poses if (window := _linear(CAMERA, each, lifetimes, None))]


def _measured(
    recordings: Sequence[Recording], speed: int, length: int, lifetimes: NDArray[np.int64]
) -> Iterator[Sequence[LinearTracks]]:
    for recording in recordings:
        poses = _middle(recording.poses, speed, length)
        if poses is None or not len(recording.sights):
            continue
        apart = np.linalg.norm(poses[-1, :3, 3] - poses[0, :3, 3])
        if apart < _LEAST_MOTION * np.median(recording.sights[:, 2]):
            continue
        tracks = _linear(_pinhole(recording.camera), poses, lifetimes, recording.sights)
        if sum(len(one.rays) for one in tracks) >= _LEAST_TRACKS:
            yield tracks


def _linear(
    camera: Camera, poses: NDArray[np.float64], lifetimes: NDArray[np.int64], sights: NDArray[np.float64] | None
) -> Sequence[LinearTracks]:
    """Tracks of one window, more of them where they do not determine its poses; none where more do not either."""
    length = len(poses)
    mean = np.clip(lifetimes, 3, length).mean()
    count = int(np.ceil(_TRACKS * (length + mean) / mean))
    for more in _MORE:
        drawn = simulated_tracks(poses, n_tracks=more * count, lengths=lifetimes, camera=camera, sights=sights)
        window = [linear_tracks(camera, poses, tracks) for tracks in drawn]
        if determines_poses(window):
            return window
    return []


def _middle(poses: pl.DataFrame, speed: int, length: int) -> NDArray[np.float64] | None:
    """(length, 4, 4) float64: poses of the middle of a recording; None if it is too short, or one is missing."""
    used = poses.sort("frame").gather_every(speed)
    if used.height < length:
        return None
    part = used.slice((used.height - length) // 2, length)
    if any(part.null_count().row(0)):
        return None
    return from_quaternion(part.select("x_m", "y_m", "z_m").to_numpy(), part.select("qx", "qy", "qz", "qw").to_numpy())


def _pinhole(table: pl.DataFrame) -> Camera:
    """The camera without its distortion."""
    names = ("width", "height", "fx_px", "fy_px", "cx_px", "cy_px")
    return Camera(*table.select(names).row(0))
