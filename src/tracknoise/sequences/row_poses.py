"""The pose of the camera when each pixel of a sequence was exposed."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.pose import PosePath
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import Sequence, path_of, shutter_of, times_of
from tracknoise.text import significant

_MS = 1000.0


class RowPoses:
    """Poses of a sequence's pixels: that of their frame, or with a rolling shutter that of their row.

    Parameters
    ----------
    sequence
        The sequence.

    Attributes
    ----------
    rows
        Poses of rows; None where all rows of an image are exposed together.
    known : (frames,) bool
        The frame has a pose; with a rolling shutter, at the time of each of its rows.

    Raises
    ------
    DataError
        If it has a rolling shutter, but no timestamps or a single frame.
    """

    __slots__ = ("_poses", "known", "rows")

    def __init__(self, sequence: Sequence) -> None:
        shutter = shutter_of(sequence)
        self._poses = sequence.world_from_camera
        self.rows: RollingPoses | None = None if shutter is None else RollingPoses(sequence, shutter)
        self.known: NDArray[np.bool_] = has_pose(self._poses)
        if self.rows is not None:
            self.known &= self.rows.known_around()

    def at(self, index: int | NDArray[np.intp], uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pose at which pixels were exposed.

        Parameters
        ----------
        index
            Frame of all pixels, or (n,) the frame of each.
        uv
            (n, 2) float64, px.

        Returns
        -------
        (4, 4) or (n, 4, 4) float64
            One for all pixels, or with a rolling shutter or several frames one for each: what
            `tracknoise.geometry.pose.transform` takes. NaN where it is unknown.
        """
        return self._poses[index] if self.rows is None else self.rows.after(index, self.rows.delays_s(uv))


class RollingPoses:
    """Poses of a sequence with a rolling shutter.

    Parameters
    ----------
    sequence
        The sequence.
    shutter
        Its shutter.

    Attributes
    ----------
    most_s
        Longest time between that of a frame and that of a row, seconds.

    Raises
    ------
    DataError
        If the sequence has no timestamps or a single frame.
    """

    __slots__ = ("_camera", "_path", "_shutter", "_times", "most_s")

    def __init__(self, sequence: Sequence, shutter: RollingShutter) -> None:
        self._camera, self._shutter = sequence.camera, shutter  # all images have the size of the first
        self._path, self._times = _timed(sequence)
        self.most_s = abs(shutter.readout_s)

    def after(self, index: int | NDArray[np.intp], delays_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 4, 4) float64: poses at times (n,) after that of their frame, seconds; NaN where unknown."""
        return self._path.at(self._times[index] + delays_s)

    def delays_s(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) float64: time from that of a frame to that of its pixels, seconds; NaN of pixels that are NaN.

        Outside of the image it grows up to half an image from the border, and no further.
        """
        return np.clip(self._shutter.delays_s(self._camera, uv), -self.most_s, self.most_s)

    def known_around(self) -> NDArray[np.bool_]:
        """(frames,) bool: there are poses at all times to which a row of the frame can belong."""
        first, last = (self._path.at(self._times + most_s) for most_s in (-self.most_s, self.most_s))
        return has_pose(first) & has_pose(last)


def shutter_notes(sequence: Sequence, n_frames: int) -> tuple[str, ...]:
    """What a rolling shutter means for the first frames: its readout, and how many of their rows have no pose.

    Empty where all rows of an image are exposed together.
    """
    shutter = shutter_of(sequence)
    if shutter is None:
        return ()
    readout = f"a rolling shutter with a readout of {significant(_MS * shutter.readout_s, 4)} ms is assumed"
    lost = has_pose(sequence.world_from_camera) & ~RowPoses(sequence).known
    count = int(np.count_nonzero(lost[:n_frames]))
    verb = "has" if count == 1 else "have"
    beside = f"{count} of {n_frames} frames {verb} a neighbour without a pose: their observations have no true position"
    return (readout, *((beside,) if count else ()))


def _timed(sequence: Sequence) -> tuple[PosePath, NDArray[np.float64]]:
    """Poses over time, and the times of frames."""
    path, times = path_of(sequence), times_of(sequence)
    if path is None or times is None:
        raise DataError(sequence.source, "a rolling shutter without timestamps", "timestamps of at least two frames")
    return path, times
