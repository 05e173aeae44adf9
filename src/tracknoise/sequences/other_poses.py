"""Poses of the same recording from elsewhere: of another estimator, or at times without a frame."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.pose import PosePath, invert, position_rows, transform
from tracknoise.sequences.poses import has_pose, require_some_poses
from tracknoise.sequences.sequence import (
    IMAGE_AXES,
    Axes,
    Scan,
    Sequence,
    clock_start_of,
    path_of,
    times_of,
)
from tracknoise.sequences.views import View


@dataclass(frozen=True, slots=True, eq=False)
class OtherPoses(View):
    """A sequence with other poses, in a world frame of their own. Images, cameras and depths stay.

    Points of a surface or a scan are moved with the camera from the one world frame to the other.
    """

    keeps_kind_of_depth: ClassVar[bool] = True

    poses: NDArray[np.float64]  # (n, 4, 4) float64: world_from_camera of each frame, all NaN for a frame without a pose
    name: str  # where they are from, for messages
    path: PosePath | None = None  # the other poses at other times than those of frames; None where there are none
    pose_notes: tuple[str, ...] = ()  # what is to be said of them, one sentence each

    def __post_init__(self) -> None:
        require_some_poses(self.poses, self.name)

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: the other poses."""
        return self.poses

    @property
    def recorded_axes(self) -> Axes:
        """Those of the image: the other poses did not pass the reader of the sequence shown."""
        return IMAGE_AXES

    @property
    def pose_accuracy(self) -> None:
        """None: what is stated holds for the poses of the sequence shown."""
        return None

    @property
    def truth_accuracy(self) -> TruthAccuracy:
        """What is stated about the depths. All else may belong to the poses of the sequence shown."""
        return TruthAccuracy.of(None, self.depth_accuracy, source=self.id.dataset)

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence shown, and where the poses are from."""
        return (*self.sequence.notes, f"poses are from {self.name}", *self.pose_notes)

    @property
    def scan(self) -> Scan | None:
        """That of the sequence shown, moved with the camera of the key frame."""
        scan = self.sequence.scan
        return None if scan is None else replace(scan, points_world=self._moved(scan.key_frame, scan.points_world))

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels: see `Surface.cast`."""
        points, hit = View.cast(self, index, uv)
        return self._moved(index, points), hit

    def _moved(self, index: int, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) in the world frame of the other poses, as the camera of one frame sees them."""
        return transform(self.poses[index] @ invert(self.sequence.world_from_camera[index]), points_world)


def has_other_poses(sequence: Sequence) -> bool:
    """Whether a sequence, or one that it shows, has other poses than its reader's."""
    while isinstance(sequence, View):
        if isinstance(sequence, OtherPoses):
            return True
        sequence = sequence.sequence
    return False


def trajectory_text(sequence: Sequence, about: str) -> str:
    """Poses of a sequence as `with_trajectory` reads them, after a comment that says what they are.

    Without times, rows have numbers of frames, and those of frames without a pose are NaN.
    """
    times, poses = sequence.timestamps_s, sequence.world_from_camera
    stamps = np.arange(len(poses), dtype=np.float64) if times is None else times
    rows = np.column_stack([stamps, position_rows(poses)])
    written = rows if times is None else rows[has_pose(poses)]
    lines = (" ".join(map(repr, row)) for row in written.tolist())
    start = clock_start_of(sequence)
    clock = "the clock of the recording" if start is None else f"the first frame, which is {start * 1e-9:.9f} s"
    unit = "frame" if times is None else f"time in s by {clock}"
    return "\n".join([f"# {about}", f"# {unit}; tx ty tz qx qy qz qw, m, world_from_camera", *lines, ""])


_SAME_TIME = 1e-6
"""Times are the same if they differ by less than this share of the time between frames: a velocity between them would
be one of rounding."""


def path_between_frames(sequence: Sequence, n_frames: int) -> PosePath | None:
    """Poses over time that are not those of the first frames of a sequence; None where there are none.

    Parameters
    ----------
    sequence
        The sequence.
    n_frames
        How many of its frames are read.
    """
    path, times = path_of(sequence), times_of(sequence)
    if path is None or times is None or n_frames < 2:
        return None
    read = times[:n_frames]
    after = np.clip(np.searchsorted(read, path.times), 1, n_frames - 1)
    apart = np.minimum(np.abs(path.times - read[after - 1]), np.abs(path.times - read[after]))
    is_between = apart > _SAME_TIME * float(np.median(np.diff(read)))
    return PosePath(path.times[is_between], path.poses[is_between]) if is_between.any() else None
