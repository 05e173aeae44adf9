import pickle
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.sequences.images import read_depth_png16
from tracknoise.sequences.recorded import RecordedSequence, depth_notes
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.tables.identity import SequenceId

CAMERA = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
READ = partial(read_depth_png16, metres_per_unit=0.001)


def make(**changes: object) -> RecordedSequence:
    settings: dict = {
        "id": SequenceId("test", "a"),
        "camera": CAMERA,
        "world_from_camera": np.broadcast_to(np.eye(4), (2, 4, 4)),
        "image_paths": (Path("0.png"), Path("1.png")),
    }
    return RecordedSequence(**(settings | changes))


def test_is_a_sequence():
    assert isinstance(make(), Sequence)
    assert len(make()) == 2
    assert make().surface is None


def test_offers_truth_only_with_depth():
    assert make().truths == ()
    assert make(depth_paths=(None, None), read_depth=READ).truths == ()
    assert make(depth_paths=(None, Path("d.png")), read_depth=READ).truths == (TruthKind.birth,)


def test_reads_files_when_asked_also_after_pickling(tmp_path):
    image = np.arange(48 * 64, dtype=np.uint8).reshape(48, 64)
    cv2.imwrite(str(tmp_path / "0.png"), image)
    cv2.imwrite(str(tmp_path / "0d.png"), np.full((48, 64), 2500, np.uint16))
    paths = (tmp_path / "0.png", tmp_path / "absent.png")
    made = make(image_paths=paths, depth_paths=(tmp_path / "0d.png", None), read_depth=READ)
    for sequence in (made, pickle.loads(pickle.dumps(made))):
        np.testing.assert_array_equal(sequence.image(0), image)
        assert sequence.depth(0).depth_m[3, 4] == 2.5
        assert sequence.depth(1) is None
        with pytest.raises(DataError, match=r"absent\.png: no such file, expected an image"):
            sequence.image(1)


def test_no_depth_at_all():
    assert make().depth(0) is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"image_paths": (), "world_from_camera": np.empty((0, 4, 4))}, "test a: no images, expected at least one"),
        ({"world_from_camera": np.eye(4)[None]}, "test a: 1 poses, expected one for each of the 2 images"),
        (
            {"depth_paths": (None,), "read_depth": READ},
            "test a: 1 depth maps, expected one for each of the 2 images",
        ),
    ],
)
def test_counts_that_differ(changes, message):
    with pytest.raises(DataError) as caught:
        make(**changes)
    assert str(caught.value) == message


def test_depth_files_need_their_reader():
    with pytest.raises(ValueError, match="go together"):
        make(depth_paths=(None, None))


def test_notes_say_where_depth_is_missing():
    assert depth_notes((Path("a"), Path("b"))) == ()
    assert depth_notes((Path("a"), None, None)) == ("2 of 3 frames have no depth",)
