"""Sequences whose stated truth is wrong in a known way: what an audit of the truth must find."""

import zlib
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.accuracy import DepthAccuracy, PoseAccuracy
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.fault_options import NO_FAULTS, DepthFaults, Faults
from tracknoise.sequences.faulty_truth import depth_with_lag, require_lag, stated_camera, stated_depth, stated_poses
from tracknoise.sequences.sequence import SecondCamera, Sequence, TruthKind, camera_at, second_of, shutter_of
from tracknoise.sequences.views import View


class _Stream(IntEnum):
    """Independent streams of random numbers."""

    poses = 0
    depth = 1


def with_faults(sequence: Sequence, faults: Faults, *, seed: int = 0) -> Sequence:
    """The sequence with a stated truth that is wrong; the sequence itself without any fault.

    Parameters
    ----------
    sequence
        Any sequence. Its truth counts as correct.
    faults
        What is wrong.
    seed
        Random seed of noise. The noise of a scene depends on its name.

    Raises
    ------
    SettingsError
        If a fault does not suit the sequence.
    """
    if faults == NO_FAULTS:
        return sequence
    faulty = FaultySequence(sequence, faults, seed)
    _ = faulty.camera, faulty.world_from_camera  # refuse faults that do not suit it before anything is measured
    require_lag(sequence, faults.depth.lag_frames)
    return faulty


@dataclass(frozen=True, eq=False)
class FaultySequence(View):
    """A sequence with faults in its stated camera, poses, shutter and depth. Made by `with_faults`.

    Ray-cast truth is not offered: it would use the true surface. Truth from depth at birth uses what is stated, as that
    of a recording does. Accuracies are not stated where there are faults, and the kind of depth counts as unknown:
    everything is looked for as in a recording.

    Parameters
    ----------
    sequence
        What is shown.
    faults
        What is wrong.
    seed
        Random seed of noise.
    """

    faults: Faults
    seed: int

    @property
    def camera(self) -> CameraModel:
        """The stated camera."""
        return stated_camera(self.sequence.camera, self.faults)

    def camera_at(self, index: int) -> CameraModel:
        """The stated camera of one frame."""
        return stated_camera(camera_at(self.sequence, index), self.faults)

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: the stated poses."""
        return self._poses

    @property
    def pose_accuracy(self) -> PoseAccuracy | None:
        """That of the sequence shown; None where the stated poses are wrong."""
        return None if self.faults.move_poses else self.sequence.pose_accuracy

    @property
    def depth_accuracy(self) -> DepthAccuracy | None:
        """That of the sequence shown; None where the stated depths are wrong."""
        return self.sequence.depth_accuracy if self.faults.depth == DepthFaults() else None

    @property
    def shutter(self) -> RollingShutter | None:
        """The stated shutter."""
        return None if self.faults.hide_shutter else shutter_of(self.sequence)

    @property
    def second(self) -> SecondCamera | None:
        """That of the sequence shown."""
        return second_of(self.sequence)

    @property
    def truths(self) -> tuple[str, ...]:
        """Those of the sequence shown, without ray cast."""
        return tuple(kind for kind in self.sequence.truths if kind != TruthKind.raycast)

    @property
    def surface(self) -> None:
        """None: the exact surface is not what a recording with these faults would state."""
        return None

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence shown, and what is wrong."""
        return (*self.sequence.notes, f"the stated truth has planted faults: {', '.join(self.faults.planted())}")

    def depth(self, index: int) -> DepthMap | None:
        """The stated depth of one frame: see `Sequence.depth`."""
        faults = self.faults.depth
        found = depth_with_lag(self.sequence, index, faults.lag_frames)
        if faults == replace(DepthFaults(), lag_frames=faults.lag_frames):
            return found
        return None if found is None else stated_depth(found, faults, self._generator(_Stream.depth, index))

    @cached_property
    def _poses(self) -> NDArray[np.float64]:
        if not self.faults.move_poses:
            return self.sequence.world_from_camera
        return stated_poses(self.sequence, self.faults, self._generator(_Stream.poses))

    def _generator(self, stream: _Stream, index: int = 0) -> np.random.Generator:
        """A generator that does not depend on the order in which frames are read."""
        scene = zlib.crc32(self.sequence.id.scene.encode())
        return np.random.default_rng([self.seed, stream, scene, index])
