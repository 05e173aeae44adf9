"""`tracknoise datasets PATH`: what a recording holds, in a few numbers."""

import pytest
from tests.lean import of_reader

SMALL = ["--motion", "arvr", "--frames", "6", *of_reader("width=96", "height=64", "supersampling=1"), "--quiet"]


@pytest.fixture
def recording(tracknoise, tmp_path):
    tracknoise("simulate", "--out", str(tmp_path / "data" / "walk"), *SMALL)
    return tmp_path / "data"


def cells(out, sequence):
    (line,) = [line for line in out.splitlines() if line.startswith(sequence)]
    return line.split()


def test_frames_poses_size_rate_and_depth_are_shown(tracknoise, recording):
    code, out, err = tracknoise("datasets", str(recording))
    assert (code, err) == (0, "")
    assert out.startswith("reader: folder\n")
    _, frames, posed, size, *rest = cells(out, "walk")
    assert (frames, posed, size) == ("6", "6", "96x64")
    assert rest[-3:] == ["100%", "of", "pixels"]


def test_the_options_of_the_reader_follow(tracknoise, recording):
    _, out, _ = tracknoise("datasets", "folder", str(recording))
    assert out.endswith(tracknoise("datasets", "folder")[1])


def test_a_sequence_that_cannot_be_read_hides_no_other(tracknoise, recording):
    broken = recording / "broken"
    (broken / "images").mkdir(parents=True)
    (broken / "poses.txt").write_text("1 2 3\n")
    code, out, err = tracknoise("datasets", str(recording))
    assert code == 1
    assert cells(out, "walk")[1] == "6"
    assert cells(out, "broken")[1] == "-"
    assert "broken" in err


def test_real_recordings_are_shown_with_their_rate_and_depth(tracknoise, sample):
    code, out, _ = tracknoise("datasets", str(sample("tum_rgbd")))
    assert code == 0
    assert cells(out, "rgbd_dataset_freiburg1_rpy")[1:] == ["50", "50", "640x480", "31.19", "Hz", "76%", "of", "pixels"]
    assert "none" in tracknoise("datasets", str(sample("kitti_odometry")))[1]


def test_a_path_that_is_not_there_is_a_user_error(tracknoise, tmp_path):
    code, _, err = tracknoise("datasets", str(tmp_path / "nothing"))
    assert code == 1
    assert "no such file or folder" in err
