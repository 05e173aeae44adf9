"""Keypoints of an image, strongest first: how they are found, shared out over the image, and refined."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le, Lt
from numpy.typing import NDArray

from tracknoise.checks import Between0And1, NotNegative, Positive, require, require_bounds, require_odd, settle_members
from tracknoise.trackers.keypoint_network import NetworkKeypoints, NetworkUnits, find_keypoints, require_network
from tracknoise.trackers.tracker import Frame

Detect = Callable[[NDArray[np.uint8], "Thresholds"], Sequence[cv2.KeyPoint]]

SMALLEST_SIDE_PX = 7
"""Images with a shorter side have no keypoints: FAST and AGAST compare a pixel with a circle of radius 3."""
_MOST_ORB = 100_000
"""ORB asks for a number of keypoints. This one is larger than the number of corners of any image in use."""


class Detector(StrEnum):
    """How keypoints are found.

    agast: AGAST corners (OAST_9_16), on whole pixels. fast: FAST corners (9 of 16), on whole pixels. gftt: corners of
    Shi and Tomasi, by the smaller eigenvalue of the structure tensor of a block, on whole pixels. orb: FAST corners of
    an image pyramid, ranked by Harris' response, with a direction; those of its coarser levels are too far up and left,
    by up to about 1.5 px, as OpenCV scales positions without half a pixel. akaze: maxima of the Hessian's determinant
    in a nonlinear scale space, between pixels, with size and direction. sift: extrema of the difference of Gaussians,
    between pixels, with size and direction.
    """

    agast = "agast"
    fast = "fast"
    gftt = "gftt"
    orb = "orb"
    akaze = "akaze"
    sift = "sift"


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Thresholds of the detectors: see `tracknoise.trackers.detection.Detection`."""

    threshold: int
    quality: float
    contrast: float
    block_px: int


