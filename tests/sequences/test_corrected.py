"""Corrections of what a recording states: opposite to a known fault, they give the truth without the fault."""

import pickle
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.truth.rolling import CAMERA, RATE_HZ, READOUT_S, RollingRoom, path

import tracknoise as tn
from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import EquidistantCamera
from tracknoise.geometry.corrections import Corrections
from tracknoise.geometry.pose import PosePath, invert
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.corrected import corrected
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.views import Backward, View, chosen_frames, turned
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth_registry import make_truth

BIRTH, NOW = 2, 6
MOUNTING = Corrections(mounting_rotation_deg=(0.7, -0.4, 1.2), mounting_translation_m=(0.026, -0.01, 0.004))


@dataclass(frozen=True, slots=True, eq=False)
class Stated(View):
    """A sequence that states something else than what is true."""

    changes: dict = field(default_factory=dict)

    @property
    def camera(self):
        return replace(self.sequence.camera, **self.changes.get("camera", {}))

    def camera_at(self, index):
        return self.camera

    @property
    def world_from_camera(self):
        return self.changes.get("poses", self.sequence.world_from_camera)

    @property
    def timestamps_s(self):
        return self.changes.get("times", self.sequence.timestamps_s)

    @property
    def shutter(self):
        return self.changes.get("shutter", self.sequence.shutter)

    @property
    def path(self):
        return self.changes.get("path")

    def depth(self, index):
        depth = self.sequence.depth(index)
        if "ray depth" in self.changes:
            v, u = np.indices(depth.depth_m.shape)
            rays = self.camera.bearings(np.stack([u, v], axis=-1).astype(float))
            return replace(depth, depth_m=depth.depth_m * np.linalg.norm(rays, axis=-1))
        if "disparity" in self.changes:
            return replace(depth, depth_m=1.0 / (1.0 / depth.depth_m - 0.02))
        return replace(depth, depth_m=(depth.depth_m - 0.05) / 1.1) if "depth" in self.changes else depth


@pytest.fixture(scope="module")
def room():
    return RollingRoom.of(path())


def mounting(corrections):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(np.deg2rad(corrections.mounting_rotation_deg)).as_matrix()
    pose[:3, 3] = corrections.mounting_translation_m
    return pose


def pixels():
    u, v = np.meshgrid(np.arange(20.3, 140.0, 17.0), np.arange(15.6, 105.0, 11.0))
    return np.stack([u.ravel(), v.ravel()], axis=-1)


def located(sequence, kind="birth", birth=BIRTH, now=NOW):
    truth = make_truth(sequence, kind)
    return truth.locate(now, truth.anchor(birth, pixels())[0])


FAULTS = {
    "focal length": ({"camera": {"fx": CAMERA.fx / 0.9, "fy": CAMERA.fy / 0.9}}, Corrections(focal_scale=0.9)),
    "principal point": (
        {"camera": {"cx": CAMERA.cx - 2.5, "cy": CAMERA.cy + 1.25}},
        Corrections(principal_point_px=(2.5, -1.25)),
    ),
    "k1": ({"camera": {"distortion": (-0.1, *CAMERA.distortion[1:])}}, Corrections(k1=CAMERA.distortion[0] + 0.1)),
    "depth": ({"depth": True}, Corrections(depth_scale=1.1, depth_offset_m=0.05)),
    "disparity": ({"disparity": True}, Corrections(inverse_depth_offset_per_m=0.02)),
    "ray depth": ({"ray depth": True}, Corrections(depth_along_ray=True)),
    "readout": ({"shutter": None}, Corrections(readout_s=READOUT_S)),
    "part of the readout": ({"shutter": RollingShutter(0.01)}, Corrections(readout_s=READOUT_S - 0.01)),
    "mounting": ({"poses": path() @ invert(mounting(MOUNTING))}, MOUNTING),
}


@pytest.mark.parametrize("name", FAULTS)
def test_the_opposite_correction_undoes_a_fault(room, name):
    changes, corrections = FAULTS[name]
    expected, status = located(room)
    found, found_status = located(corrected(Stated(room, changes), corrections))
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert (found_status == status).all()
    assert np.nanmedian(np.abs(located(Stated(room, changes))[0] - expected)) > 0.1


def test_all_faults_together_are_undone(room):
    changes = {
        "camera": {"fx": CAMERA.fx / 0.9, "fy": CAMERA.fy / 0.9, "cx": CAMERA.cx - 2.0},
        "depth": True,
        "shutter": None,
        "poses": path() @ invert(mounting(MOUNTING)),
    }
    every = replace(
        MOUNTING,
        focal_scale=0.9,
        principal_point_px=(2.0, 0.0),
        depth_scale=1.1,
        depth_offset_m=0.05,
        readout_s=READOUT_S,
    )
    np.testing.assert_allclose(located(corrected(Stated(room, changes), every))[0], located(room)[0], atol=1e-9)


