"""Keypoints of an image, strongest first, and where features may be.

- OpenCV's detectors of keypoints, each with the few thresholds that decide how many keypoints there are.
- Keypoints of a whole image, strongest first, shared by all trackers that see the frame.
- Where features may be: outside the margin, and outside the squares of earlier features.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le, Lt
from numpy.typing import NDArray

from tracknoise.checks import Between0And1, NotNegative, require, require_bounds, require_odd
from tracknoise.trackers.tracker import Frame

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
        How keypoints are found: see `tracknoise.trackers.detection.Detector`.
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


class Mask:
    """The positions in one image that are still free for features.

    A feature at (u, v) lies on pixel (floor u, floor v). That pixel must be outside the border margin and
    outside the squares of all features that were accepted before. The feature's own square is centred on the
    pixel nearest to it (halves round up). For keypoints, which lie on pixel centres, the two are the same.

    This is XIVO's convention, and it affects results: with the nearest pixel instead, the mean lifetime on the
    7-Scenes sample would be 9.5 frames instead of 8.8 (Lucas-Kanade, OpenCV 4.11's rejection). Shapes: size
    (width, height).
    """

    __slots__ = ("_blocked", "_margin_px", "_reach", "_size", "_squares")

    def __init__(self, size: tuple[int, int], detection: Detection) -> None:
        width, height = size
        self._size = size
        self._margin_px = detection.margin_px
        self._reach = detection.square_px // 2
        padding = 2 * self._reach + 1  # no square needs clipping, even one centred beyond the image by rounding
        self._blocked = bytearray((height + padding) * (width + padding))
        self._squares = np.frombuffer(self._blocked, dtype=np.uint8).reshape(height + padding, width + padding)

    def claim(self, uv: NDArray[np.float64], *, limit: int | None = None) -> NDArray[np.intp]:
        """Accept features in the given order if their pixel is free; each accepted feature blocks its square.

        Shapes: uv (n, 2) px; returns (m,). Indices of the accepted features, ascending. `uv`: NaN and positions outside
        the image are never free.
        """
        inside = (uv >= self._margin_px) & (uv < np.array(self._size) - self._margin_px)
        rows = np.flatnonzero(inside[:, 0] & inside[:, 1])
        column, row = np.floor(uv[rows]).astype(np.intp).T + self._reach
        place = row * self._squares.shape[1] + column
        free = np.flatnonzero(self._squares.ravel()[place] == 0)
        rows, place = rows[free], place[free]
        left, top = np.floor(uv[rows] + 0.5).astype(np.intp).T.tolist()
        return rows[self._first_come(place.tolist(), left, top, len(rows) if limit is None else limit)]

    def _first_come(self, places: list[int], left: list[int], top: list[int], limit: int) -> list[int]:
        """The sequential loop. Reading a byte string is much faster than reading an array, and both share memory."""
        blocked, squares, side = self._blocked, self._squares, 2 * self._reach + 1
        kept: list[int] = []
        for index, place in enumerate(places):
            if len(kept) >= limit:
                break
            if not blocked[place]:
                x, y = left[index], top[index]
                squares[y : y + side, x : x + side] = 1
                kept.append(index)
        return kept
