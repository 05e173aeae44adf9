"""What is read of a sequence once is not read again, as far as there is room for it."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from tests.measurement.planes import CAMERA, FRAMES, depths_of, images_of, moving, recorded

from tracknoise.measurement.refined_poses import Leading
from tracknoise.sequences.kept_frames import KeptFrames
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.views import chosen_frames, source_frames
from tracknoise.truth.accuracies import DEFAULT_RULE

POSES = moving()
IMAGES, DEPTHS = images_of(POSES), depths_of(POSES)
BYTES = CAMERA.width * CAMERA.height


@pytest.fixture
def read():
    return Counter()


@pytest.fixture
def counted(read):
    def once(name, values):
        def at(index):
            read[name, index] += 1
            return values[index]

        return at

    return replace(recorded(POSES, IMAGES, DEPTHS), images=once("image", IMAGES), depths=once("depth", DEPTHS))


def test_images_and_depths_of_reference_tracks_are_not_read_again_to_measure(counted, read):
    led = Leading.of([counted], [], kind="birth", rule=DEFAULT_RULE)
    for index in range(FRAMES):
        np.testing.assert_array_equal(led.sequences[0].image(index), IMAGES[index])
        assert led.sequences[0].depth(index) is DEPTHS[index]
    assert set(read.values()) == {1}


def test_a_frame_is_kept_where_there_is_room_and_only_until_it_is_read_again(counted, read):
    kept = KeptFrames(counted, most_bytes=3 * BYTES)
    for _ in range(2):
        for index in range(FRAMES):
            np.testing.assert_array_equal(kept.image(index), IMAGES[index])
    assert [read["image", index] for index in range(FRAMES)] == [1, 1, 1] + [2] * (FRAMES - 3)
    kept.image(0)
    assert read["image", 0] == 2


def test_truths_that_read_the_same_depth_in_turn_read_it_once(counted, read):
    kept = KeptFrames(counted, most_bytes=0)
    assert kept.depth(1) is kept.depth(1)
    assert kept.depth(2) is kept.depth(2)
    assert read == {("depth", 1): 1, ("depth", 2): 1}


def test_other_poses_do_not_hide_which_frames_were_chosen(counted):
    chosen = chosen_frames(counted, (2, 6, 2))
    assert source_frames(OtherPoses(KeptFrames(chosen), chosen.world_from_camera, "a test")) == range(2, 7, 2)
