import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError, DataWarning, SettingsError, UnknownNameError
from tracknoise.geometry.depth import interpolate
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.sequences.simulated import Simulated, SimulatedSequence
from tracknoise.tables.identity import SequenceId

MOTIONS = ("sideways", "fixating", "forward", "arvr")
FRAMES, WIDTH, HEIGHT = 11, 160, 120


@pytest.fixture(scope="module", params=MOTIONS)
def sequence(request: pytest.FixtureRequest) -> SimulatedSequence:
    reader = Simulated(motions=(request.param,), frames=FRAMES, width=WIDTH, height=HEIGHT)
    return reader.open(reader.sequences()[0])


@pytest.fixture
def world_file(tmp_path: Path) -> Path:
    """A wall that is 40 m wide, 20 m high and 2 m thick, with its southern side at y = 4."""
    wall = "<geometry><box><size>40 2 20</size></box></geometry>"
    link = f"<link name='l'><visual name='v'><pose>0 5 0 0 0 0</pose>{wall}</visual></link>"
    world = f"<world name='w'><model name='m'>{link}</model></world>"
    path = tmp_path / "wall.world"
    path.write_text(f"<sdf version='1.6'>{world}</sdf>")
    return path


def places(sequence: SimulatedSequence, count: int = 2000) -> np.ndarray:
    border = 4.0
    camera = sequence.camera
    return np.random.default_rng(0).uniform(border, (camera.width - 1 - border, camera.height - 1 - border), (count, 2))


def project(sequence: SimulatedSequence, index: int, points: np.ndarray) -> np.ndarray:
    return sequence.camera.project(transform(invert(sequence.world_from_camera[index]), points))


def test_scenes_are_named_by_motion_and_world() -> None:
    listed = Simulated(motions=("forward", "arvr"), worlds=2, lightings=("default", "east")).sequences()
    assert [(item.scene, item.lighting) for item in listed[:3]] == [
        ("arvr-00", "default"),
        ("arvr-00", "east"),
        ("arvr-01", "default"),
    ]
    assert len(listed) == 8
    assert listed == sorted(listed)
    assert {item.dataset for item in listed} == {"simulated"}


def test_the_camera_has_its_field_of_view_and_its_centre_between_the_middle_pixels() -> None:
    camera = Simulated(width=800, height=600, hfov_deg=60.0).camera
    assert camera.fx == camera.fy == pytest.approx(692.8203230275509)
    assert (camera.cx, camera.cy) == (399.5, 299.5)
    left, right = camera.bearings(np.array([[-0.5, 299.5], [799.5, 299.5]]))
    assert np.rad2deg(np.arctan(right[0]) - np.arctan(left[0])) == pytest.approx(60.0)


def test_a_sequence_is_what_the_protocol_says(sequence: SimulatedSequence) -> None:
    assert isinstance(sequence, Sequence)
    assert len(sequence) == FRAMES == len(sequence.world_from_camera)
    assert sequence.truths == (TruthKind.raycast, TruthKind.birth)
    image = sequence.image(0)
    assert (image.shape, image.dtype) == ((HEIGHT, WIDTH), np.uint8)
    assert 60 < image.mean() < 200
    assert image.std() > 20


def test_a_frame_is_the_same_in_any_order_and_in_any_copy(sequence: SimulatedSequence) -> None:
    first = [sequence.image(index) for index in (0, 3)]
    data = pickle.dumps(sequence)
    copy: SimulatedSequence = pickle.loads(data)
    assert len(data) < 10_000
    again = [copy.image(index) for index in (3, 0)]
    for before, after in zip(first, reversed(again), strict=True):
        np.testing.assert_array_equal(before, after)
    assert np.any(first[0] != first[1])


def test_cast_points_project_to_where_they_were_cast_from(sequence: SimulatedSequence) -> None:
    uv = places(sequence)
    assert sequence.surface is not None
    points, hit = sequence.surface.cast(4, uv)
    assert hit.all()
    assert np.abs(project(sequence, 4, points) - uv).max() < 1e-9


def test_depth_is_that_of_cast_points(sequence: SimulatedSequence) -> None:
    v, u = np.indices((HEIGHT, WIDTH), dtype=np.float64)
    points, hit = sequence.cast(2, np.stack([u.ravel(), v.ravel()], axis=-1))
    z = transform(invert(sequence.world_from_camera[2]), points)[:, 2]
    depth = sequence.depth(2)
    np.testing.assert_array_equal(depth.valid.ravel(), hit)
    np.testing.assert_allclose(depth.depth_m.ravel(), z, rtol=1e-12)


