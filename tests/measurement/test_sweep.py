import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.measurement.scene import measure_scene
from tracknoise.measurement.sweep import Condition
from tracknoise.sequences.sequence import SequenceId, TruthKind
from tracknoise.trackers.imported import Imported


class Wall:
    """Five frames of a camera that stands 2 m before a wall."""

    id = SequenceId("case", "wall")
    source = "the wall"
    camera = Camera(40, 30, 100.0, 100.0, 19.5, 14.5)
    world_from_camera = np.tile(np.eye(4), (5, 1, 1))
    truths = (TruthKind.birth,)
    notes = ()
    surface = None

    def __len__(self) -> int:
        return 5

    def image(self, index: int) -> np.ndarray:
        return np.zeros((30, 40), np.uint8)

    def depth(self, index: int) -> DepthMap:
        return DepthMap(np.full((30, 40), 2.0), np.full((30, 40), fill_value=True))


def measured(tmp_path, last_frame: int):
    path = tmp_path / "tracks.csv"
    path.write_text("track,frame,u_px,v_px\n" + "".join(f"0,{k},9.0,9.0\n" for k in range(last_frame + 1)))
    return measure_scene(Wall(), [Condition("imported", Imported(str(path)), 1)], max_frames=2)


def test_a_tracker_is_told_the_length_of_the_sequence_not_of_the_part_that_is_read(tmp_path):
    assert measured(tmp_path, last_frame=4).observations["frame"].to_list() == [0, 1]
    with pytest.raises(DataError, match=r"tracks.csv:7: frame 5, expected a frame from 0 to 4 of the sequence$"):
        measured(tmp_path, last_frame=5)
