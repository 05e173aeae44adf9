"""Tracks on topics of bags: four front ends, ROS 1 and ROS 2, and bags that do not show which tracks are meant."""

from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg
from tests.writers.bags import BagWriter, Format

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera
from tracknoise.tables.identity import SequenceId
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.imported_rows import Units
from tracknoise.trackers.track_files import TrackFormat
from tracknoise.trackers.tracker import Frame, SequenceContext

SIZE, N_FRAMES, STEP_NS, BEGIN_NS = (320, 240), 4, 50_000_000, 1_700_000_000_000_000_000
IDS = np.array([7, 9, 12])
POSITIONS = np.array([[50.0, 60.0], [150.5, 100.25], [250.0, 200.0]])
TYPES = MappingProxyType(
    {
        "msckf_vio/msg/FeatureMeasurement": "uint64 id\nfloat64 u0\nfloat64 v0\nfloat64 u1\nfloat64 v1\n",
        "msckf_vio/msg/CameraMeasurement": "std_msgs/Header header\nFeatureMeasurement[] features\n",
        "depthai_ros_msgs/msg/TrackedFeature": "std_msgs/Header header\n\ngeometry_msgs/Point position\nuint32 id\n\n"
        "uint32 age\n\nfloat32 harris_score\n\nfloat32 tracking_error\n",
        "depthai_ros_msgs/msg/TrackedFeatures": "std_msgs/Header header\ndepthai_ros_msgs/TrackedFeature[] features",
        "dl_vins/msg/FeatureObservations": "std_msgs/Header header\nuint32[] feature_ids\nuint32 num_features\n"
        + "".join(f"float64[] {name}_{axis}\n" for name in ("points_left", "points_right") for axis in "xy")
        + "".join(f"float64[] {name}_{axis}\n" for name in ("pixel_left", "pixel_right") for axis in "xy")
        + "float64[] velocities_x\nfloat64[] velocities_y\n",
    }
)
"""As their packages define them."""


def at(frame: int) -> np.ndarray:
    return POSITIONS + frame * np.array([2.0, -1.0])


def cloud(bag: BagWriter, frame: int, *, with_camera: bool = False, short: bool = False, ids=IDS):
    uv = at(frame)
    columns = [ids, *uv.T]
    if with_camera:  # features of the right camera follow
        columns = [np.tile(IDS, 2), np.repeat([0, 1], 3), *np.tile(uv, (2, 1)).T, np.zeros(6), np.zeros(6)]
    if short:
        columns[1] = columns[1][:-1]
    channels = [bag.make("sensor_msgs/msg/ChannelFloat32", name="", values=np.float32(one)) for one in columns]
    points = [bag.make("geometry_msgs/msg/Point32", x=0.1, y=0.2, z=1.0) for _ in columns[0]]
    return bag.make("sensor_msgs/msg/PointCloud", header=header(bag, frame), points=points, channels=channels)


def msckf(bag: BagWriter, frame: int, *, ids=IDS):
    rays = (at(frame) - [160.0, 120.0]) / 300.0
    features = [
        bag.make("msckf_vio/msg/FeatureMeasurement", id=int(name), u0=u, v0=v, u1=0.1, v1=-0.05)
        for name, (u, v) in zip(ids, rays.tolist(), strict=True)
    ]
    return bag.make("msckf_vio/msg/CameraMeasurement", header=header(bag, frame), features=features)


def oak(bag: BagWriter, frame: int):
    features = [
        bag.make(
            "depthai_ros_msgs/msg/TrackedFeature",
            header=header(bag, frame),
            position=bag.make("geometry_msgs/msg/Point", x=u, y=v, z=0.0),
            id=int(name),
            age=frame,
            harris_score=5.0,
            tracking_error=0.25,
        )
        for name, (u, v) in zip(IDS, at(frame).tolist(), strict=True)
    ]
    return bag.make("depthai_ros_msgs/msg/TrackedFeatures", header=header(bag, frame), features=features)


def dl_vins(bag: BagWriter, frame: int):
    u, v = at(frame).T.copy()
    empty = np.empty(0)
    others = {f"{name}_{axis}": empty for name in ("points_left", "points_right", "pixel_right") for axis in "xy"}
    others |= {"velocities_x": empty, "velocities_y": empty, "pixel_left_x": u, "pixel_left_y": v}
    ids = IDS.astype(np.uint32)
    kind = "dl_vins/msg/FeatureObservations"
    return bag.make(kind, header=header(bag, frame), feature_ids=ids, num_features=len(ids), **others)


def header(bag: BagWriter, frame: int):
    return bag.header(BEGIN_NS + frame * STEP_NS, "world")


def written(path: Path, kind: Format, topics: dict, **options) -> Path:
    """A bag with the messages of each topic."""
    with BagWriter(path / "run", kind) as bag:
        for name, text in TYPES.items():
            bag.store.register(get_types_from_msg(text, name))
        for frame in range(N_FRAMES):
            for topic, make in topics.items():
                bag.write(topic, make(bag, frame, **options), BEGIN_NS + frame * STEP_NS + 9_000_000)
    return bag.path


