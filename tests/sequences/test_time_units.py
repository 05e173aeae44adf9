"""Units of times: an unlikely rate is refused by every reader, and accepted once its unit is stated."""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from tests.sequences.test_arrays import POSES, K, pictures
from tests.sequences.test_tum import INTRINSICS, images, poses
from tests.writers.bags import BagWriter, Format
from tests.writers.euroc import START_NS, write_euroc
from tests.writers.kitti_odometry import write_kitti_odometry
from tests.writers.tum import write_tum

import tracknoise as tn
from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.folder import write_folder
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import Sequence
from tracknoise.sequences.views import chosen_frames
from tracknoise.tables.identity import SequenceId
from tracknoise.time_units import TimeUnit, likely_unit
from tracknoise.truth_faults.check_recording import check_sequence

N = 6
CAMERA = Camera(64, 48, *INTRINSICS)
AT_20_HZ = np.arange(N) / 20


def write_plain(root: Path, times: Iterable[float]) -> None:
    shown = images(N)
    source = RecordedSequence(
        id=SequenceId("made", "up"),
        source="memory",
        camera=CAMERA,
        world_from_camera=poses(N),
        images=shown.__getitem__,
    )
    write_folder(source, root / "scene")
    (root / "scene" / "timestamps.txt").write_text("".join(f"{time:.17g}\n" for time in times))


def write_drive(root: Path, times: Iterable[float]) -> None:
    folder = write_kitti_odometry(root, images(N), poses(N), intrinsics=INTRINSICS)
    (folder / "times.txt").write_text("".join(f"{time:.17g}\n" for time in times))


def write_rgbd(root: Path, times: Iterable[float]) -> None:
    """Both files have times of the same unit."""
    folder = root / "scene"
    stamps = write_tum(folder, images(N), poses(N))
    (folder / "calibration.txt").write_text("60 61 31 24\n")
    for name in ("rgb.txt", "groundtruth.txt"):
        rows = (folder / name).read_text()
        for stamp, time in zip(stamps, times, strict=True):
            rows = re.sub(rf"^{stamp:.6f}", f"{time:.17g}", rows, flags=re.MULTILINE)
        (folder / name).write_text(rows)


def write_asl(root: Path, times: Iterable[float]) -> None:
    write_euroc(root / "scene", images(N), poses(N), intrinsics=INTRINSICS)
    for path in (root / "scene").rglob("data.csv"):
        rows = path.read_text()
        for index, time in enumerate(times):
            written = f"{time:.6f}".rstrip("0").rstrip(".")
            rows = re.sub(rf"^{START_NS + index * 50_000_000},", f"{written},", rows, flags=re.MULTILINE)
        path.write_text(rows)


def write_bag(root: Path, times: Iterable[float]) -> None:
    """Headers whose seconds are other numbers; messages are received at 20 Hz."""
    with BagWriter(root / "run", Format.mcap) as bag:
        bag.camera_info("/cam/camera_info", 1, "optical", size=(64, 48), k=INTRINSICS)
        for index, (image, time) in enumerate(zip(images(N), times, strict=True)):
            stamp, received = round((100 + time) * 1e9), 10**18 + index * 50_000_000
            bag.image("/cam/image_raw", stamp, "optical", "mono8", image, received_ns=received)
            bag.posed("/pose", stamp, "PoseStamped", "world", "", poses(N)[index])


@dataclass(frozen=True)
class Written:
    """A reader, how its recordings are written with times in one unit, and this unit."""

    reader: str
    write: Callable[[Path, Iterable[float]], None]
    unit: TimeUnit = TimeUnit.s
    wrong: tuple[TimeUnit, ...] = (TimeUnit.ms, TimeUnit.us, TimeUnit.ns)

    def open(self, root: Path, **options: object) -> Sequence:
        return tn.open_sequence(self.reader, root, **options)


READERS = (
    Written("folder", write_plain),
    Written("kitti-odometry", write_drive),
    Written("tum", write_rgbd),
    Written("euroc", write_asl, TimeUnit.ns, (TimeUnit.s, TimeUnit.ms, TimeUnit.us)),
    Written("rosbag", write_bag, wrong=(TimeUnit.ms,)),
)
CASES = [pytest.param(one, unit, id=f"{one.reader}-{unit}") for one in READERS for unit in one.wrong]
EVERY = pytest.mark.parametrize("written", READERS, ids=[one.reader for one in READERS])


