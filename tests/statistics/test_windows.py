"""Windows of tracks with planted noise: residuals, and how far the depths of fitted points err."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.projection import projection_jacobian
from tracknoise.statistics.windows import LEAST_PARALLAX_PX, fit_windows

CAMERA = Camera(640, 480, 460.0, 460.0, 319.5, 239.5)
COUNT, SIGMA_PX = 3000, 0.3


def world(motion: str, length: int, step_m: float = 0.08) -> tuple[NDArray[np.float64], ...]:
    """Points, derivatives of their images and their depths in every frame, for a camera that moves along an axis."""
    rng = np.random.default_rng(0)
    uv = np.column_stack([rng.uniform(150, 500, COUNT), rng.uniform(100, 380, COUNT)])
    points = CAMERA.unproject(uv, rng.uniform(2, 10, COUNT))
    camera = np.zeros((length, 3))
    camera[:, {"sideways": 0, "forward": 2}[motion]] = step_m * np.arange(length)
    seen = points[:, None] - camera
    return points, projection_jacobian(CAMERA, seen.reshape(-1, 3)).reshape(COUNT, length, 2, 3), seen[..., 2]


@pytest.mark.parametrize("motion", ["sideways", "forward"])
@pytest.mark.parametrize("length", [5, 15])
def test_detection_noise_has_the_same_sigma_in_residuals_and_in_depths(motion, length):
    points, jacobian, _ = world(motion, length)
    noise = SIGMA_PX * np.random.default_rng(1).standard_normal((COUNT, length, 2))
    uv = CAMERA.project(points)
    anchored = CAMERA.unproject(uv + noise[:, 0], points[:, 2])  # the true point of a track is on its first ray
    errors = noise - np.einsum("wnij,wj->wni", jacobian, anchored - points)
    found = fit_windows(errors, jacobian, points)
    assert np.sqrt(found.squares.sum() / found.freedom.sum()) == pytest.approx(SIGMA_PX, rel=0.03)
    assert np.sqrt(found.squares.sum(axis=0) / found.freedom.sum(axis=0)) == pytest.approx(SIGMA_PX, rel=0.04)
    shown = np.isfinite(found.z_px)
    assert np.std(found.z_px[shown]) == pytest.approx(SIGMA_PX, rel=0.05)
    np.testing.assert_allclose(found.freedom.sum(axis=1), np.where(shown, 2 * length - 3, 2 * length - 2), atol=1e-9)


def test_a_walk_looks_small_in_residuals_and_is_large_in_depths_the_longer_the_window():
    ratios = []
    for length in (5, 15):
        points, jacobian, depth = world("sideways", length)
        steps = 0.1 * np.random.default_rng(2).standard_normal((COUNT, length, 2))
        steps[:, 0] = 0.0
        errors = np.cumsum(steps * depth[..., None], axis=1) / depth[..., None]
        found = fit_windows(errors, jacobian, points)
        residual = np.sqrt(found.squares.sum() / found.freedom.sum())
        ratios.append(np.nanstd(found.z_px) / residual)
    assert 1.5 < ratios[0] < ratios[1]


def test_moving_the_point_is_no_residual():
    points, jacobian, _ = world("forward", 8)
    moved = np.einsum("wnij,j->wni", jacobian, np.array([0.01, -0.02, 0.05]))
    found = fit_windows(moved, jacobian, points)
    shown = np.isfinite(found.z_px)
    np.testing.assert_allclose(found.squares[shown], 0.0, atol=1e-18)


def test_without_parallax_the_depth_is_not_shown():
    points, jacobian, _ = world("sideways", 6, step_m=1e-4)
    found = fit_windows(np.zeros((COUNT, 6, 2)), jacobian, points)
    assert np.isnan(found.z_px).all()
    np.testing.assert_allclose(found.freedom.sum(axis=1), 10.0)
    assert LEAST_PARALLAX_PX == 1.0
