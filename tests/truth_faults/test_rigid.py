"""The rigid share: planted pose errors are found, what is a tracker's own is not, and nothing breaks at the edges."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.rigid import CAMERA, TRACKERS, by_hand, observed, pose_noise, prepared, tables

from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.projection import FrameGeometry
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.truth_faults.pose_accuracy import pose_law, pose_share
from tracknoise.truth_faults.pose_errors import rigid_tables

FRAMES = 40
EXACT = by_hand(FRAMES)


def both(seed=0, **options):
    rng = np.random.default_rng(seed)
    return [observed(EXACT, rng, features=200, **options) for _ in TRACKERS]


def faulty(law, rotation_deg, translation_m, seed=1):
    return EXACT @ pose_noise(law, rotation_deg, translation_m, FRAMES, np.random.default_rng(seed))


def totals(table, fitted_to="own", tracker=None):
    """Sums of error, left and rigid over all ages, both coordinates and all trackers, or one."""
    rows = table.filter(fitted_to=fitted_to)
    rows = rows if tracker is None else rows.filter(tracker=tracker)
    return tuple(sum(rows[f"{name}_{axis}"].sum() for axis in ("uu", "vv")) for name in ("error", "left", "rigid"))


@pytest.mark.parametrize("fitted_to", ["own", "others"])
@pytest.mark.parametrize("planted", [("white", 0.1, 0.005), ("walk", 0.05, 0.003)])
def test_planted_pose_noise_is_removed(planted, fitted_to):
    seen = both()
    honest = totals(tables(seen, EXACT)["rigid"], fitted_to)[0]
    error, left, rigid = totals(tables(seen, faulty(*planted))["rigid"], fitted_to)
    assert error > 4 * honest
    assert (error - left) / (error - honest) > 0.9
    assert rigid / (error - honest) == pytest.approx(1.0, abs=0.05)


def test_next_to_nothing_is_removed_of_white_noise():
    found = tables(both(), EXACT)["rigid"]
    for fitted_to in ("own", "others"):
        error, left, rigid = totals(found, fitted_to)
        assert abs(rigid / error) < 0.02
        assert left / error == pytest.approx(1.05, abs=0.05)  # a correction adds the noise of its fit


def test_independent_noise_has_no_share_on_average():
    """The halves of the tracks have nothing in common, weights included."""
    seen = [[observed(EXACT, np.random.default_rng(seed), features=60)] for seed in range(20)]
    error, _, rigid = np.sum([totals(tables(one, EXACT)["rigid"]) for one in seen], axis=0)
    assert abs(rigid / error) < 0.002


def test_a_jump_of_the_poses_and_lost_tracks_do_no_harm():
    seen = both(noise_px=0.3)
    jumped = EXACT.copy()
    jumped[20:, :3, 3] += [0.03, 0.0, 0.0]
    astray = np.random.default_rng(3).random(len(seen[0].track)) < 0.1
    wild = replace(seen[0], uv=seen[0].uv + np.where(astray & (seen[0].frame > seen[0].first), 40.0, 0.0)[:, None])
    honest = totals(tables([wild, seen[1]], EXACT)["rigid"], "own", TRACKERS[0])
    error, left, _ = totals(tables([wild, seen[1]], jumped)["rigid"], "own", TRACKERS[0])
    assert error > 1.01 * honest[0]
    assert left == pytest.approx(honest[1], rel=0.01)


def test_a_motion_that_one_tracker_alone_has_is_not_confirmed_by_the_other():
    rng = np.random.default_rng(0)
    drifts = [observed(EXACT, rng, features=200, drift_px=drift_px) for drift_px in (0.3, 0.0)]
    found = tables(drifts, EXACT)["rigid"]
    error, _, own = totals(found, "own", TRACKERS[0])
    assert own / error > 0.5
    assert abs(totals(found, "others", TRACKERS[0])[2] / error) < 0.05
    assert abs(totals(found, "own", TRACKERS[1])[2] / totals(found, "own", TRACKERS[1])[0]) < 0.05


def test_tracks_that_live_longer_than_equations_reach():
    steady = np.tile(np.eye(4), (FRAMES, 1, 1))
    steady[:, 0, 3] = 0.002 * np.arange(FRAMES)
    stated = steady @ pose_noise("walk", 0.05, 0.003, FRAMES, np.random.default_rng(1))
    seen = [observed(steady, np.random.default_rng(0), features=200, loss=0.0, noise_px=0.3)]
    honest = totals(tables(seen, steady)["rigid"])[0]
    found = tables(seen, stated)["rigid"]
    assert found["age"].max() == 32
    error, left, _ = totals(found.filter(pl.col("age") >= 20))
    whole = totals(found)[0]
    assert left < 0.1 * error
    assert whole > 10 * honest


def test_the_growth_of_relative_pose_errors_is_measured():
    walk = tables(both(noise_px=0.2), faulty("walk", 0.05, 0.003))["pose_growth"]
    white = tables(both(noise_px=0.2), faulty("white", 0.1, 0.005))["pose_growth"]
    for lag in (1, 4):
        walked, jittered = (table.row(by_predicate=pl.col("lag") == lag, named=True) for table in (walk, white))
        assert walked["rotation_deg"] == pytest.approx(0.05 * np.sqrt(lag), rel=0.3)  # one walk of 40 steps
        assert walked["translation_m"] == pytest.approx(0.003 * np.sqrt(lag), rel=0.3)
        assert jittered["rotation_deg"] == pytest.approx(0.1 * np.sqrt(2), rel=0.2)
        assert jittered["translation_m"] == pytest.approx(0.005 * np.sqrt(2), rel=0.2)


def test_a_growth_that_a_short_sequence_does_not_show_is_unknown():
    late = tables(both(noise_px=0.2), faulty("walk", 0.05, 0.003))["pose_growth"].filter(pl.col("lag") >= 10)
    assert late["rotation_deg"].null_count() == late.height > 3
    assert (late["rotation_xx_deg2"] > 0.0).all()


def test_exact_poses_have_a_growth_near_zero():
    grown = tables(both(), EXACT)["pose_growth"].filter(pl.col("lag") <= 8)
    squares = grown.select("^.*_deg2$").to_numpy()
    assert np.sqrt(np.abs(squares.mean())) < 0.01
    assert grown["rotation_deg"].fill_null(0.0).max() < 0.01
    assert grown["translation_m"].fill_null(0.0).max() < 0.0005


def test_the_tables_do_not_depend_on_the_order_of_rows():
    sequence = prepared(both(), faulty("white", 0.1, 0.005))
    shuffled = prepare_sequence(sequence.observations.reverse(), sequence.tracks.reverse())
    geometry = FrameGeometry(EXACT, (CAMERA,), np.zeros(FRAMES, np.intp))
    found = [rigid_tables(one, geometry, witnesses=TRACKERS)["rigid"] for one in (sequence, shuffled)]
    for name in ("error_uu", "left_vv", "rigid_uu"):
        assert found[0][name].to_numpy() == pytest.approx(found[1][name].to_numpy(), rel=1e-6, abs=1e-6)


def test_one_tracker_has_no_others():
    assert tables(both()[:1], EXACT)["rigid"]["fitted_to"].unique().to_list() == ["own"]


def test_trackers_that_saw_no_images_say_nothing_about_poses():
    geometry = FrameGeometry(EXACT, (CAMERA,), np.zeros(FRAMES, np.intp))
    found = rigid_tables(prepared(both(), EXACT), geometry, witnesses=[])
    assert found["pose_growth"].is_empty()
    assert found["rigid"]["fitted_to"].unique().to_list() == ["own"]


def test_what_frames_with_few_features_do_not_determine_is_unknown():
    rng = np.random.default_rng(0)
    found = tables([observed(EXACT, rng, features=4)], faulty("white", 0.2, 0.01))["rigid"]
    assert found.is_empty()
    assert pose_share([found]).is_empty()


@pytest.mark.parametrize("features", [40, 60, 110])
def test_few_tracks_show_the_share_of_pose_errors(features):
    """Sparse front ends: fewer than 30 tracks in a half of a frame."""
    rng = np.random.default_rng(0)
    seen, stated = observed(EXACT, rng, features=features, noise_px=0.3), faulty("walk", 0.02, 0.001)
    moved = np.sum((seen.true_uv(stated) - seen.true_uv(EXACT)) ** 2, axis=1)
    error = np.sum((seen.uv - seen.true_uv(stated)) ** 2, axis=1)
    near = (seen.frame > seen.first) & (seen.frame - seen.first <= 10) & np.isfinite(error)
    rigid = tables([seen], stated)["rigid"].filter(pl.col("age") <= 10)
    of_all, _, explained = totals(rigid)
    assert explained / of_all == pytest.approx(moved[near].sum() / error[near].sum(), abs=0.07)
    assert near_share(rigid)["low"] > 0.4


def test_frames_whose_motion_is_unknown_widen_the_bounds():
    """Tracks are many in the first half of the recording, and few in the second."""
    rng = np.random.default_rng(0)
    seen = observed(EXACT, rng, features=200, noise_px=0.3)
    kept = (seen.first < FRAMES // 2) & (seen.frame < FRAMES // 2) | (seen.first >= FRAMES // 2) & (
        seen.track % 40 == 0
    )
    few = replace(seen, **{name: getattr(seen, name)[kept] for name in ("frame", "first", "depth_m", "uv", "uv_first")},
                  track=np.unique(seen.track[kept], return_inverse=True)[1])  # fmt: skip
    rigid = tables([few], EXACT)["rigid"]
    unknown = rigid["cut_unknown"].sum() / (rigid["cut_unknown"].sum() + rigid["cut_error"].sum())
    assert 0.01 < unknown < 0.2
    assert near_share(rigid)["high"] > near_share(rigid.with_columns(cut_unknown=0.0))["high"] + 0.8 * unknown


def test_trackers_with_few_features_do_not_deny_a_pose_error():
    """Their share would be 0, as if they did not have the motion; imported tracks may be of some frames only."""
    rng = np.random.default_rng(0)
    many, few = observed(EXACT, rng, features=200), observed(EXACT, rng, features=4)
    stated = faulty("white", 0.1, 0.005)
    found = tables([many, few], stated)["rigid"]
    assert found["tracker"].n_unique() == 2
    assert found.filter(fitted_to="others")["tracker"].unique().to_list() == [TRACKERS[1]]
    late = observed(EXACT, rng, features=200)
    kept = late.first >= 25
    names = ("track", "frame", "first", "depth_m", "uv", "uv_first")
    some = replace(late, **{name: getattr(late, name)[kept] for name in names})
    some = replace(some, track=np.unique(some.track, return_inverse=True)[1])
    error, _, rigid = totals(tables([many, some], stated)["rigid"], "others", TRACKERS[0])
    assert rigid / error > 0.8


def test_frames_without_a_pose_are_left_out():
    stated = faulty("white", 0.1, 0.005)
    stated[7] = np.nan
    rng = np.random.default_rng(0)
    seen = observed(EXACT, rng, features=200)
    kept = (seen.frame != 7) & (seen.first != 7)
    names = ("track", "frame", "first", "depth_m", "uv", "uv_first")
    numbers = np.unique(seen.track[kept], return_inverse=True)[1]
    rest = replace(seen, **{name: getattr(seen, name)[kept] for name in names})
    error, left, _ = totals(tables([replace(rest, track=numbers)], stated)["rigid"])
    assert left < 0.5 * error


def test_a_key_frame_in_the_middle():
    key, rng = 20, np.random.default_rng(0)
    steady = np.tile(np.eye(4), (FRAMES, 1, 1))
    steady[:, 0, 3] = 0.002 * np.arange(FRAMES)
    stated = steady @ pose_noise("white", 0.1, 0.005, FRAMES, rng)
    uv = rng.uniform((40.0, 40.0), (600.0, 440.0), (300, 2))
    points = CAMERA.unproject(uv, rng.uniform(1.0, 5.0, 300))
    first = transform(invert(stated[0]), transform(stated[key], points))
    track, frame = (part.ravel() for part in np.indices((300, FRAMES)))
    real = CAMERA.project(transform((invert(steady) @ steady[key])[frame], points[track]))
    noise = rng.normal(0.0, 0.3, real.shape) * (frame != key)[:, None]
    seen = observed(steady, rng, features=1)
    made = replace(
        seen, track=track, frame=frame, first=np.zeros_like(track), depth_m=first[track, 2],
        uv=real + noise, uv_first=CAMERA.project(first)[track],
    )  # fmt: skip
    sequence = prepared([made], stated)
    keyed = prepare_sequence(sequence.observations, sequence.tracks, key_frame=key)
    geometry = FrameGeometry(stated, (CAMERA,), np.zeros(FRAMES, np.intp))
    found = rigid_tables(keyed, geometry, witnesses=TRACKERS)["rigid"]
    error, left, _ = totals(found)
    assert found["age"].max() == 20
    assert left < 0.1 * error


def test_no_depth_and_points_fitted_to_tracks_have_no_rows():
    sequence = prepared(both()[:1], EXACT)
    geometry = FrameGeometry(EXACT, (CAMERA,), np.zeros(FRAMES, np.intp))
    without = prepare_sequence(sequence.observations, sequence.tracks.with_columns(depth_m=pl.lit(None, pl.Float64)))
    fitted = replace(sequence, observations=sequence.observations.with_columns(epipolar_px=0.0, epipolar_variance=1.0))
    for one in (without, fitted):
        assert all(table.is_empty() for table in rigid_tables(one, geometry, witnesses=TRACKERS).values())


def near_share(table, fitted_to="own"):
    (row,) = pose_share([table]).filter(tracker=TRACKERS[0], fitted_to=fitted_to).iter_rows(named=True)
    return row


@pytest.mark.parametrize("fitted_to", ["own", "others"])
def test_one_share_up_to_the_reference_age_does_not_depend_on_wild_tracks(fitted_to):
    seen = both(noise_px=0.3)
    lost = np.random.default_rng(3).random(len(seen[0].track)) < 0.05
    wild = replace(seen[0], uv=seen[0].uv + np.where(lost & (seen[0].frame > seen[0].first), 40.0, 0.0)[:, None])
    stated = faulty("walk", 0.02, 0.001)
    usual, moved, exact = (
        near_share(tables([one, seen[1]], poses)["rigid"], fitted_to)
        for one, poses in ((seen[0], stated), (wild, stated), (wild, EXACT))
    )
    raw = totals(tables([wild, seen[1]], stated)["rigid"], fitted_to, TRACKERS[0])
    assert usual["low"] > 0.3
    assert moved["share"] == pytest.approx(usual["share"], abs=0.05)
    assert raw[2] / raw[0] < 0.1
    assert abs(exact["share"]) < 0.02


@pytest.mark.parametrize("depth_m", [(1.0, 5.0), (4.8, 5.2)])
def test_the_law_of_pose_errors_claims_no_more_than_the_errors_of_any_age(depth_m):
    rng = np.random.default_rng(1)
    seen = [observed(EXACT, rng, features=60, depth_m=depth_m) for _ in TRACKERS]
    growth = tables(seen, faulty("walk", 0.03, 0.0))["pose_growth"].filter(pl.col("lag") <= 24)
    white_r, walk_r, white_t, walk_t = (value**2 for value in pose_law([growth])["value"])
    lag = pl.col("lag")
    claimed = (2 * white_r + walk_r * lag) * pl.col("px2_per_degree")
    claimed += (2 * white_t + walk_t * lag) * pl.col("px2_per_metre")
    assert growth.select((claimed <= pl.col("error_px2") * (1 + 1e-9)).all()).item()
    assert growth.select((claimed.sum() / pl.col("rigid_px2").sum()).is_between(0.6, 1.4)).item()
