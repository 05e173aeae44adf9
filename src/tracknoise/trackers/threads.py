"""Number of threads that OpenCV uses."""

import cv2


def use_one_thread() -> None:
    """Make OpenCV use one thread in this process; no result depends on it."""
    cv2.setNumThreads(1)
