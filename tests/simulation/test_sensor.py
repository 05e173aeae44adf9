import numpy as np

from tracknoise.simulation.sensor import expose


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_without_noise_irradiance_is_scaled_rounded_and_clipped() -> None:
    irradiance = np.array([[-0.1, 0.0, 100.4 / 255, 100.6 / 255, 1.0, 1.5]], np.float32)
    np.testing.assert_array_equal(expose(irradiance, 0.0, rng()), np.array([[0, 0, 100, 101, 255, 255]], np.uint8))


def test_noise_has_the_stated_size_and_no_bias() -> None:
    image = expose(np.full((300, 400), 0.5, np.float32), 3.0, rng()).astype(np.float64)
    assert abs(image.mean() - 127.5) < 0.05
    assert abs(image.std() - np.hypot(3.0, np.sqrt(1 / 12))) < 0.05


def test_the_irradiance_is_left_alone() -> None:
    irradiance = np.full((2, 2), 0.5, np.float32)
    expose(irradiance, 3.0, rng())
    assert np.all(irradiance == 0.5)