def test_interpolated_depth_gives_the_truth_that_ray_casting_gives(sequence: SimulatedSequence) -> None:
    uv = places(sequence)
    sample = interpolate(sequence.depth(0), uv, sequence.camera)
    assert sample.valid.mean() > 0.5
    by_depth = transform(sequence.world_from_camera[0], sequence.camera.unproject(uv, sample.depth_m))
    by_ray, _ = sequence.cast(0, uv)
    difference = np.linalg.norm(project(sequence, 10, by_depth) - project(sequence, 10, by_ray), axis=1)[sample.valid]
    assert np.median(difference) < 1e-6
    assert np.quantile(difference, 0.95) < 0.02


def test_images_move_as_the_geometry_says(sequence: SimulatedSequence) -> None:
    """Lucas-Kanade knows nothing of the poses: half a pixel of offset anywhere, or a mirrored axis, would show."""
    start, end = (sequence.image(index) for index in (0, 2))
    corners = cv2.goodFeaturesToTrack(start, 150, 0.02, 5).astype(np.float32)
    found, status, _ = cv2.calcOpticalFlowPyrLK(start, end, corners, None, winSize=(15, 15), maxLevel=3)
    tracked = status.ravel() == 1
    points, _ = sequence.cast(0, corners[tracked, 0].astype(np.float64))
    error = found[tracked, 0] - project(sequence, 2, points)
    assert np.abs(np.median(error, axis=0)).max() < 0.05
    assert np.median(np.abs(error)) < 0.15


def test_noise_is_of_the_size_asked_for_and_differs_between_frames() -> None:
    settings = {"frames": 2, "width": WIDTH, "height": HEIGHT, "scene": "sideways-00"}
    clean, noisy = (open_sequence("simulated", noise_sigma=sigma, **settings) for sigma in (0.0, 4.0))
    first, second = (noisy.image(index).astype(np.float64) - clean.image(index) for index in (0, 1))
    inside = (clean.image(0) > 20) & (clean.image(0) < 235)
    assert np.std(first[inside]) == pytest.approx(4.0, rel=0.05)
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.05


def test_lighting_and_seed_change_the_image_but_lighting_not_the_geometry() -> None:
    def opened(**options: Any) -> Sequence:
        small = {"frames": 1, "width": 80, "height": 60, "motions": ["sideways"], "noise_sigma": 0.0}
        return open_sequence("simulated", **{**small, **options})

    usual, east, other = opened(), opened(lightings=["east"]), opened(seed=1)
    assert np.abs(usual.image(0).astype(float) - east.image(0)).mean() > 5.0
    assert np.abs(usual.image(0).astype(float) - other.image(0)).mean() > 5.0
    np.testing.assert_array_equal(usual.world_from_camera, east.world_from_camera)
    np.testing.assert_array_equal(usual.depth(0).depth_m, east.depth(0).depth_m)
    assert np.any(usual.depth(0).depth_m != other.depth(0).depth_m)


def test_shadows_darken_some_of_the_image() -> None:
    settings = {"frames": 1, "width": 80, "height": 60, "noise_sigma": 0.0}
    plain, shaded = (
        open_sequence("simulated", scene="sideways-00", shadows=shadows, **settings).image(0)
        for shadows in (False, True)
    )
    assert np.all(shaded <= plain)
    assert 0.02 < np.mean(shaded < plain - 5.0) < 0.6


def test_paths_through_a_world_file_start_where_they_are_told_to(world_file: Path) -> None:
    """The sideways camera stands near (0, -6) and looks north in its own frame: here it is moved, and looks west."""
    options = {"frames": 3, "motions": ["sideways"]}
    plain = open_sequence("simulated", world_file=str(world_file), **options).world_from_camera
    placed = open_sequence("simulated", world_file=str(world_file), origin=[10, 20, 3], yaw_deg=90, **options)
    poses = placed.world_from_camera
    x, y, z = plain[:, :3, 3].T
    np.testing.assert_allclose(poses[:, :3, 3], np.stack([10 - y, 20 + x, 3 + z], axis=-1))
    np.testing.assert_allclose(poses[:, :3, 2], np.tile([-1.0, 0.0, 0.0], (3, 1)), atol=1e-12)
    np.testing.assert_allclose(poses[:, :3, 1], np.tile([0.0, 0.0, -1.0], (3, 1)), atol=1e-12)


def test_a_world_file_is_what_is_seen(world_file: Path) -> None:
    """A wall at y = 4, which the camera faces, and the way to it."""
    sequence = open_sequence("simulated", world_file=str(world_file), motions=["sideways"], frames=2)
    uv = np.array([[400.0, 300.0]])
    points, hit = sequence.surface.cast(1, uv)
    assert hit.all()
    assert points[0, 1] == pytest.approx(4.0)
    depth = sequence.depth(1).depth_m[300, 400]
    assert depth == pytest.approx(4.0 - sequence.world_from_camera[1, 1, 3])
    assert sequence.source == f"simulated scene sideways-00 in {world_file}"


