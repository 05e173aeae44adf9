"""Images with known motion, and settings of a sequence."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from tests.trackers.networks import DOTS_SIZE

from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import TruthStatus
from tracknoise.trackers.tracker import Frame, SequenceContext

SIZE = (320, 240)


def textured(width: int, height: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    coarse, fine = (cv2.GaussianBlur(rng.normal(size=(height, width)), (0, 0), sigma) for sigma in (5.0, 1.2))
    return np.clip(128 + 300 * coarse / np.ptp(coarse) + 300 * fine / np.ptp(fine), 0, 255).astype(np.uint8)


@pytest.fixture(scope="session")
def sideways() -> list[Frame]:
    """A texture that moves by exactly (3, -2) px a frame."""
    texture = textured(420, 340)
    width, height = SIZE
    return [Frame(k, texture[20 + 2 * k :][:height, 60 - 3 * k :][:, :width].copy()) for k in range(6)]


@pytest.fixture(scope="module")
def dots() -> tuple[list[Frame], np.ndarray]:
    """Images of dots with different surroundings that move by (3, -2) px, and the places of the dots in the first."""
    rng = np.random.default_rng(0)
    texture = cv2.GaussianBlur(rng.uniform(0, 255, (200, 260)).astype(np.float32), (0, 0), 2.0) * 0.7
    places = np.array([(u, v) for u in range(40, 220, 18) for v in range(40, 170, 18)])
    places += rng.integers(-4, 5, places.shape)
    for u, v in places:
        texture[v - 1 : v + 2, u - 1 : u + 2] = 190
        texture[v, u] = 200 + rng.integers(0, 50)
    texture = np.clip(texture, 0, 255).astype(np.uint8)
    images = [texture[40 + 2 * k :, 60 - 3 * k :][: DOTS_SIZE[1], : DOTS_SIZE[0]].copy() for k in range(5)]
    inside = places - (60, 40)
    inside = inside[((inside >= 8) & (inside < np.array(DOTS_SIZE) - 8)).all(axis=1)]
    return [Frame(k, image) for k, image in enumerate(images)], inside


@pytest.fixture
def setting() -> Callable[..., SequenceContext]:
    def make(
        size: tuple[int, int] = SIZE,
        n_frames: int = 6,
        speed: int = 1,
        scene: str = "scene",
        camera: str = "",
        truth: object = None,
    ) -> SequenceContext:
        known = truth if truth is not None else FlatTruth(size)
        return SequenceContext(SequenceId("data", scene, camera=camera), size, n_frames, speed, 0, known)

    return make


class FlatTruth:
    """Points on a plane that slides by `velocity` px a frame; no depth in the left `hole_px` columns."""

    def __init__(self, size: tuple[int, int], velocity: tuple[float, float] = (1.0, 0.5), hole_px: float = 0.0) -> None:
        self.size, self.velocity, self.hole_px = size, np.array(velocity), hole_px

    def anchor(self, index: int, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        status = np.where(uv[:, 0] < self.hole_px, TruthStatus.no_depth, TruthStatus.valid).astype(np.int8)
        world = np.column_stack([uv - index * self.velocity, np.ones(len(uv))])
        world[status != TruthStatus.valid] = np.nan
        return world, status

    def project(self, index: int, points_world: np.ndarray) -> np.ndarray:
        return points_world[:, :2] + index * self.velocity

    def displaced(self, index: int, points_world: np.ndarray, by_px: np.ndarray) -> np.ndarray:
        return points_world + np.pad(by_px, ((0, 0), (0, 1)))