def context() -> SequenceContext:
    camera = Camera(*SIZE, 300.0, 300.0, 160.0, 120.0)
    times = 1e-9 * (BEGIN_NS + STEP_NS * np.arange(N_FRAMES))
    return SequenceContext(
        SequenceId("d", "s"), SIZE, N_FRAMES, 1, 0, None, timestamps_s=times, camera_at=lambda _: camera
    )


def steps(path: Path, **options) -> list:
    tracker = Imported(str(path), format=TrackFormat.bag, **options).start(context())
    return [tracker.step(Frame(frame, np.zeros(SIZE[::-1], np.uint8))) for frame in range(N_FRAMES)]


@pytest.mark.parametrize(
    ("kind", "make", "options"),
    [
        (Format.ros1, cloud, {}),
        (Format.mcap, lambda *bag: cloud(*bag, with_camera=True), {}),
        (Format.ros1, msckf, {"units": Units.normalised}),
        (Format.sqlite, oak, {}),
        (Format.mcap, dl_vins, {}),
    ],
    ids=["vins-mono", "with cameras", "msckf-vio", "oak", "dl-vins"],
)
def test_tracks_of_a_topic_are_those_that_the_front_end_published(tmp_path, kind, make, options) -> None:
    found = steps(written(tmp_path, kind, {"/tracks": make}), **options)
    for frame, step in enumerate(found):
        np.testing.assert_allclose(step.uv, at(frame), atol=1e-4)
        assert step.ids.tolist() == [0, 1, 2]  # the same tracks in all frames
    if make is oak:
        assert found[0].response.tolist() == [5.0] * 3
        assert found[2].quality["tracking_error"].tolist() == [0.25] * 3


def test_a_camera_that_a_topic_does_not_have_is_named(tmp_path) -> None:
    for make, message in ((cloud, "no feature of camera 1, expected"), (oak, "no camera 1, expected one of 0")):
        with pytest.raises(DataError, match=message):
            steps(written(tmp_path / make.__name__, Format.ros1, {"/tracks": make}), camera=1)


def test_the_second_camera_of_a_pair_can_be_chosen(tmp_path) -> None:
    path = written(tmp_path, Format.ros1, {"/tracks": msckf})
    first, second = (steps(path, units=Units.normalised, camera=camera)[0] for camera in (0, 1))
    np.testing.assert_allclose(first.uv, at(0), atol=1e-4)
    np.testing.assert_allclose(second.uv, [[190.0, 105.0]] * 3)


def test_the_topic_is_asked_for_where_several_have_tracks(tmp_path) -> None:
    path = written(tmp_path, Format.ros1, {"/one": cloud, "/two": oak})
    with pytest.raises(DataError, match=r": topics of tracks /one, /two, expected one, or topic = \.\.\."):
        steps(path)
    with pytest.raises(DataError, match="no topic of tracks /three"):
        steps(path, topic="/three")
    assert len(steps(path, topic="/two")[0].ids) == 3


@pytest.mark.parametrize(
    ("make", "first", "message"),
    [
        (cloud, np.nan, "id nan, expected a whole number"),
        (cloud, np.inf, f"id inf, expected a whole number of at most {2**53 - 1}"),
        (cloud, 7.5, "id 7.5, expected a whole number"),
        (msckf, 2**63, f"id {2**63}, expected a whole number of at most {2**63 - 1}"),
    ],
)
def test_an_id_that_is_no_number_of_a_track_is_refused(tmp_path, make, first, message) -> None:
    path = written(tmp_path, Format.ros1, {"/tracks": make}, ids=[7, first, 12])
    with pytest.raises(DataError, match=f"run.bag /tracks: message 1: {message}$"):
        steps(path)


def test_large_ids_are_told_apart_and_those_of_a_cloud_that_are_not_are_refused(tmp_path) -> None:
    ids = [2**53, 2**53 + 1, 2**63 - 1]
    found = steps(written(tmp_path / "exact", Format.ros1, {"/tracks": msckf}, ids=ids), units=Units.normalised)
    assert [step.ids.tolist() for step in found] == [[0, 1, 2]] * N_FRAMES
    path = written(tmp_path / "rounded", Format.ros1, {"/tracks": cloud}, ids=[2**24, 2**24 + 1, 1])
    with pytest.raises(DataError, match=r"track 16777216, expected one row for each track and time$"):
        steps(path)


def test_what_is_no_track_is_named(tmp_path) -> None:
    path = written(tmp_path / "short", Format.ros1, {"/tracks": cloud}, short=True)
    with pytest.raises(DataError, match="message 1: 3 numbers of features, and 2 and 3 coordinates"):
        steps(path)
    with BagWriter(tmp_path / "images" / "run", Format.ros1) as bag:
        bag.image("/image", BEGIN_NS, "camera", "mono8", np.zeros(SIZE[::-1], np.uint8))
    with pytest.raises(DataError, match="no topic of the types"):
        steps(bag.path)
    (tmp_path / "damaged.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(50))
    with pytest.raises(DataError, match="bag"):
        steps(tmp_path / "damaged.bag")
