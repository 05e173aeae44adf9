"""Tracks beside the images of a plane that a camera passes by steps that change, so that each reading differs."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from benchmarks.validity.spoilt_tracks import SPOILS, chosen, right_tracks

from tracknoise.truth_faults.tracks_in_images import STRAY, Reading, Tracked, most_confirmed, wrong_reading

WIDTH, HEIGHT, FRAMES = 160, 120, 24


@pytest.fixture(scope="module")
def world() -> np.ndarray:
    """Texture of all sizes, (600, 600) uint8."""
    rng = np.random.default_rng(1)
    layers = [cv2.GaussianBlur(rng.normal(size=(600, 600)), (0, 0), sigma) * sigma for sigma in (1.5, 3.0, 6.0)]
    texture = sum(layers)
    return np.asarray(255 * (texture - texture.min()) / np.ptp(texture), np.uint8)


@pytest.fixture(scope="module")
def path() -> np.ndarray:
    """Where the upper left corner of each image is in the world, (n, 2)."""
    rng = np.random.default_rng(2)
    steps = rng.integers(-9, 10, (FRAMES, 2)) + np.array([2, 1])
    return np.clip(220 + np.cumsum(steps, axis=0), 20, 420)


@pytest.fixture(scope="module")
def image(world, path):
    return lambda index: world[path[index, 1] : path[index, 1] + HEIGHT, path[index, 0] : path[index, 0] + WIDTH]


def tracks_of(points: np.ndarray, path: np.ndarray) -> Tracked:
    """Exact positions of points of the world (n, 2), wherever they are seen."""
    uv = points[None] - path[:, None]
    seen = ((uv >= 0) & (uv <= [WIDTH - 1, HEIGHT - 1])).all(axis=2)
    # who leaves the image and comes back is another track
    runs = np.cumsum(np.diff(seen.astype(int), axis=0, prepend=0) == 1, axis=0)
    frame, point = np.nonzero(seen)
    track = point * FRAMES + runs[frame, point]
    size = WIDTH, HEIGHT
    return Tracked(track, frame, uv[seen].astype(np.float64), uv[seen].astype(np.float64), size, size, FRAMES)


@pytest.fixture(scope="module")
def corners(world, path) -> Tracked:
    found = cv2.goodFeaturesToTrack(world, 3000, 0.01, 6)[:, 0].astype(np.float64)
    return tracks_of(found, path)


@pytest.mark.parametrize("spoil", SPOILS)
def test_a_wrong_reading_is_named(spoil, corners, image):
    spoilt = SPOILS[spoil](corners)
    assert wrong_reading(spoilt.tracked, image) == spoilt.right


@pytest.mark.parametrize("columns", [(-1, -2), (2, -1), (-2, 1), (-2, -1)])
def test_other_orders_of_columns_are_named(columns, corners, image):
    size = np.array([HEIGHT, WIDTH]) if abs(columns[0]) == 2 else np.array([WIDTH, HEIGHT])
    places, signs = np.abs(columns) - 1, np.sign(columns)
    stated = np.empty_like(corners.uv)
    for axis, (place, sign) in enumerate(zip(places, signs, strict=True)):
        end = (WIDTH, HEIGHT)[axis] - 1
        stated[:, place] = corners.uv[:, axis] if sign > 0 else end - corners.uv[:, axis]
    assert (stated.max(axis=0) < size).all()
    assert wrong_reading(replace(corners, uv=stated), image) == Reading(columns)


def test_columns_of_another_raster_are_swapped_in_that_raster(corners, image):
    raster = (256.0, 256.0)
    at = (corners.uv + 0.5) * (np.array(raster) / corners.size)
    read = at[:, ::-1] * (np.array(corners.size) / raster) - 0.5
    assert wrong_reading(replace(corners, uv=read, raster=raster), image) == Reading((2, 1))


def test_columns_of_rays_are_swapped_about_the_centre(corners, image):
    centre = (np.array(corners.size) - 1) / 2
    read = centre + (corners.uv - centre)[:, ::-1]
    assert wrong_reading(replace(corners, uv=read, raster=None), image) == Reading((2, 1))


def test_right_tracks_of_any_quality_are_not_accused(corners, image):
    accused = {name: found for name, right in right_tracks(corners) if (found := wrong_reading(right, image))}
    assert accused == {}


def test_points_of_a_grid_are_not_accused(path, image):
    grid = np.stack(np.meshgrid(np.arange(100, 560, 9), np.arange(100, 560, 9)), axis=-1).reshape(-1, 2)
    right = tracks_of(grid.astype(np.float64), path)
    assert wrong_reading(right, image) is None
    noisy = replace(right, uv=right.uv + np.random.default_rng(0).normal(0.0, 1.5, right.uv.shape))
    assert wrong_reading(noisy, image) is None
    assert wrong_reading(SPOILS["u and v swapped"](right).tracked, image) == Reading((2, 1))


def test_a_camera_that_stands_still_determines_nothing_of_a_grid(world):
    grid = np.stack(np.meshgrid(np.arange(30, 150, 9), np.arange(20, 110, 9)), axis=-1).reshape(-1, 2)
    still = tracks_of(grid.astype(np.float64), np.zeros((FRAMES, 2), int))
    assert wrong_reading(SPOILS["v upwards"](still).tracked, lambda _: world[:HEIGHT, :WIDTH]) is None


def test_images_without_texture_determine_nothing(corners):
    blank = np.full((HEIGHT, WIDTH), 90, np.uint8)
    assert wrong_reading(corners, lambda _: blank) is None


def test_few_frames_or_tracks_determine_nothing(corners, image):
    for kept in (corners.frame < 3, corners.track == corners.track[0], corners.frame < 0):
        assert wrong_reading(SPOILS["u and v swapped"](chosen(corners, kept)).tracked, image) is None


def test_tracks_of_other_images_are_stray_where_the_images_follow_the_truth(corners, image):
    other = replace(corners, uv=corners.uv[:, ::-1] * [-0.83, 0.61] + [130.0, 17.0])
    first = np.array([np.flatnonzero(corners.track == track)[0] for track in corners.track])
    true = other.uv[first] + (corners.uv - corners.uv[first])
    assert wrong_reading(replace(other, true=true), image) == STRAY
    assert wrong_reading(replace(other, true=np.full_like(true, np.nan)), image) is None


def test_images_confirm_the_one_of_tracks_and_truth_that_is_exact(corners, image):
    moved = corners.uv + np.random.default_rng(0).normal(0.0, 1.0, corners.uv.shape)
    assert most_confirmed(replace(corners, uv=moved), image) < 0.1
    assert most_confirmed(replace(corners, true=moved), image) > 0.9


def test_images_confirm_the_part_of_the_truth_in_the_squared_differences(corners, image):
    """Errors of both are independent, of .8 and .6 px: 64 % of the squares are errors of the truth."""
    rng = np.random.default_rng(0)
    first = np.array([np.flatnonzero(corners.track == track)[0] for track in corners.track])
    uv, true = (corners.uv + rng.normal(0.0, sigma, corners.uv.shape) for sigma in (0.6, 0.8))
    true[first], uv[first] = corners.uv[first], corners.uv[first]
    assert most_confirmed(replace(corners, uv=uv, true=true), image) == pytest.approx(0.64, abs=0.15)


def test_without_a_truth_or_differences_nothing_is_confirmed(corners, image):
    assert most_confirmed(corners, image) is None
    assert most_confirmed(replace(corners, true=np.full_like(corners.uv, np.nan)), image) is None
