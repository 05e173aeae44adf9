"""Of a run that keeps statistics alone: what cannot be drawn is named, and everything else is."""

import pytest

from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import picture, trajectory
from tracknoise.report.figures.figure import Absence, Figure


@pytest.fixture
def evidence(make_run, synthetic) -> Evidence:
    return Evidence.of(make_run(**synthetic.DEGENERATE["statistics alone are kept"]))


def test_single_errors_are_not_drawn_and_the_figure_says_why(evidence):
    (absence,) = picture.figures(evidence)
    assert isinstance(absence, Absence)
    assert 'keeps statistics alone (keep = "statistics")' in absence.why


def test_the_path_is_drawn_without_the_depth_of_features(evidence):
    (figure,) = trajectory.figures(evidence)
    assert isinstance(figure, Figure)
    assert "the median depth" not in figure.look_for