def test_notes_say_what_of_a_world_is_not_shown(world_file: Path) -> None:
    world_file.write_text(world_file.read_text().replace("</model>", "</model><light name='lamp' type='point'/>"))
    sequence = Simulated(world_file=world_file, motions=("sideways",)).open(SequenceId("simulated", "sideways-00"))
    with pytest.warns(DataWarning, match="<light> 'lamp' is not shown"):
        notes = sequence.notes
    assert notes == (f"{world_file}: <light> 'lamp' is not shown",)
    assert Simulated().open(SequenceId("simulated", "sideways-00")).notes == ()


def test_objects_are_the_models_of_a_folder(sample: Callable) -> None:
    folder = sample("gazebo_models")
    reader = Simulated(
        motions=("linear", "arvr"), world="objects", models=folder, width=160, height=120, frames=300, worlds=2
    )
    scenes = [item.scene for item in reader.sequences()]
    assert scenes == ["arvr-00", "arvr-01", "linear-00", "linear-01"]
    first = reader.open(SequenceId("simulated", "linear-01"))
    assert first.notes[0].startswith("its objects are the Gazebo models ")
    assert first.notes[0].endswith(f" of {folder}")
    copy: SimulatedSequence = pickle.loads(pickle.dumps(first))
    np.testing.assert_array_equal(copy.image(299), first.image(299))


def test_missing_worlds_and_models_are_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"gone\.world: no such file, expected a Gazebo world"):
        Simulated(world_file=tmp_path / "gone.world").sequences()
    with pytest.raises(DataError, match="gone: no such folder, expected a folder of Gazebo models"):
        Simulated(world="objects", motions=("arvr",), models=tmp_path / "gone").sequences()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"frames": 0}, "reader 'simulated': frames is 0, expected a number from 1 to 1000000"),
        ({"frames": "60"}, "reader 'simulated': frames: expected a valid integer, found '60'"),
        ({"worlds": True}, "worlds: expected a valid integer, found True"),
        ({"width": 640.0}, "width: expected a valid integer, found 640.0"),
        ({"supersampling": 0}, "supersampling is 0, expected a number from 1 to 16"),
        ({"seed": -1}, "seed is -1, expected a number not below 0"),
        ({"hfov_deg": 180.0}, "hfov_deg is 180.0, expected a number between 0 and 180"),
        ({"noise_sigma": float("nan")}, "noise_sigma is nan, expected a number from 0 to 10000"),
        ({"noise_sigma": 1e300}, "noise_sigma is 1e+300, expected a number from 0 to 10000"),
        ({"noise_sigma": "2"}, "noise_sigma: expected a valid number, found '2'"),
        ({"shadows": 1}, "shadows: expected a valid boolean, found 1"),
        ({"motions": "forward"}, "motions: expected a valid array, found 'forward'"),
        ({"lightings": []}, "lightings is [], expected at least one name"),
        ({"motions": ["foward"]}, "unknown motion 'foward' (did you mean 'forward'?)"),
        ({"lightings": ["moon"]}, "unknown lighting 'moon'; known: default, east, overhead, west"),
        ({"world": "moon"}, "unknown world 'moon'; known: objects, objects-plain, plaza"),
        ({"motions": ["linear"]}, "motion 'linear' does not suit world 'plaza'; sideways, sideways-left, fixating, "),
        ({"world": "objects", "motions": ["forward"]}, "motion 'forward' does not suit world 'objects'; sideways, "),
        ({"models": "models"}, "world 'plaza' takes no models"),
        ({"models": 3}, "models: expected"),
        ({"world_file": ["a.world"]}, "world_file: expected"),
        ({"world_file": "a.world", "world": "objects"}, "world and world_file exclude each other"),
        ({"origin": [1.0, 2.0, 3.0]}, "origin and yaw_deg need a world_file"),
        ({"yaw_deg": 3.0}, "origin and yaw_deg need a world_file"),
        ({"world_file": "a.world", "origin": [1.0, 2.0]}, "origin.2: missing"),
        ({"world_file": "a.world", "yaw_deg": "90"}, "yaw_deg: expected a valid number, found '90'"),
        ({"hfov": 60.0}, "reader 'simulated': hfov: unknown setting (did you mean 'hfov_deg'?)"),
    ],
)
def test_bad_options_are_named(options: dict[str, object], message: str) -> None:
    with pytest.raises((SettingsError, UnknownNameError)) as caught:
        make_reader("simulated", options=options)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("scene", "lighting", "message"),
    [("sideways-01", "default", "unknown scene 'sideways-01'"), ("sideways-00", "east", "unknown lighting 'east'")],
)
def test_an_unknown_sequence_is_named(scene: str, lighting: str, message: str) -> None:
    with pytest.raises(UnknownNameError, match=message):
        Simulated().open(SequenceId("simulated", scene, lighting))
