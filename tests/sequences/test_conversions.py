"""A real recording that was written in other formats gives the same measurements."""

import cv2
import numpy as np
import pytest
from polars.testing import assert_frame_equal
from tests.writers.bags import BagWriter, Format
from tests.writers.colmap import write_binary, write_depth_map
from tests.writers.nerfstudio import write_transforms

from tracknoise.experiments.measure import measure
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.schema import TRUE_COVARIANCE
from tracknoise.trackers.tracker_registry import make_tracker

FRAMES = 4
IDENTITY = ["dataset", "scene"]


def plain(depth):
    return np.where(depth.valid, depth.depth_m, 0.0).astype(np.float32)


def rosbag(root, sequence):
    camera = sequence.camera
    with BagWriter(root / "run", Format.sqlite) as bag:
        k = (camera.fx, camera.fy, camera.cx, camera.cy)
        bag.camera_info("/camera_info", 0, "optical", size=(camera.width, camera.height), k=k)
        for index in range(FRAMES):
            stamp_ns = (index + 1) * 100_000_000
            bag.image("/image", stamp_ns, "optical", "mono8", sequence.image(index))
            bag.image("/depth", stamp_ns, "optical", "32FC1", plain(sequence.depth(index)))
            bag.tf("/tf", stamp_ns, ("world", "optical", sequence.world_from_camera[index]))


def save_images(folder, sequence):
    folder.mkdir(parents=True)
    for index in range(FRAMES):
        assert cv2.imwrite(str(folder / f"{index}.png"), sequence.image(index))


def colmap(root, sequence):
    save_images(root / "images", sequence)
    camera, poses = sequence.camera, sequence.world_from_camera
    for index in range(FRAMES):
        write_depth_map(root / f"stereo/depth_maps/{index}.png.geometric.bin", plain(sequence.depth(index)))
    parameters = [camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5]
    images = {f"{index}.png": (1, poses[index]) for index in range(FRAMES)}
    write_binary(root / "sparse" / "0", {1: ("PINHOLE", camera.width, camera.height, parameters)}, images)


def nerfstudio(root, sequence):
    save_images(root / "images", sequence)
    camera = sequence.camera
    for index in range(FRAMES):
        np.save(root / f"{index}.npy", plain(sequence.depth(index)))
    intrinsics = {"fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx + 0.5, "cy": camera.cy + 0.5}
    further = [{"depth_file_path": f"{index}.npy"} for index in range(FRAMES)]
    names = [f"images/{index}.png" for index in range(FRAMES)]
    poses = sequence.world_from_camera[:FRAMES]
    write_transforms(root, names, poses, depth_unit_scale_factor=1.0, frames=further, **intrinsics)


@pytest.mark.parametrize("write", [rosbag, colmap, nerfstudio])
def test_the_same_recording_in_another_format(tmp_path, sample, write):
    original = open_sequence("tartanair", sample("tartanair_v2"))
    write(tmp_path, original)
    tracker = make_tracker("lucas-kanade")
    expected = measure(original, tracker, max_frames=FRAMES).observations.drop(IDENTITY, *TRUE_COVARIANCE)
    found = measure(open_sequence(write.__name__, tmp_path), tracker).observations.drop(IDENTITY)
    assert len(expected) > 1000
    assert_frame_equal(found, expected, abs_tol=1e-9)
