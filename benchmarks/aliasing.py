"""Whether the renderer's sampling shows in what Lucas-Kanade makes of its images: it should not.

The same corners are tracked through the same frames rendered with 2x2 and with 4x4 rays a pixel, and their mean
absolute error at age 10 (eta) is compared. Tracks whose true point is hidden in the end, or whose error is among the
largest tenth, are left out of both.
"""

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.harness import Row
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.simulated import Simulated, SimulatedSequence

AGE = 10
STARTS = (0, 25)
CORNERS = 1200
KEPT = 0.9
NOISES = (0.0, 2.0)
RAYS = (2, 4)
Errors = NDArray[np.float64]  # (corners, 2) signed, px; NaN where unknown
Images = list[NDArray[np.uint8]]


def rows() -> list[Row]:
    """Eta at age 10 with 2x2 and 4x4 rays a pixel, with and without sensor noise, for each motion and for all."""
    collected: dict[tuple[float, str], list[tuple[Errors, Errors]]] = {}
    for motion in Simulated().motions:
        coarse, fine = (_sequence(motion, rays) for rays in RAYS)
        for start in STARTS:
            frames = range(start, start + AGE + 1)
            rendered = [[sequence.image(index) for index in frames] for sequence in (coarse, fine)]
            for noise in NOISES:
                pair = _errors(coarse, start, *([_noisy(images, noise) for images in rendered]))
                for name in (motion, "all motions"):
                    collected.setdefault((noise, name), []).append(pair)
    return [_compared(f"{name}, noise {noise:g}", pairs) for (noise, name), pairs in sorted(collected.items())]


def _sequence(motion: str, rays: int) -> SimulatedSequence:
    reader = Simulated(motions=(motion,), frames=max(STARTS) + AGE + 1, supersampling=rays, noise_sigma=0.0)
    return reader.open(reader.sequences()[0])


def _compared(name: str, pairs: list[tuple[Errors, Errors]]) -> Row:
    coarse, fine = (np.concatenate(errors) for errors in zip(*pairs, strict=True))
    worst = np.abs(np.hstack([coarse, fine])).max(axis=1)
    kept = worst <= np.nanquantile(worst, KEPT)
    eta = [float(np.abs(errors[kept]).mean()) for errors in (coarse, fine)]
    note = f"{eta[0]:.4f} px at 2x2, {eta[1]:.4f} px at 4x4, {np.count_nonzero(kept)} tracks"
    return Row(f"Lucas-Kanade's eta at age {AGE}, 4x4 against 2x2 rays: {name}", 100 * (eta[1] / eta[0] - 1), "%", note)


def _noisy(images: Images, sigma: float) -> Images:
    """The images with the same noise at every call, so that it cancels in the comparison."""
    rng = np.random.default_rng(0)
    grey = (image + sigma * rng.standard_normal(image.shape) for image in images)
    return [np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in grey]


def _errors(sequence: SimulatedSequence, start: int, coarse: Images, fine: Images) -> tuple[Errors, Errors]:
    """Errors of the coarse image's corners when tracked through either rendering."""
    detector = cv2.xfeatures2d.AgastFeatureDetector.create(threshold=10)
    strongest = sorted(detector.detect(coarse[0]), key=lambda corner: -corner.response)[:CORNERS]
    corners = np.array([corner.pt for corner in strongest], np.float32)
    true = _true_positions(sequence, start, corners.astype(np.float64))
    return _track(coarse, corners) - true, _track(fine, corners) - true


def _true_positions(sequence: SimulatedSequence, start: int, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) where the corners really are in the end, px; NaN where they are not seen any more."""
    points, _ = sequence.cast(start, corners)
    camera_from_world = invert(sequence.world_from_camera[start + AGE])
    there = transform(camera_from_world, points)
    uv = sequence.camera.project(there)
    seen = sequence.camera.contains(uv)
    nearest, _ = sequence.cast(start + AGE, np.where(seen[:, None], uv, 0.0))
    clear = there[:, 2] <= 1.02 * transform(camera_from_world, nearest)[:, 2]
    return np.where((seen & clear)[:, None], uv, np.nan)


def _track(images: Images, corners: NDArray[np.float32]) -> NDArray[np.float64]:
    """(n, 2) where Lucas-Kanade ends up, px; NaN where it lost its way."""
    positions, found = corners.copy(), np.ones(len(corners), bool)
    for previous, image in pairwise(images):
        positions, status, _ = cv2.calcOpticalFlowPyrLK(previous, image, positions, None, winSize=(15, 15), maxLevel=4)
        found &= status.ravel() == 1
    return np.where(found[:, None], positions, np.nan).astype(np.float64)
