"""SIFT descriptors of a frame's AGAST keypoints, shared by all trackers that see the frame."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.detection import Detection, keypoints
from tracknoise.trackers.frame import Frame

DESCRIPTOR_SIZE = 128


@dataclass(frozen=True, slots=True)
class Described:
    """Keypoints with descriptors, strongest first.

    Attributes
    ----------
    uv : (n, 2) float64
        Positions, px.
    response : (n,) float32
        AGAST's score.
    descriptors : (n, 128) float32
        Whole numbers from 0 to 255, of length about 512.
    """

    uv: NDArray[np.float64]
    response: NDArray[np.float32]
    descriptors: NDArray[np.float32]


def describe(frame: Frame, detection: Detection) -> Described:
    """SIFT descriptors of all AGAST keypoints of the whole image, computed once per frame.

    SIFT may drop keypoints; only those that it returns are used.
    """

    def compute(image: NDArray[np.uint8]) -> Described:
        points = keypoints(frame, detection)
        raw = [points.raw[index] for index in points.order.tolist()]
        if not raw:
            return Described(points.uv, points.response, np.empty((0, DESCRIPTOR_SIZE), dtype=np.float32))
        kept, descriptors = cv2.SIFT.create().compute(image, raw)
        uv = np.asarray(cv2.KeyPoint.convert(kept), dtype=np.float64).reshape(-1, 2)
        response = np.array([point.response for point in kept], dtype=np.float32)
        return Described(uv, response, np.asarray(descriptors, dtype=np.float32).reshape(-1, DESCRIPTOR_SIZE))

    return frame.memo(("descriptors", detection.threshold, detection.min_response), compute)
