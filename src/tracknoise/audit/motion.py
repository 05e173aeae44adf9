"""Poses of many sequences at any time, and how they change with time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """Poses and velocities of n cameras.

    Attributes
    ----------
    rotation : (n, 3, 3) float64
        world_from_camera.
    position : (n, 3) float64
        Metres, world frame.
    turning : (n, 3) float64
        Angular velocity in the camera frame, radians per unit of time.
    velocity : (n, 3) float64
        Metres per unit of time, world frame.
    """

    rotation: NDArray[np.float64]
    position: NDArray[np.float64]
    turning: NDArray[np.float64]
    velocity: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """Poses of the frames of several sequences, one after the other; between frames as `PosePath` has them.

    Attributes
    ----------
    times : (frames,) float64
        Increasing within each sequence.
    first, last : (frames,) intp
        First and last frame of the sequence of each frame.
    rotation, position : (frames, 3, 3), (frames, 3) float64
        NaN where a frame has no pose.
    turning, velocity : (frames, 3) float64
        Between a frame and the next, see `Moving`; NaN where there is none or either has no pose.
    """

    times: NDArray[np.float64]
    first: NDArray[np.intp]
    last: NDArray[np.intp]
    rotation: NDArray[np.float64]
    position: NDArray[np.float64]
    turning: NDArray[np.float64]
    velocity: NDArray[np.float64]

    @classmethod
    def of(cls, times: NDArray[np.float64], poses: NDArray[np.float64], sequence: NDArray[np.intp]) -> "Paths":
        """Make the paths of frames.

        Parameters
        ----------
        times : (frames,) float64
            Increasing within each sequence.
        poses : (frames, 4, 4) float64
            world_from_camera; NaN where a frame has none.
        sequence : (frames,) intp
            Number of the sequence, never decreasing.
        """
        first = np.searchsorted(sequence, sequence, side="left")
        last = np.searchsorted(sequence, sequence, side="right") - 1
        rotation, position = poses[:, :3, :3], poses[:, :3, 3]
        known = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
        between = np.flatnonzero(known[:-1] & known[1:] & (sequence[:-1] == sequence[1:]))
        span = (times[between + 1] - times[between])[:, None]
        turning, velocity = np.full((2, len(times), 3), np.nan)
        step = np.swapaxes(rotation[between], 1, 2) @ rotation[between + 1]
        turning[between] = _rotation_vectors(step) / span
        velocity[between] = (position[between + 1] - position[between]) / span
        return cls(times, first, last, rotation, position, turning, velocity)

    @property
    def surrounded(self) -> NDArray[np.bool_]:
        """Whether the frame and its neighbours in its sequence have poses, (frames,); never in one of one frame."""
        place, known = np.arange(len(self.times)), np.isfinite(self.turning[:, 0])
        before, after = np.maximum(place - 1, 0), place
        ends = (known[before] | (place == self.first)) & (known[after] | (place == self.last))
        return np.asarray(ends & (self.first < self.last))

    def moving(self, frame: NDArray[np.intp], delay: NDArray[np.float64]) -> Moving:
        """As `at`; where no time is after its frame, as `still`."""
        return self.at(frame, delay) if np.any(delay) else self.still(frame)

    def still(self, frame: NDArray[np.intp]) -> Moving:
        """Poses of frames, (n,), with their velocities: the mean of those before and after the frame."""
        before = np.clip(frame - 1, self.first[frame], self.last[frame] - 1)
        after = np.clip(frame, self.first[frame], self.last[frame] - 1)
        turning = 0.5 * (self.turning[before] + self.turning[after])
        velocity = 0.5 * (self.velocity[before] + self.velocity[after])
        return Moving(self.rotation[frame], self.position[frame], turning, velocity)

    def at(self, frame: NDArray[np.intp], delay: NDArray[np.float64]) -> Moving:
        """Poses some time after frames.

        Parameters
        ----------
        frame : (n,) intp
            Frames.
        delay : (n,) float64
            Time after each; negative before it. Beyond the ends of a sequence the last velocity goes on.
        """
        start = self._segment(frame, delay)
        elapsed = self.times[frame] + delay - self.times[start]
        turned = Rotation.from_rotvec(np.nan_to_num(elapsed[:, None] * self.turning[start])).as_matrix()
        position = self.position[start] + elapsed[:, None] * self.velocity[start]
        rotation = self.rotation[start] @ turned
        rotation[np.isnan(position[:, 0])] = np.nan
        return Moving(rotation, position, self.turning[start], self.velocity[start])

    def _segment(self, frame: NDArray[np.intp], delay: NDArray[np.float64]) -> NDArray[np.intp]:
        """First of the two frames around each time. Sequences are laid out one after the other on one axis of time."""
        own = self.times - self.times[self.first]
        span = float(own.max(initial=0.0)) + 1.0
        ahead = float(np.nanmax(np.abs(delay), initial=0.0))
        apart = (span + 2.0 * ahead) * (np.cumsum(self.first == np.arange(len(self.first))) - 1)
        found = np.searchsorted(own + apart, own[frame] + apart[frame] + delay, side="right") - 1
        return np.clip(found, self.first[frame], self.last[frame] - 1)


def _rotation_vectors(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    if not len(rotations):
        return np.empty((0, 3))
    vectors: NDArray[np.float64] = Rotation.from_matrix(rotations).as_rotvec()
    return vectors
