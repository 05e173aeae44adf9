"""True positions under a rolling shutter, against a search over the times of rows."""

from dataclasses import replace

import numpy as np
import pytest
from tests.truth.rolling import BOARD_M, CAMERA, READOUT_S, RollingRoom, path

import tracknoise
from tracknoise.exceptions import DataError
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.row_poses import shutter_notes
from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.sequences.views import Backward, chosen_frames, turned
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.scan import ScanAnchoring, ScanRule
from tracknoise.truth.truth_registry import make_truth

BIRTH, NOW = 2, 6


@pytest.fixture(scope="module")
def room():
    return RollingRoom.of(path())


@pytest.fixture(scope="module")
def pixels():
    u, v = np.meshgrid(np.arange(12.3, 150.0, 17.0), np.arange(9.6, 112.0, 11.0))
    return np.stack([u.ravel(), v.ravel()], axis=-1)


def located(sequence, kind, uv, birth=BIRTH, now=NOW):
    """True positions in one frame of features that were found in another, and their status."""
    truth = make_truth(sequence, kind)
    return truth.locate(now, truth.anchor(birth, uv)[0])


def seen(room, points, index=NOW):
    return np.array([room.seen(index, point) for point in points])


def test_positions_are_those_of_a_search_over_row_times(room, pixels):
    points, _ = room.cast(BIRTH, pixels)
    found, status = located(room, TruthKind.raycast, pixels)
    np.testing.assert_allclose(found, seen(room, points), atol=1e-7)
    inside = CAMERA.contains(found)
    assert inside.sum() > 60
    assert (status[~inside] == TruthStatus.out_of_image).all()
    assert set(status[inside].tolist()) <= {TruthStatus.valid, TruthStatus.occluded}


def test_positions_in_the_first_and_the_last_frame_go_on_with_the_nearest_velocity(room, pixels):
    last = len(room) - 1
    points, _ = room.cast(0, pixels)
    found, _ = located(room, TruthKind.raycast, pixels, birth=0, now=last)
    np.testing.assert_allclose(found, seen(room, points, last), atol=1e-7)


def test_a_feature_stays_where_it_was_found_in_its_first_frame(room, pixels):
    found, status = located(room, TruthKind.raycast, pixels, now=BIRTH)
    np.testing.assert_allclose(found, pixels, atol=1e-8)
    assert (status == TruthStatus.valid).all()


def test_depth_maps_give_the_same_positions_within_their_interpolation(room, pixels):
    points, _ = room.cast(BIRTH, pixels)
    found, status = located(room, TruthKind.birth, pixels)
    known = np.isfinite(found[:, 0]) & (status == TruthStatus.valid)
    error = np.linalg.norm(found - seen(room, points), axis=1)[known]
    assert known.sum() > 40
    assert np.median(error) < 0.02


def test_a_global_truth_is_wrong_by_pixels(room, pixels):
    rolling, _ = located(room, TruthKind.raycast, pixels)
    still, _ = located(replace(room, shutter=None), TruthKind.raycast, pixels)
    assert np.median(np.linalg.norm(rolling - still, axis=1)) > 1.0


def test_without_readout_all_rows_are_exposed_together(room, pixels):
    rolling, status = located(replace(room, shutter=RollingShutter(0.0)), TruthKind.raycast, pixels)
    still, still_status = located(replace(room, shutter=None), TruthKind.raycast, pixels)
    np.testing.assert_allclose(rolling, still, atol=1e-9)
    assert (status == still_status).all()


def test_occlusion_compares_depths_at_the_time_of_the_row():
    poses = np.broadcast_to(np.eye(4), (3, 4, 4)).copy()
    poses[:, 2, 3] = 0.0, 0.4, 0.8  # towards the wall at 12 m/s: between first and last row by 0.3 m
    room = RollingRoom.of(poses)
    uv = np.array([[79.5, 3.0], [79.5, 116.0]])
    found, status = located(room, TruthKind.birth, uv, birth=1, now=1)
    np.testing.assert_allclose(found, uv, atol=1e-6)
    assert (status == TruthStatus.valid).all()
    depth = make_truth(room, TruthKind.raycast).start()
    depth.observe(1, np.arange(2, dtype=np.uint32), uv, np.ones(2, np.bool_))
    drift_m = 12.0 * READOUT_S * ((uv[:, 1] + 0.5) / 120 - 0.5)
    np.testing.assert_allclose(depth.resolve().depth_m, BOARD_M - 0.4 - drift_m, atol=1e-9)


