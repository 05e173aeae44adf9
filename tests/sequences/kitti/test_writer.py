from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.kitti_files import find_drives, find_frames, read_scan
from tracknoise.sequences.kitti_writer import write_kitti
from tracknoise.sequences.simulated import Simulated


def tiny(frames: int = 11, width: int = 64, **changes: object):
    reader = Simulated(motions=("forward",), frames=frames, width=width, height=48, supersampling=1, **changes)
    return reader.open(reader.sequences()[0])


def files_of(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_drive_a_sequence(written, simulated):
    drives = find_drives(written, None)
    assert list(drives) == ["2011_09_26_drive_0001_sync", "2011_09_26_drive_0002_sync"]
    for drive in drives.values():
        frames = find_frames(drive)
        assert frames.numbers == range(16)
        suffixes = [path.suffix for path in frames.depths]
        assert suffixes == [".bin"] * 5 + [".png"] * 6 + [".bin"] * 5
        fields = drive.oxts(3).read_text().split()
        assert len(fields) == 30
        assert 48.9 < float(fields[0]) < 49.1
    assert sorted(path.name for path in next(iter(drives.values())).day.glob("*.txt")) == [
        "calib_cam_to_cam.txt",
        "calib_imu_to_velo.txt",
        "calib_velo_to_cam.txt",
    ]


def test_depth_is_sparse_exact_and_near(written, simulated):
    for drive, sequence in zip(find_drives(written, None).values(), simulated, strict=True):
        units, exact = cv2.imread(str(drive.depth(7)), cv2.IMREAD_UNCHANGED), sequence.depth(7)
        known = units > 0
        assert units.dtype == np.uint16
        assert 0.1 < known.mean() < 0.8
        assert exact.valid[known].all()
        assert np.abs(units / 256.0 - exact.depth_m)[known].max() < 0.501 / 256
        distance_m = np.linalg.norm(read_scan(drive.scan(7)), axis=1)
        assert 0.5 < distance_m.min() < distance_m.max() < 80.5


def test_the_same_seed_gives_the_same_files(tmp_path):
    counts: list[tuple[int, int]] = []
    for name, seed in (("one", 4), ("same", 4), ("other", 5)):
        progress = (lambda *count: counts.append(count)) if name == "one" else None
        write_kitti(iter([tiny()]), tmp_path / name, seed=seed, progress=progress)
    assert counts == [(done, 11) for done in range(1, 12)]
    one, same, other = (files_of(tmp_path / name) for name in ("one", "same", "other"))
    assert one == same
    assert one.keys() == other.keys()
    changed = {path.parts[2] for path in one if one[path] != other[path]}
    assert changed == {"velodyne_points", "proj_depth"}


class Flat(type(tiny(1))):
    """A sequence without a surface."""

    surface = None


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (
            lambda one: Flat(one.id, one.camera, one.world_from_camera, one.settings, one.world),
            "no exact surface, expected",
        ),
        (lambda one: tiny(1, width=80), "another camera, expected one camera without distortion for all sequences"),
        (
            lambda one: replace(one, camera=Camera(64, 48, 55, 55, 31, 23, (0.1, 0, 0, 0, 0))),
            "another camera, expected",
        ),
    ],
    ids=["surface", "camera", "distortion"],
)
def test_what_cannot_be_written(tmp_path, change, found):
    one = tiny(1)
    with pytest.raises(DataError, match=f"simulated scene forward-00: {found}"):
        write_kitti([one, change(one)], tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(DataError, match="already exists, expected a new or empty folder"):
        write_kitti([tiny(1)], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_no_sequence(tmp_path):
    with pytest.raises(ValueError, match="no sequence to write"):
        write_kitti([], tmp_path / "out")
