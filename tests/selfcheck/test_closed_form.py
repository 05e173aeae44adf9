"""The closed forms against each other, and against numbers worked out by hand."""

import numpy as np
import pytest
from benchmarks.selfcheck.known_worlds import (
    NOTHING,
    Pinhole,
    Scene,
    about,
    depth_maps,
    occluded_scene,
    panel,
    product,
    rotation_of,
    turned,
)
from scipy.spatial.transform import Rotation

CAMERA = Pinhole(40, 30, fx=20.0, fy=10.0, cx=19.5, cy=14.5)


def still(panels: list[np.ndarray]) -> Scene:
    """A camera at the origin that looks along z, for one frame."""
    return Scene(CAMERA, np.array(panels), np.array([[0.0, 0.0, 0.0, 1.0]]), np.zeros((1, 3)))


def test_a_wall_across_the_axis_has_one_depth_and_the_image_is_similar():
    scene = still([panel((-50.0, -50.0, 4.0), (100.0, 0.0, 0.0), (0.0, 100.0, 0.0))])
    uv = np.array([[19.5, 14.5], [29.5, 19.5]])
    depth, seen = scene.look(np.zeros(2, dtype=np.int64), uv)
    assert depth.tolist() == pytest.approx([4.0, 4.0])
    assert seen.tolist() == [0, 0]
    points = scene.world(np.zeros(2, dtype=np.int64), uv, depth)
    assert points.ravel().tolist() == pytest.approx([0.0, 0.0, 4.0, 2.0, 2.0, 4.0])
    assert scene.images(points)[0][:, 0].ravel().tolist() == pytest.approx(uv.ravel().tolist())


def test_the_nearer_panel_is_seen_and_rays_beside_all_panels_meet_nothing():
    near = panel((0.0, -1.0, 2.0), (1.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    far = panel((-1.0, -1.0, 4.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    uv = np.array([[20.5, 14.5], [18.5, 14.5], [0.0, 14.5]])
    depth, seen = still([far, near]).look(np.zeros(3, dtype=np.int64), uv)
    assert depth[:2].tolist() == pytest.approx([2.0, 4.0])
    assert seen.tolist() == [1, 0, NOTHING]


def test_rotations_are_those_of_their_quaternions():
    quaternions = product(about((1.0, 2.0, 3.0), np.array([0.7, -2.0])), about((0.0, 1.0, 0.0), np.array([0.1, 3.0])))
    assert np.allclose(rotation_of(quaternions), Rotation.from_quat(quaternions).as_matrix(), atol=1e-12)
    first, second = (rotation_of(about(axis, np.array([0.3])))[0] for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    both = product(about((1.0, 0.0, 0.0), np.array([0.3])), about((0.0, 0.0, 1.0), np.array([0.3])))
    assert np.allclose(rotation_of(both)[0], first @ second, atol=1e-12)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_every_point_that_is_seen_has_its_image_where_it_is_seen(number):
    scene = occluded_scene(number, n_frames=12)
    uv = np.random.default_rng(number).uniform(0, (119, 89), (500, 2))
    frame = np.random.default_rng(number).integers(0, 12, 500)
    depth, seen = scene.look(frame, uv)
    assert set(seen) == {0, 1}
    images, depths = scene.images(scene.world(frame, uv, depth))
    assert np.allclose(images[np.arange(500), frame], uv, atol=1e-9)
    assert np.allclose(depths[np.arange(500), frame], depth, atol=1e-9)


def test_the_wall_fills_the_image_and_the_board_is_far_in_front_of_it():
    depth = depth_maps(occluded_scene(0, n_frames=2))
    assert np.isfinite(depth).all()
    step = np.abs(np.diff(depth, axis=2)) / np.minimum(depth[..., 1:], depth[..., :-1])
    assert (step > 0.5).any()  # at the outline, where the package calls the edge at 2 %
    assert not ((step > 0.015) & (step < 0.5)).any()


def test_four_quarter_turns_are_none():
    uv = np.array([[3.0, 1.0]])
    assert turned(uv, 40, 30, 1).tolist() == [[1.0, 36.0]]
    assert turned(uv, 40, 30, 2).tolist() == [[36.0, 28.0]]
    assert turned(uv, 40, 30, 4).tolist() == uv.tolist()
