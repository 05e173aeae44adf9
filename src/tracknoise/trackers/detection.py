"""AGAST keypoints of a whole image, strongest first, shared by all trackers that see the frame."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require, require_at_least, require_odd
from tracknoise.trackers.frame import Frame

MOST_FEATURES = 1_000_000
"""Largest number of features that a tracker may be asked for."""
_SMALLEST_SIDE_PX = 7  # OAST_9_16 compares a pixel with a circle of radius 3


@dataclass(frozen=True, slots=True)
class Detection:
    """Where features may begin. The defaults are those of XIVO's tracker.

    Parameters
    ----------
    threshold
        Least difference of gray values between a corner and the circle of pixels around it, 1 to 255.
    min_response
        Keypoints with a lower response are discarded.
    square_px
        Side of the square around a feature in which no other feature may begin or stay, px; odd.
    margin_px
        Width of the image border without features, px.
    """

    threshold: int = 10
    min_response: float = 5.0
    square_px: int = 15
    margin_px: int = 8

    def __post_init__(self) -> None:
        require(1 <= self.threshold <= 255, "threshold", self.threshold, "a whole number from 1 to 255")
        require_at_least("min_response", self.min_response, 0)
        require_odd("square_px", self.square_px)
        require_at_least("margin_px", self.margin_px, 0)


@dataclass(frozen=True, slots=True)
class Keypoints:
    """Keypoints of an image, strongest first; ties in the order of detection.

    Attributes
    ----------
    raw
        As OpenCV made them, in the order of detection.
    order : (n,) intp
        Which of `raw` they are.
    uv : (n, 2) float64
        Positions, px.
    response : (n,) float32
        AGAST's score: the largest threshold at which the corner would still be one.
    """

    raw: Sequence[cv2.KeyPoint]
    order: NDArray[np.intp]
    uv: NDArray[np.float64]
    response: NDArray[np.float32]


def keypoints(frame: Frame, detection: Detection) -> Keypoints:
    """AGAST keypoints (OAST_9_16, non-maximum suppression) of the whole image, computed once per frame.

    Neither margin nor squares are applied here.
    """

    def detect(image: NDArray[np.uint8]) -> Keypoints:
        if min(image.shape) < _SMALLEST_SIDE_PX:
            return _strongest_first([], detection.min_response)
        detector = cv2.xfeatures2d.AgastFeatureDetector.create(
            threshold=detection.threshold,
            nonmaxSuppression=True,
            type=cv2.xfeatures2d.AgastFeatureDetector_OAST_9_16,
        )
        return _strongest_first(detector.detect(image), detection.min_response)

    return frame.memo(("keypoints", detection.threshold, detection.min_response), detect)


def _strongest_first(raw: Sequence[cv2.KeyPoint], min_response: float) -> Keypoints:
    response = np.array([point.response for point in raw], dtype=np.float32)
    uv = np.asarray(cv2.KeyPoint.convert(raw), dtype=np.float64).reshape(-1, 2)
    order = np.argsort(-response, kind="stable")
    order = order[response[order] >= min_response]
    return Keypoints(raw, order, uv[order], response[order])
