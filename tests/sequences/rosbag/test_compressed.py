"""Bags that are compressed with zstd and have lost their metadata, and compressed files that become too large."""

from pathlib import Path

import numpy as np
import pytest
from backports import zstd
from tests.writers.bags import BagWriter, Format

from tracknoise import rosbag_files
from tracknoise.exceptions import DataError
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.recognise import recognise

STEP_NS = 50_000_000


@pytest.fixture(scope="module")
def simulated():
    return open_sequence("simulated", motions=["arvr"], frames=4, width=64, height=48, supersampling=1)


def written(folder: Path, simulated, kind: Format, compression: str) -> Path:
    """The folder of a bag of ROS 2."""
    camera = simulated.camera
    with BagWriter(folder / "run", kind, compression=compression) as bag:
        bag.camera_info("/camera_info", 1, "optical", size=(64, 48), k=(camera.fx, camera.fy, camera.cx, camera.cy))
        for index in range(4):
            bag.image("/image", (index + 1) * STEP_NS, "optical", "mono8", simulated.image(index))
            bag.posed("/pose", (index + 1) * STEP_NS, "PoseStamped", "world", "", simulated.world_from_camera[index])
    return bag.path


def require_same(found, simulated):
    np.testing.assert_allclose(found.world_from_camera, simulated.world_from_camera, rtol=0, atol=1e-9)
    for index in range(4):
        np.testing.assert_array_equal(found.image(index), simulated.image(index))


@pytest.mark.parametrize("kind", [Format.sqlite, Format.mcap])
@pytest.mark.parametrize("compression", ["file", "message"])
def test_compressed_bags_without_metadata_are_read(tmp_path, simulated, kind, compression):
    folder = written(tmp_path, simulated, kind, "message" if compression == "message" else "")
    (folder / "metadata.yaml").unlink()
    if compression == "file":
        (file,) = folder.iterdir()
        file.with_name(f"{file.name}.zstd").write_bytes(zstd.compress(file.read_bytes()))
        file.unlink()
    assert recognise(folder) == "rosbag"
    require_same(open_sequence("rosbag", tmp_path), simulated)


def test_copies_of_compressed_files_are_removed(tmp_path, simulated, monkeypatch):
    folder = written(tmp_path, simulated, Format.sqlite, "file")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "copies"))
    (tmp_path / "copies").mkdir()
    with rosbag_files.plain_files(folder) as plain:
        assert sorted(path.suffix for path in plain.iterdir()) == [".db3", ".yaml"]
    assert list((tmp_path / "copies").iterdir()) == []


@pytest.mark.parametrize("with_metadata", [True, False])
def test_a_file_that_becomes_too_large_is_refused(tmp_path, simulated, with_metadata):
    folder = written(tmp_path, simulated, Format.sqlite, "file")
    (file,) = folder.glob("*.zstd")
    file.write_bytes(zstd.compress(bytes(300 << 20)))
    if not with_metadata:
        (folder / "metadata.yaml").unlink()
    with pytest.raises(DataError, match=r"run.*: a damaged or unsupported bag \(.*becomes more than 100 times larger"):
        open_sequence("rosbag", tmp_path)


def test_a_cut_file_is_refused(tmp_path, simulated):
    folder = written(tmp_path, simulated, Format.sqlite, "file")
    (file,) = folder.glob("*.zstd")
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(DataError, match=r"run: a damaged or unsupported bag \("):
        open_sequence("rosbag", tmp_path)


def test_a_message_that_is_cut_or_too_large_is_refused(monkeypatch):
    content = zstd.compress(b"\x00\x01\x00\x00" + bytes(2000))
    assert len(rosbag_files.plain_message(content)) == 2004
    monkeypatch.setattr(rosbag_files, "_MOST_MESSAGE_BYTES", 2000)
    for wrong in (content, content[:-3]):
        with pytest.raises(ValueError, match="a compressed message that is cut off, or becomes larger than 2000 bytes"):
            rosbag_files.plain_message(wrong)
