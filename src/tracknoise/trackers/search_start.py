"""Where the search for a feature in the next image starts."""

from collections.abc import Callable
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError
from tracknoise.geometry.cameras import CameraModel
from tracknoise.trackers.features import Features
from tracknoise.trackers.tracker import Frame, SequenceContext


class Start(StrEnum):
    """Where the search for a feature starts.

    last: where it was. velocity: as far from there as it moved in the step before. rotation: where a point at infinity
    would be, by the rotation between the images. That of the sequence's poses stands for the one that systems
    integrate from a gyroscope; where a pose is unknown, the search starts where the feature was.
    """

    last = "last"
    velocity = "velocity"
    rotation = "rotation"


Guess = Callable[[Frame, Frame, Features], NDArray[np.float64]]
"""Positions (n, 2), px, at which features of the first image are looked for in the second."""


def guess_from(start_at: Start, context: SequenceContext) -> Guess:
    """How positions are guessed in a sequence."""
    if start_at is Start.last:
        return at_last
    if start_at is Start.velocity:
        return lambda before, after, features: 2 * features.uv - features.before_uv
    if context.camera_at is None or context.rotation_at is None:
        raise SettingsError(f"start_at is 'rotation' in {context.sequence}: no camera or poses, expected both")
    return _Turned(context.camera_at, context.rotation_at)


def at_last(before: Frame, after: Frame, features: Features) -> NDArray[np.float64]:
    """Where the features were."""
    return features.uv


class _Turned:
    """Positions of points at infinity, after the rotation of the camera."""

    def __init__(
        self, camera_at: Callable[[int], CameraModel], rotation_at: Callable[[int], NDArray[np.float64]]
    ) -> None:
        self._camera_at = camera_at
        self._rotation_at = rotation_at

    def __call__(self, before: Frame, after: Frame, features: Features) -> NDArray[np.float64]:
        world_from_before, world_from_after = self._rotation_at(before.index), self._rotation_at(after.index)
        rays = self._camera_at(before.index).bearings(features.uv) @ world_from_before.T @ world_from_after
        uv = self._camera_at(after.index).project(rays)
        return np.where(np.isfinite(uv).all(axis=1, keepdims=True), uv, features.uv)