@pytest.mark.parametrize("anchoring", list(ScanAnchoring))
def test_a_scan_is_seen_row_by_row(room, pixels, anchoring):
    points, _ = room.cast(BIRTH, pixels)
    scanned = replace(room, truths=(TruthKind.scan,), scan=Scan(points, BIRTH))
    truth = make_truth(scanned, scan_rule=ScanRule(0.5, anchoring))
    anchors, status = truth.anchor(BIRTH, pixels + 0.001)
    assert (status == TruthStatus.valid).all()
    np.testing.assert_allclose(truth.project(BIRTH, points), pixels, atol=1e-8)
    np.testing.assert_allclose(anchors, points, atol=1e-3)


def test_views_keep_true_positions(room, pixels):
    last = len(room) - 1
    expected, _ = located(room, TruthKind.raycast, pixels)
    back, _ = located(Backward(room), TruthKind.raycast, pixels, birth=last - BIRTH, now=last - NOW)
    np.testing.assert_allclose(back, expected, atol=1e-8)
    chosen = chosen_frames(room, [2, 6, 4])
    few, _ = located(chosen, TruthKind.raycast, pixels, birth=0, now=1)
    np.testing.assert_allclose(few, expected, atol=1e-9)
    back, _ = located(Backward(chosen), TruthKind.raycast, pixels, birth=1, now=0)
    np.testing.assert_allclose(back, expected, atol=1e-8)


@pytest.mark.parametrize("quarters", [1, 2, 3])
@pytest.mark.parametrize("backward", [False, True])
def test_turned_images_keep_true_positions(room, pixels, quarters, backward):
    expected, _ = located(room, TruthKind.raycast, pixels)
    uv, wanted, side = pixels, expected, (CAMERA.width, CAMERA.height)
    for quarter in range(quarters):
        width = side[quarter % 2]
        uv, wanted = (np.stack([at[:, 1], width - 1 - at[:, 0]], axis=-1) for at in (uv, wanted))
    view, birth, now = turned(room, 90 * quarters), BIRTH, NOW
    if backward:
        view, birth, now = Backward(view), len(room) - 1 - BIRTH, len(room) - 1 - NOW
    found, _ = located(view, TruthKind.raycast, uv, birth, now)
    np.testing.assert_allclose(found, wanted, atol=1e-8)


def test_shutters_of_views_by_hand():
    room = RollingRoom.of(path())
    shutters = [view.shutter for view in (turned(room, 90), turned(room, 180), turned(room, 270), Backward(room))]
    assert [(shutter.readout_s, shutter.axis) for shutter in shutters] == [
        (READOUT_S, 0),
        (-READOUT_S, 1),
        (-READOUT_S, 0),
        (-READOUT_S, 1),
    ]
    assert turned(replace(room, shutter=None), 90).shutter is None
    assert Backward(replace(room, shutter=None)).shutter is None


def test_a_frame_beside_one_without_a_pose_has_none(room, pixels):
    poses = room.world_from_camera.copy()
    poses[4] = np.nan
    gappy = replace(room, world_from_camera=poses)
    truth = make_truth(gappy, TruthKind.raycast)
    points, _ = room.cast(BIRTH, pixels)
    status = {index: set(truth.locate(index, points)[1].tolist()) for index in range(len(room))}
    assert [index for index, found in status.items() if found == {TruthStatus.no_pose}] == [3, 4, 5]
    assert (truth.anchor(3, pixels)[1] == TruthStatus.no_pose).all()
    np.testing.assert_array_equal(truth.project(6, points), make_truth(room, TruthKind.raycast).project(6, points))


def test_notes_state_the_readout_and_frames_beside_one_without_a_pose(room):
    poses = room.world_from_camera.copy()
    poses[4] = np.nan
    gappy = replace(room, world_from_camera=poses)
    readout = "a rolling shutter with a readout of 25 ms is assumed"
    beside = "2 of 9 frames have a neighbour without a pose: their observations have no true position"
    assert shutter_notes(gappy, len(room)) == (readout, beside)
    assert shutter_notes(gappy, 3) == shutter_notes(room, len(room)) == (readout,)
    assert shutter_notes(replace(gappy, shutter=None), len(room)) == ()


