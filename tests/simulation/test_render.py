from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.simulation.light import Lamp, Lighting, PointLamp
from tracknoise.simulation.ray_casting import Raycaster, surface_points
from tracknoise.simulation.render import Quality, Renderer, sample_offsets
from tracknoise.simulation.world import Quad, assemble

Facing = Callable[..., Quad]
Render = Callable[..., np.ndarray]
NORTH_LAMP, SOUTH_LAMP = Lamp(0.0, 0.0, 0.5), Lamp(180.0, 0.0, 0.5)


def plain(*greys: float) -> tuple[np.ndarray, ...]:
    return tuple(np.full((1, 1), grey, np.float32) for grey in greys)


def wall(facing: Facing, texture: np.ndarray, *, repeat_m: float):
    """A wall that fills the view, 4 m ahead, with the texture's upper left corner at its centre."""
    quad = facing(0.0, 0.0, width=16.0, height=16.0, distance=4.0)
    start = (-8.0 / repeat_m, -8.0 / repeat_m)
    return assemble([quad.dressed(0, repeat_m=repeat_m, start=start)], (texture.astype(np.float32),))


def test_an_evenly_lit_wall_shows_its_reflectance(facing: Facing, render: Render) -> None:
    np.testing.assert_allclose(render(wall(facing, plain(0.37)[0], repeat_m=1.0)), 0.37, rtol=1e-6)


def test_where_there_is_nothing_the_sky_is_seen(facing: Facing, render: Render) -> None:
    image = render(assemble([facing(0.0, 0.0, width=1.0, height=1.0, distance=4.0)], plain(0.2)))
    np.testing.assert_allclose(image[[0, 0, -1, -1], [0, -1, 0, -1]], 0.8)


def test_east_is_right_and_up_is_up(facing: Facing, render: Render) -> None:
    background = facing(0.0, 0.0, width=16.0, height=16.0, distance=5.0)
    patch = facing(1.0, 0.8, width=0.4, height=0.4, distance=4.0, texture=1)
    row, column = np.unravel_index(np.argmax(render(assemble([background, patch], plain(0.1, 0.9)))), (64, 96))
    assert (row, column) == pytest.approx((31.5 - 80 * 0.8 / 4, 47.5 + 80 * 1.0 / 4), abs=5)


@pytest.mark.parametrize("turn_deg", [(0.0, 0.0, 0.0), (10.0, -8.0, 25.0)])
@pytest.mark.parametrize("place_m", [(0.0, 0.0), (0.313, -0.171), (-0.4, 0.233)])
def test_a_small_patch_is_centred_where_its_corners_project(
    facing: Facing, render: Render, camera: Camera, north: np.ndarray, place_m, turn_deg
) -> None:
    background = facing(0.0, 0.0, width=40.0, height=40.0, distance=6.0)
    patch = facing(*place_m, width=0.7, height=0.5, distance=4.0, texture=1)
    pose = north.copy()
    pose[:3, :3] = north[:3, :3] @ Rotation.from_euler("YXZ", turn_deg, degrees=True).as_matrix()
    image = render(assemble([background, patch], plain(0.0, 1.0)), pose=pose, supersampling=8)
    moments = cv2.moments(camera.project(transform(invert(pose), patch.corners)).astype(np.float32))
    v, u = np.indices(image.shape)
    centre = np.array([(u * image).sum(), (v * image).sum()]) / image.sum()
    np.testing.assert_allclose(centre, [moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]], atol=1 / 128)
    assert image.sum() == pytest.approx(abs(moments["m00"]), rel=5e-3)


