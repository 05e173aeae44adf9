"""Positions x/z and y/z are projected by the camera of the sequence, with its distortion."""

from dataclasses import replace

import numpy as np
import pytest
from tests.writers.track_files import WRITERS, Observed

import tracknoise as tn
from tracknoise.exceptions import DataError, SettingsError
from tracknoise.geometry.cameras import Camera, EquidistantCamera
from tracknoise.sequences.arrays import Sequence
from tracknoise.tables.identity import SequenceId
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.tracker import Frame, SequenceContext
from tracknoise.trackers.tracker_registry import make_tracker

SIZE, N_FRAMES = (320, 240), 10
RADTAN = Camera(*SIZE, 260.0, 255.0, 163.0, 117.0, (-0.28, 0.07, 0.0002, -0.0003))
FISHEYE = EquidistantCamera(*SIZE, 150.0, 152.0, 158.0, 121.0, (-0.02, 0.01, -0.01, 0.001))
TIMES = 1_403_636_579.763 + 0.05 * np.arange(N_FRAMES)


def context(*cameras) -> SequenceContext:
    return SequenceContext(
        SequenceId("d", "s"),
        SIZE,
        N_FRAMES,
        1,
        0,
        None,
        timestamps_s=TIMES,
        camera_at=lambda i: cameras[i % len(cameras)],
    )


def pixels(seed=0, n_tracks=12):
    rng = np.random.default_rng(seed)
    track, frame = (a.ravel() for a in np.meshgrid(np.arange(n_tracks), np.arange(N_FRAMES), indexing="ij"))
    return track, frame, np.column_stack([rng.uniform(5, 314, len(track)), rng.uniform(5, 234, len(track))])


def undistorted(uv, frame, *cameras):
    rays = np.array([cameras[i % len(cameras)].bearings(one[None])[0] for one, i in zip(uv, frame, strict=True)])
    return rays[:, :2]


def seen(tracker):
    return [tracker.step(Frame(index, np.zeros(SIZE[::-1], np.uint8))) for index in range(N_FRAMES)]


def compare(tracker, track, frame, uv, **close):
    for index, step in enumerate(seen(tracker)):
        order = np.lexsort(step.uv.T)
        expected = uv[frame == index]
        np.testing.assert_allclose(step.uv[order], expected[np.lexsort(expected.T)], **close)


@pytest.mark.parametrize("name", [name for name in WRITERS if not name.endswith(".db")])
@pytest.mark.parametrize("camera", [RADTAN, FISHEYE], ids=["radtan", "fisheye"])
def test_positions_come_back_in_every_format(tmp_path, name, camera):
    track, frame, uv = pixels()
    x, y = undistorted(uv, frame, camera).T
    WRITERS[name](tmp_path / name, Observed(track, frame, x, y, TIMES))
    tracker = make_tracker("imported", {"path": str(tmp_path / name), "units": "normalised"}).start(context(camera))
    compare(tracker, track, frame, uv, atol=2e-3)
    assert tracker.notes == ()


def test_the_camera_is_that_of_each_frame():
    cameras = (RADTAN, FISHEYE, replace(RADTAN, fx=300.0))
    track, frame, uv = pixels()
    x, y = undistorted(uv, frame, *cameras).T
    compare(
        Imported.from_arrays(track, frame, x, y, units="normalised").start(context(*cameras)),
        track,
        frame,
        uv,
        atol=1e-6,
    )


@pytest.mark.parametrize("camera", [RADTAN, FISHEYE], ids=["radtan", "fisheye"])
def test_covariances_become_those_of_pixels(camera):
    """Of many samples in the normalised plane, projected one by one."""
    track, frame, uv = pixels(n_tracks=2)
    xy = undistorted(uv, frame, camera)
    covariance = 1e-6 * np.array([[4.0, 1.5], [1.5, 2.0]])
    entries = {"uu": 4e-6, "uv": 1.5e-6, "vv": 2e-6}
    quality = {f"cov_{entry}": np.full(len(xy), value) for entry, value in entries.items()}
    given = {**quality, "score": np.arange(len(xy))}
    step = seen(Imported.from_arrays(track, frame, *xy.T, quality=given, units="normalised").start(context(camera)))[3]
    samples = np.random.default_rng(0).multivariate_normal((0.0, 0.0), covariance, size=200_000)
    for row, position in enumerate(step.uv):
        place = xy[np.argmin(np.linalg.norm(uv - position, axis=1))]
        projected = camera.project(np.column_stack([place + samples, np.ones(len(samples))]))
        found = [step.quality[f"cov_{entry}"][row] for entry in ("uu", "uv", "vv")]
        expected = np.cov(projected.T)
        scale = np.trace(expected)
        np.testing.assert_allclose(found, [expected[0, 0], expected[0, 1], expected[1, 1]], atol=0.01 * scale)
        assert step.quality["score"][row] in np.arange(len(xy))


