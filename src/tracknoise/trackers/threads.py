"""How many threads OpenCV uses."""

import cv2


def use_one_thread() -> None:
    """Let OpenCV use one thread in this process from now on; no result depends on it."""
    cv2.setNumThreads(1)