def _agast(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    return cv2.xfeatures2d.AgastFeatureDetector.create(
        threshold=least.threshold,
        nonmaxSuppression=True,
        type=cv2.xfeatures2d.AgastFeatureDetector_OAST_9_16,
    ).detect(image)


def _fast(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    return cv2.FastFeatureDetector.create(threshold=least.threshold, nonmaxSuppression=True).detect(image)


def _gftt(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    return cv2.GFTTDetector.create(
        maxCorners=0, qualityLevel=least.quality, minDistance=1, blockSize=least.block_px
    ).detect(image)


def _orb(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    return cv2.ORB.create(nfeatures=_MOST_ORB, fastThreshold=least.threshold).detect(image)


def _sift(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    return _sift_of(least.contrast).detect(image)


def _sift_of(contrast: float) -> cv2.SIFT:
    # Without the precise upscaling, positions are biased by a quarter of a pixel.
    return cv2.SIFT.create(contrastThreshold=contrast, enable_precise_upscale=True)


def _akaze(image: NDArray[np.uint8], least: Thresholds) -> Sequence[cv2.KeyPoint]:
    return cv2.xfeatures2d.AKAZE.create().detect(image)


DETECTORS: Mapping[Detector, Detect] = {
    Detector.agast: _agast,
    Detector.fast: _fast,
    Detector.gftt: _gftt,
    Detector.orb: _orb,
    Detector.akaze: _akaze,
    Detector.sift: _sift,
}
"""Keypoints of an image, by each detector."""


MOST_FEATURES = 1_000_000
"""Largest number of features that a tracker may be asked for."""
_SCORED = (Detector.agast, Detector.fast)
"""Detectors whose response is a score in gray values."""


class Spacing(StrEnum):
    """How features are kept apart.

    squares: no feature in the square around another. circles: no feature in the circle around another. cells: at most
    one feature in each cell of a fine grid, and no new one in the square around an older one. anms: circles, and new
    features are those farthest from stronger ones (adaptive non-maximal suppression), so that they spread over the
    image. See `tracknoise.trackers.spacing`.
    """

    squares = "squares"
    circles = "circles"
    cells = "cells"
    anms = "anms"


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
    block_px
        For gftt: side of the block whose structure tensor counts, px.
    spacing
        How features are kept apart: by squares of `square_px`, by circles or cells of `distance_px`, or by anms: see
        `tracknoise.trackers.detection.Spacing`.
    distance_px
        Radius of the circles, or side of the cells, px.
    grid
        Columns and rows of a grid, in each cell of which keypoints are found by themselves. None: one for the whole
        image.
    per_cell
        The strongest keypoints of each cell that are considered, at most.
    refill_below
        Keypoints are considered in cells with fewer features than this.
    retry_thresholds
        Thresholds to retry a cell without keypoints with, one after the other.
    subpixel_px
        Keypoints are moved between pixels, to where the gradients around them point away from: half of the side of the
        window, without its central pixel, px. 0: they stay on whole pixels.
    network
        An ONNX file with a network that finds keypoints instead of `detector`: see docs/trackers.md. It needs
        the extra `learned`, and takes no grid.
    network_units
        What its positions are: see `tracknoise.trackers.keypoint_network.NetworkUnits`.
    network_score
        Least score of its keypoints.
    subpixel_iterations, subpixel_epsilon
        Convergence of that: at most this many iterations, or until the update is smaller than `subpixel_epsilon` px.
    """

    detector: Detector = Detector.agast
    threshold: Annotated[int, Ge(1), Le(255)] = 10
    min_response: NotNegative = 5.0
    quality: Between0And1 = 0.01
    contrast: Annotated[float, Ge(0), Lt(1)] = 0.04
    square_px: Annotated[int, Ge(1)] = 15
    margin_px: Annotated[int, Ge(0)] = 8
    block_px: Annotated[int, Ge(2), Le(31)] = 3
    spacing: Spacing = Spacing.squares
    distance_px: Annotated[int, Ge(1), Le(999)] = 10
    grid: tuple[Annotated[int, Ge(1), Le(1000)], Annotated[int, Ge(1), Le(1000)]] | None = None
    per_cell: Annotated[int, Ge(1), Le(MOST_FEATURES)] = 1
    refill_below: Annotated[int, Ge(1), Le(MOST_FEATURES)] = 1
    retry_thresholds: tuple[Annotated[int, Ge(1), Le(255)], ...] = ()
    subpixel_px: Annotated[int, Ge(0), Le(50)] = 0
    subpixel_iterations: Annotated[int, Ge(1)] = 20
    subpixel_epsilon: Positive = 0.001
    network: Path | None = None
    network_units: NetworkUnits = NetworkUnits.pixels
    network_score: NotNegative = 0.0

    def __post_init__(self) -> None:
        settle_members(self, detector=Detector, spacing=Spacing, network_units=NetworkUnits)
        require_bounds(self)
        require_odd("square_px", self.square_px)
        require(self.network is None or self.grid is None, "grid", self.grid, "none with a network")

    def require_usable(self) -> None:
        """Check that the network can be used, if there is one: see `require_network`."""
        if self.network is not None:
            require_network(self.network)

    @property
    def least_response(self) -> float:
        """Keypoints with a lower response are discarded."""
        return self.min_response if self.detector in _SCORED else -np.inf

    @property
    def key(self) -> tuple[object, ...]:
        """What the keypoints of an image, or of a cell, depend on. Neither margin nor spacing are part of it."""
        network = self.network, self.network_units, self.network_score
        return self.detector, self.threshold, self.min_response, self.quality, self.contrast, self.block_px, *network


@dataclass(frozen=True, slots=True)
class Keypoints:
    """Keypoints of an image, strongest first; ties in the order of detection."""

    raw: Sequence[cv2.KeyPoint]  # as OpenCV made them, in the order of detection
    order: NDArray[np.intp]  # (n,): which of `raw` they are
    uv: NDArray[np.float64]  # (n, 2): positions, px
    # (n,): Of the detector, in its own unit. Of agast and fast, the largest threshold at which the corner would still
    # be one.
    response: NDArray[np.float32]


def keypoints(frame: Frame, detection: Detection) -> Keypoints:
    """Keypoints of the whole image by the detector of the settings, computed once per frame.

    Neither margin nor spacing, neither grid nor refinement are applied here.
    """
    if detection.network is not None:
        return frame.memo(("keypoints", detection.key), lambda image: _by_network(network_keypoints(frame, detection)))
    return frame.memo(("keypoints", detection.key), lambda image: _found(image, detection, detection.threshold))


def sift_descriptors(frame: Frame, detection: Detection) -> NDArray[np.float32]:
    """(n, 128): descriptors of all that SIFT finds in the image, in the order of `Keypoints.raw`.

    Keypoints and descriptors are from one scale space, which takes most of the time of either.
    """

    def compute(image: NDArray[np.uint8]) -> NDArray[np.float32]:
        if min(image.shape) < SMALLEST_SIDE_PX:
            return np.empty((0, 128), np.float32)
        raw, descriptors = _sift_of(detection.contrast).detectAndCompute(image, None)
        frame.memo(("keypoints", detection.key), lambda _: _strongest_first(raw, detection.least_response))
        return np.asarray(descriptors, np.float32) if raw else np.empty((0, 128), np.float32)

    return frame.memo(("sift", detection.contrast), compute)


def network_keypoints(frame: Frame, detection: Detection) -> NetworkKeypoints:
    """What the network of the settings finds in the image, computed once per frame."""
    assert detection.network is not None
    path, units, least = detection.network, detection.network_units, detection.network_score
    key = ("network", path, units, least)
    return frame.memo(key, lambda image: find_keypoints(image, path, units).at_least(least))


def _by_network(of_network: NetworkKeypoints) -> Keypoints:
    """Keypoints whose class is their number among those of the network."""
    rows = zip(of_network.uv.tolist(), of_network.score.tolist(), strict=True)
    raw = [cv2.KeyPoint(u, v, 1.0, response=score, class_id=row) for row, ((u, v), score) in enumerate(rows)]
    return Keypoints(raw, np.arange(len(raw)), of_network.uv, of_network.score)


def _found(image: NDArray[np.uint8], detection: Detection, threshold: int) -> Keypoints:
    if min(image.shape) < SMALLEST_SIDE_PX:
        return _strongest_first([], detection.least_response)
    thresholds = Thresholds(threshold, detection.quality, detection.contrast, detection.block_px)
    return _strongest_first(DETECTORS[detection.detector](image, thresholds), detection.least_response)


def _strongest_first(raw: Sequence[cv2.KeyPoint], least_response: float) -> Keypoints:
    response = np.array([point.response for point in raw], dtype=np.float32)
    uv = np.asarray(cv2.KeyPoint.convert(raw), dtype=np.float64).reshape(-1, 2)
    order = np.argsort(-response, kind="stable")
    order = order[response[order] >= least_response]
    return Keypoints(raw, order, uv[order], response[order])


def cell_keypoints(frame: Frame, detection: Detection, grid: tuple[int, int]) -> Keypoints:
    """The strongest `per_cell` keypoints of each cell of a grid, computed once per frame.

    Each cell is an image of its own for the detector, with a border of its own. Cells have a whole number of pixels;
    what is left of the image on the right and below belongs to none. They come column by column, and in each the
    strongest keypoint first.
    """
    key = ("cell keypoints", detection.key, grid, detection.per_cell, detection.retry_thresholds)
    return frame.memo(key, lambda image: _joined(list(_of_cells(image, detection, grid))))


def _of_cells(image: NDArray[np.uint8], detection: Detection, grid: tuple[int, int]) -> Iterator[Keypoints]:
    columns, rows = grid
    width, height = image.shape[1] // columns, image.shape[0] // rows
    for left in range(0, width * columns, max(width, 1)):
        for top in range(0, height * rows, max(height, 1)):
            cell = np.ascontiguousarray(image[top : top + height, left : left + width])
            for threshold in (detection.threshold, *detection.retry_thresholds):
                points = _found(cell, detection, threshold)
                if len(points.uv):
                    break
            yield _moved(points, (left, top), detection.per_cell)


def _moved(points: Keypoints, by_px: tuple[int, int], most: int) -> Keypoints:
    """The strongest keypoints of a part of an image, in its whole."""
    order = points.order[:most]
    raw = [points.raw[index] for index in order.tolist()]
    for point in raw:
        point.pt = (point.pt[0] + by_px[0], point.pt[1] + by_px[1])
    return Keypoints(raw, np.arange(len(raw)), points.uv[:most] + by_px, points.response[:most])


def _joined(parts: Sequence[Keypoints]) -> Keypoints:
    raw = [point for part in parts for point in part.raw]
    uv = np.concatenate([np.empty((0, 2)), *(part.uv for part in parts)])
    response = np.concatenate([np.empty(0, dtype=np.float32), *(part.response for part in parts)])
    return Keypoints(raw, np.arange(len(raw)), uv, response)


def refined(frame: Frame, uv: NDArray[np.float64], detection: Detection) -> NDArray[np.float64]:
    """Positions of keypoints between pixels, by the settings of the detection; as they are if that is switched off.

    Shapes: uv (n, 2) px; returns (n, 2). Where an image is too small for the window, they stay as they are.
    """
    half = detection.subpixel_px
    if not half or not len(uv) or min(frame.size) < 2 * half + 5:
        return uv
    ends = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, detection.subpixel_iterations, detection.subpixel_epsilon)
    start = uv.astype(np.float32).reshape(-1, 1, 2)
    moved = np.asarray(cv2.cornerSubPix(frame.image, start, (half, half), (-1, -1), ends), dtype=np.float64)[:, 0]
    return np.where(np.isfinite(moved), moved, uv)
