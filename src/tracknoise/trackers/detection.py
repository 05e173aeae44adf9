"""Keypoints of a whole image, strongest first, shared by all trackers that see the frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le, Lt
from numpy.typing import NDArray

from tracknoise.checks import Between0And1, NotNegative, require, require_bounds, require_odd
from tracknoise.trackers.detectors import DETECTORS, SMALLEST_SIDE_PX, Detector, Thresholds
from tracknoise.trackers.frame import Frame

MOST_FEATURES = 1_000_000
"""Largest number of features that a tracker may be asked for."""
_SCORED = (Detector.agast, Detector.fast)
"""Detectors whose response is a score in gray values."""


@dataclass(frozen=True, slots=True)
class Detection:
    """Where features may begin. The defaults are those of XIVO's tracker.

    Parameters
    ----------
    detector
        How keypoints are found: see `tracknoise.trackers.detectors.Detector`.
    threshold
        For agast, fast and orb: least difference of gray values between a corner and the circle of pixels around it, 1
        to 255.
    min_response
        For agast and fast: keypoints with a lower score are discarded.
    quality
        For gftt: least response of a keypoint, as a share of the strongest one in the image.
    contrast
        For sift: least contrast of a keypoint, with gray values from 0 to 1.
    square_px
        Side of the square around a feature in which no other feature may begin or stay, px; odd.
    margin_px
        Width of the image border without features, px.
    """

    detector: Detector = Detector.agast
    threshold: Annotated[int, Ge(1), Le(255)] = 10
    min_response: NotNegative = 5.0
    quality: Between0And1 = 0.01
    contrast: Annotated[float, Ge(0), Lt(1)] = 0.04
    square_px: Annotated[int, Ge(1)] = 15
    margin_px: Annotated[int, Ge(0)] = 8

    def __post_init__(self) -> None:
        require(self.detector in tuple(Detector), "detector", self.detector, f"one of {', '.join(Detector)}")
        object.__setattr__(self, "detector", Detector(self.detector))  # so that a name will do for the member
        require_bounds(self)
        require_odd("square_px", self.square_px)

    @property
    def least_response(self) -> float:
        """Keypoints with a lower response are discarded."""
        return self.min_response if self.detector in _SCORED else -np.inf

    @property
    def key(self) -> tuple[object, ...]:
        """What the keypoints of an image depend on. Neither margin nor squares are part of it."""
        return self.detector, self.threshold, self.min_response, self.quality, self.contrast


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
        Of the detector, in its own unit. Of agast and fast, the largest threshold at which the corner would still be
        one.
    """

    raw: Sequence[cv2.KeyPoint]
    order: NDArray[np.intp]
    uv: NDArray[np.float64]
    response: NDArray[np.float32]


def keypoints(frame: Frame, detection: Detection) -> Keypoints:
    """Keypoints of the whole image by the detector of the settings, computed once per frame.

    Neither margin nor squares are applied here.
    """

    def detect(image: NDArray[np.uint8]) -> Keypoints:
        if min(image.shape) < SMALLEST_SIDE_PX:
            return _strongest_first([], detection.least_response)
        thresholds = Thresholds(detection.threshold, detection.quality, detection.contrast)
        return _strongest_first(DETECTORS[detection.detector](image, thresholds), detection.least_response)

    return frame.memo(("keypoints", detection.key), detect)


def _strongest_first(raw: Sequence[cv2.KeyPoint], least_response: float) -> Keypoints:
    response = np.array([point.response for point in raw], dtype=np.float32)
    uv = np.asarray(cv2.KeyPoint.convert(raw), dtype=np.float64).reshape(-1, 2)
    order = np.argsort(-response, kind="stable")
    order = order[response[order] >= least_response]
    return Keypoints(raw, order, uv[order], response[order])
