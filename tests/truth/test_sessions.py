"""Truth sessions fed by hand: when tracks are anchored, and where and whether they are then seen."""

import numpy as np
import pytest

from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.scan import ScanAnchoring, ScanRule
from tracknoise.truth.truth_registry import make_truth

VALID, NO_DEPTH, EDGE, OCCLUDED = TruthStatus.valid, TruthStatus.no_depth, TruthStatus.edge, TruthStatus.occluded


def observe(session, frames):
    """Show a session {frame: [(track, u, v), ...]}; a track is born where it is first named."""
    known = set()
    for index, rows in frames.items():
        tracks = np.array([track for track, _, _ in rows], np.uint32)
        uv = np.array([(u, v) for _, u, v in rows], float).reshape(-1, 2)
        session.observe(index, tracks, uv, np.array([track not in known for track in tracks.tolist()], bool))
        known |= set(tracks.tolist())
    return session.resolve()


def test_each_track_is_anchored_at_birth_and_located_in_later_frames(make_room, at):
    """40 px at 2 m is 2 m: 0.1 m to the right move the board by 2 px and the wall by 1 px to the left."""
    truth = make_truth(make_room(at(), at(x=0.1), at(x=0.2)), TruthKind.birth)
    found = observe(
        truth.start(),
        {
            0: [(0, 31.5, 23.5), (1, 37.4, 23.5)],
            1: [(1, 30.0, 20.0), (2, 51.5, 23.5), (0, 30.0, 23.0)],
            2: [(2, 50, 23)],
        },
    )
    assert found.status.tolist() == [VALID, EDGE, EDGE, VALID, VALID, VALID]
    assert found.status.dtype == np.int8
    nan = (np.nan, np.nan)
    expected = [(31.5, 23.5), nan, nan, (51.5, 23.5), (29.5, 23.5), (50.5, 23.5)]
    np.testing.assert_allclose(found.uv, expected, atol=1e-12)
    np.testing.assert_allclose(found.depth_m, [2.0, np.nan, 4.0])
    assert found.covariance is None


@pytest.mark.parametrize("kind", [TruthKind.birth, TruthKind.raycast])
def test_a_track_that_the_board_hides_is_occluded_in_that_frame_only(make_room, at, kind):
    truth = make_truth(make_room(at(), at(x=-0.8), at(x=0.8)), kind)
    found = observe(truth.start(), {index: [(0, 39.5, 20.0)] for index in range(3)})
    assert found.status.tolist() == [VALID, OCCLUDED, VALID]
    np.testing.assert_allclose(found.uv[:, 0], [39.5, 47.5, 31.5])


def test_with_a_scan_the_tracks_found_in_the_key_frame_are_anchored_there_and_located_in_earlier_frames(make_room, at):
    points = np.array([[0.0, 0.0, 2.0], [0.4, 0.0, 4.0]])
    room = make_room(at(), at(x=0.1), at(x=-0.8), truths=(TruthKind.scan,), scan=Scan(points, 1))
    frames = {
        0: [(0, 31.0, 23.0), (1, 60.0, 5.0), (2, 35.0, 23.0)],
        1: [(2, 34.5, 23.5), (0, 29.5, 23.5), (3, 5.0, 5.0)],
        2: [(3, 5.0, 5.0), (0, 47.0, 23.0), (4, 9.0, 9.0)],
    }
    found = observe(make_truth(room).start(), frames)
    # The second point lies on the wall at x = 0.4 m: the board, half as wide at twice the depth, hides it from x = 0.
    statuses = [VALID, NO_DEPTH, OCCLUDED, OCCLUDED, VALID, NO_DEPTH, NO_DEPTH, VALID, NO_DEPTH]
    assert found.status.tolist() == statuses
    nan = (np.nan, np.nan)
    expected = [(31.5, 23.5), nan, (35.5, 23.5), (34.5, 23.5), (29.5, 23.5), nan, nan, (47.5, 23.5), nan]
    np.testing.assert_allclose(found.uv, expected, atol=1e-12)
    np.testing.assert_allclose(found.depth_m, [2.0, np.nan, 4.0, np.nan, np.nan])


def test_sessions_of_one_truth_do_not_disturb_each_other(make_room, at):
    truth = make_truth(make_room(at(), at(x=0.1)), TruthKind.raycast)
    one, other = truth.start(), truth.start()
    only = np.array([0], np.uint32)
    for index in range(2):
        for session, uv in ((one, (31.5, 23.5)), (other, (51.5, 23.5))):
            session.observe(index, only, np.array([uv]), np.array([index == 0]))
    np.testing.assert_allclose(one.resolve().uv, [(31.5, 23.5), (29.5, 23.5)], atol=1e-12)
    np.testing.assert_allclose(other.resolve().uv, [(51.5, 23.5), (50.5, 23.5)], atol=1e-12)


