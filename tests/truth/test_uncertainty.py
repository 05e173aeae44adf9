"""The derivatives of true positions against true positions of changed sequences, and what is made of them."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from benchmarks.validity.floor import exact_tracks, exact_world, positions_of
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import PosePath, invert, transform
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.tables.enumerations import FloorSource
from tracknoise.truth.uncertainty import TrueErrors, TruthDerivatives, anchored_points

DISTORTED = Camera(320, 240, 250.0, 252.0, 161.0, 118.0, (-0.1, 0.02, 0.001, -0.002))


@pytest.fixture(scope="module", params=["pinhole", "distorted"])
def world(request):
    made = exact_world(frames=14)
    return made if request.param == "pinhole" else replace(made, lens=DISTORTED)


@dataclass(frozen=True)
class Seen:
    """Observations with known points, and the derivatives of their true positions."""

    rows: NDArray[np.intp]
    points: object
    found: object
    uv: NDArray[np.float64]


@pytest.fixture(scope="module")
def tracks(world):
    return exact_tracks(world, per_frame=10)


@pytest.fixture(scope="module")
def seen(world, tracks):
    positions = positions_of(world, tracks)
    frame, track = tracks.frame.astype(np.intp), tracks.track.astype(np.intp)
    rows, points = anchored_points(world, frame, track, positions, key_frame=None)
    return Seen(rows, points, TruthDerivatives(world).sensitivity(points), positions.uv)


def moved(world, tracks, seen, changed, size):
    """(n, 2): change of true positions, per unit of a fault of this size."""
    return (positions_of(changed, tracks).uv - seen.uv)[seen.rows] / size


def twisted(frames, index, motion):
    """Motions of one frame only, on the right."""
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[index, :3, :3] = Rotation.from_rotvec(motion[3:]).as_matrix()
    poses[index, :3, 3] = motion[:3]
    return poses


def test_points_are_where_the_true_positions_are(world, seen) -> None:
    here = transform(invert(world.poses[seen.points.frame]), seen.points.points_world)
    np.testing.assert_allclose(world.lens.project(here), seen.uv[seen.rows], atol=1e-6)


@pytest.mark.parametrize("axis", range(6))
def test_a_motion_of_one_pose_moves_positions_by_the_derivative(world, tracks, seen, axis) -> None:
    """Sign is that of the relative pose: the frame of the observation moves positions the other way."""
    size, index = 1e-5, 6
    motion = np.zeros(6)
    motion[axis] = size
    changed = replace(world, poses=world.poses @ twisted(len(world), index, motion))
    measured = moved(world, tracks, seen, changed, size)
    here, there = seen.points.frame == index, seen.points.anchor == index
    only_here = here & ~there
    by_translation = seen.found.translation if axis < 3 else seen.found.rotation_here
    # the cross product of a derivative and a point is minus the derivative by the rotation of the point
    sign = -1.0 if axis < 3 else 1.0
    np.testing.assert_allclose(measured[only_here], sign * by_translation[only_here, :, axis % 3], atol=2e-2, rtol=1e-3)
    only_there = there & ~here
    turned = (invert(world.poses[seen.points.frame]) @ world.poses[seen.points.anchor])[only_there, :3, axis % 3]
    factors = seen.found.translation if axis < 3 else -seen.found.rotation_there
    expected = np.einsum("nij,nj->ni", factors[only_there], turned)
    np.testing.assert_allclose(measured[only_there], expected, atol=2e-2, rtol=1e-3)


def test_depth_moves_positions_by_the_derivative(world, tracks, seen) -> None:
    size = 1e-5
    deeper = tuple(replace(depth, depth_m=depth.depth_m * (1.0 + size)) for depth in world.depths)
    measured = moved(world, tracks, seen, replace(world, depths=deeper), size)
    np.testing.assert_allclose(measured, seen.found.depth * seen.found.depth_m[:, None], atol=1e-4, rtol=1e-3)


def test_the_focal_length_moves_positions_by_the_derivative(world, tracks, seen) -> None:
    size = 1e-5
    longer = replace(world.lens, fx=world.lens.fx * (1.0 + size), fy=world.lens.fy * (1.0 + size))
    measured = moved(world, tracks, seen, replace(world, lens=longer), size)
    np.testing.assert_allclose(measured, seen.found.focal, atol=1e-3, rtol=1e-3)


def test_a_clock_offset_moves_positions_by_the_derivative(world, tracks, seen) -> None:
    size_s = 1e-4
    path = PosePath(world.timestamps_s, world.poses)
    # a central difference, as the path has corners in the frames
    later, earlier = (replace(world, poses=path.at(world.timestamps_s + sign * size_s)) for sign in (1.0, -1.0))
    measured = (positions_of(later, tracks).uv - positions_of(earlier, tracks).uv)[seen.rows] / (2.0 * size_s)
    inner = (seen.points.frame < len(world) - 1) & (seen.points.anchor > 0)
    np.testing.assert_allclose(measured[inner], seen.found.clock[inner], atol=0.3, rtol=0.02)


def test_a_rolling_shutter_moves_positions_by_the_derivative(world, seen) -> None:
    readout_s = 1e-3
    shutter, times = RollingShutter(readout_s), world.timestamps_s
    path, points = PosePath(times, world.poses), seen.points
    birth_uv = world.lens.project(transform(invert(world.poses[points.anchor]), points.points_world))
    depth_m = seen.found.depth_m
    uv = seen.uv[seen.rows]
    shifts = []
    for sign in (1.0, -1.0):
        at_birth = path.at(times[points.anchor] + sign * shutter.delays_s(world.lens, birth_uv))
        now = path.at(times[points.frame] + sign * shutter.delays_s(world.lens, uv))
        point = transform(at_birth, world.lens.unproject(birth_uv, depth_m))
        shifts.append(world.lens.project(transform(invert(now), point)))
    measured = (shifts[0] - shifts[1]) / (2.0 * readout_s)
    inner = (points.frame < len(world) - 1) & (points.anchor > 0)
    np.testing.assert_allclose(measured[inner], seen.found.readout[inner], atol=0.3, rtol=0.03)


def test_every_source_has_a_covariance_which_is_zero_at_birth(world, seen) -> None:
    every = TruthAccuracy(
        rotation_white_deg=0.1, translation_m_per_sqrt_frame=0.01, depth_relative=0.01, clock_ms=3.0,
        readout_ms=10.0, focal_relative=0.01,
    )  # fmt: skip
    errors = TrueErrors(TruthDerivatives(world), every, step=1)
    assert errors.sources == tuple(source for source in FloorSource if source != FloorSource.all)
    (_, found), *others = errors.of(seen.points)
    assert not others
    born = seen.points.frame == seen.points.anchor
    for source in errors.sources:
        covariance = found.covariance[source]
        assert not covariance[born].any()
        assert (np.linalg.eigvalsh(covariance[~born]) > -1e-9).all()
        assert np.einsum("nii->n", covariance[~born]).mean() > 1e-5, source


def test_laws_are_of_frames_of_the_recording(world, seen) -> None:
    walk = TruthAccuracy(rotation_deg_per_sqrt_frame=0.1)
    single, double = (
        next(TrueErrors(TruthDerivatives(world), walk, step=step).of(seen.points))[1].covariance[FloorSource.poses]
        for step in (1, 2)
    )
    np.testing.assert_allclose(double, 2.0 * single)
