"""Tracks and true positions frame by frame, as a user asks for them."""

import pytest
from PIL import Image
from tests.report.runs import filmed


@pytest.fixture
def run(make_run, tmp_path):
    small = make_run(scenes=("one",), trackers=("a", "b", "c", "d"), speeds=(1,), n_frames=6, born=4)
    return filmed(small, tmp_path / "run")


def test_a_video_is_written_beside_the_report(tracknoise, run, tmp_path):
    code, out, err = tracknoise("report", str(run.path), "--video", str(tmp_path / "new" / "tracks.gif"))
    assert code == 0
    assert "shown: a, b, c, the first of 4 trackers\n" in err
    assert f"written: {tmp_path / 'new' / 'tracks.gif'}\n" in out
    assert f"report: {run.path / 'report' / 'index.html'}\n" in out
    with Image.open(tmp_path / "new" / "tracks.gif") as file:
        assert file.n_frames > 1


def test_a_run_without_frames_is_one_line(tracknoise, make_run, tmp_path):
    run = make_run(scenes=("one",), trackers=("one",), speeds=(1,), n_frames=6, born=4)
    code, out, err = tracknoise("report", str(run.path), "--video", str(tmp_path / "tracks.gif"))
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert err.startswith(f"tracknoise: error: {run.path}: no frames are kept, expected ")
    assert list(tmp_path.iterdir()) == []
