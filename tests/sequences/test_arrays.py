import pickle

import numpy as np
import pytest

import tracknoise as tn
from tracknoise.exceptions import DataError, DataWarning
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.shutter import RollingShutter

K = np.array([[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]])
POSES = np.broadcast_to(np.eye(4), (4, 4, 4)).copy()
POSES[:, 0, 3] = 0.02 * np.arange(4)


def pictures(n: int = 4, shape: tuple[int, ...] = (48, 64)) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (n, *shape), dtype=np.uint8)


def test_arrays_become_a_sequence_that_can_be_measured_and_pickled():
    motion = np.stack([np.roll(pictures(1)[0], -k, axis=1) for k in range(4)])
    depth = np.full((4, 48, 64), 1.2)
    sequence = tn.Sequence.from_arrays(motion, POSES, K, depth, timestamps_s=[0.0, 0.1, 0.2, 0.3], scene="a")
    assert (len(sequence), sequence.id.scene, sequence.truths) == (4, "a", ("birth",))
    assert sequence.camera == Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    assert sequence.timestamps_s.tolist() == [0.0, 0.1, 0.2, 0.3]
    rows = {"track": [0, 0, 0], "frame": [0, 1, 2], "u_px": [30.0, 29.0, 28.5], "v_px": [20.0, 20.0, 20.0]}
    measured = tn.measure(pickle.loads(pickle.dumps(sequence)), tn.Imported.from_arrays(**rows))
    errors = measured.observations.select("du_px", "dv_px").to_numpy()
    np.testing.assert_allclose(errors, [[0, 0], [0, 0], [0.5, 0]], atol=1e-12)


def test_a_readout_is_that_of_the_shutter():
    times = [0.0, 0.1, 0.2, 0.3]
    rolling = tn.Sequence.from_arrays(pictures(4), POSES, K, timestamps_s=times, readout_s=0.0261)
    assert rolling.shutter == RollingShutter(0.0261)
    assert tn.Sequence.from_arrays(pictures(4), POSES, K, timestamps_s=times, readout_s=0.0).shutter is None
    assert tn.Sequence.from_arrays(pictures(4), POSES, K).shutter is None


def test_depth_is_unknown_where_it_is_not_positive_or_missing():
    depth = np.full((48, 64), 2.0)
    depth[0, 0], depth[0, 1], depth[0, 2] = 0.0, np.nan, -1.0
    sequence = tn.Sequence.from_arrays(pictures(2), POSES[:2], K, [depth, None])
    assert sequence.depth(0).valid.sum() == 48 * 64 - 3
    assert sequence.depth(1) is None


def test_colours_become_gray_and_poses_may_lack_their_last_row_or_be_missing():
    poses = POSES[:, :3].copy()
    poses[2] = np.nan
    sequence = tn.Sequence.from_arrays(list(pictures(shape=(48, 64, 3))), poses, K)
    assert sequence.image(0).shape == (48, 64)
    np.testing.assert_array_equal(sequence.world_from_camera[[0, 1, 3]], POSES[[0, 1, 3]])
    assert np.isnan(sequence.world_from_camera[2]).all()


