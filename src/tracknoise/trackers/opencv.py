"""What OpenCV does on this machine: its machine code and its threads.

- The machine code that OpenCV chose for the processor: trackers round differently with another.
- Number of threads that OpenCV uses.
"""

import cv2

_NOT_USED, _OPTIONAL = "?", "*"
"""OpenCV writes these after instructions that the processor lacks, and before those that not every processor has."""


def opencv_kernel() -> str:
    """Name the highest instructions that OpenCV uses here, such as ``AVX2``."""
    used = [word for word in cv2.getCPUFeaturesLine().split() if not word.endswith(_NOT_USED)]
    return used[-1].removeprefix(_OPTIONAL) if used else "none"


def use_one_thread() -> None:
    """Make OpenCV use one thread in this process; no result depends on it."""
    cv2.setNumThreads(1)
