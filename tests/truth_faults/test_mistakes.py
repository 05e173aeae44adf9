"""Each usual mistake is named where it was planted, and none where none was."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.truth_faults.planted import MISTAKES, without_depth

from tracknoise.geometry.pose import invert
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.views import chosen_frames
from tracknoise.truth_faults.check_report import Severity
from tracknoise.truth_faults.image_evidence import AS_GIVEN, Evidence, Flow, axis_rotations, hypotheses
from tracknoise.truth_faults.motion_checks import mistakes, warping

RECORDINGS = ("simulated", "tartanair", "sevenscenes")
ONE_OF_A_KIND = list({kind: name for name, (_, kind, _) in MISTAKES.items()}.values())
MOST_FRAMES = 24
"""Of a recording. To register the depth of a frame of 7-Scenes takes a fifth of a second."""


@cache
def recording(name, data_root):
    if name == "simulated":
        return open_sequence("simulated", motions=("arvr",), frames=24, width=320, height=240, supersampling=1)
    recorded = open_sequence(name, data_root / {"tartanair": "tartanair_v2"}.get(name, name))
    return chosen_frames(recorded, (0, MOST_FRAMES - 1))


@cache
def evidence(name, data_root):
    return Evidence.measured(recording(name, data_root))


@pytest.fixture(scope="module", autouse=True)
def let_go():
    """Recordings are in memory as long as these tests need them."""
    yield
    recording.cache_clear()
    evidence.cache_clear()


def depths_at(sequence, pairs):
    """Depths of planted maps at the points of pairs, from the depths as they are: the change depends on the pixel."""
    for pair in pairs:
        first, second = (
            _changed(sequence, uv, depth_m)
            for uv, depth_m in ((pair.uv_first, pair.depth_first_m), (pair.uv_second, pair.depth_second_m))
        )
        yield replace(pair, depth_first_m=first, depth_second_m=second)


def _changed(sequence, uv, depth_m):
    camera = sequence.sequence.camera
    factor = sequence.depths(np.ones((camera.height, camera.width)), camera)
    column, row = np.clip(np.round(uv).astype(int), 0, (camera.width - 1, camera.height - 1)).T
    return depth_m * factor[row, column]


def planted(name, sequence, seen):
    """Evidence about a sequence with a mistake; the image motion is what it is."""
    made = MISTAKES[name][0](sequence)
    flow = replace(
        seen.flow, steps=tuple(depths_at(made, seen.flow.steps)), wide=tuple(depths_at(made, seen.flow.wide))
    )
    return Evidence.of(flow, made.world_from_camera, made.camera)


@pytest.mark.parametrize(
    ("name", "where"), [*((name, "tartanair") for name in MISTAKES), *((name, "sevenscenes") for name in ONE_OF_A_KIND)]
)
def test_a_planted_mistake_is_named(name, where, data_root):
    _, kind, words = MISTAKES[name]
    item = mistakes(planted(name, recording(where, data_root), evidence(where, data_root)))
    assert item.severity is Severity.fatal, item.text
    assert (item.values["mistake"], words in item.text) == (kind, True), item.text


@pytest.mark.parametrize("where", RECORDINGS)
@pytest.mark.parametrize("factor", [0.8, 0.9, 1.1, 1.25])
def test_a_wrong_focal_length_is_no_mistake_of_the_poses(where, factor, data_root):
    seen = evidence(where, data_root)
    camera = replace(seen.camera, fx=factor * seen.camera.fx, fy=factor * seen.camera.fy)
    for known in (seen, replace(seen, flow=without_depth(seen.flow))):
        item = mistakes(replace(known, camera=camera))
        assert item.values.get("mistake", "focal") == "focal", item.text


BODY_FROM_CAMERA = np.eye(4)
BODY_FROM_CAMERA[:3, :3] = Rotation.from_euler("zyx", [91.0, 3.0, -2.0], degrees=True).as_matrix()
BODY_FROM_CAMERA[:3, 3] = -0.02, -0.06, 0.01
OF_BODIES = {
    "mounting": (lambda body: body, invert(BODY_FROM_CAMERA), "the pose of the camera on the body"),
    "inverted": (invert, BODY_FROM_CAMERA, "poses of the body are inverted"),
    "quaternion_order": (lambda body: with_scalar_first(body), BODY_FROM_CAMERA, "w x y z were read as x y z w"),
}
"""What is read of poses of the body, the stated mounting, and words of what is said."""


def with_scalar_first(body):
    changed = body.copy()
    quaternions = Rotation.from_matrix(body[:, :3, :3]).as_quat()[:, [3, 0, 1, 2]]
    changed[:, :3, :3] = Rotation.from_quat(quaternions).as_matrix()
    return changed


@pytest.mark.parametrize("where", RECORDINGS)
@pytest.mark.parametrize("kind", OF_BODIES)
def test_a_mistake_in_poses_of_a_body_or_its_camera_is_named(where, kind, data_root):
    seen, (read, mounting, words) = evidence(where, data_root), OF_BODIES[kind]
    poses = read(seen.poses @ invert(BODY_FROM_CAMERA)) @ mounting
    item = mistakes(replace(seen, poses=poses, body_from_camera=mounting))
    assert (item.values["mistake"], words in item.text) == (kind, True), item.text


@pytest.mark.parametrize("where", RECORDINGS)
def test_a_kind_of_depth_that_is_known_is_not_tried(where, data_root):
    found = planted("ray depth", recording(where, data_root), evidence(where, data_root))
    item = mistakes(replace(found, z_depth_from="stereo matching"))
    assert item.values.get("mistake") != "ray_depth"
    assert item.text.endswith("Depth along the ray was not tried: depths are z by construction (from stereo matching).")


@pytest.mark.parametrize("where", RECORDINGS)
def test_no_mistake_is_named_where_there_is_none(where, data_root):
    item = mistakes(evidence(where, data_root))
    assert item.severity is Severity.ok, item.text


def test_without_depth_a_mistake_is_seen_in_epipolar_lines(data_root):
    seen = evidence("sevenscenes", data_root)
    blind = without_depth(seen.flow)
    flow = replace(blind, steps=(*blind.steps, *blind.wide), wide=())
    right = Evidence.of(flow, seen.poses, seen.camera)
    wrong = Evidence.of(flow, np.linalg.inv(seen.poses), seen.camera)
    assert not right.has_depth
    assert mistakes(right).severity is Severity.ok
    assert mistakes(wrong).values["mistake"] == "inverted"


def test_a_recording_without_motion_says_that_nothing_can_be_seen(data_root):
    seen = evidence("simulated", data_root)
    still = Evidence.of(replace(seen.flow, steps=(), wide=()), seen.poses, seen.camera)
    assert mistakes(still).severity is Severity.unknown


def test_what_cannot_be_distinguished_is_named_too():
    sequence = open_sequence("simulated", motions=("sideways",), frames=14, width=200, height=150, supersampling=1)
    item = mistakes(planted("body", sequence, Evidence.measured(sequence)))
    assert item.severity is Severity.fatal
    assert "cannot distinguish" in item.text


def test_the_24_axis_rotations_are_rotations_and_differ():
    found = axis_rotations()
    assert len({tuple(matrix.ravel()) for matrix in found}) == 24
    assert all(np.isclose(np.linalg.det(matrix), 1.0) for matrix in found)
    assert np.array_equal(found[0], np.eye(3))


def test_every_mistake_can_be_undone_on_any_poses():
    poses = np.tile(np.eye(4), (6, 1, 1))
    assert {one.poses(poses).shape for one in (*hypotheses(), AS_GIVEN)} == {(6, 4, 4)}


def test_things_that_move_are_no_mistake_in_the_poses(data_root):
    """Four of five points are on them, and move as the nearest of them would if the poses were wrong."""
    still = evidence("simulated", data_root)

    def with_traffic(pair):
        moves = np.arange(len(pair.uv_second)) % 5 > 0
        return replace(
            pair, uv_second=pair.uv_second + moves[:, None] * (pair.second - pair.first) * np.array([3.0, 1.0])
        )

    flow = Flow(*(tuple(map(with_traffic, pairs)) for pairs in (still.flow.steps, still.flow.wide)))
    moving = Evidence.stated(flow, still.poses, recording("simulated", data_root))
    assert mistakes(moving).severity is Severity.ok
    seen = warping(moving)
    assert seen.severity is Severity.caveat
    assert "Parts of the scene probably move" in seen.text