def test_a_shutter_without_timestamps_is_an_error(room):
    with pytest.raises(DataError, match="made rolling room: a rolling shutter without timestamps, expected time"):
        make_truth(replace(room, timestamps_s=None))


def test_the_oracle_has_its_own_errors_only(room):
    still = tracknoise.Oracle(n_features=60, covariance_px2=((0.0, 0.0), (0.0, 0.0)))
    errors = tracknoise.measure(room, still, truth="raycast").observations.drop_nulls("du_px")
    assert errors.height > 200
    assert np.abs(errors.select("du_px", "dv_px").to_numpy()).max() < 1e-4  # stored as float32


def test_the_oracle_keeps_features_through_a_gap(room):
    poses = room.world_from_camera.copy()
    poses[4] = np.nan
    still = tracknoise.Oracle(n_features=60, covariance_px2=((0.0, 0.0), (0.0, 0.0)))
    seen = tracknoise.measure(replace(room, world_from_camera=poses), still, truth="raycast").observations
    assert sorted(seen.filter(truth="no_pose")["frame"].unique().to_list())[:3] == [3, 4, 5]
    through = seen.filter(seen["frame"] > 5, seen["frame"] == seen["age"], seen["truth"] == "valid")
    assert through.height > 10
    assert through["du_px"].abs().max() < 1e-4


def test_points_behind_the_camera_have_no_position_and_those_beside_the_image_have_one(room):
    truth = make_truth(room, TruthKind.raycast)
    uv, status = truth.locate(NOW, np.array([[0.0, 0.0, -1.0], [0.3, 0.1, 3.0], [np.nan] * 3, [9.0, 0.0, 3.0]]))
    assert np.isfinite(uv).all(axis=1).tolist() == [False, True, False, True]
    assert status[[0, 3]].tolist() == [TruthStatus.behind_camera, TruthStatus.out_of_image]


def test_a_fitted_point_explains_exact_tracks(room):
    poses = path(12, seed=5)
    poses[:, 0, 3] += np.linspace(0.0, 0.5, 12)
    room = RollingRoom.of(poses)
    points = np.array([[x, y, z] for x in (-0.5, 0.0, 0.6) for y in (-0.3, 0.25) for z in (2.0, 3.5)])
    tracks = np.arange(len(points), dtype=np.uint32)
    session = make_truth(room, "triangulated").start()
    still = make_truth(replace(room, shutter=None), "triangulated").start()
    for index in range(len(room)):
        uv = seen(room, points, index)
        for one in (session, still):
            one.observe(index, tracks, uv, np.full(len(tracks), index == 0))
    truth, wrong = session.resolve(), still.resolve()
    every = np.concatenate([seen(room, points, index) for index in range(len(room))])
    np.testing.assert_allclose(truth.uv, every, atol=1e-5)
    assert np.nanmedian(np.linalg.norm(wrong.uv - every, axis=1)) > 0.1


def test_errors_of_fitted_points_are_measured_in_their_own_row(room):
    """One observation that is off by 3 px along the motion: the true position must not move with its row."""
    poses = path(12, seed=5)
    poses[:, 0, 3] += np.linspace(0.0, 0.5, 12)
    room = RollingRoom.of(poses)
    point = np.array([[0.1, 0.05, 2.0]])
    exact = np.concatenate([seen(room, point, index) for index in range(len(room))])
    observed = exact.copy()
    observed[6, 1] += 3.0
    session = make_truth(room, "triangulated").start()
    for index in range(len(room)):
        session.observe(index, np.zeros(1, np.uint32), observed[index : index + 1], np.array([index == 0]))
    found = session.resolve().uv
    fitted = make_truth(room, TruthKind.raycast).project(6, _point_of(room, session, found))
    np.testing.assert_allclose(found[6], fitted[0], atol=1e-6)


def _point_of(room, session, found):
    """The fitted world point: where the rays of true positions meet."""
    rows, right = [], []
    for index, uv in enumerate(found):
        turn, position = room.pose_after(room.row_time(index, uv[None])[0])
        ray = turn @ CAMERA.bearings(uv)
        across = np.eye(3) - np.outer(ray, ray) / (ray @ ray)
        rows.append(across)
        right.append(across @ position)
    return np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0][None]
