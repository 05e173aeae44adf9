import numpy as np
import pytest

from tracknoise.trackers import gradient
from tracknoise.trackers.gradient import LEAST_COHERENCE, WINDOW_PX, dominant_gradient
from tracknoise.trackers.tracker import Frame

WIDTH, HEIGHT = 80, 60


def stripes(angle: float) -> np.ndarray:
    """A sine wave that rises along `angle`, 12 px long."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    return np.round(128 + 100 * np.sin((u * np.cos(angle) + v * np.sin(angle)) * 2 * np.pi / 12)).astype(np.uint8)


def between(a: np.ndarray, b: np.ndarray | float) -> np.ndarray:
    """Angle between two axes, which have no sign."""
    return np.abs((a - b + np.pi / 2) % np.pi - np.pi / 2)


def structure(image: np.ndarray, column: int, row: int) -> tuple[float, float]:
    """Orientation of the larger eigenvector of the structure tensor, and the coherence, by the book."""
    half = WINDOW_PX // 2
    patch = image[row - half - 1 : row + half + 2, column - half - 1 : column + half + 2].astype(float)
    smooth_v = patch[:-2] + 2 * patch[1:-1] + patch[2:]
    smooth_u = patch[:, :-2] + 2 * patch[:, 1:-1] + patch[:, 2:]
    du, dv = smooth_v[:, 2:] - smooth_v[:, :-2], smooth_u[2:] - smooth_u[:-2]
    values, vectors = np.linalg.eigh([[np.sum(du * du), np.sum(du * dv)], [np.sum(du * dv), np.sum(dv * dv)]])
    return float(np.arctan2(vectors[1, 1], vectors[0, 1])), float((values[1] - values[0]) / values.sum())


@pytest.mark.parametrize("degrees", [-80, -45, -10, 0, 20, 45, 70, 90])
def test_stripes_have_the_gradient_that_crosses_them(degrees):
    angles = dominant_gradient(Frame(0, stripes(np.deg2rad(degrees))), np.array([[20.0, 20.0], [41.3, 30.8]]))
    assert angles.dtype == np.float32
    np.testing.assert_allclose(angles, np.deg2rad(degrees), atol=0.03)  # pixels and Sobel's own error


def test_both_ends_of_the_vertical_axis_are_told_as_the_one_that_points_down():
    assert dominant_gradient(Frame(0, stripes(np.pi / 2)), np.array([[30.0, 30.0]])) == np.float32(np.pi / 2)


def test_it_is_the_larger_eigenvector_of_the_structure_tensor_where_one_dominates(sideways):
    image = sideways[0].image
    height, width = image.shape
    uv = np.random.default_rng(3).uniform([8, 8], [width - 9, height - 9], (400, 2))
    angles = dominant_gradient(Frame(0, image), uv)
    expected, coherence = np.array([structure(image, *np.round(place).astype(int)) for place in uv]).T
    assert (np.isnan(angles) == (coherence < LEAST_COHERENCE)).all()
    assert 10 < np.isnan(angles).sum() < 200
    assert between(angles, expected)[~np.isnan(angles)].max() < 1e-5


def test_an_even_image_and_a_round_spot_have_none():
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    spot = np.where(np.hypot(u - 40, v - 30) < 5, 200, 20).astype(np.uint8)
    for image in (np.full((HEIGHT, WIDTH), 90, np.uint8), spot):
        assert np.isnan(dominant_gradient(Frame(0, image), np.array([[40.0, 30.0]]))).all()


def test_there_is_none_where_the_window_or_its_derivatives_would_leave_the_image():
    inside = [(7.5, 30), (WIDTH - 8.6, 30), (30, 8), (30, HEIGHT - 9)]
    outside = [(7.4, 30), (WIDTH - 8.5, 30), (30, 7), (30, HEIGHT - 8), (-5, 9), (1e9, 9), (np.inf, 9), (np.nan, 9)]
    angles = dominant_gradient(Frame(0, stripes(0.3)), np.array([*inside, *outside], dtype=float))
    assert np.isfinite(angles).tolist() == [True] * len(inside) + [False] * len(outside)


def test_a_turned_image_has_turned_gradients(sideways):
    image = sideways[0].image
    width = image.shape[1]
    uv = np.random.default_rng(4).integers([10, 10], [300, 220], (100, 2)).astype(float)
    turned_uv = np.column_stack([uv[:, 1], width - 1 - uv[:, 0]])
    upright = dominant_gradient(Frame(0, image), uv)
    turned = dominant_gradient(Frame(0, np.ascontiguousarray(np.rot90(image))), turned_uv)
    assert (np.isnan(upright) == np.isnan(turned)).all()
    assert np.nanmax(between(turned, upright - np.pi / 2)) < 1e-6


def test_derivatives_are_computed_once_a_frame_and_not_where_nothing_begins(monkeypatch):
    computed, plain = [], gradient._derivatives
    monkeypatch.setattr(gradient, "_derivatives", lambda image: computed.append(1) or plain(image))
    frame = Frame(0, stripes(0.3))
    assert dominant_gradient(frame, np.empty((0, 2))).shape == (0,)
    assert dominant_gradient(frame, np.array([[1.0, 1.0]])).shape == (1,)
    assert computed == []
    for _ in range(3):
        dominant_gradient(frame, np.array([[20.0, 20.0]]))
    assert computed == [1]


@pytest.mark.parametrize("shape", [(1, 1), (3, 50), (16, 16), (17, 17)])
def test_tiny_images_do_no_harm(shape):
    image = np.random.default_rng(0).integers(0, 255, shape).astype(np.uint8)
    middle = np.array([[(shape[1] - 1) / 2, (shape[0] - 1) / 2]])
    assert dominant_gradient(Frame(0, image), middle).shape == (1,)
