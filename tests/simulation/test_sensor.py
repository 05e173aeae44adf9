from typing import Any

import numpy as np
import pytest

from tracknoise.geometry.cameras import Camera
from tracknoise.simulation.imaging import AutoExposure, Imaging, Sensor, expose


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


CAMERA = Camera(400, 300, 300.0, 300.0, 199.5, 149.5)
GREY = np.full((300, 400), 0.5, np.float32)


def image(index: int = 0, light: np.ndarray = GREY, sigma: float = 0.0, noise: int = 0, **options: Any) -> np.ndarray:
    sensor = Sensor(CAMERA, Imaging(**options), noise_sigma=sigma, pattern=np.random.default_rng(1))
    return sensor.image(light, index, np.random.default_rng([2, noise]))


def test_without_effects_the_image_is_what_exposure_alone_gives() -> None:
    light = np.random.default_rng(3).uniform(0.0, 1.2, (300, 400)).astype(np.float32)
    np.testing.assert_array_equal(image(light=light, sigma=2.0), expose(light, 2.0, np.random.default_rng([2, 0])))


def test_the_variance_of_photon_noise_is_proportional_to_the_light() -> None:
    dark, bright = (image(light=GREY * share, photon_gain=0.2).astype(float) for share in (0.5, 1.0))
    for grey, found in ((63.75, dark), (127.5, bright)):
        assert found.mean() == pytest.approx(grey, abs=0.05)
        assert found.var() == pytest.approx(0.2 * grey + 1 / 12, rel=0.03)


def test_the_fixed_pattern_is_the_same_in_every_frame_and_has_the_stated_size() -> None:
    first, second = (image(noise=noise, prnu=0.03, dsnu=2.0) for noise in (0, 1))
    np.testing.assert_array_equal(first, second)
    assert first.std() == pytest.approx(np.hypot(0.03 * 127.5, 2.0), rel=0.03)


def test_sensitivity_scales_with_light_and_offset_does_not() -> None:
    sensitivity, offset = (
        [image(light=GREY * share, **options).astype(float).std() for share in (0.5, 1.0)]
        for options in ({"prnu": 0.05}, {"dsnu": 4.0})
    )
    assert sensitivity[1] / sensitivity[0] == pytest.approx(2.0, rel=0.03)
    assert offset[1] / offset[0] == pytest.approx(1.0, rel=0.03)


def test_vignetting_leaves_the_centre_and_takes_the_stated_share_in_the_corner() -> None:
    shaded = image(vignetting=0.4)
    assert shaded[150, 200] in (127, 128)
    assert shaded[0, 0] == shaded[-1, -1] == round(0.6 * 127.5)
    half = 199.5**2 / (199.5**2 + 149.5**2)  # at the middle of the right side
    assert shaded[150, -1] == pytest.approx(127.5 * (1 - 0.4 * half), abs=0.6)


def test_gain_multiplies_the_light() -> None:
    step = AutoExposure(light_step=1.5, period_frames=5, delay_frames=1)
    assert [image(index, auto_exposure=step)[0, 0] for index in (4, 5, 6, 10)] == [128, 191, 128, 85]


def test_jpeg_changes_more_at_lower_quality_and_keeps_the_mean() -> None:
    light = np.random.default_rng(3).uniform(0.2, 0.8, (300, 400)).astype(np.float32)
    plain = image(light=light).astype(float)
    differences = [image(light=light, jpeg_quality=quality) - plain for quality in (95, 50)]
    assert 0.5 < np.abs(differences[0]).mean() < np.abs(differences[1]).mean() / 3
    assert max(abs(difference.mean()) for difference in differences) < 0.2
