"""Poses of another program: every format gives the poses that were written, on the frames that they belong to."""

import json

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.contract.test_sequences import LAYOUTS
from tests.writers import colmap, euroc
from tests.writers.bags import BagWriter, Format

from tracknoise.exceptions import DataError
from tracknoise.sequences.estimated_poses import posed_by, with_trajectory
from tracknoise.sequences.folder import Folder
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import Body
from tracknoise.sequences.timed_poses import PosesOf
from tracknoise.tables.identity import SequenceId
from tracknoise.truth.accuracies import known_accuracy

COUNT = 6
START_NS = 1_403_636_579_763_555_584


def made_poses(count=COUNT, seed=1):
    rng, poses = np.random.default_rng(seed), np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    poses[:, :3, :3] = Rotation.from_rotvec(rng.normal(0.0, 0.5, (count, 3))).as_matrix()
    poses[:, :3, 3] = rng.normal(0.0, 2.0, (count, 3))
    return poses


POSES = made_poses()


def quaternions(poses, *, scalar_first=False):
    xyzw = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    return np.roll(xyzw, 1, axis=1) if scalar_first else xyzw


def lines(first, values, separator=" "):
    rows = zip(first, values, strict=True)
    return "".join(separator.join([str(key), *(f"{value:.17g}" for value in row)]) + "\n" for key, row in rows)


def tum(stamps, poses=POSES):
    return lines(stamps, np.c_[poses[:, :3, 3], quaternions(poses)])


def sequence_of(times=None, start_ns=None, **facts):
    return RecordedSequence(
        id=SequenceId("made", "walk"),
        source="made",
        camera=open_sequence("simulated", frames=2, width=32, height=24).camera,
        world_from_camera=np.full((COUNT, 4, 4), np.nan),
        poses_elsewhere=True,
        images=lambda _: np.zeros((24, 32), np.uint8),
        timestamps_s=times,
        clock_start_ns=start_ns,
        **facts,
    )


def found(tmp_path, text, sequence, name="poses.txt", **how):
    (tmp_path / name).write_text(text)
    return with_trajectory(sequence, tmp_path / name, **how)


TIMES = np.arange(COUNT) / 20
STAMPS_NS = [START_NS + 50_000_000 * index for index in range(COUNT)]
SECONDS = [f"{ns // 10**9}.{ns % 10**9:09d}" for ns in STAMPS_NS]
EUROC = lines(STAMPS_NS, np.c_[POSES[:, :3, 3], quaternions(POSES, scalar_first=True)], ",")
NAMED = "#timestamp [ns],x,y,z,qx,qy,qz,qw\n" + lines(STAMPS_NS, np.c_[POSES[:, :3, 3], quaternions(POSES)], ",")


