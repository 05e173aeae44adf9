import numpy as np
import pytest

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.sequence import TruthKind
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth_registry import make_truth

BOTH = pytest.mark.parametrize("kind", [TruthKind.birth, TruthKind.raycast])


@BOTH
def test_every_status_by_hand(make_room, at, kind):
    truth = make_truth(make_room(at()), kind)
    points = np.array(
        [
            (0.0, 0.0, 2.0),  # on the board
            (1.0, 0.0, 4.0),  # on the wall, beside the board
            (0.2, 0.0, 4.0),  # on the wall, behind the board
            (0.0, 0.0, 1.0),  # in the air, before the board
            (4.0, 0.0, 4.0),  # beyond the image's right border
            (0.0, 0.0, -1.0),  # behind the camera
            (0.0, 0.0, 0.0),  # in the camera
        ]
    )
    expected = ["valid", "valid", "occluded", "valid", "out_of_image", "behind_camera", "behind_camera"]
    status = truth.locate(0, points)[1]
    assert [TruthStatus(value).name for value in status] == expected
    assert status.dtype == np.int8


@BOTH
def test_a_point_that_the_board_hides_later(make_room, at, kind):
    """From x = 0 the wall at 0.8 m is seen; from -0.8 m the board hides 0.8 +- 0.6 m of it, from 0.8 m none."""
    truth = make_truth(make_room(at(), at(x=-0.8), at(x=0.8)), kind)
    points, _ = truth.anchor(0, np.array([[39.5, 20.0]]))
    np.testing.assert_allclose(points[0, 0], 0.8)
    statuses = [TruthStatus(truth.locate(index, points)[1][0]).name for index in range(3)]
    assert statuses == ["valid", "occluded", "valid"]


def test_beside_an_edge_a_point_counts_as_seen(make_room, at):
    """The wall just right of the board's edge, u = 37.5: one neighbour is the wall itself, and the farthest counts."""
    room = make_room(at())
    behind = np.array([[(u - 31.5) / 10.0, 0.0, 4.0] for u in (36.9, 37.1)])
    status = make_truth(room, TruthKind.birth).locate(0, behind)[1]
    assert status.tolist() == [TruthStatus.occluded, TruthStatus.valid]
    status = make_truth(room, TruthKind.raycast).locate(0, behind)[1]
    assert status.tolist() == [TruthStatus.occluded, TruthStatus.occluded]


@BOTH
@pytest.mark.parametrize(("surface_m", "tolerance_m"), [(2.0, 0.04), (0.1, 0.005)])
def test_the_tolerance_is_two_percent_and_at_least_5_mm(make_room, at, kind, surface_m, tolerance_m):
    truth = make_truth(make_room(at(z=2.0 - surface_m)), kind)
    along = np.array([surface_m + 0.99 * tolerance_m, surface_m + 1.01 * tolerance_m])
    points = np.stack([np.zeros(2), np.zeros(2), 2.0 - surface_m + along], axis=-1)
    assert truth.locate(0, points)[1].tolist() == [TruthStatus.valid, TruthStatus.occluded]


def test_a_point_that_the_lens_has_no_image_of_has_no_position(make_room, at):
    lens = Camera(64, 48, 40.0, 40.0, 31.5, 23.5, (-0.2, 0.0, 0.0, 0.0))  # no image beyond 52 degrees
    truth = make_truth(make_room(at(), camera=lens), TruthKind.birth)
    uv, status = truth.locate(0, np.array([[0.0, 0.0, 2.0], [4.8, 0.0, 4.0], [5.6, 0.0, 4.0]]))
    assert [TruthStatus(value).name for value in status] == ["valid", "out_of_image", "behind_camera"]
    assert np.isfinite(uv).all(axis=1).tolist() == [True, True, False]


def test_where_nothing_is_measured_nothing_is_hidden(make_room, at):
    truth = make_truth(make_room(at(), with_depth=False), TruthKind.birth)
    assert truth.locate(0, np.array([[0.2, 0.0, 4.0]]))[1].tolist() == [TruthStatus.valid]


def test_invalid_depth_hides_nothing(make_room, at):
    class Holed(type(make_room(at()))):
        def depth(self, index):
            return DepthMap(np.full((48, 64), 0.5), np.zeros((48, 64), bool))

    truth = make_truth(Holed(np.stack([at()])), TruthKind.birth)
    assert truth.locate(0, np.array([[0.2, 0.0, 4.0]]))[1].tolist() == [TruthStatus.valid]


def test_the_outermost_half_pixels_belong_to_the_image(make_room, at):
    truth = make_truth(make_room(at()), TruthKind.birth)
    points = np.array([[(u - 31.5) / 10.0, 0.0, 4.0] for u in (-0.4, -0.6, 63.4, 63.6)])
    assert truth.locate(0, points)[1].tolist() == [
        TruthStatus.valid,
        TruthStatus.out_of_image,
        TruthStatus.valid,
        TruthStatus.out_of_image,
    ]


@BOTH
def test_no_points(make_room, at, kind):
    status = make_truth(make_room(at()), kind).locate(0, np.empty((0, 3)))[1]
    assert status.shape == (0,)
    assert status.dtype == np.int8
