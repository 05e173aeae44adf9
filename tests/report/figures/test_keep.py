"""Of a run that keeps statistics alone: what cannot be drawn is named, and everything else is."""

import pytest

from tracknoise.report.figures import frames
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData


@pytest.fixture
def data(make_run, synthetic) -> ReportData:
    return ReportData.of(make_run(**synthetic.DEGENERATE["statistics alone are kept"]))


def test_single_errors_are_not_drawn_and_the_figure_says_why(data):
    (absence,) = frames.example_frame_figures(data)
    assert isinstance(absence, Absence)
    assert 'keeps only statistics (keep = "statistics")' in absence.why


def test_the_path_is_drawn_without_the_depth_of_features(data):
    (figure,) = frames.trajectory_figures(data)
    assert isinstance(figure, Figure)
    assert "the median feature depth" not in figure.look_for
