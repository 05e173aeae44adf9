"""Descriptors of a frame's keypoints, shared by all trackers that see the frame."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.detection import Detection, Keypoints, keypoints
from tracknoise.trackers.frame import Frame

_CORNER_SIZE_PX = 7.0
"""Size of the keypoints of AGAST and FAST."""


class Descriptor(StrEnum):
    """What a keypoint is recognised by.

    sift: 128 gradients. orb and brisk: 256 and 512 comparisons of gray values.
    """

    sift = "sift"
    orb = "orb"
    brisk = "brisk"

    @property
    def size(self) -> int:
        """Length of a descriptor."""
        return {Descriptor.sift: 128, Descriptor.orb: 256, Descriptor.brisk: 512}[self]


@dataclass(frozen=True, slots=True)
class Described:
    """Keypoints with descriptors, strongest first.

    Attributes
    ----------
    uv : (n, 2) float64
        Positions, px.
    response : (n,) float32
        Of the detector.
    descriptors : (n, size) float32
        Of SIFT, whole numbers from 0 to 255, of length about 512. Of the others, one bit per comparison, so that the
        squared distance of two descriptors is the number of bits that differ.
    """

    uv: NDArray[np.float64]
    response: NDArray[np.float32]
    descriptors: NDArray[np.float32]


def describe(frame: Frame, detection: Detection, descriptor: Descriptor = Descriptor.sift) -> Described:
    """Descriptors of all keypoints of the whole image, computed once per frame.

    Keypoints of `sift` and `orb` are described with their own size and direction if the descriptor is of the same kind.
    All others are described as AGAST's are: with a size of 7 px, and upright or, by `brisk`, along a direction that it
    finds itself. A descriptor may drop keypoints, such as those near the border; only those that it returns are used.
    """

    def compute(image: NDArray[np.uint8]) -> Described:
        raw = _to_describe(keypoints(frame, detection), own=detection.detector.value == descriptor.value)
        kept, found = _extractor(descriptor).compute(image, raw) if raw else ((), None)
        uv = np.asarray(cv2.KeyPoint.convert(kept), dtype=np.float64).reshape(-1, 2)
        response = np.array([point.response for point in kept], dtype=np.float32)
        order = np.argsort(-response, kind="stable")  # ORB returns its keypoints by level
        return Described(uv[order], response[order], _as_numbers(found, descriptor)[order])

    return frame.memo(("descriptors", descriptor, detection.key), compute)


def _to_describe(points: Keypoints, *, own: bool) -> list[cv2.KeyPoint]:
    """The keypoints, strongest first: as they were detected if `own`, otherwise as corners of one size."""
    raw = [points.raw[index] for index in points.order.tolist()]
    if own:
        return raw
    return [cv2.KeyPoint(one.pt[0], one.pt[1], _CORNER_SIZE_PX, response=one.response) for one in raw]


def _extractor(descriptor: Descriptor) -> cv2.Feature2D:
    if descriptor is Descriptor.sift:  # as `tracknoise.trackers.detectors` finds its keypoints: where it looks at them
        return cv2.SIFT.create(enable_precise_upscale=True)
    return cv2.ORB.create() if descriptor is Descriptor.orb else cv2.xfeatures2d.BRISK.create()


def _as_numbers(descriptors: NDArray[Any] | None, descriptor: Descriptor) -> NDArray[np.float32]:
    """Descriptors (n, size) as numbers whose squared distance means something; bytes become bits."""
    if descriptors is None:
        return np.empty((0, descriptor.size), dtype=np.float32)
    numbers = descriptors if descriptor is Descriptor.sift else np.unpackbits(descriptors, axis=1)
    return np.asarray(numbers, dtype=np.float32).reshape(-1, descriptor.size)