@pytest.mark.parametrize("side", [8, 64, 1024])
@pytest.mark.parametrize("shift_m", [0.0, 0.0137, 0.031])
@pytest.mark.parametrize("across", [True, False])
def test_an_edge_in_a_texture_is_where_it_projects_at_every_mip_level(
    facing: Facing, render: Render, north: np.ndarray, side: int, shift_m: float, *, across: bool
) -> None:
    """Texels of 10 px to 0.08 px: half a texel or half a pixel of offset would show."""
    dark_after_light = np.where(np.arange(side) < side // 2, 0.8, 0.2)  # so that the repeat begins with a rising edge
    texture = np.broadcast_to(dark_after_light if across else dark_after_light[:, None], (side, side))
    pose = north.copy()
    pose[:3, 3] = (-shift_m, 0.0, shift_m)  # moves the image to the right and down
    image = render(wall(facing, texture, repeat_m=4.0), pose=pose)
    first = 40 if across else 24  # of the 16 pixels around the middle
    profile = image.mean(axis=0 if across else 1)[first : first + 16]
    edge = first - 0.5 + (0.8 - profile).sum() / 0.6
    assert edge == pytest.approx((47.5 if across else 31.5) + 80.0 * shift_m / 4.0, abs=0.01)


def test_perspective_bends_no_texture(facing: Facing, camera: Camera, north: np.ndarray) -> None:
    """A smooth texture on a slanted wall, against its formula at the exact surface points."""
    slanted = Quad(np.array([-5.0, 3.0, 6.0]), np.array([16.0, 8.0, 0.0]), np.array([0.0, 0.0, -12.0]), repeat_m=8.0)
    place = (np.arange(256) + 0.5) / 256
    waves = 0.5 + 0.2 * np.sin(2 * np.pi * place) + 0.2 * np.cos(2 * np.pi * place[:, None])
    world = assemble([slanted], (waves.astype(np.float32),))
    raycaster, even = Raycaster(world), Lighting(ambient=1.0, lamps=())
    image = Renderer(world, raycaster, camera=camera, lighting=even, quality=Quality(supersampling=1)).image(north)
    v, u = np.indices(image.shape, dtype=np.float64)
    points, hit = surface_points(raycaster, camera, north, np.stack([u.ravel(), v.ravel()], axis=-1))
    assert hit.all()
    along = np.hypot(points[:, 0] + 5.0, points[:, 1] - 3.0) / 8.0
    expected = 0.5 + 0.2 * np.sin(2 * np.pi * along) + 0.2 * np.cos(2 * np.pi * (6.0 - points[:, 2]) / 8.0)
    np.testing.assert_allclose(image.ravel(), expected, atol=3e-3)


def test_a_texture_finer_than_the_pixels_is_grey(facing: Facing, render: Render) -> None:
    checkers = np.indices((64, 64)).sum(axis=0) % 2
    image = render(wall(facing, checkers, repeat_m=0.5))  # texels of 0.16 px
    assert np.abs(image - 0.5).max() < 0.02


def test_only_lamps_on_the_side_that_is_seen_count(facing: Facing, render: Render) -> None:
    front = facing(0.0, 0.0, width=16.0, height=16.0, distance=4.0)
    for quad in (front, front.reversed()):
        world = assemble([quad], plain(0.5))
        np.testing.assert_allclose(render(world, Lighting(0.2, (NORTH_LAMP,))), 0.5 * 0.2, rtol=1e-6)
        np.testing.assert_allclose(render(world, Lighting(0.2, (SOUTH_LAMP,))), 0.5 * 0.7, rtol=1e-6)
        np.testing.assert_allclose(render(world, Lighting(0.2, (Lamp(180.0, 60.0, 0.5),))), 0.5 * 0.45, rtol=1e-6)


def test_shadows_fall_where_a_surface_blocks_the_lamp(facing: Facing, render: Render) -> None:
    back = facing(0.0, 0.0, width=16.0, height=16.0, distance=4.0)
    block = facing(0.0, 0.0, width=1.0, height=1.0, distance=-2.0)  # behind the camera
    world, lighting = assemble([back, block], plain(1.0)), Lighting(0.2, (SOUTH_LAMP,))
    open_light, shaded = render(world, lighting), render(world, lighting, shadows=True)
    np.testing.assert_allclose(open_light, 0.7, rtol=1e-6)
    np.testing.assert_allclose(shaded[[31, 5], [47, 5]], [0.2, 0.7], rtol=1e-6)
    assert np.count_nonzero(shaded < 0.3) == pytest.approx(20 * 20, abs=41)  # 1 m at 4 m is 20 px


@pytest.mark.parametrize("tilt_m", [0.0, 2.0])
def test_a_point_lamp_lights_each_point_by_its_own_distance_and_angle(
    camera: Camera, north: np.ndarray, render: Render, tilt_m: float
) -> None:
    lamp = PointLamp((1.5, 1.0, 0.7), strength=3.0)
    wall = Quad(np.array([-8.0, 4.0, 8.0]), np.array([16.0, tilt_m, 0.0]), np.array([0.0, 0.0, -16.0]))
    world = assemble([wall.dressed(0, repeat_m=1.0, start=(0.0, 0.0))], plain(0.5))
    image = render(world, Lighting(0.1, point_lamps=(lamp,)), supersampling=1)
    v, u = np.indices(image.shape, dtype=np.float64)
    points, _ = surface_points(Raycaster(world), camera, north, np.stack([u.ravel(), v.ravel()], axis=-1))
    towards = np.array(lamp.position_m) - points
    distance = np.linalg.norm(towards, axis=1)
    cosine = towards @ np.array([tilt_m, -16.0, 0.0]) / np.hypot(tilt_m, 16.0) / distance
    np.testing.assert_allclose(image.ravel(), 0.5 * (0.1 + 3.0 * cosine / distance**2), rtol=1e-5)


def test_a_point_lamp_behind_the_wall_does_not_light_it(facing: Facing, render: Render) -> None:
    front = facing(0.0, 0.0, width=16.0, height=16.0, distance=4.0)
    behind = Lighting(0.2, point_lamps=(PointLamp((0.0, 5.0, 0.0), 1.0),))
    for quad in (front, front.reversed()):
        np.testing.assert_allclose(render(assemble([quad], plain(0.5)), behind), 0.5 * 0.2, rtol=1e-6)


def test_shadows_of_point_lamps_spread_with_the_distance(facing: Facing, render: Render) -> None:
    """Halfway between lamp and wall, a block from x = 0.5 m to 1.5 m throws a shadow from -1 m to 1 m: 40 x 40 px."""
    back = facing(0.0, 0.0, width=16.0, height=16.0, distance=4.0)
    block = facing(1.0, 0.0, width=1.0, height=1.0, distance=1.0)
    lighting = Lighting(0.2, point_lamps=(PointLamp((2.0, -2.0, 0.0), 10.0),))
    world = assemble([back, block], plain(1.0))
    shaded, bright = render(world, lighting, shadows=True), render(world, lighting)
    shadow = np.zeros_like(shaded, np.bool_)
    shadow[12:52, 28:68] = True
    np.testing.assert_allclose(shaded[shadow], 0.2, rtol=1e-6)
    np.testing.assert_array_equal(shaded[~shadow], bright[~shadow])
    assert bright.min() > 0.3


def test_lamps_add_up(facing: Facing, camera: Camera, north: np.ndarray, render: Render) -> None:
    world = wall(facing, np.random.default_rng(0).uniform(0.2, 0.8, (64, 64)), repeat_m=3.0)
    lamps = (PointLamp((1.0, 0.0, 1.0), 3.0), PointLamp((-1.0, 1.0, 0.0), 2.0))
    for shadows in (False, True):
        renderer = Renderer(
            world,
            Raycaster(world),
            camera=camera,
            lighting=Lighting(0.1, point_lamps=lamps),
            quality=Quality(supersampling=2, shadows=shadows),
        )
        each = renderer.images_by_lamp(north)
        assert len(each) == 2
        for image, lamp in zip(each, lamps, strict=True):
            alone = render(world, Lighting(0.1, point_lamps=(lamp,)), supersampling=2, shadows=shadows)
            np.testing.assert_allclose(image, alone, rtol=1e-6)
        together, ambient = renderer.image(north), render(world, Lighting(0.1), supersampling=2)
        np.testing.assert_allclose(together, each[0] + each[1] - ambient, rtol=1e-5)


@pytest.mark.parametrize("supersampling", [1, 2, 3, 4])
def test_rays_spread_evenly_and_symmetrically_over_the_pixel(supersampling: int) -> None:
    offsets = sample_offsets(supersampling)
    evenly = (np.arange(supersampling**2) + 0.5) / supersampling**2 - 0.5
    for coordinate in offsets.T:
        np.testing.assert_allclose(np.sort(coordinate), evenly, atol=1e-15)
    mirrored = {tuple(place) for place in np.round(-offsets, 12) + 0.0}
    assert mirrored == {tuple(place) for place in np.round(offsets, 12) + 0.0}
    cells = np.floor((offsets + 0.5) * supersampling)
    assert len(np.unique(cells, axis=0)) == supersampling**2


def test_at_least_one_ray_a_pixel_is_needed() -> None:
    with pytest.raises(ValueError, match="supersampling must be at least 1, not 0"):
        Quality(supersampling=0)


def test_a_ray_along_the_ground_sees_the_sky(north: np.ndarray) -> None:
    """The middle row never meets the plane of the only surface."""
    camera = Camera(9, 9, 10.0, 10.0, 4.0, 4.0)
    ground = Quad(np.array([-50.0, 50.0, -1.0]), np.array([100.0, 0.0, 0.0]), np.array([0.0, -100.0, 0.0]))
    world = assemble([ground], plain(0.3))
    even, once = Lighting(ambient=1.0, lamps=()), Quality(supersampling=1)
    image = Renderer(world, Raycaster(world), camera=camera, lighting=even, quality=once).image(north)
    np.testing.assert_allclose(image[:, 4], [0.8] * 5 + [0.3] * 4)


def test_a_surface_without_texture_coordinates_has_one_grey(facing: Facing, render: Render) -> None:
    world = assemble([facing(0.0, 0.0, width=16.0, height=16.0, distance=4.0)], plain(0.6))
    np.testing.assert_allclose(render(replace(world, corner_uv=np.zeros((2, 3, 2)))), 0.6, rtol=1e-6)
