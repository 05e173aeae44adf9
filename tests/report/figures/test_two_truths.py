"""The disagreement of two truths, drawn beside the errors by each of them."""

import altair as alt
import numpy as np
import pytest
import vl_convert as vlc
from scipy.spatial.transform import Rotation
from tests.lean import only_topics, without_audit, without_geometry

import tracknoise
from tracknoise.report.figure_files import specification
from tracknoise.report.figures import truth_curves
from tracknoise.report.report_data import ReportData
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.tables.store import RunFolder

FRAMES, SIGMA_RAD = 40, 0.003


def measured(number: int) -> tracknoise.Measurement:
    """Two oracles before a wall; the second truth has turned poses."""
    images, poses = np.zeros((FRAMES, 48, 64), np.uint8), np.tile(np.eye(4), (FRAMES, 1, 1))
    K = np.array([[300.0, 0, 31.5], [0, 300.0, 23.5], [0, 0, 1]])
    depths = [np.full((48, 64), 2.0)] * FRAMES
    sequence = tracknoise.Sequence.from_arrays(images, poses, K, depths, scene=f"scene-{number}")
    turned, rng = poses.copy(), np.random.default_rng(number)
    turned[:, :3, :3] = Rotation.from_rotvec(rng.normal(0.0, SIGMA_RAD, (FRAMES, 3))).as_matrix()
    trackers = {name: tracknoise.Oracle(n_features=20, loss_rate=0.1, margin_px=4) for name in ("one", "two")}
    return tracknoise.measure(sequence, trackers, second_truth=OtherPoses(sequence, turned, "made"))


@pytest.fixture(scope="module")
def made():
    with without_audit(), only_topics(), without_geometry():
        run = tracknoise.analyse([measured(number) for number in range(2)], min_features=5)
    return truth_curves.two_truth_figures(ReportData.of(RunFolder(run.path)))


def test_each_tracker_and_the_poses_have_a_figure(made):
    assert [figure.id for figure in made] == ["two-truths-one", "two-truths-two", "two-truths-poses"]
    for figure in made:
        alt.ConcatChart.validate(specification(figure))
        svg = vlc.vegalite_to_svg(specification(figure), show_warnings=True)
        assert "<path" in svg
        assert "NaN" not in svg


def test_the_sentences_state_the_disagreement(made):
    assert "the two truths differ by" in made[0].look_for
    assert "of one by the first truth is" in made[0].look_for
    rotation = float(made[2].look_for.split("differ by ")[1].split(" degrees")[0])
    assert rotation == pytest.approx(np.degrees(SIGMA_RAD * np.sqrt(2.0)), rel=0.2)
    assert made[2].message.startswith("Relative poses of the truths differ by ")
    assert float(made[2].message.split()[7]) == rotation
    for figure in made:
        assert "blocks of tracks resampled within 2 scenes" in figure.shows


def test_without_a_second_truth_nothing_is_drawn(run):
    assert truth_curves.two_truth_figures(ReportData.of(run)) == []