class TestByTime:
    @pytest.mark.parametrize(
        "text",
        [
            tum(SECONDS),
            tum([f"{ns}.000000" for ns in STAMPS_NS]),
            tum([f"{ns / 1e3:.3f}" for ns in STAMPS_NS]),
            tum([f"{time:.6f}" for time in TIMES]),
            "# timestamp,tx\n" + tum(SECONDS).replace(" ", ", "),
            EUROC,
            EUROC.replace("\n", ",\n"),
            NAMED,
        ],
        ids=["s", "ns", "us", "since the first frame", "commas", "EuRoC", "last comma", "names of columns"],
    )
    def test_every_format_gives_the_poses_that_were_written(self, tmp_path, text):
        opened = found(tmp_path, text, sequence_of(TIMES, START_NS))
        np.testing.assert_allclose(opened.world_from_camera, POSES, atol=1e-5)
        assert any("by time" in note for note in opened.notes)

    @pytest.mark.parametrize("first_ns", [0, 5_000_000_000_000])
    @pytest.mark.parametrize("ns_of_unit", [1, 1_000, 1_000_000], ids=["ns", "us", "ms"])
    def test_times_of_euroc_need_not_be_since_1970(self, tmp_path, first_ns, ns_of_unit):
        """A clock may begin when the computer or the recording did."""
        stamps = [(first_ns + 50_000_000 * index) // ns_of_unit for index in range(COUNT)]
        text = "#timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z\n" + lines(
            stamps, np.c_[POSES[:, :3, 3], quaternions(POSES, scalar_first=True)], ","
        )
        opened = found(tmp_path, text, sequence_of(TIMES, first_ns))
        np.testing.assert_allclose(opened.world_from_camera, POSES, atol=1e-9)

    def test_frames_outside_or_in_a_gap_have_no_pose(self, tmp_path):
        rows = [0, 1, 2, 5]
        text = tum([SECONDS[index] for index in rows], POSES[rows])
        opened = found(tmp_path, text, sequence_of(TIMES, START_NS))
        assert np.flatnonzero(np.isfinite(opened.world_from_camera[:, 0, 0])).tolist() == rows
        assert any("2 of 6 frames have no pose" in note for note in opened.notes)

    def test_poses_of_keyframes_are_interpolated(self, tmp_path):
        opened = found(tmp_path, tum([f"{TIMES[row]:.3f}" for row in (0, 4)], POSES[[0, 4]]), sequence_of(TIMES))
        assert np.isfinite(opened.world_from_camera[:, 0, 0]).tolist() == [True] * 5 + [False]
        np.testing.assert_allclose(opened.world_from_camera[2, :3, 3], POSES[[0, 4], :3, 3].mean(axis=0), atol=1e-9)

    def test_slow_frames_with_rounded_times_have_poses(self, tmp_path):
        times = np.arange(COUNT) * 0.25
        text = tum([f"{time:.3f}" for time in (-0.0004, 0.2501, 0.4999, 0.7502, 0.9996, 1.2503)])
        opened = found(tmp_path, text.replace("-0.000", "0.000"), sequence_of(times))
        assert np.isfinite(opened.world_from_camera).all(axis=(1, 2)).sum() == COUNT

    def test_a_path_between_frames_is_that_of_the_file(self, tmp_path):
        middle = made_poses(2 * COUNT - 1, seed=2)
        text = tum([f"{time:.4f}" for time in np.arange(2 * COUNT - 1) / 40], middle)
        opened = found(tmp_path, text, sequence_of(TIMES))
        np.testing.assert_allclose(opened.path.at(np.array([0.025])), middle[1:2], atol=1e-9)

    def test_the_shift_of_clocks_is_added_to_the_times_of_frames(self, tmp_path):
        opened = found(tmp_path, tum([f"{time + 7.0:.6f}" for time in TIMES]), sequence_of(TIMES), time_shift_s=7.0)
        np.testing.assert_allclose(opened.world_from_camera, POSES, atol=1e-9)

    def test_times_of_another_clock_are_refused(self, tmp_path):
        with pytest.raises(DataError, match="expected poses at the times of images"):
            found(tmp_path, tum([f"{time + 500:.6f}" for time in TIMES]), sequence_of(TIMES, START_NS))

    @pytest.mark.parametrize(("first", "rows"), [(0, [0, 1, 2, 4, 5]), (1, [1, 2, 5]), (0, [0, 5])])
    def test_numbers_of_frames_in_place_of_times(self, tmp_path, first, rows):
        got = found(tmp_path, tum([row + first for row in rows], POSES[rows]), sequence_of(TIMES, START_NS))
        np.testing.assert_allclose(got.world_from_camera[rows], POSES[rows], atol=1e-12)
        assert np.isnan(np.delete(got.world_from_camera, rows, axis=0)).all()
        assert f"their times are numbers of frames, from {first}" in got.pose_notes

    def test_whole_seconds_of_a_slow_recording_are_times(self, tmp_path):
        got = found(tmp_path, tum(range(3), POSES[:3]), sequence_of(0.5 * np.arange(COUNT)))
        np.testing.assert_allclose(got.world_from_camera[::2], POSES[:3], atol=1e-12)


class TestWithoutTimes:
    def test_a_row_of_nan_is_no_pose(self, tmp_path):
        values = POSES[:, :3].reshape(COUNT, 12).copy()
        values[2] = np.nan
        rows = "\n".join(" ".join(f"{value:.17g}" for value in row) for row in values)
        got = found(tmp_path, rows, sequence_of())
        assert np.isnan(got.world_from_camera[2]).all()
        np.testing.assert_allclose(np.delete(got.world_from_camera, 2, axis=0), np.delete(POSES, 2, axis=0), atol=1e-9)
        assert "1 of 6 rows holds no pose (NaN)" in got.pose_notes

    def test_rows_of_kitti_belong_to_frames_in_order(self, tmp_path):
        rows = "".join(" ".join(f"{value:.17g}" for value in pose[:3].ravel()) + "\n" for pose in POSES)
        np.testing.assert_allclose(found(tmp_path, rows, sequence_of()).world_from_camera, POSES, atol=1e-12)
        with pytest.raises(DataError, match="5 poses for 6 frames, expected one row per frame"):
            found(tmp_path, rows[: rows.rstrip().rindex("\n") + 1], sequence_of())

    def test_whole_numbers_are_numbers_of_frames(self, tmp_path):
        opened = found(tmp_path, tum([1, 3, 4], POSES[[1, 3, 4]]), sequence_of())
        assert np.isfinite(opened.world_from_camera[:, 0, 0]).tolist() == [False, True, False, True, True, False]
        np.testing.assert_allclose(opened.world_from_camera[[1, 3, 4]], POSES[[1, 3, 4]], atol=1e-12)

    def test_as_many_rows_as_frames_belong_to_them_in_order(self, tmp_path):
        opened = found(tmp_path, tum(np.arange(COUNT) * 7.5), sequence_of())
        np.testing.assert_allclose(opened.world_from_camera, POSES, atol=1e-12)

    def test_rows_of_a_longer_file_belong_to_the_numbers_of_images(self, tmp_path, write_images):
        poses = made_poses(40)
        rows = "".join(" ".join(f"{value:.17g}" for value in pose[:3].ravel()) + "\n" for pose in poses)
        opened = posed_images(tmp_path, write_images([f"{10 + i:06d}.png" for i in range(COUNT)]), rows)
        np.testing.assert_allclose(opened.world_from_camera, poses[10 : 10 + COUNT], atol=1e-12)


@pytest.fixture
def write_images(tmp_path):
    """Writes images of given names, and a camera file; returns the options of the reader."""

    def write(names, folder="data"):
        for name in names:
            (tmp_path / folder / name).parent.mkdir(parents=True, exist_ok=True)
            assert cv2.imwrite(str(tmp_path / folder / name), np.zeros((24, 32), np.uint8))
        camera = {"width": 32, "height": 24, "fx": 30.0, "fy": 30.0, "cx": 15.5, "cy": 11.5}
        (tmp_path / "camera.json").write_text(json.dumps(camera))
        return tmp_path / folder

    return write


def posed_images(tmp_path, root, text):
    (tmp_path / "poses.txt").write_text(text)
    return opened_with(tmp_path, root, tmp_path / "poses.txt")


def opened_with(tmp_path, root, trajectory):
    reader = posed_by(Folder(root, camera_file=tmp_path / "camera.json"), str(trajectory))
    return reader.open(reader.sequences()[0])


class TestByName:
    NAMES = tuple(f"shot_{number}.png" for number in (1, 2, 3, 10, 11, 12))

    @pytest.mark.parametrize("write", [colmap.write_text, colmap.write_binary], ids=["text", "binary"])
    @pytest.mark.parametrize("below", ["", "sparse/0"])
    @pytest.mark.parametrize("stored_as", ["{}", "data/{}", "other/{}"])
    def test_poses_of_colmap_belong_to_images_of_the_same_names(self, tmp_path, write_images, write, below, stored_as):
        root = write_images(self.NAMES)
        images = {stored_as.format(name): (1, POSES[at]) for at, name in enumerate(self.NAMES) if at != 2}
        write(tmp_path / "model" / below, {1: ("PINHOLE", 32, 24, (30.0, 30.0, 16.0, 12.0))}, images)
        opened = opened_with(tmp_path, root, tmp_path / "model")
        assert np.isfinite(opened.world_from_camera[:, 0, 0]).tolist() == [True, True, False, True, True, True]
        np.testing.assert_allclose(np.delete(opened.world_from_camera, 2, 0), np.delete(POSES, 2, 0), atol=1e-9)

    def test_rows_by_name_are_those_of_the_world_in_the_camera(self, tmp_path, write_images):
        inverse = np.linalg.inv(POSES)
        rows = lines(self.NAMES, np.c_[quaternions(inverse, scalar_first=True), inverse[:, :3, 3], np.full(COUNT, 525)])
        opened = posed_images(tmp_path, write_images(self.NAMES), rows)
        np.testing.assert_allclose(opened.world_from_camera, POSES, atol=1e-12)

    def test_namesakes_in_several_folders_are_not_guessed(self, tmp_path, write_images):
        images = {f"{side}/{name}": (1, POSES[0]) for side in ("left", "right") for name in self.NAMES}
        colmap.write_text(tmp_path / "model", {1: ("PINHOLE", 32, 24, (30.0, 30.0, 16.0, 12.0))}, images)
        with pytest.raises(DataError, match="of which the recording has 0, expected names of its images"):
            opened_with(tmp_path, write_images(self.NAMES), tmp_path / "model")

    def test_images_that_are_no_files_have_no_names(self, tmp_path):
        with pytest.raises(DataError, match="expected a recording whose images are files"):
            found(tmp_path, lines(self.NAMES, np.c_[np.ones(COUNT), np.zeros((COUNT, 6))]), sequence_of())


class TestImagesAlone:
    def test_times_in_the_names_of_images_are_used(self, tmp_path, write_images):
        root = write_images([f"{ns}.png" for ns in STAMPS_NS])
        opened = posed_images(tmp_path, root, EUROC)
        np.testing.assert_allclose(opened.timestamps_s, TIMES, atol=1e-12)
        np.testing.assert_allclose(opened.world_from_camera, POSES, atol=1e-9)

    def test_images_are_in_the_order_in_which_people_number_them(self, tmp_path, write_images):
        opened = posed_images(tmp_path, write_images(TestByName.NAMES, "data/images"), tum(range(COUNT)))
        assert [path.name for path in opened.sequence.images.paths] == list(TestByName.NAMES)
        assert any("jump from shot_3.png to shot_10.png" in note for note in opened.notes)

    def test_without_a_camera_it_says_which_option_has_one(self, tmp_path, write_images):
        (tmp_path / "poses.txt").write_text(tum(range(COUNT)))
        reader = posed_by(Folder(write_images(TestByName.NAMES)), str(tmp_path / "poses.txt"))
        with pytest.raises(DataError, match=r"no camera\.json, expected it, or --option camera_file=FILE"):
            reader.open(reader.sequences()[0])


class TestOfTheBody:
    MOUNTED = made_poses(1, seed=5)[0]

    def test_poses_of_the_body_are_moved_to_the_camera(self, tmp_path):
        sequence = sequence_of(TIMES, START_NS, body=Body(self.MOUNTED, 0.05))
        opened = found(tmp_path, tum(SECONDS), sequence, poses_of=PosesOf.body)
        np.testing.assert_allclose(opened.world_from_camera[:-1], (POSES @ self.MOUNTED)[1:], atol=1e-6)
        assert np.isnan(opened.world_from_camera[-1]).all()  # the clock of the body is 0.05 s ahead

    def test_a_recording_without_a_body_is_refused(self, tmp_path):
        with pytest.raises(DataError, match="no statement of where the camera is on the body"):
            found(tmp_path, tum(SECONDS), sequence_of(TIMES, START_NS), poses_of=PosesOf.body)

    def test_euroc_without_its_ground_truth(self, tmp_path):
        device, images = tmp_path / "walk" / "mav0", [np.zeros((24, 32), np.uint8)] * COUNT
        euroc.write_images(device, "cam0", STAMPS_NS, images)
        euroc.write_sensor(device / "cam0" / "sensor.yaml", (32, 24), (30.0, 30.0, 15.5, 11.5))
        (tmp_path / "vio.csv").write_text(EUROC)
        reader = posed_by(make_reader("euroc", tmp_path / "walk"), str(tmp_path / "vio.csv"), PosesOf.body)
        opened = reader.open(reader.sequences()[0])
        np.testing.assert_allclose(opened.world_from_camera, POSES @ euroc.BODY_FROM_CAMERA, atol=1e-9)


@pytest.mark.parametrize("name", ["euroc", "folder", "kitti-odometry", "sevenscenes", "tum"])
def test_readers_do_without_the_poses_of_a_recording(name, tmp_path):
    """The same recording with its poses, and without them and with a trajectory."""
    root = tmp_path / "data"
    written = LAYOUTS[name](root, COUNT)
    complete = written.open()
    (tmp_path / "poses.txt").write_text(
        "".join(" ".join(f"{x:.17g}" for x in pose[:3].ravel()) + "\n" for pose in complete.world_from_camera)
    )
    lost = [
        path
        for pattern in ("groundtruth.txt", "poses.txt", "poses/*.txt", "*.pose.txt", "state_groundtruth*/data.csv")
        for path in root.rglob(pattern)
    ]
    for path in set(lost):
        path.unlink()
    assert lost
    with pytest.raises(DataError):
        written.open()
    reader = posed_by(written.reader, str(tmp_path / "poses.txt"))
    opened = reader.open(reader.sequences()[0])
    np.testing.assert_allclose(opened.world_from_camera, complete.world_from_camera, atol=1e-12)
    np.testing.assert_array_equal(opened.image(COUNT - 1), complete.image(COUNT - 1))
    assert (opened.depth(0) is None) == (complete.depth(0) is None)
    assert opened.camera == complete.camera


def test_a_bag_without_poses(tmp_path):
    with BagWriter(tmp_path / "data" / "run", Format.mcap) as bag:
        bag.camera_info("/camera_info", 0, "optical", size=(32, 24), k=(30.0, 30.0, 15.5, 11.5))
        for stamp in STAMPS_NS:
            bag.image("/image", stamp, "optical", "mono8", np.zeros((24, 32), np.uint8))
    (tmp_path / "slam.txt").write_text(tum(SECONDS))
    reader = make_reader("rosbag", tmp_path / "data")
    with pytest.raises(DataError, match="expected one topic of geometry_msgs"):
        reader.open(reader.sequences()[0])
    posed = posed_by(reader, str(tmp_path / "slam.txt"))
    opened = posed.open(posed.sequences()[0])
    np.testing.assert_allclose(opened.world_from_camera, POSES, atol=1e-5)
    assert opened.image(COUNT - 1).shape == (24, 32)


def test_poses_of_kitti_odometry_may_be_those_of_camera_0(tmp_path):
    written = LAYOUTS["kitti-odometry"](tmp_path / "data", COUNT)
    complete = written.open()
    file = next((tmp_path / "data").rglob("poses/*.txt"))
    reader = posed_by(written.reader, str(file), PosesOf.body)
    np.testing.assert_allclose(reader.open(reader.sequences()[0]).world_from_camera, complete.world_from_camera)


def test_published_accuracy_of_poses_is_not_that_of_a_trajectory(tmp_path):
    written = LAYOUTS["sevenscenes"](tmp_path / "data", COUNT)
    (tmp_path / "poses.txt").write_text(
        "".join(" ".join(f"{x:.17g}" for x in pose[:3].ravel()) + "\n" for pose in written.world_from_camera)
    )
    reader = posed_by(written.reader, str(tmp_path / "poses.txt"))
    own = known_accuracy(written.open(), "birth").figures.topics
    assert {"rotation", "translation"} <= own
    assert known_accuracy(reader.open(reader.sequences()[0]), "birth").figures.topics == own - {
        "rotation",
        "translation",
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no rows, expected poses in the format of TUM"),
        ("1 2 3\n", r"a first row of 3 fields \(1 2 3\), expected poses in the format of TUM"),
        ("once upon a time\n", "a first row of 4 fields"),
        ("PNG\0\0", "a binary file, expected poses in the format of TUM"),
        (tum(SECONDS) + "1 2\n", "2 fields, expected 8"),
    ],
)
def test_a_file_in_no_known_format_is_one_line(tmp_path, text, message):
    with pytest.raises(DataError, match=message):
        found(tmp_path, text, sequence_of(TIMES, START_NS))
    with pytest.raises(DataError, match="no such file"):
        with_trajectory(sequence_of(TIMES), tmp_path / "nothing")
    with pytest.raises(DataError, match=r"no images\.bin or images\.txt"):
        with_trajectory(sequence_of(TIMES), tmp_path)