def test_a_rotation_that_is_not_exact_is_noted():
    poses = POSES.copy()
    poses[1, 0, 1] = 0.005
    with pytest.warns(DataWarning, match=r"poses\[1\]"):
        sequence = tn.Sequence.from_arrays(pictures(), poses, K)
    assert "nearest rotation" in sequence.notes[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"images": []}, "no image, expected at least one"),
        ({"images": pictures() / 255.0}, r"images\[0\] of shape \(48, 64\) and type float64, expected .*uint8"),
        ({"images": pictures(3)}, "3 images, expected one for each of the 4 poses"),
        ({"poses": np.eye(4)}, r"poses of shape \(4, 4\), expected 3 axes"),
        ({"poses": 2 * POSES}, r"poses\[0\]: a pose whose last row"),
        ({"K": np.eye(2)}, r"K \[\[1.0, 0.0\], \[0.0, 1.0\]\], expected 3 x 3 intrinsics"),
        ({"K": K * [[1], [-1], [1]]}, "focal lengths must be positive"),
        ({"K": [["a"]]}, "K is no array of numbers"),
        (
            {"depths": np.ones((4, 48, 64), np.uint16)},
            r"depths\[0\] of shape .* type uint16, expected .*metres",
        ),
        ({"depths": np.ones((3, 48, 64))}, "3 depth maps, expected one for each"),
        ({"timestamps_s": [0.0, 0.1, 0.1, 0.3]}, "timestamps that do not increase"),
        (
            {"timestamps_s": [0.0, 1e12, 2e12, 3e12]},
            r"\[1\]: a timestamp of 1e\+12, expected seconds, up to 1e\+11; .* in ms",
        ),
        ({"readout_s": 0.02}, "a rolling shutter without timestamps, expected the time of each frame, seconds"),
        ({"readout_s": 26.1, "timestamps_s": [0.0, 0.1, 0.2, 0.3]}, "readout_s 26.1, expected seconds between -1 and"),
        ({"readout_s": "fast"}, "readout_s 'fast', expected seconds between -1 and 1"),
        ({"images": [*pictures(3), pictures(1, (24, 64))[0]]}, r"images\[3\] of shape \(24, 64\), expected \(48, 64\)"),
        ({"images": None}, "images of type NoneType, expected a list of arrays"),
        ({"images": [[[1, 2], [3]]] * 4}, r"images\[0\] is no array"),
        ({"depths": np.ones((4, 24, 64))}, r"depths\[0\] of shape \(24, 64\), expected \(48, 64\), the size of the im"),
        ({"depths": [[[1.0, 2.0], [3.0]]] * 4}, r"depths\[0\] is no array"),
        ({"K": np.where(np.eye(3) > 0, np.nan, K)}, r"K\[0, 0\] is nan, expected finite numbers"),
        ({"K": Camera(32, 24, 30.0, 30.0, 15.5, 11.5)}, r"images\[0\] of shape \(48, 64\), expected \(24, 32\)"),
        ({"timestamps_s": [0.0, 0.1, np.nan, 0.3]}, r"timestamps_s\[2\] is nan, expected finite numbers"),
        ({"scene": 1}, "scene is 1, expected a text in UTF-8 without control characters"),
        ({"scene": "a\nb"}, r"scene is 'a\\nb', expected a text"),
        ({"dataset": None}, "dataset is None, expected a text"),
        ({"distortion": 0.1}, r"distortion of shape \(\), expected 1 axis"),
        ({"distortion": (0.1,)}, "distortion must have 0, 4, 5 or 8"),
        ({"distortion": (-9.0, 0.0, 0.0, 0.0)}, "one that can be inverted"),
        ({"K": Camera(64, 48, 60.0, 60.0, 31.5, 23.5), "distortion": (0.1, 0, 0, 0)}, "a camera and distortion"),
    ],
)
def test_a_wrong_array_is_named(change, message):
    arrays = {"images": pictures(), "poses": POSES, "K": K, **change}
    with pytest.raises(DataError, match=message):
        tn.Sequence.from_arrays(**arrays)


def test_a_camera_with_another_model_is_taken_as_it_is():
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5, (0.1, 0.0, 0.0, 0.0))
    assert tn.Sequence.from_arrays(pictures(), POSES, camera).camera is camera


def test_a_second_camera():
    images, place = [np.full((48, 64), index, np.uint8) for index in range(3)], np.eye(4)
    place[0, 3] = 0.1
    made = tn.Sequence.from_arrays(
        images, [np.eye(4)] * 3, K, second_images=[images[0], None, images[2]], second_K=K, first_from_second=place
    )
    assert made.second.images(1) is None
    assert made.second.images(2).max() == 2
    np.testing.assert_array_equal(made.second.first_from_second, place)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"second_K": None}, "no second_K"),
        ({"second_images": [np.zeros((48, 64), np.uint8)]}, "1 second_images"),
        ({"second_images": [None] * 3}, "no second_images"),
        ({"first_from_second": np.eye(3)}, r"shape \(3, 3\)"),
        ({"first_from_second": np.diag([2.0, 2.0, 2.0, 1.0])}, "first_from_second"),
    ],
)
def test_a_second_camera_that_is_wrong_is_refused(changed, message):
    images = [np.zeros((48, 64), np.uint8)] * 3
    given = {"second_images": images, "second_K": K, "first_from_second": np.eye(4), **changed}
    with pytest.raises(DataError, match=message):
        tn.Sequence.from_arrays(images, [np.eye(4)] * 3, K, **given)
