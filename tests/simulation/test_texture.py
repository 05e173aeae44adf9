import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from tracknoise.simulation.textures import Atlas

COUNT = 500


@pytest.fixture
def textures() -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(3)
    return tuple(rng.random((side, side), dtype=np.float32) for side in (16, 1, 8))


@pytest.fixture
def places() -> tuple[np.ndarray, np.ndarray]:
    """Positions in repeats, far from the first repeat too."""
    s, t = np.random.default_rng(4).uniform(-40.0, 40.0, (2, COUNT))
    return s, t


def read(atlas: Atlas, texture: int, s: np.ndarray, t: np.ndarray, footprint: float) -> np.ndarray:
    return atlas.read(np.full(len(s), texture), s, t, np.full(len(s), footprint, np.float32))


def bilinear(image: np.ndarray, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The same by SciPy, in float64."""
    side = len(image)
    return map_coordinates(image.astype(np.float64), [t * side - 0.5, s * side - 0.5], order=1, mode="grid-wrap")


@pytest.mark.parametrize("texture", [0, 1, 2])
def test_the_finest_level_is_read_bilinearly_without_rounding(textures, places, texture: int) -> None:
    got = read(Atlas(textures), texture, *places, footprint=0.3)
    np.testing.assert_allclose(got, bilinear(textures[texture], *places), atol=3e-5)


def test_a_footprint_of_two_texels_sees_means_of_two_by_two(textures, places) -> None:
    means = textures[0].reshape(8, 2, 8, 2).mean(axis=(1, 3))
    got = read(Atlas(textures), 0, *places, footprint=2.0)
    np.testing.assert_allclose(got, bilinear(means, *places), atol=3e-5)


def test_between_levels_both_are_blended(textures, places) -> None:
    atlas = Atlas(textures)
    fine, coarse = (read(atlas, 2, *places, footprint=size) for size in (2.0, 4.0))
    got = read(atlas, 2, *places, footprint=2.0**1.25)
    np.testing.assert_allclose(got, 0.75 * fine + 0.25 * coarse, atol=1e-5)


def test_a_huge_footprint_sees_the_mean_of_all(textures, places) -> None:
    got = read(Atlas(textures), 0, *places, footprint=1e6)
    np.testing.assert_allclose(got, textures[0].mean(), atol=1e-6)


def test_textures_can_be_mixed_in_one_call(textures, places) -> None:
    atlas, which = Atlas(textures), np.arange(COUNT) % 3
    mixed = atlas.read(which, *places, np.ones(COUNT, np.float32))
    for texture in range(3):
        alone = read(atlas, texture, *places, footprint=1.0)
        np.testing.assert_array_equal(mixed[which == texture], alone[which == texture])


def test_sides_are_those_of_the_textures(textures) -> None:
    np.testing.assert_array_equal(Atlas(textures).side(np.array([2, 0, 1])), [8, 16, 1])