@pytest.mark.parametrize("shutter", [None, RollingShutter(READOUT_S)])
def test_a_clock_offset_of_whole_frames_is_undone(room, shutter):
    room = replace(room, shutter=shutter)
    late = np.concatenate([room.world_from_camera[:1], room.world_from_camera[:-1]])  # frame i has the pose of i - 1
    found = corrected(Stated(room, {"poses": late}), Corrections(clock_offset_s=1 / RATE_HZ))
    assert has_pose(found.world_from_camera).tolist() == [True] * 8 + [False]
    np.testing.assert_allclose(located(found)[0], located(room)[0], atol=1e-9)
    assert (located(found, now=8)[1] == TruthStatus.no_pose).all()


def test_a_clock_offset_below_a_frame_is_undone_at_constant_velocity():
    steady = np.broadcast_to(np.eye(4), (9, 4, 4)).copy()
    steady[:, :3, :3] = Rotation.from_rotvec(np.arange(9)[:, None] * [0.0, 0.02, 0.01]).as_matrix()
    steady[:, 0, 3] = 0.03 * np.arange(9)
    room = RollingRoom.of(steady)
    poses = np.broadcast_to(np.eye(4), (9, 4, 4)).copy()
    for pose, time_s in zip(poses, room.timestamps_s, strict=True):
        pose[:3, :3], pose[:3, 3] = room.pose_after(time_s - 0.011)
    found = corrected(Stated(room, {"poses": poses}), Corrections(clock_offset_s=0.011))
    np.testing.assert_allclose(located(found)[0], located(room)[0], atol=1e-9)


@pytest.mark.parametrize("shutter", [None, RollingShutter(READOUT_S)])
def test_a_clock_that_runs_at_another_rate_is_undone(room, shutter):
    room, drift = replace(room, shutter=shutter), 0.02
    times = room.timestamps_s
    middle = 0.5 * (times[0] + times[-1])
    slow = PosePath(middle + (times - middle) / (1.0 + drift), room.world_from_camera)
    fast = PosePath(middle + (times - middle) * (1.0 + drift), room.world_from_camera)
    found = corrected(Stated(room, {"path": fast}), Corrections(clock_drift=drift))
    np.testing.assert_allclose(found.path.times, times, atol=1e-12)
    np.testing.assert_allclose(found.world_from_camera, room.world_from_camera, atol=1e-9)
    np.testing.assert_allclose(located(found)[0], located(room)[0], atol=1e-9)
    ends = has_pose(corrected(Stated(room, {"path": slow}), Corrections(clock_drift=drift)).world_from_camera)
    assert not ends[0]
    assert not ends[-1]


def test_depths_whose_corrected_inverse_is_not_positive_are_invalid(room):
    depth = room.depth(BIRTH)
    least = float(np.median(depth.depth_m[depth.valid]))
    found = corrected(room, Corrections(inverse_depth_offset_per_m=-1.0 / least)).depth(BIRTH)
    np.testing.assert_array_equal(found.valid, depth.valid & (depth.depth_m < least))
    assert (found.depth_m[found.valid] > 0.0).all()


def test_a_clock_offset_in_frames_needs_no_timestamps(room):
    room = replace(room, shutter=None)
    late = np.concatenate([room.world_from_camera[:2], room.world_from_camera[:-2]])
    found = corrected(Stated(room, {"poses": late, "times": None}), Corrections(clock_offset_frames=2))
    np.testing.assert_allclose(located(found)[0], located(room)[0], atol=1e-9)
    assert has_pose(found.world_from_camera).tolist() == [True] * 7 + [False] * 2


def test_an_exact_surface_keeps_its_depth_under_each_pixel(room):
    found, _ = located(corrected(room, Corrections(focal_scale=0.9, depth_scale=1.1)), "raycast")
    expected, _ = located(corrected(room, Corrections(focal_scale=0.9, depth_scale=1.1)), "birth")
    close = np.linalg.norm(found - expected, axis=1)
    assert np.nanmedian(close) < 0.02


def test_an_exact_surface_is_corrected_as_a_depth_map_is(room):
    corrections = Corrections(depth_along_ray=True)
    found, expected = (located(corrected(room, corrections), kind)[0] for kind in ("raycast", "birth"))
    assert np.nanmedian(np.linalg.norm(found - expected, axis=1)) < 0.02


def test_corrections_apply_before_views(room):
    corrections = replace(MOUNTING, clock_offset_s=0.004, readout_s=-0.005, focal_scale=1.05)
    expected, _ = located(corrected(room, corrections))
    back, _ = located(Backward(corrected(room, corrections)), birth=8 - BIRTH, now=8 - NOW)
    np.testing.assert_allclose(back, expected, atol=1e-9)
    few, _ = located(chosen_frames(corrected(room, corrections), [BIRTH, NOW, 4]), birth=0, now=1)
    np.testing.assert_allclose(few, expected, atol=1e-9)
    assert turned(corrected(room, corrections), 90).shutter == RollingShutter(READOUT_S - 0.005, axis=0)