def test_pixels_are_named():
    track, frame, uv = pixels()
    with pytest.raises(DataError, match=r"positions from 5.* these look like pixels: leave out units"):
        Imported.from_arrays(track, frame, *uv.T, units="normalised").start(context(RADTAN))


def test_swapped_columns_are_named():
    """Where the image is much wider than high, they can be told."""
    track, frame, uv = pixels()
    wide = uv[:, 0] < 60
    x, y = undistorted(uv[wide], frame[wide], RADTAN).T
    with pytest.raises(DataError, match="the columns are swapped"):
        Imported.from_arrays(track[wide], frame[wide], y, x, units="normalised").start(context(RADTAN))


def test_positions_without_an_image_are_left_out_and_noted():
    track, frame, uv = pixels()
    camera = replace(RADTAN, distortion=(-0.28, 0.0, 0.0, 0.0))
    assert np.isnan(camera.project(np.array([40.0, 0.0, 1.0]))).any()
    xy = undistorted(uv, frame, camera)
    xy[(track == 0) & (frame == 4)] = (40.0, 0.0)
    tracker = Imported.from_arrays(track, frame, *xy.T, units="normalised").start(context(camera))
    assert tracker.notes == ("0.8% of imported positions have no image in the camera, and were left out",)
    kept = ~((track == 0) & (frame == 4))
    compare(tracker, track[kept], frame[kept], uv[kept], atol=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"raster": [1.0, 1.0]}, r"raster is \(1.0, 1.0\), expected none with units = normalised"),
        ({"origin": "corner"}, "origin is .*, expected none with units = normalised"),
        ({"units": "metres"}, "units: expected 'pixels' or 'normalised', found 'metres'"),
    ],
)
def test_options_that_contradict_each_other_are_refused(options, message):
    with pytest.raises(SettingsError, match=message):
        make_tracker("imported", {"path": "x.csv", "units": "normalised", **options})
    with pytest.raises(SettingsError, match="units 'metres', expected one of pixels, normalised"):
        Imported.from_arrays([0], [0], [0.0], [0.0], units="metres")


def test_tracks_of_a_lens_with_distortion_have_the_errors_of_their_pixels():
    simulated = tn.open_sequence(
        "simulated",
        motions=["forward"],
        frames=6,
        width=160,
        height=120,
        lens="radtan",
        distortion=[-0.2, 0.03, 0.0, 0.0],
    )
    sequence = Sequence.from_arrays(
        [simulated.image(index) for index in range(6)],
        simulated.world_from_camera,
        simulated.camera,
        [simulated.depth(index).depth_m for index in range(6)],
    )
    native = tn.measure(sequence, tn.LucasKanade(min_features=60, max_features=80)).observations
    track, frame = (native[name].to_numpy().astype(np.int64) for name in ("track", "frame"))
    xy = sequence.camera.bearings(native.select("u_px", "v_px").to_numpy())[:, :2]
    found = tn.measure(sequence, tn.Imported.from_arrays(track, frame, *xy.T, units="normalised")).observations
    both = [table.sort("frame", "u_px", "v_px") for table in (native, found)]
    np.testing.assert_allclose(*(table.select("u_px", "v_px").to_numpy() for table in both), atol=1e-3)
    native_px, found_px = (table.select("du_px", "dv_px").fill_null(np.nan).to_numpy() for table in both)
    known = np.isfinite(native_px + found_px).all(axis=1)
    assert known.sum() > 100
    np.testing.assert_allclose(found_px[known], native_px[known], atol=0.05)