@pytest.mark.parametrize("kind", [TruthKind.birth, TruthKind.scan])
def test_no_observations(make_room, at, kind):
    room = make_room(at(), truths=(kind,), scan=Scan(np.ones((1, 3)), 0))
    for frames in ({}, {0: []}):
        found = observe(make_truth(room).start(), frames)
        assert (found.uv.shape, found.status.shape, found.depth_m.shape) == ((0, 2), (0,), (0,))


def test_many_tracks_keep_their_own_points(make_room, at, pixel_grid):
    room = make_room(at(x=0.1), at(x=0.15))
    truth = make_truth(room, TruthKind.raycast)
    uv = np.concatenate([pixel_grid(room.camera, step) for step in (1.1, 0.9)])
    assert len(uv) > 3000
    session = truth.start()
    parts = np.array_split(np.arange(len(uv), dtype=np.uint32), [1, 1000, 1030, 2500])
    for part in parts:
        session.observe(0, part, uv[part], np.ones(len(part), bool))
    session.observe(1, np.arange(len(uv), dtype=np.uint32), uv, np.zeros(len(uv), bool))
    found = session.resolve()
    points, status = truth.anchor(0, uv)
    np.testing.assert_allclose(found.uv[len(uv) :], truth.project(1, points), rtol=1e-12)
    np.testing.assert_array_equal(np.isnan(found.depth_m), status != VALID)


@pytest.mark.parametrize("kind", [TruthKind.birth, TruthKind.raycast])
def test_the_surroundings_of_tracks_are_those_of_their_first_frames(make_room, at, kind):
    """The board is 12 px wide and straight ahead in frame 0, and 2 px further left in frame 1."""
    truth = make_truth(make_room(at(), at(x=0.1)), kind)
    frames = {
        0: [(0, 31.5, 23.5), (1, 41.5, 23.5), (2, 35.5, 23.5)],
        1: [(2, 33.5, 23.5), (3, 33.5, 23.5), (0, 29.5, 23.5)],
    }
    found = observe(truth.start(), frames).surroundings
    np.testing.assert_allclose(found.edge_px, [6.0, -4.0, 2.0, 2.0], atol=0.75)
    assert found.incidence_deg[0] == pytest.approx(0.0, abs=1e-6)
    right_deg = np.rad2deg(np.arctan(4.0 / 40.0))  # both surfaces face the camera
    np.testing.assert_allclose(found.incidence_deg[[2]], right_deg, atol=0.75)


def test_surroundings_are_unknown_without_dense_depth_and_infinite_without_an_edge(make_room, at):
    room = make_room(at())
    frames = {0: [(0, 56.5, 23.5), (1, 31.5, 23.5)]}
    dense = observe(make_truth(room, TruthKind.birth).start(), frames).surroundings
    assert np.isposinf(dense.edge_px[0])
    depth = room.depth(0)

    class Sparse(type(room)):
        def depth(self, index):
            return DepthMap(depth.depth_m, depth.valid, radius_px=1.0)

    for bare in (Sparse(room.world_from_camera), make_room(at(), with_depth=False)):
        found = observe(make_truth(bare, TruthKind.birth).start(), frames).surroundings
        assert np.isnan([found.edge_px, found.incidence_deg]).all()


@pytest.mark.parametrize("kind", [TruthKind.birth, TruthKind.raycast, TruthKind.scan])
def test_the_error_where_a_track_is_anchored_is_exactly_zero(make_room, at, pixel_grid, kind):
    """Rounding on the way to the world point and back would otherwise decide which tracks trimming drops."""
    points = np.stack([*np.meshgrid(np.linspace(-3, 3, 600), np.linspace(-2, 2, 400)), np.full((400, 600), 4.0)], -1)
    poses = at(x=0.0), at(x=0.37, z=0.113)
    room = make_room(*poses, truths=(kind,), scan=Scan(points.reshape(-1, 3), 1))
    session = make_truth(room).start()
    uv = pixel_grid(room.camera, 1.7)
    tracks, born = np.arange(len(uv), dtype=np.uint32), np.ones(len(uv), bool)
    session.observe(1, tracks, uv, born)
    found = session.resolve()
    known = found.status == VALID
    assert known.sum() > 100
    np.testing.assert_array_equal(found.uv[known], uv[known])


def test_the_scan_point_itself_keeps_its_distance_from_the_feature(make_room, at):
    scan = Scan(np.array([[0.0, 0.0, 2.0]]), 0)
    truth = make_truth(
        make_room(at(), truths=(TruthKind.scan,), scan=scan), scan_rule=ScanRule(0.25, ScanAnchoring.point)
    )
    found = observe(truth.start(), {0: [(0, 31.6, 23.5)]})
    np.testing.assert_allclose(found.uv, [(31.5, 23.5)], atol=1e-12)
