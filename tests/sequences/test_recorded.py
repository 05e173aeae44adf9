import pickle
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.images import read_depth_png16
from tracknoise.sequences.recorded import DepthFiles, ImageFiles, RecordedSequence, depth_files, depth_notes
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.tables.identity import SequenceId

CAMERA = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
READ = partial(read_depth_png16, metres_per_unit=0.001)


class Archive:
    """Frames that are no files, and whose count is not known."""

    def __init__(self, *images: np.ndarray) -> None:
        self.images = images

    def __call__(self, index: int) -> np.ndarray:
        return self.images[index]


def make(**changes: object) -> RecordedSequence:
    settings: dict = {
        "id": SequenceId("test", "a"),
        "source": "somewhere",
        "camera": CAMERA,
        "world_from_camera": np.broadcast_to(np.eye(4), (2, 4, 4)),
        "images": images(Path("0.png"), Path("1.png")),
    }
    return RecordedSequence(**(settings | changes))


def images(*paths: Path) -> ImageFiles:
    return ImageFiles(paths, CAMERA)


def test_is_a_sequence():
    assert isinstance(make(), Sequence)
    assert len(make()) == 2
    assert make().surface is None


def test_offers_truth_from_depth_only_where_there_is_some():
    assert make().truths == ("swept", "triangulated")
    assert make(depths=depth_files((None, None), CAMERA, READ)).truths == ("swept", "triangulated")
    assert make(depths=depth_files((None, Path("d.png")), CAMERA, READ)).truths == (TruthKind.birth,)


def test_reads_files_when_asked_also_after_pickling(tmp_path):
    image = np.arange(48 * 64, dtype=np.uint8).reshape(48, 64)
    cv2.imwrite(str(tmp_path / "0.png"), image)
    cv2.imwrite(str(tmp_path / "0d.png"), np.full((48, 64), 2500, np.uint16))
    depths = DepthFiles((tmp_path / "0d.png", None), CAMERA, READ)
    made = make(images=images(tmp_path / "0.png", tmp_path / "absent.png"), depths=depths)
    for sequence in (made, pickle.loads(pickle.dumps(made))):
        np.testing.assert_array_equal(sequence.image(0), image)
        assert sequence.depth(0).depth_m[3, 4] == 2.5
        assert sequence.depth(1) is None
        with pytest.raises(DataError, match=r"absent\.png: no such file, expected an image"):
            sequence.image(1)


def test_frames_need_not_be_files():
    shown = [np.full((48, 64), value, np.uint8) for value in (10, 20)]
    sequence = make(images=Archive(*shown))
    assert len(sequence) == 2
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(sequence)).image(1), shown[1])


@pytest.mark.parametrize("wrong", [np.zeros((48, 63), np.uint8), np.zeros((48, 64, 3), np.uint8), np.zeros((48, 64))])
def test_an_image_of_another_shape_or_type_is_refused(wrong):
    with pytest.raises(DataError, match=r"somewhere: frame 1 of shape \(48, 6.* and type uint8$"):
        make(images=Archive(wrong, wrong)).image(1)


def test_a_depth_of_another_shape_is_refused():
    depth = DepthMap(np.ones((48, 63)), np.ones((48, 63), np.bool_))
    with pytest.raises(DataError, match=r"somewhere: depth 0 of shape \(48, 63\), expected shape \(48, 64\)"):
        make(depths=Archive(depth, depth)).depth(0)


def test_no_depth_at_all():
    assert make().depth(0) is None


def test_what_is_not_stated_is_unknown():
    made = make()
    assert (made.timestamps_s, made.pose_accuracy, made.depth_accuracy) == (None, None, None)
    assert made.camera_at(1) is made.camera


def test_the_camera_may_change_from_frame_to_frame():
    zoomed = Camera(64, 48, 55.0, 55.0, 31.5, 23.5)
    made = make(cameras=(CAMERA, zoomed))
    assert (made.camera, made.camera_at(0), made.camera_at(1)) == (CAMERA, CAMERA, zoomed)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"images": images(), "world_from_camera": np.empty((0, 4, 4))}, "test a: no frames, expected at least one"),
        ({"world_from_camera": np.eye(4)[None]}, "test a: 2 images, expected one for each of the 1 pose"),
        (
            {"depths": DepthFiles((None,), CAMERA, READ)},
            "test a: 1 depth map, expected one for each of the 2 poses",
        ),
        ({"timestamps_s": np.arange(3.0)}, "test a: 3 timestamps, expected one for each of the 2 poses"),
        ({"cameras": (CAMERA,)}, "test a: 1 camera, expected one for each of the 2 poses"),
        (
            {"timestamps_s": np.array([0.5, 0.25])},
            "test a: timestamps that do not increase (frame 1: 0.250000000 after 0.500000000 s), expected increasing"
            " timestamps",
        ),
        (
            {"timestamps_s": np.array([np.nan, 0.0])},
            "test a: timestamps that do not increase (frame 0: nan s), expected increasing timestamps",
        ),
        (
            {"cameras": (CAMERA, Camera(63, 48, 50.0, 50.0, 31.5, 23.5))},
            "test a: cameras of different image sizes, expected one size for all frames",
        ),
    ],
)
def test_what_contradicts_itself_is_refused(changes, message):
    with pytest.raises(DataError) as caught:
        make(**changes)
    assert str(caught.value) == message


def test_notes_say_where_depth_is_missing():
    assert depth_notes((Path("a"), Path("b"))) == ()
    assert depth_notes((Path("a"), None, None)) == ("2 of 3 frames have no depth",)
