import numpy as np
import pytest

from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.sequence import TruthKind
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth_registry import make_truth

BOTH = pytest.mark.parametrize("kind", [TruthKind.birth, TruthKind.raycast])


@BOTH
def test_points_by_hand(make_room, at, kind):
    """40 px at 2 m is 2 m, at 4 m is 4 m; the camera stands 0.1 m to the right."""
    truth = make_truth(make_room(at(x=0.1)), kind)
    points, status = truth.anchor(0, np.array([[31.5, 23.5], [27.5, 19.5], [51.5, 33.5]]))
    assert status.tolist() == [TruthStatus.valid] * 3
    assert status.dtype == np.int8
    np.testing.assert_allclose(points, [(0.1, 0.0, 2.0), (-0.1, -0.2, 2.0), (2.1, 1.0, 4.0)], atol=1e-12)


def test_beside_the_board_dense_depth_has_an_edge_and_a_ray_has_none(make_room, at):
    """The board's edge lies at u = 31.5 + 40 * 0.3 / 2 = 37.5, between pixels 37 and 38."""
    room, uv = make_room(at()), np.array([[37.4, 20.0], [37.6, 20.0], [38.1, 20.0]])
    points, status = make_truth(room, TruthKind.birth).anchor(0, uv)
    assert status.tolist() == [TruthStatus.edge, TruthStatus.edge, TruthStatus.valid]
    assert np.isnan(points[:2]).all()
    points, status = make_truth(room, TruthKind.raycast).anchor(0, uv)
    assert status.tolist() == [TruthStatus.valid] * 3
    np.testing.assert_allclose(points[:, 2], (2.0, 4.0, 4.0))


@BOTH
def test_where_nothing_is_there_is_no_depth(make_room, at, kind):
    points, status = make_truth(make_room(at(turned=True)), kind).anchor(0, np.array([[31.5, 23.5], [3.2, 4.7]]))
    assert status.tolist() == [TruthStatus.no_depth] * 2
    assert np.isnan(points).all()


def test_a_frame_without_depth_anchors_nothing(make_room, at):
    truth = make_truth(make_room(at(), with_depth=False), TruthKind.birth)
    points, status = truth.anchor(0, np.array([[31.5, 23.5]]))
    assert status.tolist() == [TruthStatus.no_depth]
    assert np.isnan(points).all()


@BOTH
def test_age_0_has_no_error(make_room, at, kind, pixel_grid):
    room = make_room(at(x=0.3, z=-0.7))
    uv = pixel_grid(room.camera, 1.37)
    truth = make_truth(room, kind)
    points, status = truth.anchor(0, uv)
    valid = status == TruthStatus.valid
    assert valid.mean() > 0.7
    assert np.abs(truth.project(0, points) - uv)[valid].max() < 1e-12


def test_a_caster_of_few_digits_costs_depth_and_not_direction(make_room, at, pixel_grid):
    """Casters work in single precision; the feature's own ray is known exactly."""

    class Coarse(type(make_room(at()))):
        def cast(self, index, uv):
            points, hit = super().cast(index, uv)
            return points.astype(np.float16).astype(float), hit

    room = Coarse(np.stack([at(x=0.3, z=-0.7)]))
    uv = pixel_grid(room.camera, 3.1)
    truth = make_truth(room, TruthKind.raycast)
    points, status = truth.anchor(0, uv)
    assert np.abs(truth.project(0, points) - uv)[status == TruthStatus.valid].max() < 1e-12


@BOTH
def test_no_features(make_room, at, kind):
    truth = make_truth(make_room(at()), kind)
    points, status = truth.anchor(0, np.empty((0, 2)))
    assert points.shape == (0, 3)
    assert status.shape == (0,)
    assert status.dtype == np.int8


def test_sparse_depth_is_read_from_the_nearest_pixel(make_room, at):
    """Every third pixel is measured; the board's edge lies at u = 37.5, between the measured 36 and 39."""

    class Scanned(type(make_room(at()))):
        def depth(self, index):
            dense = super().depth(index)
            measured = np.zeros_like(dense.valid)
            measured[::3, ::3] = True
            return DepthMap(dense.depth_m, dense.valid & measured, 2.0)

    uv = np.array([[35.9, 24.2], [38.0, 24.0], [36.5, 24.0], [34.5, 22.5]])
    points, status = make_truth(Scanned(np.stack([at()])), TruthKind.birth).anchor(0, uv)
    assert status.tolist() == [TruthStatus.valid, TruthStatus.edge, TruthStatus.valid, TruthStatus.no_depth]
    np.testing.assert_allclose(points[0], ((35.9 - 31.5) / 20.0, 0.7 / 20.0, 2.0))
