"""Images of a run that are damaged or missing."""

import pytest

from tracknoise.exceptions import StoreError
from tracknoise.report.figures import frames
from tracknoise.report.figures.figure import Absence
from tracknoise.report.report_data import ReportData


def test_a_damaged_image_is_an_error_and_a_missing_one_is_named(make_run):
    run = make_run(scenes=("forward",), trackers=("lucas-kanade",), born=40)
    data = ReportData.of(run)
    (path,) = (run.path / "snapshots").iterdir()
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(bytes(content))
    with pytest.raises(StoreError, match="damaged"):
        frames.example_frame_figures(data)
    path.unlink()
    (absence,) = frames.example_frame_figures(data)
    assert isinstance(absence, Absence)
    assert "is missing in the run folder" in absence.why