@pytest.mark.parametrize(("written", "unit"), CASES)
def test_another_unit_is_refused_with_the_option_that_states_it(tmp_path, written, unit):
    written.write(tmp_path, (1.0 + AT_20_HZ) * unit.per_second)
    with pytest.raises(DataError, match=rf"--option time_unit={unit}, or time_unit in \[dataset.options\]"):
        written.open(tmp_path)
    found = written.open(tmp_path, time_unit=unit.value)
    np.testing.assert_allclose(found.timestamps_s, AT_20_HZ + (1.0 if written.reader == "folder" else 0.0), atol=1e-8)
    assert np.isfinite(found.world_from_camera).all()


@EVERY
def test_a_slow_recording_is_refused_until_its_unit_is_stated(tmp_path, written):
    """One image in five seconds: a robot that stops, or a time lapse."""
    written.write(tmp_path, (1.25 + 5.0 * np.arange(N)) * written.unit.per_second)
    with pytest.raises(DataError, match=r"frames at 0.2 Hz, .*expected 1 to 1000 Hz"):
        written.open(tmp_path)
    found = written.open(tmp_path, time_unit=written.unit.value)
    np.testing.assert_allclose(np.diff(found.timestamps_s), 5.0)
    assert np.isfinite(found.world_from_camera).all()


@EVERY
@pytest.mark.parametrize("rate_hz", [1.0, 4.0, 62.5, 1000.0])
def test_rates_of_cameras_are_accepted(tmp_path, written, rate_hz):
    written.write(tmp_path, (1.0 + np.arange(N) / rate_hz) * written.unit.per_second)
    times = written.open(tmp_path).timestamps_s
    if written.reader == "tum" and rate_hz == 1.0:
        assert times is None  # small whole numbers are numbers of frames
    else:
        np.testing.assert_allclose(np.diff(times), 1.0 / rate_hz, rtol=1e-6)


def test_the_likely_unit_has_the_rate_of_a_camera():
    assert likely_unit(0.02) == (TimeUnit.ms, pytest.approx(20.0))
    assert likely_unit(30e-6) == (TimeUnit.us, pytest.approx(30.0))
    assert likely_unit(20_000.0, TimeUnit.ns) == (TimeUnit.us, pytest.approx(20.0))
    assert likely_unit(5e9) is None


