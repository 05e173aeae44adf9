import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.geometry.cameras import Camera, EquidistantCamera
from tracknoise.geometry.depth import DepthMap, farthest_neighbour, interpolate, nearest, sample

CAMERA = Camera(32, 24, 30.0, 30.0, 15.5, 11.5)


def whole(depth: np.ndarray) -> DepthMap:
    return DepthMap(depth, np.ones(depth.shape, bool))


def plane(normal: np.ndarray, distance_m: float, uv: np.ndarray) -> np.ndarray:
    """Depth of the plane normal . X = distance along the rays of pixels: closed form."""
    return distance_m / (CAMERA.bearings(uv) @ normal)


def pixels() -> np.ndarray:
    u, v = np.meshgrid(np.arange(32.0), np.arange(24.0))
    return np.stack([u, v], axis=-1)


@given(
    st.floats(-0.08, 0.08),
    st.floats(-0.08, 0.08),
    st.lists(st.tuples(st.floats(0, 31), st.floats(0, 23)), min_size=1, max_size=20),
)
def test_exact_on_every_slanted_plane(slant_x, slant_y, positions):
    normal = np.array([slant_x, slant_y, 1.0])
    uv = np.array(positions)
    sample = interpolate(whole(plane(normal, 3.0, pixels())), uv, CAMERA)
    assert sample.valid.all()
    np.testing.assert_allclose(sample.depth_m, plane(normal, 3.0, uv), rtol=1e-12)


def test_the_depth_at_a_pixel_centre_is_that_pixel_s():
    depth = 2.0 + 0.001 * np.arange(24 * 32).reshape(24, 32) % 0.01
    sample = interpolate(whole(depth), np.array([[3.0, 7.0], [0.0, 0.0], [31.0, 23.0], [31.0, 5.0]]), CAMERA)
    np.testing.assert_allclose(sample.depth_m, depth[[7, 0, 23, 5], [3, 0, 31, 31]], rtol=1e-15)
    assert sample.valid.all()


@given(st.floats(0, 31), st.floats(0, 23), st.integers(0, 2**32 - 1))
def test_lies_between_its_neighbours(u, v, seed):
    depth = np.random.default_rng(seed).uniform(5.0, 5.09, (24, 32))
    sample = interpolate(whole(depth), np.array([[u, v]]), CAMERA)
    corners = depth[np.ix_([int(v), min(int(v) + 1, 23)], [int(u), min(int(u) + 1, 31)])]
    assert sample.valid[0]
    assert corners.min() - 1e-12 <= sample.depth_m[0] <= corners.max() + 1e-12


def test_a_step_is_an_edge_and_a_hole_is_unknown():
    depth = np.full((24, 32), 2.0)
    depth[:, 16:] = 3.0
    holed = whole(depth)
    holed.valid[10, 4] = False
    uv = np.array([[15.5, 3.0], [14.9, 3.0], [16.1, 3.0], [3.5, 9.5], [2.9, 9.5]])
    sample = interpolate(holed, uv, CAMERA)
    assert sample.edge.tolist() == [True, False, False, False, False]
    assert sample.valid.tolist() == [False, True, True, False, True]


FISHEYE = EquidistantCamera(256, 192, 60.0, 60.0, 127.5, 95.5)
"""Depths are tried up to 78 degrees from the axis."""


def fisheye_pixels() -> tuple[np.ndarray, np.ndarray]:
    """Which pixels lie within these, and the rays of all, of length 1."""
    u, v = np.meshgrid(np.arange(256.0), np.arange(192.0))
    return np.hypot(u - 127.5, v - 95.5) < 60.0 * np.radians(78.0), unit_rays(np.stack([u, v], axis=-1))


def unit_rays(uv: np.ndarray) -> np.ndarray:
    rays = FISHEYE.bearings(uv.reshape(-1, 2)).reshape(*uv.shape[:-1], 3)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def sphere(rays: np.ndarray) -> np.ndarray:
    return 3.0 * rays[..., 2]


def wall(rays: np.ndarray) -> np.ndarray:
    return np.full(rays.shape[:-1], 2.0)


@pytest.mark.parametrize("surface", [sphere, wall])
def test_a_smooth_surface_has_no_edges_far_from_the_axis_of_a_fisheye_lens(surface):
    near, rays = fisheye_pixels()
    uv = np.random.default_rng(1).uniform((20.0, 20.0), (235.0, 171.0), (2000, 2))
    read = interpolate(DepthMap(surface(rays), near), uv, FISHEYE)
    assert read.valid.sum() > 1000
    assert not read.edge.any()
    np.testing.assert_allclose(read.depth_m[read.valid], surface(unit_rays(uv))[read.valid], rtol=0.01)


def test_a_step_is_an_edge_far_from_the_axis_of_a_fisheye_lens():
    near, rays = fisheye_pixels()
    range_m = np.where(np.arange(256.0) < 50.0, 3.0, 3.2)
    positions = np.array([[49.5, 95.0], [48.5, 95.0]])
    assert interpolate(DepthMap(range_m * rays[..., 2], near), positions, FISHEYE).edge.tolist() == [True, False]


@pytest.mark.parametrize(("step_m", "edge"), [(0.0399, False), (0.0401, True)])
def test_neighbours_may_differ_by_two_percent(step_m, edge):
    depth = np.full((24, 32), 2.0)
    depth[:, 16:] += step_m
    assert interpolate(whole(depth), np.array([[15.5, 3.0]]), CAMERA).edge.tolist() == [edge]


def test_nothing_is_read_beyond_the_outermost_pixel_centres():
    uv = np.array([[-0.01, 5.0], [31.01, 5.0], [5.0, -0.01], [5.0, 23.01], [np.nan, 5.0]])
    sample = interpolate(whole(np.full((24, 32), 2.0)), uv, CAMERA)
    assert not sample.valid.any()
    assert not sample.edge.any()
    assert np.isfinite(sample.depth_m).all()


