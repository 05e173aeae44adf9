"""MCAP files of other programs: what is read is what was simulated."""

import struct
from pathlib import Path

import numpy as np
import pytest
from tests.writers.bags import BagWriter, Format
from tests.writers.mcap import MAGIC, record, text, write_mcap

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.sequence import Sequence

STEP_NS = 50_000_000


@pytest.fixture(scope="module")
def simulated() -> Sequence:
    return open_sequence("simulated", motions=["arvr"], frames=5, width=64, height=48, supersampling=1)


@pytest.fixture(scope="module", params=[Format.ros1, Format.mcap])
def bag(request, simulated, tmp_path_factory) -> Path:
    """A bag of ROS 1 or ROS 2."""
    camera = simulated.camera
    assert isinstance(camera, Camera)
    with BagWriter(tmp_path_factory.mktemp("bag") / "run", request.param) as bag:
        bag.camera_info("/camera_info", 1, "optical", size=(64, 48), k=(camera.fx, camera.fy, camera.cx, camera.cy))
        for index in range(5):
            bag.image("/image", (index + 1) * STEP_NS, "optical", "mono8", simulated.image(index))
            bag.posed("/pose", (index + 1) * STEP_NS, "PoseStamped", "world", "", simulated.world_from_camera[index])
    return bag.path


@pytest.mark.parametrize("compression", [None, "", "lz4", "zstd"])
def test_messages_of_ros_1_and_ros_2_are_read(tmp_path, simulated, bag, compression):
    write_mcap(tmp_path / "run.mcap", bag, compression=compression, profile="ros1" if bag.suffix == ".bag" else "")
    found = open_sequence("rosbag", tmp_path)
    np.testing.assert_allclose(found.world_from_camera, simulated.world_from_camera, rtol=0, atol=1e-9)
    assert found.camera == simulated.camera
    np.testing.assert_allclose(found.timestamps_s, np.arange(5) * STEP_NS / 1e9, rtol=0, atol=1e-12)
    for index in range(5):
        np.testing.assert_array_equal(found.image(index), simulated.image(index))


def test_other_encodings_are_named(tmp_path, bag):
    write_mcap(tmp_path / "run.mcap", bag, compression="zstd", encoding="json")
    with pytest.raises(DataError, match=r"run.mcap /.*messages encoded as 'json', neither as 'ros1' nor as 'cdr'"):
        open_sequence("rosbag", tmp_path)


@pytest.mark.parametrize("keep", [0.1, 0.5, 0.99])
def test_truncated_files_are_refused(tmp_path, bag, keep):
    path = tmp_path / "run.mcap"
    write_mcap(path, bag, compression="zstd")
    path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])
    with pytest.raises(DataError, match=r"run.mcap: a damaged or unsupported bag \("):
        open_sequence("rosbag", path)


def test_a_record_that_claims_to_be_huge_is_refused(tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(MAGIC + record(1, text("") + text("")) + struct.pack("<BQ", 6, 1 << 62))
    with pytest.raises(DataError, match=r"a record of 4611686018427387904 bytes at 25, where 0 are left"):
        open_sequence("rosbag", path)
