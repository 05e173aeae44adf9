"""Poses from images alone: where the images do not determine them, there are none."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.reconstruction import _written, reconstruct
from tracknoise.sequences.views import chosen_frames

pytestmark = pytest.mark.skipif(importlib.util.find_spec("pycolmap") is None, reason="pycolmap is not installed")


def test_poses_that_little_parallax_leaves_open_are_refused():
    """The camera turns by 10 degrees and moves by .2 m before walls 10 m away: poses are found, 4 degrees off."""
    walk = open_sequence("simulated", motions=("arvr",), seed=1, frames=50, width=240, height=180)
    with pytest.raises(DataError, match=r"points that move by 1\.\d+ px beside rotations.*--trajectory FILE") as caught:
        reconstruct(chosen_frames(walk, (0, 48, 6)))
    assert "\n" not in str(caught.value)


def test_a_camera_that_only_turns_gives_no_poses():
    walk = open_sequence("simulated", motions=("sideways",), frames=10, width=320, height=240)
    poses, frame = np.repeat(walk.world_from_camera[:1], 10, axis=0), np.arange(10)
    turned = Rotation.from_rotvec(np.column_stack([0.002 * frame, 0.006 * frame, 0.0 * frame]))
    poses[:, :3, :3] = poses[:, :3, :3] @ turned.as_matrix()
    with pytest.raises(DataError, match="reconstructs no poses") as caught:
        reconstruct(replace(walk, world_from_camera=poses))
    assert "\n" not in str(caught.value)


def test_parameters_are_written_as_colmap_reads_them() -> None:
    """Files of OpenCV give numbers of NumPy, whose representation has their type."""
    assert _written((np.float64(346.4), 1, 0.25)) == "346.4,1.0,0.25"
