"""OpenCV's detectors of keypoints, each with the few thresholds that decide how many keypoints there are."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
from numpy.typing import NDArray

Detect = Callable[[NDArray[np.uint8], "Thresholds"], Sequence[cv2.KeyPoint]]

SMALLEST_SIDE_PX = 7
"""Images with a shorter side have no keypoints: FAST and AGAST compare a pixel with a circle of radius 3."""
_MOST_ORB = 100_000
"""ORB asks for a number of keypoints. This one is larger than the number of corners of any image in use."""


class Detector(StrEnum):
    """How keypoints are found.

    agast: AGAST corners (OAST_9_16), on whole pixels. fast: FAST corners (9 of 16), on whole pixels. gftt: corners of
    Shi and Tomasi, by the smaller eigenvalue of the structure tensor of 3 x 3 px, on whole pixels. orb: FAST corners of
    an image pyramid, ranked by Harris' response, with a direction; those of its coarser levels are too far up and left,
    by up to about 1.5 px, as OpenCV scales positions without half a pixel. sift: extrema of the difference of
    Gaussians, between pixels, with size and direction.
    """

    agast = "agast"
    fast = "fast"
    gftt = "gftt"
    orb = "orb"
    sift = "sift"


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Thresholds of the detectors: see `tracknoise.trackers.detection.Detection`."""

    threshold: int
    quality: float
    contrast: float


def _agast(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    return cv2.xfeatures2d.AgastFeatureDetector.create(
        threshold=least.threshold,
        nonmaxSuppression=True,
        type=cv2.xfeatures2d.AgastFeatureDetector_OAST_9_16,
    ).detect(image)


def _fast(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    return cv2.FastFeatureDetector.create(threshold=least.threshold, nonmaxSuppression=True).detect(image)


def _gftt(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    return cv2.GFTTDetector.create(maxCorners=0, qualityLevel=least.quality, minDistance=1, blockSize=3).detect(image)


def _orb(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    return cv2.ORB.create(nfeatures=_MOST_ORB, fastThreshold=least.threshold).detect(image)


def _sift(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    # Without the precise upscaling, positions are biased by a quarter of a pixel.
    return cv2.SIFT.create(contrastThreshold=least.contrast, enable_precise_upscale=True).detect(image)


DETECTORS: Mapping[Detector, Detect] = {
    Detector.agast: _agast,
    Detector.fast: _fast,
    Detector.gftt: _gftt,
    Detector.orb: _orb,
    Detector.sift: _sift,
}
"""Keypoints of an image, by each detector."""