@pytest.mark.parametrize(("per_second", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_arrays_state_their_unit(per_second, unit):
    times = np.arange(4) / 30 * per_second
    with pytest.raises(DataError, match=rf"times are probably in {unit} \(30 Hz\): time_unit = '{unit}'"):
        tn.Sequence.from_arrays(pictures(), POSES, K, timestamps_s=times)
    found = tn.Sequence.from_arrays(pictures(), POSES, K, timestamps_s=times, time_unit=unit)
    np.testing.assert_allclose(found.timestamps_s, np.arange(4) / 30)
    slow = tn.Sequence.from_arrays(pictures(), POSES, K, timestamps_s=np.arange(4) * 60.0, time_unit="s")
    np.testing.assert_allclose(np.diff(slow.timestamps_s), 60.0)
    with pytest.raises(DataError, match="time_unit 'min', expected one of s, ms, us, ns"):
        tn.Sequence.from_arrays(pictures(), POSES, K, timestamps_s=times, time_unit="min")


class OfAnotherPackage:
    """A sequence that is none of the package's own."""

    id, source, camera = SequenceId("made", "up"), "elsewhere", CAMERA
    notes, truths, surface, scan, pose_accuracy, depth_accuracy = (), (), None, None, None, None

    def __init__(self, times: np.ndarray) -> None:
        self.timestamps_s, self.world_from_camera = times, poses(len(times))

    def __len__(self) -> int:
        return len(self.timestamps_s)

    def image(self, index: int) -> np.ndarray:
        return images(len(self))[index]

    def depth(self, index: int) -> None:
        return None


def test_a_sequence_of_another_package_is_refused_where_it_is_measured_and_checked():
    """The rate is that of the recording: frames of it that are chosen may be farther apart."""
    given, lucas_kanade = OfAnotherPackage(1e3 * AT_20_HZ), tn.LucasKanade()
    with pytest.raises(DataError, match=r"elsewhere: frames at 0.02 Hz, .* probably in ms \(20 Hz\)"):
        tn.measure(given, lucas_kanade)
    assert "probably in ms (20 Hz)" in check_sequence(given).items[0].text
    given.time_unit_stated = True
    assert "0.02 Hz" in check_sequence(given).items[1].text
    thinned = chosen_frames(OfAnotherPackage(np.arange(N) / 1.5), [0, 4, 2])
    with pytest.raises(DataError, match="frames at 2000 Hz"):
        tn.measure(chosen_frames(OfAnotherPackage(np.arange(N) / 2000), [0, 4, 2]), lucas_kanade)
    assert not tn.measure(thinned, lucas_kanade, truth="triangulated").tracks.is_empty()


@pytest.mark.parametrize("unit", [TimeUnit.s, TimeUnit.ms, TimeUnit.us])
@pytest.mark.parametrize("start_ns", [0, 1_403_636_579_750_000_000], ids=["relative", "since 1970"])
def test_images_and_poses_of_two_units(tmp_path, unit, start_ns):
    """Converters write poses in another unit than the images, which was an error about poses after the first image."""
    write_euroc(tmp_path / "scene", images(N), poses(N), intrinsics=INTRINSICS)
    times_ns = [start_ns + index * 50_000_000 for index in range(N)]
    for path in (tmp_path / "scene").rglob("data.csv"):
        of_poses = "groundtruth" in str(path)
        rows = path.read_text()
        for index, time_ns in enumerate(times_ns):
            whole = f"{time_ns / 1e9:.2f}" if unit is TimeUnit.s else time_ns * unit.per_second // 10**9
            rows = rows.replace(f"{START_NS + index * 50_000_000},", f"{whole if of_poses else time_ns},")
        path.write_text(rows)
    with pytest.raises(DataError, match=rf"state_groundtruth_estimate0/data.csv.*--option pose_time_unit={unit}, or"):
        tn.open_sequence("euroc", tmp_path)
    found = tn.open_sequence("euroc", tmp_path, pose_time_unit=unit.value)
    np.testing.assert_allclose(found.world_from_camera, poses(N), atol=1e-4)


def test_poses_of_a_tum_recording_in_nanoseconds(tmp_path):
    folder = tmp_path / "scene"
    stamps = write_tum(folder, images(N), poses(N))
    (folder / "calibration.txt").write_text("60 61 31 24\n")
    truth = folder / "groundtruth.txt"
    truth.write_text(re.sub(r"^(\d+)\.(\d{6})", r"\1\g<2>000", truth.read_text(), flags=re.MULTILINE))
    with pytest.raises(DataError, match=r"groundtruth.txt:3: .* probably in ns: --option pose_time_unit=ns"):
        tn.open_sequence("tum", tmp_path)
    found = tn.open_sequence("tum", tmp_path, pose_time_unit="ns")
    np.testing.assert_allclose(found.world_from_camera, poses(N), atol=1e-5)
    np.testing.assert_allclose(found.timestamps_s, stamps - stamps[0])


def test_whole_milliseconds_are_no_numbers_of_frames(tmp_path):
    """They are not those by which poses are listed."""
    write_rgbd(tmp_path, np.array([0.0, 33.0, 66.0, 100.0, 133.0, 166.0]))
    truth = tmp_path / "scene" / "groundtruth.txt"
    rows = [line for line in truth.read_text().splitlines() if not line.startswith("#")]
    fields = [row.split(" ", 1)[1] for row in rows]
    truth.write_text("".join(f"{10 * index} {fields[min(index // 4, N - 1)]}\n" for index in range(20)))
    with pytest.raises(DataError, match=r"rgb.txt: frames at 0.0303 Hz, .* probably in ms \(30.3 Hz\)"):
        tn.open_sequence("tum", tmp_path)
    np.testing.assert_allclose(tn.open_sequence("tum", tmp_path, time_unit="ms").timestamps_s[-1], 0.166)
