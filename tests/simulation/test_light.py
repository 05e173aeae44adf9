import numpy as np
import pytest

from tracknoise.simulation.light import LIGHTINGS, Lamp, PointLamp


@pytest.mark.parametrize(
    ("azimuth_deg", "elevation_deg", "towards"),
    [(0.0, 0.0, [0, 1, 0]), (90.0, 0.0, [1, 0, 0]), (270.0, 0.0, [-1, 0, 0]), (123.0, 90.0, [0, 0, 1])],
)
def test_a_lamp_stands_where_azimuth_and_elevation_say(azimuth_deg, elevation_deg, towards) -> None:
    np.testing.assert_allclose(Lamp(azimuth_deg, elevation_deg, 1.0).towards, towards, atol=1e-15)


def test_irradiance_is_the_cosine_and_none_from_behind() -> None:
    up, slanted, down = [0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [0.0, 0.0, -1.0]
    lamp = Lamp(azimuth_deg=0.0, elevation_deg=90.0, strength=0.5)
    np.testing.assert_allclose(lamp.irradiance(np.array([up, slanted, down])), [0.5, 0.4, 0.0], atol=1e-15)


def test_no_lighting_lets_a_white_surface_exceed_the_sensor_by_much() -> None:
    for lighting in LIGHTINGS.values():
        assert lighting.ambient + max(lamp.strength for lamp in lighting.lamps) <= 1.2


def test_the_default_lighting_is_among_the_named() -> None:
    assert {"default", "east", "west"} <= set(LIGHTINGS)


def test_a_point_lamp_fades_with_the_square_of_the_distance_and_the_cosine() -> None:
    lamp = PointLamp((0.0, 0.0, 2.0), strength=0.6)
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 3.0]])
    height_m = np.array([2.0, 1.0, 2.0, -1.0])  # of the lamp, above level surfaces that face up
    expected = [0.6 / 4, 0.6, 0.6 / 8 * np.sqrt(0.5), 0.0]
    np.testing.assert_allclose(lamp.irradiance(points, height_m), expected, atol=1e-15)