def test_farthest_neighbour():
    depth = np.full((24, 32), 2.0, np.float32)
    depth[:, 16:] = 3.0
    holed = whole(depth)
    holed.valid[8:11, 15:18] = False
    uv = np.array([[15.5, 3.0], [14.9, 3.0], [14.5, 9.0], [16.0, 9.0], [-0.3, 3.0]])
    farthest, valid = farthest_neighbour(holed, uv)
    assert valid.tolist() == [True, True, True, False, False]
    assert farthest.tolist() == [3.0, 2.0, 2.0, 0.0, 0.0]


def test_no_positions_and_a_single_pixel():
    assert interpolate(whole(np.ones((24, 32))), np.empty((0, 2)), CAMERA).depth_m.shape == (0,)
    assert farthest_neighbour(whole(np.ones((24, 32))), np.empty((0, 2)))[0].shape == (0,)
    assert interpolate(whole(np.full((1, 1), 4.0)), np.zeros((1, 2)), CAMERA).depth_m.tolist() == [4.0]


def test_depth_and_validity_have_one_shape():
    with pytest.raises(ValueError, match="must be the same 2-D shape"):
        DepthMap(np.ones((3, 4)), np.ones((4, 3), bool))


def sparse(pixels: dict[tuple[int, int], float], *, radius_px: float = 1.0) -> DepthMap:
    """A map with depth at a few pixels (u, v)."""
    depth = np.zeros((24, 32))
    for (u, v), depth_m in pixels.items():
        depth[v, u] = depth_m
    return DepthMap(depth, depth > 0, radius_px)


def test_sparse_depth_is_that_of_the_nearest_pixel_by_hand():
    depth = sparse({(10, 5): 4.0, (11, 5): 4.1, (11, 6): 4.2})
    uv = np.array([[10.4, 5.0], [10.6, 5.0], [10.6, 5.6], [9.0, 5.0], [8.99, 5.0], [12.0, 7.0], [11.7, 6.7]])
    read = nearest(depth, uv, 1.0)
    assert read.valid.tolist() == [True, True, True, True, False, False, True]
    assert read.depth_m.tolist() == [4.0, 4.1, 4.2, 4.0, 1.0, 1.0, 4.2]
    assert not read.edge.any()


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.4, 1.0, 1.5, 2.6]))
def test_sparse_depth_against_a_search_through_all_pixels(seed, radius_px):
    rng = np.random.default_rng(seed)
    depth = DepthMap(rng.uniform(4.0, 4.2, (24, 32)), rng.random((24, 32)) < 0.2, radius_px)
    uv = rng.uniform((-2.0, -2.0), (33.0, 25.0), (40, 2))
    uv[::4] = np.rint(uv[::4])
    v, u = np.nonzero(depth.valid)
    read = nearest(depth, uv, radius_px)
    for position, depth_m, valid in zip(uv, read.depth_m, read.valid, strict=True):
        distance = np.hypot(u - position[0], v - position[1])
        assert valid == (distance.min() <= radius_px)
        if valid:
            assert depth_m == depth.depth_m[v, u][distance == distance.min()].min()


def test_of_equally_near_pixels_the_least_depth_counts_however_the_image_is_turned():
    depth = sparse({(9, 5): 4.2, (11, 5): 4.0, (10, 4): 4.1})
    turned = DepthMap(np.rot90(depth.depth_m), np.rot90(depth.valid), 1.0)
    assert nearest(depth, np.array([[10.0, 5.0]]), 1.0).depth_m == 4.0
    assert nearest(turned, np.array([[5.0, 31.0 - 10.0]]), 1.0).depth_m == 4.0


@pytest.mark.parametrize(("far_m", "edge"), [(2.199, False), (2.201, True)])
def test_sparse_pixels_that_differ_by_a_tenth_are_an_edge(far_m, edge):
    read = nearest(sparse({(10, 5): 2.0, (11, 5): far_m}), np.array([[10.4, 5.0], [9.9, 5.0]]), 1.0)
    assert read.edge.tolist() == [edge, False]  # the second position is too far from the other pixel
    assert read.valid.tolist() == [not edge, True]


def test_a_map_is_read_as_its_kind_wants():
    pixels, uv = {(10, 5): 4.0, (11, 5): 4.04, (10, 6): 4.0, (11, 6): 4.04}, np.array([[10.4, 5.5], [11.2, 5.0]])
    dense = sample(sparse(pixels, radius_px=None), uv, CAMERA)
    assert dense.valid.tolist() == [True, False]
    np.testing.assert_allclose(dense.depth_m[0], 1 / (0.6 / 4.0 + 0.4 / 4.04))
    assert sample(sparse(pixels), uv, CAMERA).depth_m.tolist() == [4.0, 4.04]
    assert sample(sparse(pixels, radius_px=0.3), uv, CAMERA).valid.tolist() == [False, True]


def test_sparse_depth_without_positions_and_beyond_the_image():
    depth = sparse({(0, 0): 3.0, (31, 23): 5.0})
    assert nearest(depth, np.empty((0, 2)), 1.0).depth_m.shape == (0,)
    read = nearest(depth, np.array([[-0.5, -0.5], [31.4, 23.4], [-1.0, -1.0], [np.nan, 0.0], [1e30, 0.0]]), 1.0)
    assert read.valid.tolist() == [True, True, False, False, False]
    assert read.depth_m.tolist() == [3.0, 5.0, 1.0, 1.0, 1.0]


def test_a_radius_is_no_negative_number():
    with pytest.raises(ValueError, match="radius_px must be at least 0, not -1"):
        sparse({}, radius_px=-1)
