import numpy as np
import pytest

from tracknoise.geometry.pose import invert, transform
from tracknoise.paper.light_stage import KEY_FRAME, LightStage, arc, led_positions, stage_camera

SIZE = {"width": 96, "height": 72}


@pytest.fixture(scope="module")
def stage() -> LightStage:
    return LightStage(1, **SIZE)


def test_the_arc_goes_from_left_to_right_about_the_middle() -> None:
    poses = arc()
    assert poses.shape == (49, 4, 4)
    centres, axes = poses[:, :3, 3], poses[:, :3, 2]
    target = centres + 0.6 * axes
    np.testing.assert_allclose(target, np.broadcast_to(target[0], target.shape), atol=1e-12)
    assert (np.diff(centres[:, 0]) > 0).all()
    np.testing.assert_allclose(poses[KEY_FRAME, :3, 0], (1, 0, 0), atol=1e-12)
    ends = centres[[0, -1], :2] - target[0, :2]
    np.testing.assert_allclose(np.rad2deg(np.arctan2(ends[:, 0], -ends[:, 1])), (-40, 40))


def test_the_middle_is_seen_at_the_principal_point(stage: LightStage) -> None:
    for pose in stage.world_from_camera[::8]:
        middle = stage.camera.project(transform(invert(pose), np.array([[0.0, 0.0, 0.04]])))
        np.testing.assert_allclose(middle, [[stage.camera.cx, stage.camera.cy]], atol=1e-9)


def test_the_camera_is_like_dtus() -> None:
    camera = stage_camera(1600, 1200)
    assert (camera.fx, camera.fy) == (2900.0, 2904.0)
    assert camera.cx != 799.5
    half = stage_camera(800, 600)
    assert (half.fx, half.width) == (1450.0, 800)


def test_leds_are_in_rows_from_the_back_to_the_front() -> None:
    leds = led_positions()
    assert leds.shape == (19, 3)
    np.testing.assert_allclose(leds.mean(axis=0), (0, 0, 0.9), atol=1e-12)
    distance = np.linalg.norm(leds[:, None] - leds, axis=2)
    np.testing.assert_allclose(np.sort(distance, axis=1)[:, 1], 0.25)
    assert (np.diff(leds[:, 1]) <= 1e-12).all()
    assert leds[7, 0] == -0.5


def test_every_pixel_of_every_position_sees_the_table_or_what_stands_on_it(stage: LightStage) -> None:
    corners = np.array([[-0.5, -0.5], [95.5, -0.5], [-0.5, 71.5], [95.5, 71.5]])
    uv = np.concatenate([corners, np.random.default_rng(0).uniform(0, 71, (500, 2))])
    for index in range(0, 49, 6):
        points, hit = stage.cast(index, uv)
        assert hit.all()
        assert (points[:, 2] > -1e-9).all()
        assert (points[:, 2] < 0.2).all()
    assert (points[:, 2] > 0.01).mean() > 0.2


def test_leds_shine_from_where_they_are(stage: LightStage) -> None:
    """The side of the image on which an LED stands is brighter in its light than in that of all."""
    images = np.stack(list(stage.images(KEY_FRAME))).astype(float)
    assert images.shape == (19, 72, 96)
    relative = images / images.mean(axis=0)
    assert relative[7, :, :24].mean() > relative[7, :, -24:].mean() + 0.1  # far left
    assert relative[11, :, -24:].mean() > relative[11, :, :24].mean() + 0.1  # far right
    assert relative[1, :12].mean() > relative[17, :12].mean()  # the back lies at the top
    assert images.max() <= 255
    assert 40 < images.mean() < 130


def test_images_depend_on_nothing_but_scene_seed_and_position(stage: LightStage) -> None:
    again = LightStage(1, **SIZE)
    for one, other in zip(again.images(3), stage.images(3), strict=True):
        np.testing.assert_array_equal(one, other)
    first = next(stage.images(3))
    for different in (LightStage(2, **SIZE), LightStage(1, seed=1, **SIZE)):
        assert np.abs(next(different.images(3)).astype(int) - first).mean() > 5


def test_noise_differs_between_leds_and_positions(stage: LightStage) -> None:
    quiet = LightStage(1, noise_sigma=0.0, **SIZE)
    noise = [image.astype(float) - clean for image, clean in zip(stage.images(3), quiet.images(3), strict=True)]
    assert np.std(noise) == pytest.approx(2.0, abs=0.1)
    assert abs(np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]) < 0.06


def test_the_scan_lies_on_the_surface_within_its_range(stage: LightStage) -> None:
    scan = stage.scan(step_px=3.0)
    pose = stage.world_from_camera[KEY_FRAME]
    uv = stage.camera.project(transform(invert(pose), scan))
    assert stage.camera.contains(uv).all()
    points, _ = stage.cast(KEY_FRAME, uv)
    np.testing.assert_allclose(points, scan, atol=1e-9)
    distance = np.linalg.norm(scan - (0, 0, 0.04), axis=1)
    assert 0.2 < distance.max() <= 0.25
    np.testing.assert_allclose(np.diff(np.unique(np.round(uv, 6).T[0])), 3.0, atol=1e-5)
    np.testing.assert_allclose(np.diff(np.unique(np.round(uv, 6).T[1])), 3.0, atol=1e-5)


def test_the_scan_has_a_point_within_a_quarter_of_a_pixel_of_the_halved_image(stage: LightStage) -> None:
    """Corners lie at whole pixels of the halved image: a grid that fits the full image's pixels would miss them all."""
    uv = stage.camera.project(transform(invert(stage.world_from_camera[KEY_FRAME]), stage.scan()))
    used = (uv - 0.5) / 2.0
    near = {tuple(pixel) for pixel in np.rint(used[np.linalg.norm(used - np.rint(used), axis=1) <= 0.25]).astype(int)}
    middle = {(u, v) for u in range(16, 32) for v in range(18, 30)}
    assert len(middle - near) <= 0.05 * len(middle)
