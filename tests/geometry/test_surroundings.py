"""Depth edges and angles of incidence, against scenes whose geometry is known in closed form."""

import numpy as np
import pytest

from tracknoise.geometry.accuracy import EXACT_DEPTH, DepthAccuracy
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.surroundings import (
    REACH_PX,
    Surroundings,
    around,
    find_surroundings,
    joined_surroundings,
    unknown_surroundings,
)

CAMERA = Camera(640, 480, 500.0, 480.0, 319.5, 239.5)


def look(uv, depth, known=lambda uv: np.ones(len(uv), bool), accuracy=EXACT_DEPTH) -> Surroundings:
    uv = np.asarray(uv, float)
    return find_surroundings(CAMERA, uv, depth(around(uv)), known(around(uv)), accuracy)


def step(angle_deg: float, *, near_m: float = 2.0, far_m: float = 3.0, at=(320.0, 240.0)):
    """A straight edge through a point: near where the component along the angle is positive, far elsewhere."""
    normal = np.array([np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))])
    return normal, lambda uv: np.where((uv - at) @ normal > 0, near_m, far_m)


@pytest.mark.parametrize("angle_deg", [0.0, 10.0, 15.0, 45.0, 97.0, 200.0, 311.0])
def test_the_distance_of_a_straight_edge_has_the_sign_of_its_side(angle_deg: float) -> None:
    normal, depth = step(angle_deg)
    distances = np.array([-14.0, -8.3, -3.0, -0.7, 0.7, 2.5, 6.0, 13.9])
    found = look(np.array([320.0, 240.0]) + distances[:, None] * normal, depth).edge_px
    assert (np.sign(found) == np.sign(distances)).all()
    assert np.abs(found - distances) == pytest.approx(0.0, abs=1.0 + 0.08 * 14)
    assert np.abs(found - distances).mean() < 0.75


def test_no_edge_in_reach_is_infinite_and_unknown_depth_is_unknown() -> None:
    normal, depth = step(30.0)
    there = np.array([320.0, 240.0]) + np.array([[REACH_PX + 2.0], [-REACH_PX - 2.0]]) * normal
    assert np.isposinf(look(there, depth).edge_px).all()
    nothing = look(there, depth, known=lambda uv: np.zeros(len(uv), bool))
    assert np.isnan(nothing.edge_px).all()
    assert np.isnan(nothing.incidence_deg).all()
    assert look(np.empty((0, 2)), depth).edge_px.shape == (0,)


def test_the_relative_step_decides_and_the_accuracy_of_depth_widens_it() -> None:
    small, large = (step(0.0, near_m=2.0, far_m=2.0 * (1 + share))[1] for share in (0.019, 0.021))
    there = [[323.0, 240.0]]
    assert np.isinf(look(there, small).edge_px).all()
    assert look(there, large).edge_px == pytest.approx(3.0, abs=0.5)
    assert np.isinf(look(there, large, accuracy=DepthAccuracy(0.01, 0.0)).edge_px).all()


def test_an_edge_belongs_to_the_nearer_surface_where_depth_is_missing_beside_it() -> None:
    _, depth = step(0.0)
    hole = lambda uv: ~((uv[:, 0] > 312.0) & (uv[:, 0] <= 320.0))  # noqa: E731 - far side, next to the edge
    assert look([[326.0, 240.0]], depth, hole).edge_px == pytest.approx(6.0, abs=0.5)
    assert look([[310.0, 240.0]], depth, hole).edge_px == pytest.approx(-10.0, abs=1.0)


def test_a_slope_across_a_hole_is_no_edge() -> None:
    slanted = lambda uv: 2.0 / (1.0 - 0.004 * (uv[:, 0] - 320.0))  # noqa: E731 - 0.4 % per px, a plane
    hole = lambda uv: ~((uv[:, 0] > 322.0) & (uv[:, 0] < 332.0))  # noqa: E731
    assert np.isinf(look([[319.0, 240.0]], slanted, hole).edge_px).all()


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, -1.0), (0.6, 0.8), (-0.9, 0.436)])
def test_a_steep_plane_and_a_crease_are_no_edges(direction: tuple[float, float]) -> None:
    """Depth changes by up to 5 % per px on the plane; behind the crease it is constant."""
    along = lambda uv: (uv - (320.0, 240.0)) @ np.array(direction)  # noqa: E731
    steep = lambda uv: 1.0 / (0.1 - 0.002 * along(uv))  # noqa: E731 - 20 m at the crease, 2 % to 5 % per px
    crease = lambda uv: np.minimum(steep(uv), 15.0)  # noqa: E731
    rng = np.random.default_rng(2)
    uv = np.array([320.0, 240.0]) + rng.uniform(-12.0, 12.0, (300, 2))
    assert np.isinf(look(uv, steep).edge_px).all()
    assert np.isinf(look(uv, crease).edge_px).all()


def test_nothing_behind_a_surface_is_an_edge_of_its_near_side() -> None:
    depth = lambda uv: np.where(uv[:, 0] > 320.0, 2.0, np.inf)  # noqa: E731
    found = look([[324.0, 240.0], [318.0, 240.0]], depth)
    assert found.edge_px[0] == pytest.approx(4.0, abs=0.5)
    assert np.isnan(found.edge_px[1])


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (20.0, 0.0), (0.0, -50.0), (40.0, 60.0), (-30.0, 15.0)])
def test_the_angle_of_incidence_is_that_of_the_plane(tilt: tuple[float, float]) -> None:
    a, b = np.tan(np.deg2rad(tilt))
    normal = np.array([a, b, 1.0]) / np.linalg.norm([a, b, 1.0])
    uv = np.array([[319.5, 239.5], [100.0, 60.0], [550.0, 400.0]])
    rays = CAMERA.bearings(uv)
    found = look(uv, lambda at: 4.0 * normal[2] / (CAMERA.bearings(at) @ normal)).incidence_deg
    facing = rays @ normal > 0
    expected = np.rad2deg(np.arccos(np.abs(rays @ normal) / np.linalg.norm(rays, axis=1)))
    assert found[facing] == pytest.approx(expected[facing], abs=1e-6)


def test_the_plane_is_that_of_the_surface_on_which_the_point_lies() -> None:
    depth = lambda uv: np.where(uv[:, 0] > 320.0, 2.0, 5.0 - 0.01 * uv[:, 1])  # noqa: E731
    found = look([[322.0, 239.5]], depth).incidence_deg
    ray = CAMERA.bearings(np.array([[322.0, 239.5]]))[0]
    assert found == pytest.approx(np.rad2deg(np.arccos(1 / np.linalg.norm(ray))), abs=1e-6)


def test_points_stay_in_order_when_parts_are_joined() -> None:
    parts = [Surroundings(np.array([1.0, -2.0]), np.array([3.0, 4.0])), unknown_surroundings(1)]
    joined = joined_surroundings(parts)
    np.testing.assert_array_equal(joined.edge_px, [1.0, -2.0, np.nan])
    np.testing.assert_array_equal(joined.incidence_deg, [3.0, 4.0, np.nan])
    assert joined_surroundings([]).edge_px.shape == (0,)
