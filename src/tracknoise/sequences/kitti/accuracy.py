"""What the OXTS files of a drive state about their own errors.

A record has the standard deviations of position (north and east, metres) and of velocity (north and east, metres per
second). The error of the position is nearly the same in successive frames. Their relative error is that of the velocity
times the time between them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.accuracy import PoseAccuracy, TruthAccuracy
from tracknoise.sequences.kitti.layout import Drive
from tracknoise.sequences.kitti.oxts import read_accuracies

_NOMINAL_INTERVAL_S = 0.1
_SOURCE = "vel_accuracy in the OXTS files"


@dataclass(frozen=True, slots=True)
class OxtsAccuracy:
    """Stated accuracy of the poses of a drive; None where nothing is stated.

    Parameters
    ----------
    pose
        Of single poses: the median over frames. OXTS files state no accuracy of angles.
    truth
        Of relative poses: growth of the error of the position from frame to frame.
    notes
        The figures, in one sentence.
    """

    pose: PoseAccuracy | None = None
    truth: TruthAccuracy | None = None
    notes: tuple[str, ...] = ()


def read_oxts_accuracy(drive: Drive, numbers: range, timestamps_s: NDArray[np.float64] | None) -> OxtsAccuracy:
    """Read the accuracies that the OXTS files of a drive state.

    Parameters
    ----------
    drive
        The drive; without OXTS files nothing is stated.
    numbers
        Of its frames.
    timestamps_s
        (n,) float64, seconds; without them, frames are taken to be 0.1 s apart.

    Raises
    ------
    DataError
        If a file is damaged.
    """
    if not drive.has_oxts:
        return OxtsAccuracy()
    stated = read_accuracies(map(drive.oxts, numbers))
    known = stated[(np.isfinite(stated) & (stated > 0.0)).all(axis=1)]
    if not len(known):
        return OxtsAccuracy()
    position_m, velocity_m_per_s = np.median(known, axis=0).tolist()
    steps_s = np.array([_NOMINAL_INTERVAL_S]) if timestamps_s is None or len(stated) < 2 else np.diff(timestamps_s)
    truth = TruthAccuracy(translation_m_per_frame=velocity_m_per_s * float(np.median(steps_s)), source=_SOURCE)
    note = (
        f"OXTS states standard deviations of {position_m:.3g} m in position and {velocity_m_per_s:.3g} m/s in "
        f"velocity (medians of {len(known)} of {len(stated)} frames), and none of angles"
    )
    return OxtsAccuracy(PoseAccuracy(position_m, None), truth, (note,))
