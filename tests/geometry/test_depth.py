import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.geometry.camera import Camera
from tracknoise.geometry.depth import DepthMap, farthest_neighbour, interpolate

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
    sample = interpolate(whole(plane(normal, 3.0, pixels())), uv)
    assert sample.valid.all()
    np.testing.assert_allclose(sample.depth_m, plane(normal, 3.0, uv), rtol=1e-12)


def test_the_depth_at_a_pixel_centre_is_that_pixel_s():
    depth = 2.0 + 0.001 * np.arange(24 * 32).reshape(24, 32) % 0.01
    sample = interpolate(whole(depth), np.array([[3.0, 7.0], [0.0, 0.0], [31.0, 23.0], [31.0, 5.0]]))
    np.testing.assert_allclose(sample.depth_m, depth[[7, 0, 23, 5], [3, 0, 31, 31]], rtol=1e-15)
    assert sample.valid.all()


@given(st.floats(0, 31), st.floats(0, 23), st.integers(0, 2**32 - 1))
def test_lies_between_its_neighbours(u, v, seed):
    depth = np.random.default_rng(seed).uniform(5.0, 5.09, (24, 32))
    sample = interpolate(whole(depth), np.array([[u, v]]))
    corners = depth[np.ix_([int(v), min(int(v) + 1, 23)], [int(u), min(int(u) + 1, 31)])]
    assert sample.valid[0]
    assert corners.min() - 1e-12 <= sample.depth_m[0] <= corners.max() + 1e-12


def test_a_step_is_an_edge_and_a_hole_is_unknown():
    depth = np.full((24, 32), 2.0)
    depth[:, 16:] = 3.0
    holed = whole(depth)
    holed.valid[10, 4] = False
    uv = np.array([[15.5, 3.0], [14.9, 3.0], [16.1, 3.0], [3.5, 9.5], [2.9, 9.5]])
    sample = interpolate(holed, uv)
    assert sample.edge.tolist() == [True, False, False, False, False]
    assert sample.valid.tolist() == [False, True, True, False, True]


@pytest.mark.parametrize(("step_m", "edge"), [(0.0399, False), (0.0401, True)])
def test_neighbours_may_differ_by_two_percent(step_m, edge):
    depth = np.full((24, 32), 2.0)
    depth[:, 16:] += step_m
    assert interpolate(whole(depth), np.array([[15.5, 3.0]])).edge.tolist() == [edge]


def test_nothing_is_read_beyond_the_outermost_pixel_centres():
    uv = np.array([[-0.01, 5.0], [31.01, 5.0], [5.0, -0.01], [5.0, 23.01], [np.nan, 5.0]])
    sample = interpolate(whole(np.full((24, 32), 2.0)), uv)
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
    assert interpolate(whole(np.ones((24, 32))), np.empty((0, 2))).depth_m.shape == (0,)
    assert farthest_neighbour(whole(np.ones((24, 32))), np.empty((0, 2)))[0].shape == (0,)
    assert interpolate(whole(np.full((1, 1), 4.0)), np.zeros((1, 2))).depth_m.tolist() == [4.0]


def test_depth_and_validity_have_one_shape():
    with pytest.raises(ValueError, match="must be the same 2-D shape"):
        DepthMap(np.ones((3, 4)), np.ones((4, 3), bool))
