import numpy as np
import pytest

from tracknoise.simulation.textures import CLOUDS, GROUND, MASONRY, Recipe, paint

RECIPES = [CLOUDS, GROUND, MASONRY]


@pytest.mark.parametrize("recipe", RECIPES)
def test_textures_are_reflectances(recipe: Recipe) -> None:
    texture = paint(recipe, 128, np.random.default_rng(0))
    assert texture.shape == (128, 128)
    assert texture.dtype == np.float32
    assert texture.min() >= 0.03
    assert texture.max() <= 0.97
    assert 0.05 < texture.std() < 0.35


def test_the_generator_decides() -> None:
    first, again, other = (paint(MASONRY, 64, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).mean() > 0.05


def test_the_natural_part_has_the_spectrum_it_states() -> None:
    texture = paint(Recipe(exponent=1.0, mean=0.5, contrast=0.05, shapes=0), 256, np.random.default_rng(0))
    amplitude = np.abs(np.fft.fft2(texture - texture.mean()))
    frequency = np.hypot(np.fft.fftfreq(256)[:, None], np.fft.fftfreq(256))
    inside = (frequency > 0.02) & (frequency < 0.4)
    slope, _ = np.polyfit(np.log(frequency[inside]), np.log(amplitude[inside]), 1)
    assert slope == pytest.approx(-1.0, abs=0.03)


def test_the_natural_part_repeats_without_a_seam() -> None:
    texture = paint(Recipe(exponent=1.0, mean=0.5, contrast=0.1, shapes=0), 256, np.random.default_rng(0))
    inside, seam = np.abs(np.diff(texture, axis=1)).mean(), np.abs(texture[:, 0] - texture[:, -1]).mean()
    assert seam < 1.3 * inside


def test_shapes_have_crisp_edges() -> None:
    smooth = Recipe(exponent=2.0, mean=0.5, contrast=0.05, shapes=0)
    crisp = Recipe(exponent=2.0, mean=0.5, contrast=0.05, shapes=40)
    steps = [np.abs(np.diff(paint(recipe, 256, np.random.default_rng(0)), axis=1)) for recipe in (smooth, crisp)]
    assert steps[0].max() < 0.03
    assert steps[1].max() > 0.3