def test_what_is_neutral_is_the_sequence_itself(room):
    assert corrected(room, Corrections()) is room


def test_a_camera_without_distortion_gets_k1():
    room = RollingRoom.of(path(), camera=replace(CAMERA, distortion=()))
    assert corrected(room, Corrections(k1=0.01)).camera.distortion == (0.01, 0.0, 0.0, 0.0)


def test_corrections_are_noted_in_one_sentence_each(room):
    found = corrected(room, Corrections(focal_scale=0.8974, readout_s=0.0261, mounting_translation_m=(0.026, 0, 0)))
    assert found.notes == (
        "correction: focal lengths are multiplied by 0.8974",
        "correction: 0.0261 s is added to the readout of the rolling shutter",
        "correction: the camera is moved by (0.026, 0, 0) m in the frame of the poses",
    )


def test_a_corrected_sequence_can_be_pickled(room):
    found = pickle.loads(pickle.dumps(corrected(room, MOUNTING)))
    np.testing.assert_array_equal(found.world_from_camera, corrected(room, MOUNTING).world_from_camera)


@pytest.mark.parametrize(
    ("changes", "corrections", "message"),
    [
        ({"times": None, "shutter": None}, {"clock_offset_s": 0.1}, "clock_offset_s and no timestamps, expected clock"),
        ({"times": None, "shutter": None}, {"readout_s": 0.1}, "readout_s and no timestamps, expected timestamps"),
        ({"times": None, "shutter": None}, {"clock_drift": 0.1}, "clock_drift and no timestamps, expected timestamps"),
        ({}, {"clock_offset_frames": 1}, "clock_offset_frames and timestamps, expected clock_offset_s"),
        ({}, {"k1": -3.0}, "corrections that leave pixels without a ray, expected a lens that can be inverted"),
    ],
)
def test_what_cannot_be_corrected_is_named(room, changes, corrections, message):
    with pytest.raises(DataError, match=f"^made rolling room: {message}") as caught:
        corrected(Stated(room, changes), Corrections(**corrections))
    assert "\n" not in str(caught.value)


def test_k1_of_other_lenses_is_refused():
    fisheye = EquidistantCamera(160, 120, 90.0, 90.0, 79.5, 59.5, (0.0, 0.0, 0.0, 0.0))
    room = RollingRoom.of(path(), camera=fisheye)
    with pytest.raises(DataError, match="k1 for a camera of the model EquidistantCamera, expected radial-tangential"):
        corrected(room, Corrections(k1=0.01))
    assert corrected(room, Corrections(focal_scale=1.1)).camera.fx == pytest.approx(99.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"focal_scale": 0.0}, "focal_scale is 0.0, expected a number above 0"),
        ({"depth_scale": -1.0}, "depth_scale is -1.0, expected a number above 0"),
        ({"k1": float("nan")}, "k1 is nan, expected a finite number"),
        ({"principal_point_px": (1.0,)}, "principal_point_px is .*, expected 2 finite numbers"),
        ({"mounting_rotation_deg": 3.0}, "mounting_rotation_deg is 3.0, expected 3 finite numbers"),
        ({"clock_drift": -1.0}, "clock_drift is -1.0, expected a number above -1"),
        ({"readout_s": 26.0}, "readout_s is 26.0, expected seconds between -1 and 1"),
        ({"clock_offset_s": 0.1, "clock_offset_frames": 1.0}, "clock_offset_frames is 1.0, expected 0 beside"),
    ],
)
def test_impossible_corrections_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Corrections(**values)


def test_measured_errors_are_those_without_the_fault():
    sequence = tn.open_sequence("simulated", motions=["sideways"], frames=10, width=160, height=120, supersampling=1)
    tracker = tn.LucasKanade(min_features=60, max_features=90)
    stated = Stated(sequence, {"camera": {"fx": sequence.camera.fx * 1.5, "fy": sequence.camera.fy * 1.5}})
    truth, wrong, mended = (
        tn.measure(one, tracker, truth="birth", **more).observations
        for one, more in ((sequence, {}), (stated, {}), (stated, {"corrections": Corrections(focal_scale=1 / 1.5)}))
    )
    columns = ["u_true_px", "v_true_px", "du_px", "dv_px"]
    np.testing.assert_allclose(
        mended.select(columns).to_numpy(), truth.select(columns).to_numpy(), atol=1e-9, equal_nan=True
    )
    assert wrong["du_px"].drop_nulls().abs().mean() > 2 * truth["du_px"].drop_nulls().abs().mean()
