"""Two cameras of a rig see one scene: their results are separate, and pages name the camera."""

from dataclasses import dataclass, replace

import pytest
from tests.api.conftest import OPTIONS

import tracknoise as tn
from tracknoise.report.report_data import ReportData
from tracknoise.sequences.views import View
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.store import RunFolder


@dataclass(frozen=True, slots=True, eq=False)
class OfCamera(View):
    """The same images, as if another camera had taken them."""

    camera_name: str

    @property
    def id(self) -> SequenceId:
        return replace(self.sequence.id, camera=self.camera_name)


@pytest.fixture(scope="module")
def rig() -> tn.Run:
    sequence = tn.open_sequence("simulated", scene="forward-00", **OPTIONS)
    tracker = tn.Oracle(n_features=60, margin_px=4, covariance_px2=((0.04, 0.0), (0.0, 0.04)))
    return tn.analyse([tn.measure(OfCamera(sequence, name), tracker) for name in ("left", "right")], min_features=20)


def test_the_cameras_are_separate_conditions(rig):
    assert rig.sequences()["sequence"].to_list() == [
        "forward-00@default@camera-left",
        "forward-00@default@camera-right",
    ]
    assert rig.table("curves")["camera"].unique().sort().to_list() == ["left", "right"]
    assert rig.observations(camera="left")["camera"].unique().to_list() == ["left"]
    assert rig.intervals(statistic="outlier_ratio")["camera"].sort().to_list() == ["left", "right"]


def test_their_random_errors_are_independent(rig):
    left, right = (rig.observations(camera=name)["du_px"].drop_nulls().to_list() for name in ("left", "right"))
    assert left != right


def test_figures_are_of_the_first_camera_and_name_it(rig):
    data = ReportData.of(RunFolder(rig.path))
    assert data.view["camera"] == "left"
    assert data.where == " of camera left"
    assert "camera" in data.condition_columns
    assert "of camera left" in rig.figures().filter(figure="error-by-age")["shows"].item()
